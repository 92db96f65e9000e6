"""Safety at the hand through real processes: what a device displays after its server stood still, from the recording of the session."""
import ctypes
import ctypes.util
import math
import signal
import struct
import time
import unittest
from pathlib import Path
from typing import NamedTuple

from stage import Stage

AGE_FADING, SOFT_START = 1 << 1, 1 << 4  # of HandSample.rules
ZSTD = ctypes.CDLL(ctypes.util.find_library("zstd") or "libzstd.so.1")


def records(data):
    """Kind and body of each record of an MCAP file, chunks opened."""
    at = 0
    while at + 9 <= len(data):
        kind, length = struct.unpack_from("<BQ", data, at)
        body = data[at + 9:at + 9 + length]
        at += 9 + length
        if kind != 6:
            yield kind, body
            continue
        size, name = struct.unpack_from("<Q", body, 16)[0], struct.unpack_from("<I", body, 28)[0]
        packed = body[32 + name + 8:]
        if name:
            raw = ctypes.create_string_buffer(size)
            assert ZSTD.ZSTD_decompress(raw, ctypes.c_size_t(size), packed, ctypes.c_size_t(len(packed))) == size
            packed = raw.raw
        yield from records(packed)


def messages(recording):
    """Topic and content, after the header of CDR, of each message of an MCAP file, in order."""
    return ((topic, message) for topic, _, message in timed_messages(recording))


def timed_messages(recording):
    """Likewise, with the time [s] at which it was sent, by the clock of its sender."""
    channels = {}
    for kind, body in records(Path(recording).read_bytes()[8:]):
        if kind == 4:
            size = struct.unpack_from("<I", body, 4)[0]
            channels[struct.unpack_from("<H", body)[0]] = body[8:8 + size].decode()
        if kind == 5:
            yield channels[struct.unpack_from("<H", body)[0]], 1e-9 * struct.unpack_from("<Q", body, 6)[0], body[22 + 4:]


class HandSample(NamedTuple):
    """A HandState_100."""

    step: int  # of its station: a cycle of 1 ms, or a late one
    peak: float  # [N] largest force displayed since the last one
    force: float  # [N] displayed
    age: int  # [ms] of its contacts
    rules: int  # of the safety layer that act, as devices/safety_rules.h
    place: tuple  # [m] of the hand, in the world
    time: float = 0.0  # [s] of the station

    @property
    def is_starting(self):
        return bool(self.rules & SOFT_START)

    @property
    def is_late(self):
        return bool(self.rules & AGE_FADING)

    def is_of_soft_start(self, began):
        """Of one that began with that sample and takes a second of the station's time; late cycles are fewer."""
        return self.step <= began.step + 900 and self.time <= began.time + 0.9


def hand_states(recording):
    """Of each hand its samples, in order."""
    hands = {}
    for topic, time_sent, message in timed_messages(recording):
        if topic != "HandState_100":
            continue
        hand, step = struct.unpack_from("<II", message)
        force = math.hypot(*struct.unpack_from("<3d", message, 144))
        peak = struct.unpack_from("<f", message, 208)[0]
        age, rules = struct.unpack_from("<II", message, 192)
        place = struct.unpack_from("<3d", message, 8)
        hands.setdefault(hand, []).append(HandSample(step, peak, force, age, rules, place, time_sent))
    return hands


class ForceReturn(unittest.TestCase):
    # The trainee touches for a second and inserts for ten. Whenever it does so, the server may stop.
    def test_after_a_server_that_stood_still_the_force_is_not_above_what_it_was_and_grows_slowly(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            recorder = stage.start("record", "-o", stage.out / "session.mcap")
            trainee = stage.start("trainee", "--seed", 1, "--wait", 120)
            server.wait_for("run: running", 120)
            for _ in range(8):
                time.sleep(1.7)
                if server.popen.poll() is not None:
                    break
                server.signal(signal.SIGSTOP)
                time.sleep(0.5)
                server.signal(signal.SIGCONT)
            server.wait_for("everything is mounted", 120)  # the offset of each gap is worked off
            for process in (trainee, server, recorder):
                process.wait(60)
            returns = [judged for states in hand_states(stage.out / "session.mcap").values() for judged in self.returns(states)]
        self.assertTrue(returns, "no stop of the server met a hand in contact")

    def returns(self, states, longest=1500):
        """Judges what follows each gap, of `longest` steps at most, of a hand that felt a force; yields that force."""
        # [ms] what the link explains is no gap: its delay, and as much again (clients/haptic/answer_age.h)
        link = 2 * min((state.age for state in states), default=0)
        for i in range(1, len(states)):
            now, before = states[i], states[i - 1]
            # a recorder behind the link has no samples of a gap
            is_unseen = now.step - before.step > 150 and now.is_starting and not before.is_starting
            if not ((before.age > link + 150 or is_unseen) and now.age < link + 50):
                continue  # not the end of a gap
            # Until contacts are late, at 20 ms beyond the delay and at most 50 ms of jitter, the force follows the hand; the sample
            # that names an age is up to 10 ms younger.
            in_time = [state for state in states[:i] if state.age < link + 80 and not state.is_late]
            fresh = [state.peak for state in in_time if now.step - longest < state.step]
            if not fresh or fresh[-1] < 1.0:
                continue
            # What a force may come back to is what it was in the 100 ms before the gap; or, where gaps are so close that it was still
            # starting then, what it was before the earlier one.
            settled = [state.peak for state in in_time if not state.is_starting]
            limit = max([*fresh[-10:], *settled[-10:], 3.0]) + 0.3
            last = before
            for state in states[i:]:
                if not state.is_of_soft_start(now) or state.age > link + 20:
                    break
                self.assertLessEqual(state.peak, limit, f"{state.step - now.step} ms after a gap that ended at step {now.step}")
                # steps take 1 ms, and count as 2 ms at most
                self.assertLessEqual(state.peak - last.force, 20.0 * 0.002 * (state.step - last.step) + 0.02, f"step {state.step}")
                last = state
            yield fresh[-1]


if __name__ == "__main__":
    unittest.main()
