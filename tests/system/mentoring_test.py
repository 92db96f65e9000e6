"""A trainee's hand that is guided from another station, over the bus: led to the instructor's hand, and let go of without a jump when the
instructor's station is killed, hangs, or says so. Forces and poses are read from the recording of the session."""
import math
import signal
import struct
import time
import unittest
from pathlib import Path

from link import A, Link
from network_test import PEG, Machines
from safety_test import records
from stage import Stage

MOST = 6.0  # [N] of a fixture
SLOPE = 20.0  # [N/s] with which it grows and ends
INTERRUPTED = 1 << 1 | 1 << 2 | 1 << 4 | 1 << 15  # late contacts, soft start, emergency stop: devices/safety_rules.h
# the instructor's hand, from its start to 0.15 m from it
PATH = "t,x,y,z,qw,qx,qy,qz\n0,-0.25,0.10,0.20,1,0,0,0\n3,-0.15,0.0,0.20,1,0,0,0\n"


def states(recording, hand):
    """Of a hand: (step of its station, force of its fixture [N], place [m], rules of the safety layer that act), in order."""
    channels, found = {}, []
    for kind, body in records(Path(recording).read_bytes()[8:]):
        if kind == 4:
            size = struct.unpack_from("<I", body, 4)[0]
            channels[struct.unpack_from("<H", body)[0]] = body[8:8 + size].decode()
        if kind == 5 and channels[struct.unpack_from("<H", body)[0]] == "HandState_100":
            message = body[22 + 4:]  # a message's header, and that of CDR
            if struct.unpack_from("<I", message)[0] == hand:
                found.append((struct.unpack_from("<I", message, 4)[0], struct.unpack_from("<f", message, 212)[0],
                              struct.unpack_from("<ddd", message, 8), struct.unpack_from("<I", message, 196)[0]))
    return found


class Mentoring(unittest.TestCase):
    RIGHT, INSTRUCTOR = 0, 1

    def begin(self, stage):
        """A trainee whose arm rests where it is, and an instructor who moves by a file."""
        (stage.out / "path.csv").write_text(PATH, encoding="utf-8")
        self.server = stage.serve("peg_and_box", "--wait-for", "right,instructor,recorder")
        self.recorder = stage.start("record", "-o", stage.out / "session.mcap")
        self.recorder.wait_for("recording", 60)
        hands = ["--tracker", "none", "--device", "sigma7-sim", "--wait", 60]
        self.trainee = stage.start("trainee", *hands, "--person", "none", "--arm")
        self.instructor = stage.start("instructor", *hands, "--person", stage.out / "path.csv", "--arm")
        self.server.wait_for("run: running", 60)

    def command(self, stage, *words, role="instructor"):
        process = stage.start("command", "--role", role, *words)
        return process.wait(60), process.text()

    def accept(self, stage, *words, role="instructor"):
        code, text = self.command(stage, *words, role=role)
        self.assertEqual(code, 0, text)

    def end(self, stage):
        """Ends the session: the states of the trainee's hand and the instructor's."""
        self.accept(stage, "stop")
        self.assertEqual(self.recorder.wait(60), 0, self.recorder.text())
        return [states(stage.out / "session.mcap", hand) for hand in (self.RIGHT, self.INSTRUCTOR)]

    def judge(self, moved):
        """The force is bounded, and begins and ends without a jump. A step counts as 2 ms at most."""
        self.assertLessEqual(max(state[1] for state in moved), MOST + 1e-3)
        before = moved[0]
        for state in moved[1:]:
            slope = 2e-3 * SLOPE * (state[0] - before[0])
            self.assertLess(state[1], before[1] + slope + 0.6, f"a jump at step {state[0]}")
            if not (state[3] | before[3]) & INTERRUPTED:  # these let the displayed force fall within 20 ms
                self.assertGreater(state[1], before[1] - slope - 0.6, f"a jump at step {state[0]}")
            before = state

    def test_a_hand_is_led_and_let_go_when_the_instructors_station_is_killed(self):
        with Stage(lockstep=False) as stage:
            self.begin(stage)
            self.accept(stage, "guide", "show", "right")
            self.trainee.wait_for("guided by a virtual fixture", 30)
            time.sleep(8)
            code, text = self.command(stage, "guide", "show", "right", role="trainee")
            self.assertEqual(code, 1)
            self.assertIn("not permitted for the trainee", text)
            self.instructor.signal(signal.SIGKILL)
            self.trainee.wait_for("guidance ended", 30)
            self.server.wait_for("hand 'right' is guided no more: whoever moved hand 'instructor' has left", 30)
            time.sleep(1)
            right, guide = self.end(stage)
            self.judge(right)
            self.assertGreater(max(state[1] for state in right), 1.0)
            self.assertEqual(right[-1][1], 0.0)
            # How near it comes is GuidedHandOf's: on a machine that stands still every now and then each gap begins another soft start.
            goal = guide[-1][2]
            first, nearest = math.dist(right[0][2], goal), min(math.dist(state[2], goal) for state in right)
            self.assertLess(nearest, first - 0.01, "the hand has not been led")

    def test_a_station_that_hangs_guides_no_more_and_a_trainee_ends_it(self):
        with Stage(lockstep=False) as stage:
            self.begin(stage)
            self.accept(stage, "guide", "together", "right")
            for station in (self.trainee, self.instructor):
                station.wait_for("guided by a virtual fixture", 30)
            self.instructor.signal(signal.SIGSTOP)
            self.trainee.wait_for("guidance ended", 30)
            self.instructor.signal(signal.SIGCONT)
            time.sleep(2)
            code, _ = self.command(stage, "guide", "off", "right", role="trainee")
            text = self.command(stage, "guide", "off")[1]
            if code != 0:  # the server has taken the station that hung for dead
                self.server.wait_for("is guided no more", 10)
            self.assertIn("no hand is guided", text)
            time.sleep(1)
            right, guide = self.end(stage)
            self.judge(right)
            self.assertGreater(max(state[1] for state in guide), 0.5, "the instructor feels the trainee")
            self.assertEqual(right[-1][1], 0.0)

    def test_an_emergency_stop_ends_it_until_it_is_chosen_again(self):
        with Stage(lockstep=False) as stage:
            self.begin(stage)
            self.accept(stage, "guide", "show", "right")
            self.trainee.wait_for("guided by a virtual fixture", 30)
            time.sleep(2)
            self.accept(stage, "emergency", "a", "test")
            self.server.wait_for("hand 'right' is guided no more: emergency stop", 30)
            time.sleep(1)
            code, text = self.command(stage, "guide", "off", "right")
            self.assertEqual(code, 1)
            self.assertIn("hand 'right' is not guided", text)
            right, _ = self.end(stage)
            self.assertEqual(right[-1][1], 0.0)
            self.assertGreater(max(state[1] for state in right), 1.0)


