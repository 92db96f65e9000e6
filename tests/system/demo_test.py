"""`tenon demo`: it leaves no program running."""
import os
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from stage import PROGRAMS, SOURCE, TENON, free_domain, tenon

sys.path.insert(0, str(SOURCE / "deploy"))
from demo_scene import hands_of  # noqa: E402

PEG_AND_BOX = SOURCE / "scenarios" / "peg_and_box"


class DemoCase(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="tenon-demo-")
        self.addCleanup(folder.cleanup)
        self.folder, self.domain = Path(folder.name), free_domain()

    def words(self, *more):
        return ["demo", "--headless", "--domain", self.domain, "--out", self.folder / "out", *more]

    def left_running(self):
        """Command lines of the programs of this demo."""
        found = []
        for file in Path("/proc").glob("[0-9]*/cmdline"):
            try:
                words = file.read_bytes().decode(errors="replace").split("\0")
            except OSError:
                continue  # it has ended
            if words[0].startswith(str(PROGRAMS)) and "--domain" in words and words[words.index("--domain") + 1] == str(self.domain):
                found.append(" ".join(words))
        return found

    def assert_nothing_runs(self):
        deadline = time.monotonic() + 30
        while self.left_running() and time.monotonic() < deadline:
            time.sleep(0.1)
        self.assertEqual(self.left_running(), [])

class Endings(DemoCase):
    def start(self):
        demo = subprocess.Popen([TENON, *map(str, self.words("--scenario", PEG_AND_BOX, "--lockstep"))], stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, text=True, env={**os.environ, "TENON_PROGRAMS": str(PROGRAMS)})
        self.addCleanup(demo.stdout.close)
        self.addCleanup(demo.wait)
        self.addCleanup(lambda: demo.poll() is None and demo.kill())
        return demo

    def wait_for_first_step(self, demo):
        for line in demo.stdout:
            if "step 1 of 2" in line:
                return
        self.fail("the demo ended before its first step")

    def test_whatever_signal_ends_it_nothing_is_left_running(self):
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGKILL):
            with self.subTest(signal=number.name):
                demo = self.start()
                self.wait_for_first_step(demo)
                self.assertEqual(len(self.left_running()), 5)
                demo.send_signal(number)
                demo.communicate(timeout=120)
                self.assertEqual(demo.returncode, -number if number == signal.SIGKILL else 128 + number)
                self.assert_nothing_runs()

    def test_a_program_that_cannot_start_ends_it_with_its_reason(self):
        done = tenon(*self.words("--scenario", PEG_AND_BOX, "--lockstep", "--device", "nosuch"), timeout=300)
        self.assertEqual(done.returncode, 1, done.stdout)
        reason = (self.folder / "out" / "instructor.log").read_text(encoding="utf-8").strip().splitlines()[-1]
        self.assertIn("nosuch", reason)
        self.assertIn(f"instructor has ended, so the session is stopped: {reason}", done.stdout)
        self.assert_nothing_runs()

    def test_a_trainee_that_ends_in_the_session_ends_it(self):
        demo = self.start()
        self.wait_for_first_step(demo)
        trainee = next(line for line in self.left_running() if "tenon-trainee" in line)
        for file in Path("/proc").glob("[0-9]*/cmdline"):
            if file.read_bytes().decode(errors="replace").replace("\0", " ").strip() == trainee.strip():
                os.kill(int(file.parent.name), signal.SIGKILL)
        said, _ = demo.communicate(timeout=120)
        self.assertEqual(demo.returncode, 1, said)
        self.assertIn("trainee has ended, so the session is stopped", said)
        self.assert_nothing_runs()


class Instructor(DemoCase):
    def test_a_scenario_without_a_hand_for_one_starts_none(self):
        scenario = self.folder / "alone" / "scenario.yaml"
        scenario.parent.mkdir()
        text = (PEG_AND_BOX / "scenario.yaml").read_text(encoding="utf-8")
        scenario.write_text("".join(line for line in text.splitlines(True) if "role: instructor" not in line), encoding="utf-8")
        self.assertEqual(hands_of(PEG_AND_BOX), {"right": "trainee", "instructor": "instructor"})
        self.assertEqual(hands_of(scenario.parent), {"right": "trainee"})
        done = tenon(*self.words("--scenario", scenario.parent, "--lockstep"), timeout=900)
        self.assertEqual(done.returncode, 0, done.stdout[-3000:] + done.stderr)
        self.assertFalse((self.folder / "out" / "instructor.log").exists())
        self.assertRegex(done.stdout, r"everything is mounted after [0-9.]+ s; late ticks: 0")
        again = tenon(*self.words("--scenario", scenario.parent, "--lockstep"), timeout=900)
        self.assertNotIn("preparing the scene", again.stdout, "everything is baked")


if __name__ == "__main__":
    unittest.main()
