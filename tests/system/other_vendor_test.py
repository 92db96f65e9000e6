"""A client that knows the protocol's IDL file alone and uses another vendor's DDS: it hears a session and sends commands to it."""
import json
import math
import shutil
import subprocess
import unittest

from stage import PROGRAMS, SOURCE, Stage

BUILD = PROGRAMS.parent / "other_vendor"  # kept: built again where idl/tenon.idl or the client has changed
INVALID = 0xFFFFFFFF
HELD = 2  # ObjectState::status


def build():
    """As somebody does who has nothing but the folder and the IDL file."""
    for command in (["cmake", "-S", SOURCE / "clients" / "other_vendor", "-B", BUILD], ["cmake", "--build", BUILD]):
        done = subprocess.run(command, capture_output=True, text=True, timeout=900)
        if done.returncode != 0:
            raise AssertionError(done.stdout[-3000:] + done.stderr[-3000:])
    return BUILD / "tenon-other-vendor"


class OtherVendorNightly(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        missing = [name for name in ("cmake", "fastddsgen") if shutil.which(name) is None]
        if missing:
            raise AssertionError(f"missing: {', '.join(missing)}: run deploy/setup build test")
        cls.program = build()

    def hear(self, stage, *arguments):
        """What the client prints of a running session."""
        done = subprocess.run([self.program, "--domain", str(stage.domain), "--session", stage.session, *map(str, arguments)],
                              capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return json.loads(done.stdout)

    def test_it_hears_frames_and_manifolds_and_its_commands_are_answered(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            stage.start("trainee", "--seed", 1)
            server.wait_for("run: running", 120)
            refused = self.hear(stage, "--role", "observer", "--pause", "--seconds", 1)
            self.assertEqual(refused["command"], {"accepted": False, "reason": "not permitted for the observer: ask the instructor"})
            server.wait_for(r"another vendor \(observer\) has left", 30)
            heard = self.hear(stage, "--role", "trainee", "--note", 'seen by "another"', "--seconds", 3)
            self.assertEqual(heard["command"], {"accepted": True, "reason": ""})
            server.wait_for('another vendor: seen by "another"', 30)
            self.assertEqual((heard["session"], heard["scenario"]), (stage.session, "peg_and_box"))
            self.assertGreater(heard["client"], refused["client"])
            self.assertGreater(heard["frames"]["first_tick"], refused["frames"]["last_tick"])
            self.judge_frames(heard["frames"], heard["objects"])
            self.judge_manifolds(heard)
            server.wait_for("everything is mounted", 120)
            self.assertEqual(server.wait(60), 0, server.text()[-3000:])

    def judge_frames(self, frames, objects):
        self.assertTrue(frames["in_order"])
        self.assertGreater(frames["count"], 20)
        # WorldFrame_100 has each tenth tick, and peg_and_box one part
        self.assertGreaterEqual(frames["last_tick"] - frames["first_tick"], 10 * (frames["count"] - 1) - 10)
        self.assertGreater(len(objects), 1)
        for state in objects:
            self.assertAlmostEqual(math.hypot(*state["q"]), 1.0, delta=1e-9)
            self.assertLess(math.hypot(*state["p"]), 10.0)
            self.assertLessEqual(state["status"], 5)
            self.assertEqual(state["status"] == HELD, state["holder"] != INVALID)

    def judge_manifolds(self, heard):
        self.assertGreater(heard["manifolds"]["count"], 20)
        (hand,) = (one for one in heard["manifolds"]["hands"] if one["object"] != INVALID)
        self.assertAlmostEqual(math.hypot(*hand["q"]), 1.0, delta=1e-9)
        self.assertLessEqual(hand["contacts"], 16)
        # frame and manifold are of nearly the same time, so they agree where the hand's object is
        self.assertLess(abs(hand["tick"] - heard["frames"]["last_tick"]), 1000)
        (held,) = (state for state in heard["objects"] if state["object"] == hand["object"])
        self.assertLess(math.dist(held["p"], hand["p"]), 0.05)

    def test_without_a_session_it_says_so(self):
        with Stage(lockstep=False) as stage:
            done = subprocess.run([self.program, "--domain", str(stage.domain)], capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 1)
            self.assertIn("no session was announced", done.stderr)


if __name__ == "__main__":
    unittest.main()
