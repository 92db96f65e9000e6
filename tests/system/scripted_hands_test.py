"""Hands that follow files: `tenon rehearse --input`, its log and its errors. Truth is the geometry of boxes and the coupling's spring."""
import json
import math
import shutil
import tempfile
import unittest
from pathlib import Path

from stage import SOURCE, final_hash, tenon

STIFFNESS = 1000.0  # [N/m] default of a hand
REST = 0.02  # [m] height of the part's centre when it lies on the plate
ABOVE = (0, 0, 0, 0.05, 1, 0, 0, 0)

# the plate's top is at z = 10 mm; part and tool are cubes of 20 mm
SCENE = """
objects:
  - {name: plate, kind: scene, meshes: [{box: [100 mm, 100 mm, 20 mm]}], status: fixed, structures: {voxel: 2 mm, points: 2000}}
  - {name: part, meshes: [{box: [20 mm, 20 mm, 20 mm]}], start: {at: [0.3, 0, 0.3]}, structures: {voxel: 2 mm, points: 2000}}
  - {name: pointer, kind: pointer, meshes: [{box: [10 mm, 10 mm, 10 mm]}], start: {at: [-0.3, 0, 0.3]}, structures: {voxel: 2 mm, points: 500}}
  - {name: tool, meshes: [{box: [20 mm, 20 mm, 20 mm]}], start: {at: [0.5, 0, 0.3]}, structures: {voxel: 2 mm, points: 2000}}
hands:
  - {name: right, object: pointer}
  - {name: left, object: tool}
"""
STATES = """
states:
  - {name: place, object: part, target: {at: [0, 0, 20 mm], within: 1 mm, dwell: 50 ms}}
"""


STEP = 2 ** -24  # [m] of device samples, idl/types/resolution.h; those of their quaternions are smaller


class Scripted(unittest.TestCase):
    def assertPose(self, found, expected):
        """Up to the resolution of device samples."""
        self.assertEqual(len(found), len(expected))
        for one, other in zip(found, expected):
            self.assertAlmostEqual(one, other, delta=STEP)

    def setUp(self):
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)
        self.scene = self.folder / "press.yaml"
        self.scene.write_text("title: Press" + SCENE, encoding="utf-8")
        self.log = self.folder / "log.jsonl"

    def file(self, name, *rows):
        path = self.folder / name
        lines = ["t,x,y,z,qw,qx,qy,qz", *(",".join(map(repr, row)) for row in rows)]
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    def press(self, z=0.015):
        return self.file("press.csv", ABOVE, (0.1, 0, 0, z, 1, 0, 0, 0))

    def rehearse(self, *arguments, scene=None):
        return tenon("rehearse", scene or self.scene, "--quiet", *arguments)

    def logged(self, *arguments, scene=None):
        """The log of a run that must succeed, and what it printed."""
        done = self.rehearse(*arguments, "--log", self.log, "--overwrite", scene=scene)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return [json.loads(line) for line in self.log.read_text(encoding="utf-8").splitlines()], done.stdout


