"""Long sessions through real processes: faults of every process at seeded times, and a soak without any.

The last step of the exercise does not end, and the exercise is reset now and then: hands take the part, carry it, press it into
contact and hold it there for as long as a test lasts.
"""
import os
import random
import re
import signal
import time
import unittest
from pathlib import Path

import safety_test
from stage import COARSE, SOURCE, Stage, tenon

PEG = (SOURCE / "scenarios" / "peg_and_box" / "scenario.yaml").read_text(encoding="utf-8")
ENDLESS = PEG.replace("dwell: 0.2 s", "dwell: 7200 s").replace("timeout: 120 s", "timeout: 7200 s")


class LongSession:
    """A session with a trainee, an instructor, a recorder and a console, each of which can be replaced."""

    def __init__(self, stage, seed):
        self.stage, self.random = stage, random.Random(seed)
        self.running, self.ended = {}, []
        self.lives = 0
        self.scenario = stage.out / "scenario.yaml"
        self.scenario.write_text(ENDLESS, encoding="utf-8")
        self.server = self.running["serve"] = stage.serve(self.scenario, "--wait-for", "right", "--journal", stage.out / "journal.mcap")
        for name in ("record", "trainee", "instructor", "console"):
            self.begin(name)

    def begin(self, name):
        """Starts a process of this kind, in place of one that was killed."""
        self.lives += 1
        out = self.stage.out
        arguments = {
            "record": ["-o", out / f"session-{self.lives}.mcap", "--wait", 60],
            "trainee": ["--seed", self.lives, "--wait", 60, "--seat", out / "seat-trainee"],
            "instructor": ["--wait", 60, "--seat", out / "seat-instructor"],
            "console": ["--port", 0],
        }[name]
        self.running[name] = self.stage.start(name, *arguments)
        if name != "console":
            self.running[name].wait_for("joined as client|recording session|recording", 60)
        return self.running[name]

    def kill(self, name):
        process = self.running[name]
        process.signal(signal.SIGKILL)
        process.popen.wait()
        if name != "serve":
            self.begin(name)
            return
        self.server = self.running["serve"] = self.stage.start("serve", self.scenario, "--resume", self.stage.out / "journal.mcap")
        self.server.wait_for("is open again after tick", 30)

    def note(self, what):
        """Says in the server's output what was done to the session."""
        self.server.lines.append(f"--- {what}")

    def stand_still(self, name, seconds):
        self.note(f"for {seconds} s")
        process = self.running[name]
        process.signal(signal.SIGSTOP)
        time.sleep(seconds)
        process.signal(signal.SIGCONT)

    def command(self, *words):
        process = self.stage.start("command", *words, "--wait", 20)
        code = process.wait(60)
        self.stage.processes.remove(process)
        return code, process.text()

    def wait_for_next(self, pattern, seen, seconds=120):
        """The next line of the server that matches, after its first `seen` ones."""
        server, deadline = self.server, time.monotonic() + seconds
        while time.monotonic() < deadline:
            for line in server.lines[seen:]:
                if re.search(pattern, line):
                    return line
            if server.popen.poll() is not None:
                break
            time.sleep(0.05)
        newest = {name: "\n".join(process.lines[-40:]) for name, process in self.running.items()}
        raise AssertionError(f"the server did not print {pattern!r}; the newest of each process:\n" +
                             "\n".join(f"== {name}\n{text}" for name, text in newest.items()))


