#!/usr/bin/env python3
"""Measures what a crowd and a recorder that hangs cost a trainee: the longest time without contacts of the server, of a session in real time.

    python3 tests/system/crowd_table.py [--observers 200] [--at-once 20] [--seed 1] [--cases quiet,crowd,recorder]

quiet: nobody else. crowd: observers are started, and killed (-9) while they join or soon after. recorder: one of two recorders is stopped
(SIGSTOP) for the rest of the session. Nothing is asserted: times depend on the machine.
"""
import argparse
import random
import re
import signal
import subprocess
import sys
import time

from stage import PROGRAMS, Stage


def crowd(stage, count, at_once, seed):
    chance = random.Random(seed)
    running = []
    for _ in range(count):
        observer = subprocess.Popen([PROGRAMS / "tenon-observer", "--session", stage.session, "--domain", str(stage.domain)],
                                    stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        running.append((time.monotonic() + chance.uniform(0.05, 1.0), observer))
        while running and (len(running) >= at_once or time.monotonic() >= min(running, key=lambda one: one[0])[0]):
            first = min(running, key=lambda one: one[0])
            time.sleep(max(0.0, first[0] - time.monotonic()))
            first[1].kill()
            first[1].wait()
            running.remove(first)
        time.sleep(chance.uniform(0.0, 0.1))
    for _, observer in running:
        observer.kill()
        observer.wait()


def measure(case, arguments):
    with Stage(lockstep=False) as stage:
        server = stage.serve(arguments.scenario, "--wait-for", "right", "--journal", stage.out / "journal.mcap")
        recorders = [stage.start("record", "-o", stage.out / f"{i}.mcap") for i in range(2 if case == "recorder" else 0)]
        for recorder in recorders:
            recorder.wait_for("recording session", 60)
        # nobody takes the part: the session lasts until it is stopped
        trainee = stage.start("trainee", "--person", "none", "--arm")
        server.wait_for("run: running", 120)
        time.sleep(2)
        begin = time.monotonic()
        if case == "crowd":
            crowd(stage, arguments.observers, arguments.at_once, arguments.seed)
        if case == "recorder":
            recorders[0].signal(signal.SIGSTOP)
            time.sleep(10)
        if case == "quiet":
            time.sleep(10)
        seconds = time.monotonic() - begin
        server.signal(signal.SIGINT)
        trainee.wait(60)
        server.wait(60)
        silence = re.search(r"longest time without contacts of the server: ([0-9.]+) ms", trainee.text())
        print(f"{case}: {seconds:.0f} s; trainee: {silence.group(1) if silence else '?'} ms without contacts at most")
        for line in server.lines:
            if re.search("late ticks|took longer|not published|missing in", line):
                print(f"  server: {line}")
        for recorder in recorders[1:]:
            recorder.wait(60)
            print("  other recorder: " + " | ".join(line for line in recorder.lines if "TickInput" in line or "lost" in line or "missing" in line))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--observers", type=int, default=200)
    parser.add_argument("--at-once", type=int, default=20)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scenario", default="peg_and_box")
    parser.add_argument("--cases", default="quiet,crowd,recorder")
    arguments = parser.parse_args()
    for case in arguments.cases.split(","):
        measure(case, arguments)
    return 0


if __name__ == "__main__":
    sys.exit(main())