class Forces(Scripted):
    def test_a_part_pressed_at_a_plate_rests_on_it_with_the_force_of_the_coupling(self):
        for z in (0.015, 0.0, -0.03):  # the last one is beyond the plate
            ticks, _ = self.logged("--input", f"right={self.press(z)}", "--take", "right=part", "--seconds", 0.6)
            last = ticks[-1]
            force = STIFFNESS * (REST - z)
            hand, part = last["hands"]["right"], last["objects"]["part"]
            self.assertEqual(hand["object"], "part")
            self.assertPose(hand["X_WH"], [0, 0, z, 1, 0, 0, 0])
            for found, expected in zip(hand["F_Ho_W"][:3], (0, 0, force)):
                self.assertAlmostEqual(found, expected, delta=0.01 * force)
            self.assertAlmostEqual(part["X_WO"][2], REST, delta=2e-5)
            self.assertEqual((part["status"], part["in_contact"], part["asleep"]), ("held", True, False))
            pair = next(pair for pair in last["pairs"] if {pair["a"], pair["b"]} == {"part", "plate"})
            sign = 1 if pair["a"] == "part" else -1
            self.assertAlmostEqual(pair["F_Ao_W"][2], sign * force, delta=0.01 * force)
            self.assertAlmostEqual(pair["gap"], 0, delta=2e-5)
            self.assertAlmostEqual(pair["depth"], 0, delta=2e-5)

    def test_an_upright_peg_slides_past_the_rim_of_its_hole_from_each_side(self):
        # [mm] beside the axis of a hole with 0.25 mm of play: the chamfer's upper edge comes to lie along the rim
        for beside in ((0.5, -0.3), (1.0, -0.5), (1.1, -0.4), (1.0, -1.0), (-1.0, 0.5)):
            x, y = (1e-3 * away for away in beside)
            path = self.file("peg.csv", (0, x, y, 0.08, 1, 0, 0, 0), (1.5, x, y, -0.07, 1, 0, 0, 0))
            self.rehearse("--input", f"right={path}", "--take", "right=peg", "--seconds", 2.5, "--log", self.log, "--overwrite",
                          scene=SOURCE / "scenarios" / "peg_and_box")
            last = json.loads(self.log.read_text(encoding="utf-8").splitlines()[-1])
            self.assertAlmostEqual(last["objects"]["peg"]["X_WO"][2], -0.06, delta=1e-4, msg=str(beside))
            self.assertLess(math.hypot(*last["hands"]["right"]["F_Ho_W"][:3]), 15, beside)

    def test_an_object_that_is_taken_starts_at_the_first_row_with_its_frame_at_the_hands(self):
        turned = (0.8, 0, 0.6, 0)
        ticks, _ = self.logged("--input", f"right={self.file('still.csv', (0, 0.1, 0.2, 0.3, *turned))}", "--take", "right=part",
                               "--seconds", 0.01)
        for tick in ticks:
            self.assertPose(tick["objects"]["part"]["X_WO"], (0.1, 0.2, 0.3, *turned))
            self.assertAlmostEqual(math.hypot(*tick["hands"]["right"]["F_Ho_W"]), 0, delta=1e-6)
            self.assertEqual(tick["objects"]["pointer"]["status"], "hidden")

    def test_the_frame_of_an_object_that_is_taken_is_the_hands_wherever_its_mesh_is(self):
        text = SCENE.replace("name: part, meshes: [{box: [20 mm, 20 mm, 20 mm]", "name: part, meshes: [{box: [20 mm, 20 mm, 20 mm], at: [50 mm, 0, 0]")
        self.assertNotEqual(text, SCENE)
        self.scene.write_text("title: Press" + text, encoding="utf-8")
        ticks, _ = self.logged("--input", f"right={self.file('still.csv', (0, 0.1, 0.2, 0.3, 1, 0, 0, 0))}", "--take", "right=part",
                               "--seconds", 0.05)
        self.assertPose(ticks[0]["objects"]["part"]["X_WO"][:3], [0.1, 0.2, 0.3])
        self.assertEqual(ticks[-1]["hands"]["right"]["F_Ho_W"], [0, 0, 0, 0, 0, 0])

    def test_a_hand_moves_its_own_object_and_an_absent_hand_moves_none(self):
        self.scene.write_text("title: Press" + SCENE, encoding="utf-8")  # nobody moves the part
        ticks, _ = self.logged("--input", f"left={self.file('tool.csv', (0, 0.2, 0, 0.3, 1, 0, 0, 0))}", "--seconds", 0.05)
        self.assertEqual(list(ticks[-1]["hands"]), ["left"])
        self.assertEqual(ticks[-1]["hands"]["left"]["object"], "tool")
        self.assertPose(ticks[-1]["objects"]["tool"]["X_WO"], [0.2, 0, 0.3, 1, 0, 0, 0])
        self.assertEqual(ticks[-1]["objects"]["pointer"]["X_WO"], [-0.3, 0, 0.3, 1, 0, 0, 0])
        self.assertEqual(ticks[-1]["objects"]["pointer"]["status"], "parked")

    def test_two_hands_press_two_parts_at_one_plate(self):
        tool = self.file("tool.csv", (0, 0.03, 0, 0.05, 1, 0, 0, 0), (0.1, 0.03, 0, 0.012, 1, 0, 0, 0))
        ticks, _ = self.logged("--input", f"right={self.press(0.015)}", "--input", f"left={tool}", "--take", "right=part",
                               "--seconds", 0.6)
        right, left = (ticks[-1]["hands"][hand] for hand in ("right", "left"))
        self.assertAlmostEqual(right["F_Ho_W"][2], STIFFNESS * (REST - 0.015), delta=0.01 * STIFFNESS * (REST - 0.015))
        force = STIFFNESS * (REST - 0.012)
        self.assertAlmostEqual(left["F_Ho_W"][2], force, delta=0.01 * force)


