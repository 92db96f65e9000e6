"""A server that is killed and resumed, through real processes: the session ends as if nothing had happened, and its journal re-simulates."""
import configparser
import os
import re
import resource
import shutil
import signal
import struct
import subprocess
import time
import types
import unittest
from pathlib import Path

from safety_test import hand_states, messages
from stage import COARSE, PROGRAMS, SOURCE, TENON, Stage, final_hash, tenon

PEG = SOURCE / "scenarios" / "peg_and_box"


def begin(stage, *arguments):
    """A server with a journal."""
    server = stage.serve("peg_and_box", "--journal", stage.out / "journal.mcap", *arguments)
    return server


def kill(server):
    server.signal(signal.SIGKILL)
    server.popen.wait()


def resume(stage):
    """Resumes the session; the server, and the seconds [s] until its hands had their chance to be back."""
    began = time.monotonic()
    server = stage.start("serve", PEG, "--resume", stage.out / "journal.mcap")
    server.wait_for("is open again after tick", 30)
    return server, time.monotonic() - began


def ticks(file):
    """The ticks whose inputs a journal or a recording has, in their order."""
    found = []
    for topic, message in messages(file):
        if topic == "TickInput" and struct.unpack_from("<I", message)[0] == 0:  # the first part of a tick
            found.append(struct.unpack_from("<Q", message, 8)[0])
        if topic == "TickInputs":
            count = struct.unpack_from("<I", message, 20)[0]
            tick = 0
            for code in struct.unpack(f"<{count}Q", bytes(message[24 + i + byte * count] for i in range(count) for byte in range(8))):
                tick += -(code + 1 >> 1) if code & 1 else code >> 1  # steps, zigzag, byte by byte
                found.append(tick)
    return found


def resimulated(stage, file="journal.mcap"):
    return tenon("resimulate", stage.out / file, PEG, *COARSE, timeout=300)


