"""Stations through their programs: arming by the return key and by --arm, and two stations whose server is killed during an emergency stop.
What a device displays is read from the recording of the session."""
import os
import pty
import subprocess
import time
import unittest

from resume_test import begin, kill, resume
from safety_test import hand_states
from stage import PROGRAMS, Stage

EMERGENCY_STOP, FORCES_OFF = 1 << 15, 1 << 16  # of HandSample.rules


class Arming(unittest.TestCase):
    def session(self, stage, *options, keys=None):
        """A trainee whose device nobody holds; 3 s later `keys` are typed at its terminal. Returns what its hand displayed, and what it said."""
        server = stage.serve("peg_and_box", "--wait-for", "recorder")
        recorder = stage.start("record", "-o", stage.out / "session.mcap")
        recorder.wait_for("recording", 60)
        terminal, inside = pty.openpty()
        station = subprocess.Popen([PROGRAMS / "tenon-join", "--role", "trainee", "--device", "sigma7-sim", "--tracker", "none", "--person",
                                    "none", "--session", stage.session, "--domain", str(stage.domain), "--wait", "60", *options],
                                   stdin=inside, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        os.close(inside)
        try:
            server.wait_for(r"\(trainee\) has joined", 60)
            time.sleep(3)
            if keys:
                os.write(terminal, keys)
                time.sleep(3)
            self.assertEqual(stage.start("command", "stop").wait(60), 0)
            self.assertEqual(recorder.wait(60), 0, recorder.text())
            said, _ = station.communicate(timeout=60)
        finally:
            station.kill()
            os.close(terminal)
        [states] = hand_states(stage.out / "session.mcap").values()
        self.assertGreater(len(states), 100)
        return states, said

    def test_a_station_displays_no_force_until_somebody_presses_return(self):
        with Stage(lockstep=False) as stage:
            states, said = self.session(stage, keys=b"\n")
            self.assertIn("not armed: press return", said)
            off = [bool(state.rules & FORCES_OFF) for state in states]
            pressed = off.index(False)
            self.assertGreater(pressed, 10)
            self.assertGreater(states[pressed].step, 2000, "two seconds without a press")
            self.assertFalse(any(off[pressed:-20]), "armed by one press, and stays so")
            self.assertTrue(any(state.is_starting for state in states[pressed:pressed + 20]), "softly")

    def test_other_keys_do_not_arm_and_neither_does_nobody(self):
        with Stage(lockstep=False) as stage:
            states, _ = self.session(stage, keys=b"arm me ")  # a terminal hands over whole lines
            self.assertTrue(all(state.rules & FORCES_OFF for state in states))

    def test_arm_says_that_somebody_is_there(self):
        with Stage(lockstep=False) as stage:
            states, said = self.session(stage, "--arm")
            self.assertNotIn("not armed", said)
            self.assertFalse(any(state.rules & FORCES_OFF for state in states[20:-20]))


class TwoStations(unittest.TestCase):
    def test_a_stop_stands_over_a_killed_server_at_both_and_both_come_back_softly(self):
        with Stage(lockstep=False) as stage:
            server = begin(stage, "--wait-for", "right,instructor")
            recorder = stage.start("record", "-o", stage.out / "session.mcap", "--wait", 20)
            stations = [stage.start(role, "--wait", 60) for role in ("trainee", "instructor")]
            server.wait_for("step done: take_peg", 120)
            self.assertEqual(stage.start("command", "emergency", "a", "test").wait(60), 0)
            for station in stations:
                station.wait_for("emergency stop by .*: a test", 30)
            kill(server)
            time.sleep(2)
            server, _ = resume(stage)
            for station in stations:
                station.wait_for("rejoined as client", 30)
            server.wait_for("run: emergency stop", 30)
            time.sleep(2)
            for station in stations:
                self.assertNotIn("cleared", station.text())
            for words in (["clear"], ["resume"]):
                self.assertEqual(stage.start("command", *words).wait(60), 0)
            self.assertEqual(server.wait(240), 0, server.text())
            for process in (*stations, recorder):
                self.assertEqual(process.wait(60), 0, f"{process.name}: {process.text()}")
            moved = {hand: states for hand, states in hand_states(stage.out / "session.mcap").items() if any(state.rules for state in states)}
            self.assertEqual(len(moved), 2, "the hands of the two stations")
            for hand, states in moved.items():
                self.judge(hand, states)

    def judge(self, hand, states):
        """Stopped until the clear, over the death of the server; then a second of ramp, of 3 N at most and 20 N/s."""
        stopped = [i for i, state in enumerate(states) if state.rules & EMERGENCY_STOP]
        self.assertTrue(stopped, f"hand {hand} was never stopped")
        first, last = stopped[0], stopped[-1]
        self.assertEqual(len(stopped), last - first + 1, f"hand {hand}: the stop was lifted meanwhile")
        self.assertGreater(states[last].step - states[first].step, 4000, f"hand {hand}: shorter than the server was away")
        self.assertEqual(max(state.peak for state in states[first + 2:last]), 0.0, f"hand {hand}")
        after = states[last + 1:]
        self.assertTrue(any(state.is_starting for state in after[:50]), f"hand {hand} did not ramp")
        peak_before = 0.0
        for before, now in zip(after, after[1:]):
            if not now.is_of_soft_start(after[0]):
                break
            self.assertLessEqual(now.peak, 3.0 + 1e-3, f"hand {hand}, step {now.step}")
            self.assertLessEqual(now.peak - peak_before, 20.0 * 0.002 * (now.step - before.step) + 0.02, f"hand {hand}, step {now.step}")
            peak_before = now.peak


if __name__ == "__main__":
    unittest.main()