class Log(Scripted):
    def test_poses_between_rows_are_linear_and_turn_evenly(self):
        half = math.sqrt(0.5)
        path = self.file("turn.csv", (0.02, 0.2, 0, 0.3, 1, 0, 0, 0), (0.12, 0.25, 0.05, 0.3, half, 0, 0, half))
        ticks, _ = self.logged("--input", f"right={path}", "--take", "right=part", "--seconds", 0.2)
        self.assertEqual([tick["t"] for tick in ticks], [n / 1000 for n in range(1, 201)])
        for tick in ticks:
            u = min(max((tick["t"] - 0.02) / 0.1, 0), 1)
            expected = (0.2 + 0.05 * u, 0.05 * u, 0.3, math.cos(u * math.pi / 4), 0, 0, math.sin(u * math.pi / 4))
            self.assertPose(tick["hands"]["right"]["X_WH"], expected)

    def test_equal_runs_give_equal_bytes_whatever_the_workers(self):
        logs, hashes = set(), set()
        for workers in (1, 1, 2):
            _, printed = self.logged("--input", f"right={self.press()}", "--take", "right=part", "--seconds", 0.4, "--workers", workers)
            logs.add(self.log.read_bytes())
            hashes.add(final_hash(printed))
        self.assertEqual((len(logs), len(hashes)), (1, 1))
        self.logged("--input", f"right={self.press(0.014)}", "--take", "right=part", "--seconds", 0.4)
        self.assertNotIn(self.log.read_bytes(), logs)

    def test_every_nth_tick_is_logged_without_a_change_of_the_run(self):
        arguments = ("--input", f"right={self.press()}", "--take", "right=part", "--seconds", 0.35)
        all_ticks, printed = self.logged(*arguments)
        some, again = self.logged(*arguments, "--every", 100)
        self.assertEqual(some, all_ticks[99::100])
        self.assertEqual([tick["t"] for tick in some], [0.1, 0.2, 0.3])
        self.assertEqual(final_hash(printed), final_hash(again))
        self.assertEqual(final_hash(self.rehearse(*arguments).stdout), final_hash(printed), "without a log too")

    def test_timing_is_added_and_nothing_else_changes(self):
        arguments = ("--input", f"right={self.press()}", "--take", "right=part", "--seconds", 1.1)
        plain, _ = self.logged(*arguments)
        timed, _ = self.logged(*arguments, "--timing")
        for tick in timed:
            self.assertGreater(tick.pop("compute_us"), 0)
            self.assertGreaterEqual(tick.pop("work"), 0)
            self.assertEqual(tick.pop("limited_islands"), 0)
        self.assertEqual(plain, timed)
        self.assertEqual(list(plain[0]), ["t", "hands", "objects", "pairs"])

    def test_a_run_without_seconds_ends_with_the_last_row(self):
        ticks, printed = self.logged("--input", f"right={self.press()}", "--take", "right=part")
        self.assertEqual(ticks[-1]["t"], 0.1)
        self.assertIn("running after 0.100 s", printed)

    def test_a_log_that_cannot_be_written_is_an_error(self):
        arguments = ("--input", f"right={self.press()}", "--take", "right=part", "--seconds", 0.2, "--log")
        for file, said in ((self.folder / "nowhere" / "log", ": cannot be written"), (self.folder, ": is a folder"),
                           ("/dev/full", "/dev/full: could not be written completely")):
            done = self.rehearse(*arguments, file)
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertIn(said, done.stderr)


class States(Scripted):
    def setUp(self):
        super().setUp()
        self.scene.write_text("title: Press" + SCENE + STATES, encoding="utf-8")

    def test_a_scenario_with_states_ends_when_they_are_done_and_the_exit_code_says_so(self):
        arguments = ("--input", f"right={self.press()}", "--take", "right=part", "--seconds")
        done = self.rehearse(*arguments, 2)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertRegex(done.stdout, r"everything is mounted after 0\.\d+ s")
        done = self.rehearse(*arguments, 0.05)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertIn("running after 0.050 s", done.stdout)

    def test_people_need_states_and_pairs_of_what_their_states_move(self):
        self.scene.write_text("title: Press" + SCENE + "pairs:\n  - {between: [part, plate]}\n", encoding="utf-8")
        done = self.rehearse()
        self.assertEqual(done.returncode, 1)
        self.assertIn("never collide", done.stderr)


