"""What the verbs beside a session print and leave."""
import json
import re
import tempfile
import unittest
from pathlib import Path

from stage import Stage, tenon


class Verbs(unittest.TestCase):
    def test_version_names_a_version(self):
        self.assertRegex(tenon("version").stdout, r"^tenon \d+\.\d+\.\d+$")

    def test_doctor_judges_every_point_and_sums_up(self):
        done = tenon("doctor")
        self.assertEqual(done.returncode, 0, done.stdout)
        for point in ("system", "processor", "programs", "real time", "memory", "bus", "disk"):
            self.assertRegex(done.stdout, rf"(?m)^(good|note) +{point}")

    def test_parts_are_made_baked_and_described(self):
        with tempfile.TemporaryDirectory() as folder:
            parts = tenon("parts", "peg_and_box", folder)
            self.assertEqual(parts.returncode, 0, parts.stderr)
            mesh, baked = Path(folder) / "peg.stl", Path(folder) / "peg.tenon"
            self.assertTrue(mesh.exists())
            bake = tenon("bake", mesh, "-o", baked, "--voxel", "2mm", "--unit", "mm", "--points", "2000")
            self.assertEqual(bake.returncode, 0, bake.stderr)
            info = tenon("bake", "--info", baked)
            self.assertEqual(info.returncode, 0, info.stderr)
            for word in ("voxel", "points", "triangles"):
                self.assertIn(word, info.stdout.lower())

    def test_a_damaged_structure_file_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            tenon("parts", "peg_and_box", folder)
            baked = Path(folder) / "peg.tenon"
            tenon("bake", Path(folder) / "peg.stl", "-o", baked, "--voxel", "4mm", "--unit", "mm")
            data = bytearray(baked.read_bytes())
            data[len(data) // 2] ^= 0x10
            baked.write_bytes(data)
            info = tenon("bake", "--info", baked)
            self.assertNotEqual(info.returncode, 0)
            self.assertIn("peg.tenon", info.stderr)

    def test_an_observer_speaks_json(self):
        with Stage(lockstep=False) as stage:
            stage.serve("peg_and_box", "--wait-for", "right,observer")
            stage.lockstep = False
            observer = stage.start("observer", "--json")
            stage.start("trainee", "--seed", 1)
            line = observer.wait_for("take_peg", 60)
            self.assertIsInstance(json.loads(line), dict)

    def test_the_demo_leaves_report_recording_and_journal(self):
        with tempfile.TemporaryDirectory() as folder:
            done = tenon("demo", "--scenario", "peg_and_box", "--no-instructor", "--lockstep", "--headless", "--out", folder, timeout=800)
            self.assertEqual(done.returncode, 0, done.stdout[-3000:] + done.stderr[-1000:])
            self.assertTrue(re.fullmatch(r"final state hash: [0-9a-f]{16}", done.stdout.strip().splitlines()[-1]))
            for file in ("report.html", "session.mcap", "journal.mcap", "scene.png"):
                self.assertTrue((Path(folder) / file).exists(), file)


if __name__ == "__main__":
    unittest.main()
