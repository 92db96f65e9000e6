#!/usr/bin/env python3
"""Measures what viewers of a console cost the server's tick: computing times with and without them, in turns, of one session in real time.

    python3 tests/system/viewers_table.py [--viewers 20] [--turns 6] [--seconds 10] [--browser]

One gateway serves the viewers, who read all that they are sent; another one counts, with and without them alike. --browser: a Chromium in their
place, which computes its pictures itself where there is no graphics hardware. Nothing is asserted: times depend on the machine.
"""
import argparse
import contextlib
import os
import selectors
import statistics
import struct
import threading
import time

from console_test import Browser, start_console
from stage import COARSE, Stage
from viewer import Viewer


class Crowd:
    """Viewers of all topics, read by one thread that looks at nothing."""

    def __init__(self, port, count):
        self.viewers = [Viewer(port).begin() for _ in range(count)]
        self.bytes, self.ends = 0, False
        self.thread = threading.Thread(target=self.read)
        self.thread.start()

    def read(self):
        with selectors.DefaultSelector() as waiting:
            for viewer in self.viewers:
                viewer.socket.setblocking(False)
                waiting.register(viewer.socket, selectors.EVENT_READ)
            while not self.ends:
                for key, _ in waiting.select(0.1):
                    with contextlib.suppress(BlockingIOError):
                        self.bytes += len(key.fileobj.recv(1 << 20))

    def close(self):
        self.ends = True
        self.thread.join()
        for viewer in self.viewers:
            viewer.close()


def samples(counter, seconds):
    """(computing time of a tick, the longest of ten ticks) [s] of each message of these seconds."""
    found, end = [], time.monotonic() + seconds
    for topic, payload in counter.messages():
        if topic == "TickStats_100":
            # behind the encapsulation's header: server_epoch, tick, load_percent, compute_seconds, compute_seconds_max
            found.append(struct.unpack_from("<dd", payload, 4 + 24))
        if time.monotonic() > end:
            return found
    return found


def p99(values):
    return sorted(values)[int(0.99 * (len(values) - 1))]


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--viewers", type=int, default=20)
    parser.add_argument("--turns", type=int, default=6, help="of each kind")
    parser.add_argument("--seconds", type=float, default=10, help="of a turn")
    parser.add_argument("--scenario", default="engine_bay")
    parser.add_argument("--browser", action="store_true", help="a Chromium instead of the viewers")
    args = parser.parse_args()
    without, beside, sent, used = [], [], 0, 0.0
    with Stage(lockstep=False) as stage, (Browser() if args.browser else contextlib.nullcontext()) as browser:
        stage.serve(args.scenario, "--wait-for", "right,left")
        stage.start("trainee", "--seed", 1, "--device", "hug-sim")
        console, port = start_console(stage)
        _, other = start_console(stage)
        with Viewer(other) as counter:
            counter.begin("TickStats_100")
            samples(counter, 3)  # the session has begun
            for _ in range(args.turns):
                without += samples(counter, args.seconds)
                before = console.processor_seconds()
                if browser:
                    browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="dark")
                    browser("await", expression="tenon.view.models >= 3 && tenon.view.pictures > 0")
                else:
                    crowd = Crowd(port, args.viewers)
                    samples(counter, 1)  # they have what there is at the beginning
                beside += samples(counter, args.seconds)
                if browser:
                    browser("open", url="about:blank", width=1280, height=800, theme="dark")
                else:
                    crowd.close()
                    sent += crowd.bytes
                used += console.processor_seconds() - before
    who = "a browser" if args.browser else f"{args.viewers} viewers"
    rows = [(f"median of {len(without)} and {len(beside)} ticks", statistics.median, 0), ("p99 of the longest of ten ticks", p99, 1), ("longest", max, 1)]
    print(f"| computing time of a tick, {args.scenario} {' '.join(COARSE)} | without | beside {who} | ratio |\n|---|---|---|---|")
    for name, measure, column in rows:
        a, b = (measure([sample[column] for sample in kind]) for kind in (without, beside))
        print(f"| {name} | {1e6 * a:.1f} us | {1e6 * b:.1f} us | {b / a:.2f} |")
    seconds = args.turns * (args.seconds + (0 if args.browser else 1))
    print(f"\nThe gateway took {100 * used / seconds:.1f} % of a core" + (f" and sent {sent / seconds / 1e6:.2f} MB/s" if sent else "") + f"; load {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