class MentoringNightly(unittest.TestCase):
    def test_two_hands_that_are_tied_over_a_wan_come_to_rest(self):
        with Link(delay=0.05, jitter=0.005, loss=0.02, burst=3, seed=1) as link, Machines(link) as machines:
            near, far = ["--network", "wan"], ["--network", f"wan,{A}", "--key", machines.key]
            server = machines.start(0, "serve", PEG, "--wait-for", "right,instructor,recorder", *near)
            server.wait_until_open(600)
            recorder = machines.start(0, "record", "-o", machines.out / "session.mcap", *near)
            recorder.wait_for("recording", 60)
            hands = ["--tracker", "none", "--device", "sigma7-sim", "--person", "none", "--arm", "--wait", 60]
            machines.start(0, "instructor", *hands, *near)
            trainee = machines.start(1, "trainee", *hands, *far)
            server.wait_for("run: running", 60)
            time.sleep(3)  # each station has measured its link
            for words in (["guide", "together", "right"], ["guide", "off", "right"], ["stop"]):
                self.assertEqual(machines.start(0, "command", *near, *words).wait(60), 0)
                time.sleep(10 if words[1:2] == ["together"] else 1)
            self.assertIn("guidance ended", trainee.text())
            self.assertEqual(recorder.wait(60), 0, recorder.text())
            for hand in (Mentoring.RIGHT, Mentoring.INSTRUCTOR):
                moved = states(machines.out / "session.mcap", hand)
                end = max(state[0] for state in moved if state[1] > 0.5)
                rest = [state[2] for state in moved if end - 2500 < state[0] < end - 500]
                self.assertGreater(len(rest), 40)  # of 50, as far hands state 25 a second
                self.assertLess(max(math.dist(place, rest[0]) for place in rest), 5e-4, f"hand {hand} swings")

    def test_over_a_link_too_long_for_contacts_a_hand_is_led_and_everybody_is_told(self):
        with Link(delay=0.17, jitter=0.005, loss=0.02, burst=3, seed=2) as link, Machines(link) as machines:
            near, far = ["--network", "wan"], ["--network", f"wan,{A}", "--key", machines.key]
            (machines.out / "path.csv").write_text(PATH, encoding="utf-8")
            server = machines.start(0, "serve", PEG, "--wait-for", "right,instructor,recorder", *near)
            server.wait_until_open(600)
            recorder = machines.start(0, "record", "-o", machines.out / "session.mcap", *near)
            recorder.wait_for("recording", 60)
            hands = ["--tracker", "none", "--device", "sigma7-sim", "--arm", "--wait", 60]
            trainee = machines.start(1, "trainee", "--person", "none", *hands, *far)
            machines.start(0, "instructor", "--person", machines.out / "path.csv", *hands, *near)
            server.wait_for("run: running", 60)
            told = "contacts are not felt over this link: 1[678][0-9] ms one way"
            trainee.wait_for(told, 30)
            server.wait_for(f"right.*{told}|{told}", 30)
            people = machines.start(0, "command", *near, "list")
            self.assertEqual(people.wait(60), 0)
            self.assertIn("contacts are not felt, more than 150 ms one way", people.text())
            for words in (["guide", "show", "right"], ["guide", "off", "right"], ["stop"]):
                self.assertEqual(machines.start(0, "command", *near, *words).wait(60), 0)
                time.sleep(10 if words[1:2] == ["show"] else 2)
            self.assertEqual(trainee.text().count("contacts are not felt"), 1, "said once")
            self.assertEqual(recorder.wait(60), 0, recorder.text())
            right = states(machines.out / "session.mcap", Mentoring.RIGHT)
            Mentoring.judge(self, right)
            self.assertGreater(max(state[1] for state in right), 1.0)
            self.assertEqual(right[-1][1], 0.0)
            self.assertGreater(math.dist(right[0][2], right[-1][2]), 0.01, "the hand has not been led")


if __name__ == "__main__":
    unittest.main()
