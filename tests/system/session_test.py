"""Sessions between processes: lockstep over DDS and re-simulation give the same state hash as one process."""
import unittest

from stage import SOURCE, Stage, final_hash, tenon

SCENARIO = "peg_and_box"


def rehearse(*arguments):
    done = tenon("rehearse", SOURCE / "scenarios" / SCENARIO, "--seed", 1, "--no-instructor", *arguments)
    return done, final_hash(done.stdout)


class Session(unittest.TestCase):
    def test_the_state_hash_does_not_depend_on_the_number_of_workers(self):
        one, hash_one = rehearse()
        self.assertEqual(one.returncode, 0, one.stdout + one.stderr)
        again, hash_again = rehearse()
        two, hash_two = rehearse("--workers", 2)
        self.assertEqual(hash_one, hash_again)
        self.assertEqual(hash_one, hash_two)

    def test_without_collisions_the_simulated_trainee_fails(self):
        done, _ = rehearse("--no-collisions")
        self.assertEqual(done.returncode, 1, done.stdout)

    def test_a_misplaced_mount_fails_without_an_instructor(self):
        done, _ = rehearse("--misplace-mount", 0, "--seconds", 60, "--follow")
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertIn("pushes at wrong pose", done.stdout)

    def test_the_former_option_names_the_new_one(self):
        done, _ = rehearse("--stubborn", 0)
        self.assertEqual((done.returncode, done.stderr), (2, "tenon rehearse: --stubborn is now --misplace-mount\n"))
        done = tenon("join", "--role", "trainee", "--stubborn", 0)
        self.assertEqual((done.returncode, done.stderr), (2, "tenon-trainee: --stubborn is now --misplace-mount\n"))

    def test_lockstep_between_processes_equals_one_process_and_its_recordings_rerun(self):
        with Stage() as stage:
            journal, recording = stage.out / "journal.mcap", stage.out / "session.mcap"
            server = stage.serve(SCENARIO, "--wait-for", "right,recorder", "--journal", journal)
            recorder = stage.start("record", "-o", recording)
            trainee = stage.start("trainee", "--seed", 1)
            self.assertEqual(server.wait(), 0, server.text())
            self.assertEqual(recorder.wait(30), 0, recorder.text())
            self.assertEqual(trainee.wait(30), 0, trainee.text())

            over_dds = final_hash(server.text())
            self.assertEqual(over_dds, rehearse()[1])
            for file in (journal, recording):
                again = tenon("rerun", file, SOURCE / "scenarios" / SCENARIO)
                self.assertEqual(again.returncode, 0, again.stdout + again.stderr)
                self.assertEqual(final_hash(again.stdout), over_dds)

            edited = stage.out / SCENARIO / "scenario.yaml"
            edited.parent.mkdir()
            text = (SOURCE / "scenarios" / SCENARIO / "scenario.yaml").read_text(encoding="utf-8")
            edited.write_text(text + "\n# edited\n", encoding="utf-8")
            for file in (journal, recording):
                refused = tenon("rerun", file, edited)
                self.assertEqual(refused.returncode, 1, refused.stdout)
                self.assertIn(f"the scenario has changed since {file} was recorded", refused.stderr)
                self.assertIn(str(edited), refused.stderr)
            anyway = tenon("rerun", journal, edited, "--anyway")
            self.assertEqual(anyway.returncode, 0, anyway.stdout + anyway.stderr)
            self.assertEqual(final_hash(anyway.stdout), over_dds, "a comment changes nothing")

            report = tenon("report", recording, "-o", stage.out)
            self.assertEqual(report.returncode, 0, report.stdout + report.stderr)
            self.assertTrue((stage.out / "report.html").exists())


if __name__ == "__main__":
    unittest.main()