class EnduranceNightly(unittest.TestCase):
    def assertEndsWell(self, session):
        """Everybody leaves by himself; the journal runs again to the same bits; what was recorded is a report."""
        stage = session.stage
        code, text = session.command("stop")
        self.assertEqual(code, 0, text)
        for name, process in session.running.items():
            if name == "console":
                process.signal(signal.SIGTERM)
            self.assertGreaterEqual(process.wait(60), 0, f"{name} crashed: {process.text()[-4000:]}")
        again = tenon("resimulate", stage.out / "journal.mcap", session.scenario, *COARSE, timeout=1200)
        self.assertEqual(again.returncode, 0, again.stdout + again.stderr)
        self.assertIn(" 0 gaps", again.stdout)
        final = re.search("final state hash: .*", session.server.text())
        self.assertTrue(final, session.server.text()[-2000:])
        self.assertIn(final.group(), again.stdout)
        newest = max(stage.out.glob("session-*.mcap"), key=lambda file: int(re.search(r"\d+", file.stem).group()))
        report = tenon("report", newest, "--output", stage.out / "report.html", timeout=300)
        self.assertEqual(report.returncode, 1, "the session was stopped: " + report.stdout + report.stderr)
        self.assertTrue((stage.out / "report.html").exists())

    def endure(self, seconds, seed):
        """Faults at seeded times for so long. Returns how often each one was made, and the returns of a force that were judged."""
        made, judged = {}, 0
        with Stage(lockstep=False) as stage:
            session = LongSession(stage, seed)
            dice = session.random

            def emergency():
                seen = len(session.server.lines)
                code, text = session.command("emergency", "a fault of the test")
                self.assertEqual(code, 0, text)
                session.wait_for_next("run: emergency stop", seen, 30)
                for words in (["clear", "all well"], ["resume"]):
                    code, text = session.command(*words)
                    self.assertEqual(code, 0, text)

            faults = {f"kill {name}": (lambda name=name: session.kill(name))
                      for name in ("serve", "trainee", "instructor", "record", "console")}
            faults |= {f"hang {name}": (lambda name=name: session.stand_still(name, dice.choice([0.05, 0.15, 0.3, 0.8, 2.5])))
                       for name in ("serve", "trainee", "instructor", "record", "console")}
            faults["emergency stop"] = emergency
            waiting = []
            session.wait_for_next("step done: take_peg", 0)
            deadline = time.monotonic() + seconds
            while time.monotonic() < deadline:
                time.sleep(dice.uniform(0.2, 6.0))
                # each fault once, in any order, before one is made again
                waiting = waiting or dice.sample(sorted(faults), len(faults))
                fault = waiting.pop()
                session.note(fault)
                faults[fault]()
                made[fault] = made.get(fault, 0) + 1
                time.sleep(dice.uniform(0.5, 1.5))
                for name, process in session.running.items():
                    self.assertIsNone(process.popen.poll(), f"{name} ended after '{fault}': {process.text()[-3000:]}")
                if dice.random() < 0.2:
                    session.note("reset")
                    seen = len(session.server.lines)
                    code, text = session.command("reset")
                    self.assertEqual(code, 0, f"after '{fault}': {text}")
                    session.wait_for_next("step done: take_peg", seen)
            self.assertEndsWell(session)
            for file in stage.out.glob("session-*.mcap"):
                for states in safety_test.hand_states(file).values():
                    judged += len(list(safety_test.ForceReturn.returns(self, states)))
        return made, judged

    def test_a_minute_of_faults(self):
        made, _ = self.endure(60, seed=20)
        self.assertGreater(sum(made.values()), 3)

    def test_an_hour_of_faults(self):
        made, judged = self.endure(3600, seed=21)
        print(f"\nfaults: {made}; {judged} returns of a force judged")
        self.assertGreater(judged, 0, "no fault met a hand in contact")

    def test_a_soak_of_ten_minutes(self):
        rows = {}  # of each process: (seconds, resident memory [KiB], open files, threads), one each ten seconds
        with Stage(lockstep=False) as stage:
            session = LongSession(stage, 22)
            began = time.monotonic()
            seen = 0
            while time.monotonic() - began < 600:
                session.wait_for_next("step done: take_peg", seen)
                for _ in range(3):
                    time.sleep(10)
                    for name, process in session.running.items():
                        rows.setdefault(name, []).append((time.monotonic() - began, *resources(process.popen.pid)))
                seen = len(session.server.lines)
                code, text = session.command("reset")
                self.assertEqual(code, 0, text)
            session.wait_for_next("step done: take_peg", seen)
            self.assertEndsWell(session)
            late = re.search("late ticks: [0-9]+", session.server.text())
        print(f"\n{'process':<12}{'KiB after 2 min':>18}{'KiB at the end':>18}{'files':>14}{'threads':>14}")
        for name, samples in rows.items():
            settled = [row for row in samples if row[0] > 120]
            first, last = settled[0], settled[-1]
            print(f"{name:<12}{first[1]:>18}{last[1]:>18}{f'{first[2]} {last[2]}':>14}{f'{first[3]} {last[3]}':>14}")
            self.assertLessEqual(last[1] - first[1], 8192, f"memory of {name} [KiB]")
            self.assertLessEqual(last[2], first[2] + 2, f"open files of {name}")
            self.assertLessEqual(last[3], first[3] + 1, f"threads of {name}")
        print(late.group())


def resources(pid):
    """Resident memory [KiB], open files and threads of a process."""
    status = Path(f"/proc/{pid}/status").read_text(encoding="ascii")
    number = {key: int(re.search(rf"{key}:\s+(\d+)", status).group(1)) for key in ("VmRSS", "Threads")}
    return number["VmRSS"], len(os.listdir(f"/proc/{pid}/fd")), number["Threads"]


if __name__ == "__main__":
    unittest.main()
