"""Failures of clients and wrong inputs are reported clearly; a failing client does not end the session."""
import signal
import tempfile
import time
import unittest
from pathlib import Path

from stage import SOURCE, Stage, tenon


class Faults(unittest.TestCase):
    def assert_mounted(self, server):
        server.wait_for("everything is mounted", 180)
        self.assertEqual(server.wait(30), 0)

    @staticmethod
    def serve_with_seat(stage):
        """The server, and what starts its trainee, whose seat is kept in a file."""
        server = stage.serve("peg_and_box", "--wait-for", "right")
        return server, lambda: stage.start("trainee", "--seed", 1, "--seat", stage.out / "seat")

    def test_a_part_held_by_a_killed_trainee_is_parked_and_another_may_continue(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1)
            server.wait_for("taken: .*[Pp]eg", 120)
            trainee.signal(signal.SIGKILL)
            server.wait_for("is parked", 30)
            server.wait_for(r"\(trainee\) has left", 30)
            self.assertIsNone(server.popen.poll(), "the session must continue")
            stage.start("trainee", "--seed", 2)
            self.assert_mounted(server)

    def test_a_killed_trainee_gets_its_part_back_with_its_seat_file(self):
        with Stage(lockstep=False) as stage:
            server, start_trainee = self.serve_with_seat(stage)
            trainee = start_trainee()
            server.wait_for("taken: .*[Pp]eg", 120)
            trainee.signal(signal.SIGKILL)
            server.wait_for("is parked", 30)
            again = start_trainee()
            again.wait_for("joined as client 1", 60)
            server.wait_for("has rejoined", 30)
            self.assert_mounted(server)
            self.assertEqual(server.text().count("step done: take_peg"), 1, "the part is in the hand again without being taken")

    def test_a_copy_of_a_seat_ends_the_program_that_had_it_nightly(self):
        with Stage(lockstep=False) as stage:
            server, start_trainee = self.serve_with_seat(stage)
            first = start_trainee()
            server.wait_for("run: running", 60)
            start_trainee()
            server.wait_for("has rejoined", 30)
            self.assertEqual(first.wait(30), 1, first.text())
            self.assertRegex(first.text(), "another program has taken this seat with its key; this one ends")
            self.assertNotIn("; rejoining", first.text())
            self.assert_mounted(server)

    def test_a_trainee_that_hangs_beyond_its_lease_rejoins_nightly(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1)
            server.wait_for("taken: .*[Pp]eg", 120)
            trainee.signal(signal.SIGSTOP)
            server.wait_for(r"\(trainee\) has left", 30)
            trainee.signal(signal.SIGCONT)
            trainee.wait_for("rejoined as client 1", 60)
            self.assert_mounted(server)
            self.assertEqual(trainee.wait(30), 0, trainee.text())

    def test_a_trainee_rejoins_a_restarted_server(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1, "--wait", 60)
            server.wait_for("taken: .*[Pp]eg", 120)
            server.signal(signal.SIGKILL)
            trainee.wait_for("rejoining the session", 30)
            again = stage.serve("peg_and_box", "--wait-for", "right")
            trainee.wait_for("rejoined as client", 60)
            self.assert_mounted(again)

    def test_a_trainee_that_took_its_server_for_dead_notices_when_it_dies_nightly(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1, "--wait", 60)
            server.wait_for("run: running", 60)
            server.signal(signal.SIGSTOP)
            trainee.wait_for("rejoining the session", 30)
            server.signal(signal.SIGCONT)
            trainee.wait_for("rejoined as client", 60)
            server.signal(signal.SIGKILL)
            again = stage.serve("peg_and_box", "--wait-for", "right")
            self.assert_mounted(again)

    def test_the_hand_of_a_trainee_that_hangs_briefly_is_frozen(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1)
            server.wait_for("taken: .*[Pp]eg", 120)
            trainee.signal(signal.SIGSTOP)
            server.wait_for("held still", 30)
            time.sleep(0.3)  # shorter than the lease: the trainee stays in the session
            trainee.signal(signal.SIGCONT)
            server.wait_for("hand '.*' moves again", 30)
            self.assertNotIn("is absent", server.text(), "shorter than the lease")
            self.assert_mounted(server)

    def test_a_second_trainee_is_refused_when_the_hand_is_taken(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            stage.start("trainee", "--seed", 1)
            server.wait_for("has joined", 60)
            second = stage.start("trainee", "--seed", 2)
            self.assertNotEqual(second.wait(60), 0)
            self.assertIn("already moved by somebody else", second.text())

    def test_without_a_server_a_client_says_so(self):
        with Stage(lockstep=False) as stage:
            alone = stage.start("trainee", "--wait", 2)
            self.assertNotEqual(alone.wait(60), 0)
            self.assertIn("no server announced session", alone.text())

    def test_bad_scenarios_name_file_and_line(self):
        cases = {
            "nothing there": ("", "scenario.yaml:1: a scenario must be a mapping"),
            "unknown key": ("title: {en: x}\nobjekts: []\n", "scenario.yaml:2: a scenario has an unknown key 'objekts'"),
        }
        for name, (text, expected) in cases.items():
            with self.subTest(name=name), tempfile.TemporaryDirectory() as folder:
                file = Path(folder) / "scenario.yaml"
                file.write_text(text, encoding="utf-8")
                done = tenon("serve", file)
                self.assertEqual(done.returncode, 1)
                self.assertIn(expected, done.stderr)

    def test_a_missing_mesh_is_named(self):
        original = (SOURCE / "scenarios" / "peg_and_box" / "scenario.yaml").read_text(encoding="utf-8")
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "scenario.yaml"
            self.assertIn("{part: peg}", original)
            file.write_text(original.replace("{part: peg}", "{file: nowhere.stl, unit: mm}"), encoding="utf-8")
            done = tenon("serve", file)
            self.assertEqual(done.returncode, 1)
            self.assertIn("nowhere.stl", done.stderr)


if __name__ == "__main__":
    unittest.main()
