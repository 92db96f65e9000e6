"""`tenon check` finds planted mistakes by name, place and number, and nothing wrong with the shipped scenarios."""
import json
import re
import tempfile
import unittest
from pathlib import Path

from stage import COARSE, SOURCE, tenon

# A block of 60 x 60 x 40 mm with a hole of 20 x 20 x 30 mm down from z = 0, a peg of 19 x 19 x 50 mm whose origin is in the
# middle of its lower end, and a lid.
#
#      z                 ___ lid
#      |            |   |
#      |____     ___| peg |
#      |    |___|   |_____|  ->
#      |___________
EXERCISE = """\
title: Planted
reach: 2 m
objects:
  - name: block
    title: Block
    kind: scene
    meshes:
      - {{box: [60 mm, 60 mm, 10 mm], at: [0, 0, -35 mm]}}
      - {{box: [20 mm, 60 mm, 30 mm], at: [-20 mm, 0, -15 mm]}}
      - {{box: [20 mm, 60 mm, 30 mm], at: [20 mm, 0, -15 mm]}}
      - {{box: [20 mm, 20 mm, 30 mm], at: [0, -20 mm, -15 mm]}}
      - {{box: [20 mm, 20 mm, 30 mm], at: [0, 20 mm, -15 mm]}}
    structures: {{voxel: {voxel}, refinement: 4, points: 4000}}
    status: fixed
  - name: peg
    title: Peg
    meshes: [{peg}]
    structures: {{voxel: 1 mm, refinement: 1, spacing: 2 mm}}
    start: {{at: {start}}}
  - name: lid
    title: Lid
    meshes: [{{box: [30 mm, 30 mm, 4 mm]}}]
    structures: {{voxel: 1 mm, refinement: 1, spacing: 2 mm}}
    start: {{at: {lid}}}
    status: fixed
  - name: pointer
    title: Your hand
    kind: pointer
    meshes: [{{sphere: {{diameter: 10 mm}}}}]
    structures: {{voxel: 1 mm, refinement: 1, points: 300}}
    start: {{at: [0, -200 mm, 150 mm]}}
hands:
  - {{name: right, object: pointer}}
{pairs}
states:
  - name: take_peg
    touch: peg
  - name: insert_peg
    title: Push the peg in
    hands: {{right: peg}}
    object: peg
    target: {{at: {target}, {turn}within: 1 mm, angle: 2 deg}}
    approach: {{direction: [0, 0, -1], distance: 60 mm}}
    snap: true
"""
RIGHT = {"voxel": "1 mm", "peg": "{box: [19 mm, 19 mm, 50 mm], at: [0, 0, 25 mm]}", "start": "[200 mm, 0, 0]",
         "lid": "[-200 mm, 0, 0]", "pairs": "pairs:\n  - {between: [peg, block], clearance: 1 mm}", "target": "[0, 0, -29.5 mm]", "turn": ""}