class KilledServer(unittest.TestCase):
    def assertResimulates(self, stage, server, file="journal.mcap"):
        again = resimulated(stage, file)
        self.assertEqual(again.returncode, 0, again.stdout + again.stderr)
        self.assertIn(" 0 gaps", again.stdout)
        final = re.search("final state hash: .*", server.text()).group()
        self.assertIn(final, again.stdout)

    def test_a_session_that_is_killed_twice_in_contact_ends_with_everything_mounted(self):
        with Stage(lockstep=False) as stage:
            server = begin(stage, "--wait-for", "right")
            recorder = stage.start("record", "-o", stage.out / "session.mcap", "--wait", 20)
            observer = stage.start("observer", "--json", "--wait", 20)
            trainee = stage.start("trainee", "--seed", 1, "--wait", 60)
            instructor = stage.start("instructor", "--wait", 60)
            server.wait_for("step done: take_peg", 120)
            for _ in range(2):
                self.wait_for_contact(observer)
                kill(server)
                server, _ = resume(stage)
                trainee.wait_for("rejoined as client", 30)
                server.wait_for("taken: .*right hand", 30)
                time.sleep(2)
            self.assertEqual(server.wait(120), 0, server.text())
            self.assertIn("everything is mounted", server.text())
            for process in (trainee, instructor, observer, recorder):
                self.assertEqual(process.wait(60), 0, f"{process.name}: {process.text()}")
            self.assertEqual(len(re.findall("recording the resumed session after tick", recorder.text())), 2)
            clients = re.findall(r"joined as client (\d+)", trainee.text())
            self.assertEqual(set(clients), {clients[0]}, "the same seat in each life")
            self.assertResimulates(stage, server)
            self.assertResimulates(stage, server, "session.mcap")
            self.judge(stage)

    def wait_for_contact(self, observer):
        """Until the part in the hand touches something, from now on."""
        seen = len(observer.lines)
        for _ in range(600):
            if any('"contact"' in line and '"colliding":true' in line for line in observer.lines[seen:]):
                return
            time.sleep(0.1)
        self.fail("no contact came about")

    def judge(self, stage):
        """When the contacts are back, the force of a hand grows from zero by at most 20 N/s for 0.9 s."""
        returns = 0
        for states in hand_states(stage.out / "session.mcap").values():
            for i, (before, now) in enumerate(zip(states, states[1:]), 1):
                if not (before.age > 500 and now.age < 50):
                    continue
                returns += 1
                self.assertEqual(before.force, 0.0, f"step {now.step}: the contacts were old")
                last_step, last = now.step - 10, 0.0
                for state in states[i:]:
                    if state.step > now.step + 900:
                        break
                    self.assertLessEqual(state.peak - last, 20.0 * 0.002 * (state.step - last_step) + 0.02, f"step {state.step}")
                    last_step, last = state.step, state.force
        self.assertGreater(returns, 0, "no hand came back")

    def test_an_emergency_stop_stands_after_the_resume_until_it_is_cleared(self):
        with Stage(lockstep=False) as stage:
            server = begin(stage, "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1, "--wait", 60)
            server.wait_for("run: running", 120)
            time.sleep(1)
            command = stage.start("command", "emergency", "hand in the way")
            self.assertEqual(command.wait(60), 0, command.text())
            server.wait_for("run: emergency stop", 30)
            kill(server)
            server, _ = resume(stage)
            trainee.wait_for("rejoined as client", 30)
            server.wait_for("run: emergency stop", 30)
            for words in (["clear", "all well"], ["resume"]):
                command = stage.start("command", *words)
                self.assertEqual(command.wait(60), 0, command.text())
            server.wait_for("run: running", 30)
            self.assertEqual(server.wait(120), 0, server.text())
            self.assertEqual(trainee.wait(60), 0, trainee.text())
            self.assertResimulates(stage, server)

    def test_a_stop_that_only_the_journal_has_stands_too(self):
        with Stage(lockstep=False) as stage:
            server = begin(stage, "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1, "--wait", 60)
            server.wait_for("run: running", 120)
            command = stage.start("command", "emergency", "hand in the way")
            self.assertEqual(command.wait(60), 0, command.text())
            server.wait_for("run: emergency stop", 30)
            time.sleep(0.2)
            kill(server)
            kill(trainee)
            (Path(os.environ["XDG_STATE_HOME"]) / "tenon" / f"stop-{stage.domain}-test").unlink()
            server, _ = resume(stage)
            server.wait_for("engaged by server: it stood when the former server was killed", 30)
            for words in (["clear", "all well"], ["resume"]):
                command = stage.start("command", *words)
                self.assertEqual(command.wait(60), 0, command.text())
            server.wait_for("run: running", 30)

    def test_who_is_not_back_is_parked_and_gets_the_seat_later(self):
        with Stage(lockstep=False) as stage:
            server = begin(stage, "--wait-for", "right")
            seat = ["--seat", stage.out / "seat"]
            trainee = stage.start("trainee", "--seed", 1, "--wait", 60, *seat)
            server.wait_for("taken: Peg|taken: .*right", 120)
            time.sleep(2)
            kill(server)
            kill(trainee)
            server, _ = resume(stage)
            server.wait_for("hand 'right' is not back yet", 30)
            back = stage.start("trainee", "--seed", 2, "--wait", 60, *seat)
            back.wait_for("joined as client 1", 60)
            self.assertEqual(server.wait(120), 0, server.text())
            self.assertEqual(back.wait(60), 0, back.text())
            self.assertResimulates(stage, server)

    def test_a_server_that_is_interrupted_while_it_waits_for_hands_ends_as_a_stopped_session_does(self):
        ends = []
        for interrupted in ("while it runs", "while it waits"):
            with Stage(lockstep=False) as stage:
                server = begin(stage, "--wait-for", "right")
                trainee = stage.start("trainee", "--person", "none", "--wait", 60)
                server.wait_for("run: running", 120)
                if interrupted == "while it waits":
                    time.sleep(1)
                    kill(server)
                    kill(trainee)
                    server, _ = resume(stage)
                server.signal(signal.SIGINT)
                ends.append(server.wait(60))
                self.assertRegex(server.text(), "(?m)^stopped after ", interrupted)
                self.assertNotIn("is not back yet", server.text())
                again = tenon("serve", "--resume", stage.out / "journal.mcap", "--domain", stage.domain)
                self.assertEqual(again.returncode, 1)
                self.assertIn("the session has ended ('stopped'", again.stderr)
        self.assertEqual(ends, [1, 1], "not everything was mounted")

    def test_keys_are_sent_to_the_server_that_resumes_the_session(self):
        with Stage(lockstep=False) as stage:
            server = begin(stage, "--wait-for", "right")
            stage.start("trainee", "--seed", 1, "--wait", 60)
            server.wait_for("run: running", 60)
            keys = subprocess.Popen([PROGRAMS / "tenon-command", "--keys", "--session", stage.session, "--domain", str(stage.domain)],
                                    stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)

            def press(key, answer):
                keys.stdin.write(key)
                keys.stdin.flush()
                line = keys.stdout.readline()
                while line and answer not in line:
                    line = keys.stdout.readline()
                self.assertIn(answer, line)

            try:
                press("p", "pause: accepted")
                time.sleep(1)  # until the journal has it
                # what waits for an answer of a hung server is not sent to the next one
                server.signal(signal.SIGSTOP)
                keys.stdin.write("pny")
                keys.stdin.flush()
                time.sleep(0.5)
                kill(server)
                press("", "waiting for one that resumes the session, space still stops every device")
                press("", "skip: not sent: the server is gone")
                server, _ = resume(stage)
                press("", "joined session 'test' again")
                press("r", "resume: accepted")
                server.wait_for("run: running", 30)
            finally:
                keys.communicate("q", timeout=60)
            self.assertEqual(keys.returncode, 0)

    def test_who_was_removed_just_before_the_kill_stays_removed_and_is_listed_no_more(self):
        def command(*words):
            done = tenon("command", *words, "--session", stage.session, "--domain", stage.domain)
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            return done.stdout

        with Stage(lockstep=False) as stage:
            server = begin(stage, "--wait-for", "right")
            trainee = stage.start("trainee", "--person", "none", "--wait", 60)
            observer = stage.start("observer", "--wait", 60)
            server.wait_for("observer .* has joined", 60)
            server.wait_for("run: running", 60)
            self.assertRegex(command("list"), "(?m)^  observer +observer")
            command("kick", "observer")
            kill(server)
            server, _ = resume(stage)
            trainee.wait_for("rejoined as client", 30)
            self.assertNotEqual(observer.wait(60), 0, observer.text())
            self.assertIn("removed", observer.text())
            self.assertNotRegex(command("list"), "(?m)^  observer +observer")
            # of a session that goes on too
            second = stage.start("observer", "--wait", 60)
            server.wait_for("observer .* has joined", 60)
            command("kick", "observer")
            second.wait_for("removed", 60)
            self.assertNotRegex(command("list"), "(?m)^  observer +observer")


class LockstepServer(unittest.TestCase):
    def test_a_killed_lockstep_session_goes_on_and_resimulates(self):
        with Stage() as stage:
            server = begin(stage, "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1, "--wait", 60)
            server.wait_for("run: running", 300)
            time.sleep(0.5)  # of a session that takes seconds
            kill(server)
            unfinished = resimulated(stage)
            self.assertEqual(unfinished.returncode, 1, unfinished.stdout + unfinished.stderr)
            said = re.search(r"(?m)^.*journal\.mcap reaches tick (\d+) and does not record how the run ended: .*--resume .*$", unfinished.stdout)
            self.assertIsNotNone(said, unfinished.stdout)
            self.assertRegex(unfinished.stdout, rf"(?m)^ticks 2 to {said[1]}: \d+ compared, 0 gaps$")
            server, _ = resume(stage)
            self.assertRegex(server.text(), rf"journal\.mcap reaches tick {said[1]} and records no end of the run")
            trainee.wait_for("rejoined as client", 60)
            self.assertEqual(server.wait(300), 0, server.text())
            self.assertIn("everything is mounted", server.text())
            self.assertEqual(trainee.wait(60), 0, trainee.text())
            again = resimulated(stage)
            self.assertEqual(again.returncode, 0, again.stdout + again.stderr)
            self.assertEqual(final_hash(again.stdout), final_hash(server.text()))
            # what was once damaged is said, although the file was closed
            journal = stage.out / "journal.mcap"
            content = bytearray(journal.read_bytes())
            middle = len(content) // 2
            content[middle:middle + 4096] = bytes(4096)
            journal.write_bytes(content)
            damaged = resimulated(stage)
            self.assertEqual(damaged.returncode, 1, damaged.stdout + damaged.stderr)
            self.assertRegex(damaged.stdout, r"journal\.mcap: is damaged between bytes \d+ and \d+: read without them")
            self.assertRegex(damaged.stdout, r"(?m)^ticks \d+ to \d+ are missing: compared again after the checkpoint of tick \d+$")


class Recordings(unittest.TestCase):
    # a server may be killed again before its recorder is back, or while it comes back
    def test_over_kills_at_any_time_a_recording_has_each_tick_of_the_journal_once_nightly(self):
        with Stage(lockstep=False) as stage:
            server = begin(stage, "--wait-for", "right")
            recorder = stage.start("record", "-o", stage.out / "session.mcap", "--wait", 20)
            stage.start("trainee", "--person", "none", "--wait", 60)
            server.wait_for("run: running", 120)
            time.sleep(2)
            for interval in (0.05, 0.6, 0.2, 1.2, 0.1, 0.9, 0.4):
                kill(server)
                server, _ = resume(stage)
                server.wait_for(r"trainee \(trainee\) has rejoined|is not back yet", 30)
                time.sleep(interval)
            for _ in range(100):  # the recorder is back in the last life
                if "recording the resumed session" in recorder.text().splitlines()[-1]:
                    break
                time.sleep(0.1)
            time.sleep(1)
            command = stage.start("command", "stop")
            self.assertEqual(command.wait(60), 0, command.text())
            server.wait(60)
            self.assertEqual(recorder.wait(60), 0, recorder.text())
            journal, recording = ticks(stage.out / "journal.mcap"), ticks(stage.out / "session.mcap")
            self.assertEqual(journal, list(range(1, journal[-1] + 1)))
            self.assertEqual(recording, journal, recorder.text())
            self.assertRegex(recorder.text(), rf"TickInput: {journal[-1]} of {journal[-1]} samples")

    def test_a_recorder_that_stood_still_over_a_kill_has_all_ticks_or_does_not_end_well_nightly(self):
        for seconds in (2, 20):  # the server keeps 16,384 ticks for recorders
            with self.subTest(seconds=seconds), Stage(lockstep=False) as stage:
                server = begin(stage, "--wait-for", "right")
                recorder = stage.start("record", "-o", stage.out / "session.mcap", "--wait", 20)
                stage.start("trainee", "--person", "none", "--wait", 60)
                server.wait_for("run: running", 120)
                time.sleep(1)
                recorder.signal(signal.SIGSTOP)
                kill(server)
                server, _ = resume(stage)
                time.sleep(seconds)
                recorder.signal(signal.SIGCONT)
                time.sleep(4)
                command = stage.start("command", "stop")
                self.assertEqual(command.wait(60), 0, command.text())
                server.wait(60)
                code = recorder.wait(60)
                missing = set(ticks(stage.out / "journal.mcap")) - set(ticks(stage.out / "session.mcap"))
                self.assertEqual(bool(missing), seconds > 16, f"{len(missing)} ticks are missing")
                self.assertEqual(code, 1 if missing else 0, recorder.text())
                if missing:
                    self.assertIn("ticks are missing", recorder.text())
                else:
                    self.assertEqual(ticks(stage.out / "session.mcap"), ticks(stage.out / "journal.mcap"))


class Elsewhere(unittest.TestCase):
    # its folder and the cache are gone: the journal alone is there
    def test_a_journal_of_an_own_scenario_resimulates_where_nothing_else_of_it_is_nightly(self):
        with Stage() as stage:
            mine = stage.out / "lab" / "mine"
            (mine.parent / "meshes").mkdir(parents=True)
            mine.mkdir()
            parts = Path(os.environ.get("TENON_PARTS", PROGRAMS / "tenon-parts"))
            subprocess.run([parts, "peg_and_box", mine.parent / "meshes", "--detail", "0.12"], check=True, capture_output=True)
            text = (PEG / "scenario.yaml").read_text(encoding="utf-8")
            (mine / "scenario.yaml").write_text(re.sub(r"\{part: (\w+)\}", r"{file: ../meshes/\1.stl}", text), encoding="utf-8")
            cache = stage.out / "cache"
            server = stage.start("serve", mine, "--wait-for", "right", "--cache", cache, "--journal", stage.out / "journal.mcap")
            trainee = stage.start("trainee", "--seed", 1, "--wait", 60)
            self.assertEqual(server.wait(300), 0, server.text())
            trainee.wait(60)
            shutil.rmtree(mine.parent)
            shutil.rmtree(cache)
            journal = stage.out / "elsewhere" / "journal.mcap"
            journal.parent.mkdir()
            (stage.out / "journal.mcap").rename(journal)
            again = tenon("resimulate", journal, "--cache", stage.out / "other cache", cwd=journal.parent, timeout=300)
            self.assertEqual(again.returncode, 0, again.stdout + again.stderr)
            self.assertIn(f"final state hash: {final_hash(server.text())}", again.stdout)
            self.assertIn(" 0 gaps", again.stdout)
            self.assertEqual([file.name for file in journal.parent.iterdir()], ["journal.mcap"])


class Service(unittest.TestCase):
    """`deploy/systemd`, run as the unit says: the program that it names, ended by its signal, started again when it ended as its
    `Restart=` says."""
    FOLDER = SOURCE / "deploy" / "systemd"
    # by systemd.service(5), what on-abnormal does not take for a clean end
    UNCLEAN = {-number for number in signal.valid_signals()} - {-signal.SIGHUP, -signal.SIGINT, -signal.SIGTERM, -signal.SIGPIPE}

    def setUp(self):
        unit = configparser.ConfigParser(strict=False, interpolation=None)
        unit.optionxform = str
        unit.read_string((self.FOLDER / "tenon@.service").read_text(encoding="utf-8"))
        self.unit = unit["Service"]
        self.assertEqual(self.unit["Restart"], "on-abnormal")
        self.stage = Stage(lockstep=False)
        self.enterContext(self.stage)
        self.environment = {**os.environ, "STATE_DIRECTORY": str(self.stage.out), "TENON": str(TENON), "TENON_PROGRAMS": str(PROGRAMS)}

    def start(self, *more):
        """As ExecStart does, with the name of the session in place of %i, and the domain and detail of tests."""
        words = self.unit["ExecStart"].split()
        self.assertEqual(Path(words[0]).name, "serve_or_resume")
        arguments = [PEG if word == "%i" else word for word in words[1:]]
        arguments[arguments.index("--session") + 1] = "test"
        server = subprocess.Popen([self.FOLDER / "serve_or_resume", *arguments, "--domain", str(self.stage.domain), *more],
                                  stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=self.environment)
        self.addCleanup(server.stdout.close)
        self.stage.processes.append(types.SimpleNamespace(popen=server, signal=server.send_signal))
        return server

    def said(self, server, text):
        """The next line with this text."""
        return next(line for line in iter(server.stdout.readline, "") if text in line)

    def opened(self, server):
        """The line that says that people can join."""
        return self.said(server, "is open")

    def journals(self):
        return sorted(self.stage.out.glob("*.mcap"))

    def assertStops(self, server):
        """As `systemctl stop` does: in time, by itself, and with a code that is no failure of the service."""
        server.send_signal(getattr(signal, self.unit["KillSignal"]))
        code = server.wait(float(self.unit["TimeoutStopSec"]))
        self.assertIn(code, {0, *map(int, self.unit["SuccessExitStatus"].split())})

    def test_a_session_that_is_killed_is_continued_unattended_and_one_that_was_stopped_is_not(self):
        server = self.start(*COARSE)
        self.assertIn("waiting for people", self.opened(server))
        first = self.journals()
        for _ in range(2):
            server.kill()
            self.assertIn(server.wait(), self.UNCLEAN, "systemd starts it again")
            time.sleep(0.1)  # RestartSec
            server = self.start()  # the detail is the journal's
            self.assertIn("is open again", self.opened(server))
            self.assertEqual(self.journals(), first, "the same file is continued")
        self.assertStops(server)
        time.sleep(1)  # the names are times
        server = self.start(*COARSE)
        self.assertIn("waiting for people", self.opened(server))
        self.assertEqual(len(self.journals()), 2, "a new session has a file of its own")
        self.assertStops(server)

    def test_a_running_session_that_is_killed_goes_on_where_it_was_nightly(self):
        server = self.start("--wait-for", "right", *COARSE)
        self.opened(server)
        trainee = self.stage.start("trainee", "--seed", 1, "--wait", 60)
        self.said(server, "run: running")
        time.sleep(1)
        server.kill()
        self.assertIn(server.wait(), self.UNCLEAN)
        server = self.start("--wait-for", "right")
        self.assertRegex(self.opened(server), "is open again after tick [1-9]")
        trainee.wait_for("rejoined as client", 60)
        said = server.communicate(timeout=200)[0]
        self.assertEqual(server.returncode, 0, said)
        self.assertIn("everything is mounted", said)
        self.assertEqual(trainee.wait(60), 0, trainee.text())
        self.assertEqual(len(self.journals()), 1)

    def test_a_journal_that_cannot_be_continued_ends_it_with_1_so_nobody_starts_it_over_and_over(self):
        (self.stage.out / "2026-01-01-000000.mcap").write_bytes(b"no journal")
        server = self.start(*COARSE)
        said = server.communicate(timeout=60)[0]
        self.assertEqual(server.returncode, 1, said)
        self.assertNotIn(server.returncode, self.UNCLEAN)
        self.assertIn("2026-01-01-000000.mcap", said)
        self.assertEqual(len(self.journals()), 1, "and no new session hides it")


class FullDisk(unittest.TestCase):
    # a limit of the file's size stands for the disk
    def test_ends_the_journal_and_says_so_and_the_session_ends_well(self):
        def limit():
            signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
            resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))

        with Stage(lockstep=False) as stage:
            server = subprocess.Popen([PROGRAMS / "tenon-serve", PEG, "--journal", stage.out / "journal.mcap", "--wait-for", "right",
                                       "--session", "test", "--domain", str(stage.domain), *COARSE],
                                      stdout=subprocess.PIPE, text=True, preexec_fn=limit)
            stage.processes.append(types.SimpleNamespace(popen=server, signal=server.send_signal))
            observer = stage.start("observer", "--wait", 60)
            trainee = stage.start("trainee", "--seed", 1, "--wait", 60)
            said = server.communicate(timeout=200)[0]
            self.assertEqual(server.returncode, 0, said)
            self.assertIn("everything is mounted", said)
            self.assertRegex(said, "the journal ends here, the session continues without it: .*journal.mcap")
            self.assertEqual(trainee.wait(60), 0, trainee.text())
            self.assertEqual(observer.wait(60), 0)
            self.assertIn("the journal ends here", observer.text(), "people on the bus are told")
            again = resimulated(stage)
            self.assertEqual(again.returncode, 1, again.stdout + again.stderr)
            self.assertRegex(again.stdout, r"journal\.mcap reaches tick \d+ and does not record how the run ended")


class Refusals(unittest.TestCase):
    def test_what_cannot_be_resumed_is_refused_with_the_file_and_what_to_do(self):
        with Stage() as stage:
            file = stage.out / "journal.mcap"
            server = begin(stage, "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1, "--wait", 60)
            self.assertEqual(server.wait(300), 0, server.text())
            trainee.wait(60)

            def refused(*arguments, code=1):
                answer = tenon("serve", *arguments, "--domain", stage.domain, *COARSE, timeout=120)
                self.assertEqual(answer.returncode, code, answer.stdout + answer.stderr)
                return answer.stderr

            self.assertRegex(refused(PEG, "--resume", file), "journal.mcap: the session has ended.*--journal")
            self.assertRegex(refused(PEG, "--journal", file), "journal.mcap.*--overwrite")
            self.assertRegex(refused(PEG, "--resume", stage.out / "no.mcap"), "no.mcap")
            self.assertIn("--resume", refused(PEG, "--resume", file, "--journal", file, code=2))
            whole = file.read_bytes()
            file.write_bytes(whole[:len(whole) * 2 // 3])
            self.assertRegex(refused(SOURCE / "scenarios" / "stacking", "--resume", file), "another scenario.*peg_and_box")
            file.write_bytes(whole[:900])
            self.assertRegex(refused(PEG, "--resume", file), "journal.mcap: ")


if __name__ == "__main__":
    unittest.main()