class Errors(Scripted):
    def refused(self, code, said, *arguments):
        done = self.rehearse(*arguments)
        self.assertEqual(done.returncode, code, f"{arguments}\n{done.stdout}{done.stderr}")
        self.assertIn(said, done.stderr, arguments)
        self.assertEqual(done.stdout, "")

    def test_names_that_the_scenario_does_not_have_are_refused_with_those_it_has(self):
        press = self.press()
        self.refused(2, "this scenario has no hand 'rigth'; it has: right, left", "--input", f"rigth={press}")
        self.refused(2, "this scenario has no hand 'up'; it has: right, left", "--input", f"right={press}", "--take", "up=part")
        self.refused(2, "this scenario has no object 'prat'; it has: plate, part, pointer, tool", "--input", f"right={press}",
                     "--take", "right=prat")

    def test_assignments_that_contradict_each_other_are_refused(self):
        right = ("--input", f"right={self.press()}")
        self.refused(2, "hand 'right' already follows", *right, *right)
        self.refused(2, "hand 'right' already takes 'part'", *right, "--take", "right=part", "--take", "right=tool")
        self.refused(2, "'part' is already taken by hand 'right'", *right, "--input", f"left={self.press()}", "--take", "right=part",
                     "--take", "left=part")
        self.refused(2, "'tool' is the own object of hand 'left', which --input moves", *right, "--input", f"left={self.press()}",
                     "--take", "right=tool")
        self.refused(2, "hand 'left' would not move, expected --input left=FILE with it", *right, "--take", "left=part")

    def test_wrong_usage_is_refused(self):
        right = ("--input", f"right={self.press()}")
        for text in ("right", "=x.csv", "right="):
            self.refused(2, f"--input '{text}': expected HAND=FILE.csv", "--input", text)
        self.refused(2, "--take 'part': expected HAND=OBJECT", *right, "--take", "part")
        for seconds in (0, -1, 0.0001, "nan", "inf", 1e9):
            self.refused(2, "expected 0.001 to 1000000", *right, "--seconds", seconds)
        for every in (0, -1, "x"):
            self.refused(2, "--every", *right, "--log", self.log, "--every", every)
        self.refused(2, "--take requires --input", "--take", "right=part")
        self.refused(2, "--log requires --input", "--log", self.log)
        self.refused(2, "--every requires --log", *right, "--every", 2)
        self.refused(2, "--timing requires --log", *right, "--timing")
        self.refused(2, f"{self.press()}: is an input of this command", *right, "--log", self.press(), "--overwrite")
        self.refused(1, f"{__file__}: exists; --overwrite replaces it", *right, "--log", __file__)
        self.refused(2, "the last row is at t = 0: give --seconds", "--input", f"right={self.file('one.csv', ABOVE)}")
        for option in (("--seed", 2), ("--device", "sigma7-sim"), ("--misplace-mount", 0), ("--no-instructor",), ("--follow",)):
            self.refused(2, f"{option[0]} is an option of simulated people; with --input there are none", *right, *option)
        self.assertFalse(self.log.exists(), "what is refused writes nothing")

    def test_files_that_cannot_be_read_or_understood_are_refused_with_their_line(self):
        self.refused(1, f"{self.folder}/no.csv: cannot be read", "--input", f"right={self.folder}/no.csv")
        self.refused(1, f"{self.folder}: is a folder", "--input", f"right={self.folder}")
        bad = self.file("bad.csv", ABOVE, (0.1, 0, 0, "x", 1, 0, 0, 0))
        self.refused(1, f"{bad}:3: z is ''x'', not a number", "--input", f"right={bad}")
        bad.write_text("", encoding="utf-8")
        self.refused(1, f"{bad}:1: empty, expected the header t,x,y,z,qw,qx,qy,qz and a row", "--input", f"right={bad}")
        self.scene.unlink()
        self.refused(1, f"{self.scene}: no such scenario file", "--input", f"right={self.press()}")

    def test_poses_that_the_server_refuses_from_a_station_end_the_run(self):
        fast = self.file("fast.csv", ABOVE, (0.05, 0, 0, 0.05, 1, 0, 0, 0), (0.06, 0.6, 0, 0.05, 1, 0, 0, 0))
        self.refused(1, f"{fast}:3: at 0.051 s the server refuses the input: ", "--input", f"right={fast}", "--take", "right=part")
        far = self.file("far.csv", (0, 0, 0, 2000, 1, 0, 0, 0))
        self.refused(1, f"{far}:2: at 0.001 s the server refuses the input: ", "--input", f"right={far}", "--take", "right=part", "--seconds", 1)

    def test_a_held_object_moves_no_faster_than_the_cap_of_a_tick_and_follows_at_1_m_s(self):
        quick = self.file("quick.csv", (0, 0, 0, 0.2, 1, 0, 0, 0), (0.02, 0.4, 0, 0.2, 1, 0, 0, 0))
        ticks, _ = self.logged("--input", f"right={quick}", "--take", "right=part", "--seconds", 0.6)
        x = [tick["objects"]["part"]["X_WO"][0] for tick in ticks]
        steps = [b - a for a, b in zip(x, x[1:])]
        radius = 0.01 * 3**0.5
        self.assertLessEqual(max(steps), 1.001e-3 * (4.0 + 12.0 * radius), "4 m/s, and 12 rad/s at the corners")
        self.assertLessEqual(max(steps[25:]), 1.001e-3, "1 m/s while the device rests")
        self.assertAlmostEqual(x[-1], 0.4, delta=1e-6)


if __name__ == "__main__":
    unittest.main()