class CheckCase(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def check(self, code, **mistakes):
        """The findings in the exercise with these mistakes, as JSON; the table says the same."""
        scenario = self.folder / "scenario.yaml"
        scenario.write_text(EXERCISE.format(**{**RIGHT, **mistakes}), encoding="utf-8")
        done = tenon("check", scenario, "--json")
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        report = json.loads(done.stdout)
        findings = report["findings"]
        for severity in ("error", "warning", "note"):
            self.assertEqual(report[severity + "s"], sum(one["severity"] == severity for one in findings))
        table = tenon("check", scenario)
        self.assertEqual(table.returncode, code)
        self.assertNotIn("\033", table.stdout, "colours are for terminals")
        for finding in findings:
            self.assertIn(finding["text"], table.stdout)
            self.assertIn(finding["hint"], table.stdout)
        return findings

    def only(self, findings, kind, other=None):
        """The error or warning of this kind; fails unless there is one."""
        found = [one for one in findings if one["kind"] == kind and one["severity"] != "note" and other in (None, one["other"])]
        self.assertEqual(len(found), 1, json.dumps(findings, indent=1))
        return found[0]


class PlantedMistakes(CheckCase):
    def test_without_a_mistake_only_the_play_is_told(self):
        fit, = self.check(0)
        self.assertEqual((fit["kind"], fit["severity"], fit["object"], fit["other"], fit["state"]),
                         ("clearance", "note", "peg", "block", "insert_peg"))
        self.assertAlmostEqual(fit["value"], 0.001, delta=20e-6)
        self.assertEqual(fit["unit"], "m")

    def test_a_missing_clearance_an_overlap_at_the_start_and_a_turn_of_180_degrees(self):
        findings = self.check(1, voxel="2 mm", pairs="", lid="[200 mm, 0, 51 mm]",
                              turn="turn: {axis: z, deg: 180}, ")
        missing = self.only(findings, "clearance", "block")
        self.assertEqual(missing["severity"], "warning", "voxels of a solid leave room, but it may jam")
        self.assertAlmostEqual(missing["value"], 0.001, delta=0.1e-3)
        self.assertIn("no clearance is stated", missing["text"])
        self.assertRegex(missing["hint"], r"below pairs: \{between: \[peg, block\], clearance: (1|1\.0\d|0\.9\d+) mm\}")
        overlap = self.only(findings, "overlap")
        self.assertEqual({overlap["object"], overlap["other"]}, {"peg", "lid"})
        self.assertAlmostEqual(overlap["value"], 0.001, delta=50e-6)
        self.assertIsNone(overlap["state"])
        self.assertAlmostEqual(overlap["place"][2], 0.0495, delta=1e-3)
        self.assertIn("at the start", overlap["text"])
        turn = self.only(findings, "turning")
        self.assertAlmostEqual(turn["value"], 3.14159, places=3)
        self.assertIn("hug-sim turns by 149 deg", turn["text"])
        self.assertEqual(len([one for one in findings if one["severity"] != "note"]), 3, findings)

    def test_a_target_in_a_wall_a_blocked_approach_and_a_clearance_that_is_not_true(self):
        findings = self.check(1, target="[0, 0, -33 mm]", lid="[0, 0, 25 mm]",
                              pairs="pairs:\n  - {between: [peg, block], clearance: 2 mm}")
        overlap = self.only(findings, "overlap")
        self.assertEqual((overlap["severity"], overlap["object"], overlap["other"], overlap["state"]),
                         ("error", "peg", "block", "insert_peg"))
        self.assertAlmostEqual(overlap["value"], 0.003, delta=50e-6)
        self.assertAlmostEqual(overlap["place"][2], -0.033, delta=1e-4)
        free = re.fullmatch(r"it is free at \[0, 0, (-0\.\d+)\]", overlap["hint"])
        self.assertTrue(free, overlap["hint"])
        self.assertAlmostEqual(float(free[1]), -0.03, delta=2e-4)
        # the same at a target that is free
        findings = self.check(1, lid="[0, 0, 25 mm]", pairs="pairs:\n  - {between: [peg, block], clearance: 2 mm}")
        blocked = self.only(findings, "approach")
        self.assertEqual((blocked["severity"], blocked["other"]), ("error", "lid"))
        self.assertAlmostEqual(blocked["value"], 0.0565, delta=1e-3)
        self.assertAlmostEqual(blocked["place"][2], 0.027, delta=1e-3)
        stated = self.only(findings, "clearance", "block")
        self.assertEqual(stated["severity"], "warning")
        self.assertAlmostEqual(stated["value"], 0.001, delta=20e-6)
        self.assertIn("clearance: 1 mm in line", stated["hint"])

    def test_a_peg_wider_than_its_hole_is_an_error_although_its_depth_is_tolerated(self):
        wide = self.only(self.check(1, peg="{box: [21 mm, 21 mm, 50 mm], at: [0, 0, 25 mm]}"), "overlap")
        self.assertEqual((wide["severity"], wide["object"], wide["other"]), ("error", "peg", "block"))
        self.assertIn("it can never be there: it is free nowhere within 1 mm and 2 deg of it", wide["text"])

    def test_a_void_is_told_with_its_size_and_place(self):
        shell = "{box: [19 mm, 19 mm, 50 mm], at: [0, 0, 25 mm]}, {file: void.off, unit: mm}"
        # the walls of 6 x 8 x 10 mm around (0, 0, 20 mm), which face inwards
        corners = [(x, y, z) for z in (15, 25) for y in (-4, 4) for x in (-3, 3)]
        faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
        (self.folder / "void.off").write_text("OFF\n8 6 0\n" + "".join("%g %g %g\n" % c for c in corners) +
                                              "".join("4 %d %d %d %d\n" % f for f in faces), encoding="utf-8")
        filled, = (one for one in self.check(0, peg=shell) if one["kind"] == "filled")
        self.assertEqual((filled["severity"], filled["object"], filled["unit"]), ("note", "peg", "m"))
        self.assertAlmostEqual(filled["value"], 0.01, delta=1e-5)
        self.assertIn("6 mm x 8 mm x 10 mm", filled["text"])
        for place, expected in zip(filled["place"], (0.2, 0, 0.02)):
            self.assertAlmostEqual(place, expected, delta=1e-5)

    def test_a_wrong_unit_in_either_direction(self):
        thousandth = "{box: [0.1 mm, 0.1 mm, 0.1 mm]}"
        small = self.only(self.check(1, peg=thousandth), "scale")
        self.assertAlmostEqual(1 / small["value"], 200, delta=10)
        self.assertIn("smaller than its hole in Block", small["text"])
        large = self.only(self.check(1, peg="{box: [19, 19, 19], at: [0, 0, 9.5]}"), "scale")
        self.assertGreater(large["value"], 300)
        self.assertIn("a length without its unit", large["hint"])

    def test_what_is_out_of_reach_and_what_cannot_be_loaded(self):
        reach = self.only(self.check(1, start="[200, 0, 0]"), "reach")
        self.assertAlmostEqual(reach["value"], 200, delta=0.1)
        self.assertEqual(reach["object"], "peg")
        load = self.only(self.check(1, pairs="pairs:\n  - {between: [peg, block], clearance: 0.15 mm}"), "load")
        self.assertIn("smaller than the field of 'block' can resolve", load["text"])
        self.assertIn("or refinement 8", load["text"])


class AtLoad(CheckCase):
    def test_a_rehearsal_says_errors_and_warnings_before_it_begins(self):
        (self.folder / "scenario.yaml").write_text(EXERCISE.format(**{**RIGHT, "lid": "[0, 0, 25 mm]"}), encoding="utf-8")
        done = tenon("rehearse", self.folder, "--seconds", 1)
        first = done.stdout.splitlines()[0]
        self.assertRegex(first, r"scenario.yaml:\d+: error: the approach of Peg is blocked .* by Lid, at ")


class Shipped(unittest.TestCase):
    def test_the_shipped_scenarios_are_clean(self):
        for name in ("peg_and_box", "stacking", "engine_bay"):
            with self.subTest(scenario=name):
                done = tenon("check", SOURCE / "scenarios" / name, *COARSE)
                self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                self.assertRegex(done.stdout.splitlines()[-1], r"^0 errors, 0 warnings, \d+ notes?$")


if __name__ == "__main__":
    unittest.main()
