"""A station whose hand is moved by another program over a local socket: `--device remote` and the example client."""
import subprocess
import sys
import unittest

from stage import SOURCE, Stage, final_hash, tenon

CLIENT = SOURCE / "clients" / "remote_hand" / "remote_hand.py"
SCENARIO = SOURCE / "scenarios" / "peg_and_box"


class Remote(unittest.TestCase):
    def test_the_example_client_mounts_the_first_part_and_the_session_resimulates(self):
        with Stage() as stage:  # in lockstep no tick is missing in a recording
            journal, recording, path = stage.out / "journal.mcap", stage.out / "session.mcap", stage.out / "hand.sock"
            server = stage.serve("peg_and_box", "--wait-for", "right,recorder", "--journal", journal)
            recorder = stage.start("record", "-o", recording)
            station = stage.start("trainee", "--device", "remote", "--address", path)
            station.wait_for("a remote hand may connect to", 30)
            station.wait_for("joined as client", 60)
            station.wait_for("not armed: press .*the device's arming button", 30)
            client = subprocess.run([sys.executable, CLIENT, "--socket", path, "--touch=0.2,0,0.05", "--target=0,0,-0.059"],
                                    capture_output=True, text=True, timeout=300)
            self.assertEqual(client.returncode, 0, client.stdout + client.stderr + server.text()[-2000:])
            self.assertEqual(server.wait(60), 0, server.text())
            self.assertEqual(recorder.wait(30), 0, recorder.text())
            self.assertEqual(station.wait(30), 0, station.text())
            self.assertFalse(path.exists(), "the station removes its socket")
            for file in (journal, recording):
                again = tenon("resimulate", file)
                self.assertEqual(again.returncode, 0, again.stdout + again.stderr)
                self.assertEqual(final_hash(again.stdout), final_hash(server.text()))

    def test_a_simulated_person_cannot_move_it(self):
        for person in ("simulated", SOURCE / "nosuch.csv"):
            done = tenon("join", "--role", "trainee", "--device", "remote", "--person", person)
            self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
            self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)

    def test_the_client_says_what_is_wrong(self):
        done = subprocess.run([sys.executable, CLIENT, "--socket", "/nosuch/hand.sock", "--touch=0,0,0", "--target=0,0,0"],
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertIn("/nosuch/hand.sock: ", done.stderr)
        self.assertNotIn("Traceback", done.stderr)


if __name__ == "__main__":
    unittest.main()
