"""Sessions between processes: lockstep over DDS and re-simulation give the same state hash as one process."""
import os
import time
import unittest
from pathlib import Path

from stage import COARSE, SOURCE, Stage, final_hash, tenon

SCENARIO = "peg_and_box"


def rehearse(*arguments):
    return tenon("rehearse", SOURCE / "scenarios" / SCENARIO, *COARSE, "--seed", 1, "--no-instructor", *arguments)


def scheduling(pid, names):
    """Class, priority and permitted CPUs of the threads of a process that have one of these names, by name."""
    found = {}
    for task in Path(f"/proc/{pid}/task").iterdir():
        name = (task / "comm").read_text(encoding="utf-8").strip()
        if name in names:
            thread = int(task.name)
            found[name] = (os.sched_getscheduler(thread), os.sched_getparam(thread).sched_priority, sorted(os.sched_getaffinity(thread)))
    return found


class Session(unittest.TestCase):
    def test_the_state_hash_does_not_depend_on_the_number_of_workers(self):
        hashes = set()
        for arguments in ((), (), ("--workers", 2)):
            done = rehearse(*arguments)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            hashes.add(final_hash(done.stdout))
        self.assertEqual(len(hashes), 1, hashes)
        other = tenon("rehearse", SOURCE / "scenarios" / SCENARIO, *COARSE, "--seed", 2, "--no-instructor")
        self.assertNotIn(final_hash(other.stdout), hashes, "another seed is another session")

    def test_without_collisions_the_simulated_trainee_fails(self):
        done = rehearse("--no-collisions")
        self.assertEqual(done.returncode, 1, done.stdout)
        final_hash(done.stdout)  # it ran to its end

    def test_a_misplaced_mount_fails_without_an_instructor(self):
        done = rehearse("--misplace-mount", 0, "--seconds", 60, "--follow")
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertIn("pushes at wrong pose", done.stdout)

    def test_the_former_option_names_the_new_one(self):
        done = rehearse("--stubborn", 0)
        self.assertEqual((done.returncode, done.stderr), (2, "tenon rehearse: --stubborn is now --misplace-mount\n"))
        done = tenon("join", "--role", "trainee", "--stubborn", 0)
        self.assertEqual((done.returncode, done.stderr), (2, "tenon-join: --stubborn is now --misplace-mount\n"))
        done = tenon("join", "--role", "trainee", "--swap-hands")
        self.assertEqual((done.returncode, done.stderr), (2, "tenon-join: --swap-hands is now --hands left,right\n"))

    def test_lockstep_between_processes_equals_one_process_and_its_recordings_resimulate(self):
        with Stage() as stage:
            journal, recording = stage.out / "journal.mcap", stage.out / "session.mcap"
            server = stage.serve(SCENARIO, "--wait-for", "right,recorder", "--journal", journal)
            recorder = stage.start("record", "-o", recording)
            trainee = stage.start("trainee", "--seed", 1)
            self.assertEqual(server.wait(), 0, server.text())
            self.assertEqual(recorder.wait(30), 0, recorder.text())
            self.assertEqual(trainee.wait(30), 0, trainee.text())

            over_dds = final_hash(server.text())
            self.assertEqual(over_dds, final_hash(rehearse().stdout))
            for file in ("journal.mcap", "session.mcap"):
                # both know their scenario, a shipped one, and its detail
                again = tenon("resimulate", file, cwd=stage.out)
                self.assertEqual(again.returncode, 0, again.stdout + again.stderr)
                self.assertEqual(final_hash(again.stdout), over_dds)

            edited = stage.out / SCENARIO / "scenario.yaml"
            edited.parent.mkdir()
            text = (SOURCE / "scenarios" / SCENARIO / "scenario.yaml").read_text(encoding="utf-8")
            edited.write_text(text + "\n# edited\n", encoding="utf-8")
            for file in (journal, recording):
                refused = tenon("resimulate", file, edited)
                self.assertEqual(refused.returncode, 1, refused.stdout)
                self.assertIn(f"the scenario has changed since {file} was recorded", refused.stderr)
                self.assertIn(str(edited), refused.stderr)
            despite = tenon("resimulate", journal, edited, "--despite-changes")
            self.assertEqual(despite.returncode, 0, despite.stdout + despite.stderr)
            self.assertEqual(final_hash(despite.stdout), over_dds, "a comment changes nothing")

            report = tenon("report", recording, "-o", stage.out)
            self.assertEqual(report.returncode, 0, report.stdout + report.stderr)
            self.assertTrue((stage.out / "report.html").exists())
            twice = tenon("report", recording, "-o", stage.out)
            self.assertEqual(twice.returncode, 1)
            self.assertEqual(twice.stderr, f"tenon-report: {stage.out / 'report.html'}: exists; --overwrite replaces it\n")
            self.assertEqual(tenon("report", recording, "-o", stage.out, "--overwrite").returncode, 0)

    # their workspaces have radii of 60, 75 and 40 mm; the hole is 59 mm deep, and indexing pauses in contact
    def test_a_trainee_with_a_desktop_device_mounts_the_peg(self):
        for device in ("sigma7-sim", "omega3-sim", "falcon-sim"):
            with self.subTest(device=device), Stage() as stage:
                server = stage.serve(SCENARIO, "--wait-for", "right")
                trainee = stage.start("trainee", "--seed", 1, "--device", device, "--tracker", "none")
                self.assertEqual(server.wait(), 0, server.text())
                self.assertIn("everything is mounted", server.text())
                self.assertEqual(trainee.wait(30), 0, trainee.text())

    def test_the_workers_of_a_tick_are_scheduled_as_its_thread(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve(SCENARIO, "--workers", 3)
            stage.start("trainee", "--seed", 1)
            names = {"tick", "tick worker 1", "tick worker 2"}
            deadline = time.monotonic() + 120
            threads = {}
            # until the tick's thread is there and has its class, or the server has said that it was not granted
            while set(threads) != names or (threads["tick"][0] != os.SCHED_FIFO and "without real-time priority" not in server.text()):
                self.assertLess(time.monotonic(), deadline, f"{threads}\n{server.text()}")
                time.sleep(0.02)
                threads = scheduling(server.popen.pid, names)
            # its workers follow before the first tick
            while len({str(threads[name]) for name in names}) > 1 and time.monotonic() < deadline:
                time.sleep(0.02)
                threads = scheduling(server.popen.pid, names)
            self.assertEqual(threads, {name: threads["tick"] for name in names})


if __name__ == "__main__":
    unittest.main()
