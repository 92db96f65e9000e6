"""Who is who, and the emergency stop: sessions beside each other, servers of one name, keys, raises with and without a server."""
import os
import re
import signal
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

from stage import COARSE, PROGRAMS, SOURCE, Process, Stage, tenon


def peg_session(stage, name, *arguments):
    """A server of the peg scenario and its trainee, of a session of this name in the domain of `stage`."""
    stage.session = name
    return stage.serve("peg_and_box", "--wait-for", "right", *arguments), stage.start("trainee", "--seed", 1, "--wait", 120)


def command(stage, *arguments, env=None):
    return tenon("command", *arguments, "--session", stage.session, "--domain", stage.domain, env=env)


class Identity(unittest.TestCase):
    def test_two_sessions_run_beside_each_other(self):
        self.sessions_beside_each_other(2)

    def test_eight_sessions_run_beside_each_other_nightly(self):
        self.sessions_beside_each_other(8)

    def sessions_beside_each_other(self, count):
        with Stage() as stage:
            sessions = [peg_session(stage, f"lab{i}") for i in range(count)]
            hashes = set()
            for server, trainee in sessions:
                self.assertEqual(server.wait(600), 0, server.text())
                self.assertEqual(trainee.wait(60), 0, trainee.text())
                hashes |= set(re.findall("final state hash: ([0-9a-f]+)", server.text()))
                joined = [line for line in server.lines if "has joined" in line or "has rejoined" in line]
                self.assertEqual(len(joined), 1, "its own trainee and nobody else's")
                self.assertIn("refused inputs: 0", server.text())
            self.assertEqual(len(hashes), 1, "equal sessions in lockstep do not disturb each other")

    def test_a_second_server_of_a_live_name_is_refused_at_start_also_while_the_first_one_is_stopped(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box")
            for which in (None, signal.SIGSTOP):
                if which:
                    server.signal(which)
                second = stage.start("serve", SOURCE / "scenarios" / "peg_and_box")
                self.assertEqual(second.wait(120), 1, second.text())
                self.assertIn(f"session '{stage.session}' is served already, by process {server.popen.pid} on host {os.uname().nodename}",
                              second.text())
            server.signal(signal.SIGCONT)

    # Another temporary folder has no lock file of the first server, as another machine has none.
    def test_a_server_elsewhere_refuses_a_name_that_is_announced(self):
        with Stage(lockstep=False) as stage, tempfile.TemporaryDirectory() as elsewhere:
            server = stage.serve("peg_and_box")
            second = tenon("serve", SOURCE / "scenarios" / "peg_and_box", *COARSE, "--session", stage.session, "--domain", stage.domain,
                           env={"TMPDIR": elsewhere})
            self.assertEqual(second.returncode, 1, second.stdout)
            self.assertIn(f"is served already, by process {server.popen.pid} on host", second.stderr)

    def test_an_old_server_that_was_stopped_and_continues_ends_itself_nightly(self):
        with Stage(lockstep=False) as stage, tempfile.TemporaryDirectory() as elsewhere:
            old, trainee = peg_session(stage, "test")
            old.wait_for("run: running", 120)
            old.signal(signal.SIGSTOP)
            trainee.wait_for("rejoining the session", 60)
            new = Process("serve", [SOURCE / "scenarios" / "peg_and_box", *COARSE, "--wait-for", "right", "--session", "test", "--domain",
                                    stage.domain], stage.out, {"TMPDIR": elsewhere})
            stage.processes.append(new)
            new.wait_until_open(120)
            new.wait_for(r"\(trainee\) has", 60)
            old.signal(signal.SIGCONT)
            self.assertEqual(old.wait(60), 1, old.text())
            self.assertIn(f"process {new.popen.pid} on host", old.text())
            self.assertIn("this one ends", old.text())
            new.wait_for("everything is mounted", 240)
            self.assertEqual(new.wait(60), 0)
            self.assertEqual(trainee.wait(60), 0, trainee.text())

    def test_a_journal_that_is_being_written_is_not_emptied(self):
        with Stage(lockstep=False) as stage:
            journal = stage.out / "journal.mcap"
            server, _ = peg_session(stage, "test", "--journal", journal)
            server.wait_for("run: running", 120)
            stage.session = "other"
            second = stage.start("serve", SOURCE / "scenarios" / "peg_and_box", "--journal", journal, "--overwrite")
            self.assertEqual(second.wait(120), 1, second.text())
            self.assertIn("another program is writing it", second.text())
            server.wait_for("everything is mounted", 240)
            self.assertEqual(server.wait(60), 0)
            self.assertEqual(tenon("resimulate", journal, SOURCE / "scenarios" / "peg_and_box").returncode, 0)

    def test_instructors_and_admins_need_the_key_and_are_told_so(self):
        with Stage(lockstep=False) as stage, tempfile.TemporaryDirectory() as other_user:
            key = stage.out / "key"
            server, _ = peg_session(stage, "test", "--key", key)
            server.wait_for("run: running", 120)
            self.assertEqual(key.stat().st_mode & 0o777, 0o600)
            env = {"XDG_RUNTIME_DIR": other_user}
            for role in ("instructor", "admin"):
                without = command(stage, "pause", "--role", role, env=env)
                self.assertEqual(without.returncode, 1, without.stdout)
                self.assertIn(f"the {role} needs the key of this session", without.stderr)
                self.assertIn("tenon/key: cannot be read", without.stderr)
            wrong = stage.out / "wrong"
            wrong.write_text("ab" * 32, encoding="utf-8")
            wrong.chmod(0o600)
            refused = command(stage, "pause", "--key", wrong, env=env)
            self.assertEqual(refused.returncode, 1, refused.stdout)
            self.assertIn("the key is not the one of this session", refused.stderr)
            accepted = command(stage, "pause", "--key", key, env=env)
            self.assertEqual(accepted.returncode, 0, accepted.stderr)
            trainee = command(stage, "fulfilled", "--role", "trainee", env=env)
            self.assertEqual(trainee.returncode, 0, trainee.stderr)

    def test_the_programs_of_one_user_find_the_key_by_themselves(self):
        with Stage(lockstep=False) as stage:
            server, _ = peg_session(stage, "test")
            server.wait_for("run: running", 120)
            self.assertEqual(command(stage, "pause").returncode, 0)


class EmergencyStop(unittest.TestCase):
    def test_a_raise_reaches_the_devices_although_the_server_hangs_and_stands_when_it_continues(self):
        with Stage(lockstep=False) as stage:
            server, trainee = peg_session(stage, "test")
            server.wait_for("run: running", 120)
            server.signal(signal.SIGSTOP)
            raised = command(stage, "emergency", "hand", "caught")
            self.assertEqual(raised.returncode, 0, raised.stderr)
            self.assertIn("no server has answered", raised.stdout)
            trainee.wait_for("emergency stop by .*: hand caught", 30)
            server.signal(signal.SIGCONT)
            # the raiser has ended: the station tells the server
            server.wait_for("engaged by .*: hand caught", 60)

    def test_a_raise_reaches_the_devices_although_the_server_was_killed_and_stops_the_next_one(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1, "--wait", 120)
            server.wait_for("run: running", 120)
            server.signal(signal.SIGKILL)
            raised = command(stage, "emergency", "hand", "caught")
            self.assertEqual(raised.returncode, 0, raised.stderr)
            trainee.wait_for("emergency stop by .*: hand caught", 30)
            again = stage.serve("peg_and_box", "--wait-for", "right")
            again.wait_for("engaged by .*: hand caught", 60)

    def test_a_stop_stands_over_a_killed_server_and_its_end_needs_station_instructor_and_resume(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1, "--wait", 120)
            server.wait_for("run: running", 120)
            self.assertEqual(command(stage, "emergency", "a", "test").returncode, 0)
            server.wait_for("engaged by .*: a test", 30)
            trainee.wait_for("emergency stop by .*: a test", 30)
            server.signal(signal.SIGKILL)
            again = stage.serve("peg_and_box", "--wait-for", "right")
            trainee.wait_for("rejoined as client", 120)
            again.wait_for("run: emergency stop", 60)
            self.assertNotIn("cleared", trainee.text())
            refused = command(stage, "clear", "--role", "trainee")
            self.assertIn("ask the instructor", refused.stderr)
            self.assertEqual(command(stage, "clear").returncode, 0)
            trainee.wait_for("emergency stop cleared", 30)
            again.wait_for("run: paused", 30)
            self.assertEqual(command(stage, "resume").returncode, 0)
            again.wait_for("everything is mounted", 240)
            self.assertEqual(again.wait(60), 0)
            once_more = stage.serve("peg_and_box")
            self.assertNotIn("emergency", once_more.text())

    def test_a_stop_stands_over_a_killed_server_although_nobody_repeats_it(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            self.assertEqual(command(stage, "emergency", "a", "test").returncode, 0)
            server.wait_for("engaged by .*: a test", 30)
            kept = Path(os.environ["XDG_STATE_HOME"]) / "tenon" / f"stop-{stage.domain}-{stage.session}"
            end = time.monotonic() + 30
            while not (kept.exists() and "raise" in kept.read_text(encoding="utf-8")):
                self.assertLess(time.monotonic(), end, f"{kept} has no raise")
                time.sleep(0.05)
            server.signal(signal.SIGKILL)
            server.wait(30)
            again = stage.serve("peg_and_box", "--wait-for", "right")
            again.wait_for("an emergency stop raised before this server's start still stands: engaged by .*: a test", 60)

    def test_without_a_home_the_server_says_that_a_stop_will_not_stand_after_a_restart(self):
        with Stage(lockstep=False) as stage:
            server = Process("serve", [SOURCE / "scenarios" / "peg_and_box", "--session", stage.session, "--domain", stage.domain, *COARSE], stage.out,
                             env={"HOME": "", "XDG_STATE_HOME": ""})
            stage.processes.append(server)
            server.wait_for("tenon serve: neither HOME nor XDG_STATE_HOME is set: an emergency stop will not stand after a restart of this server", 600)
            server.wait_until_open(60)
            observer = stage.start("observer", "--json")
            observer.wait_for('will not stand after a restart.*"what":"emergency stop"', 60)

    def test_without_a_session_named_it_stops_all_sessions_and_without_anybody_it_says_so(self):
        with Stage(lockstep=False) as stage:
            nobody = tenon("command", "emergency", "--domain", stage.domain)
            self.assertEqual(nobody.returncode, 1)
            self.assertIn("nobody has heard the emergency stop", nobody.stderr)
            servers = [peg_session(stage, name)[0] for name in ("a", "b")]
            for server in servers:
                server.wait_for("run: running", 120)
            self.assertEqual(tenon("command", "emergency", "--domain", stage.domain).returncode, 0)
            for server in servers:
                server.wait_for("run: emergency stop", 30)

    def test_space_is_emergency_and_no_other_key_ends_a_run_by_itself(self):
        with Stage(lockstep=False) as stage:
            server, trainee = peg_session(stage, "test")
            server.wait_for("run: running", 120)
            keys = subprocess.Popen([PROGRAMS / "tenon-command", "--keys", "--session", stage.session, "--domain", str(stage.domain)],
                                    stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)
            seen = ""
            try:
                keys.stdin.write("".join(chr(code) for code in range(33, 127) if chr(code) not in "q") + "ebn")
                keys.stdin.flush()
                asked = 0
                while asked < 2:  # n, the last key
                    line = keys.stdout.readline()
                    self.assertTrue(line, "the program has ended")
                    asked += line.startswith("skip: press y to do it")
                    seen += line
                self.assertNotIn("run: stopped", server.text())
                self.assertNotIn("engaged by", server.text())
                server.signal(signal.SIGKILL)
                trainee.wait_for("rejoining", 60)
                keys.stdin.write(" ")
                keys.stdin.flush()
                trainee.wait_for("emergency stop by", 30)
            finally:
                said, _ = keys.communicate("q", timeout=60)
            self.assertIn("stop: press y to do it", seen)
            self.assertIn("reset: press y to do it", seen)
            self.assertIn("space still stops every device", said)

    def test_keys_that_wait_are_not_sent_after_the_space_bar(self):
        with Stage(lockstep=False) as stage:
            server, _ = peg_session(stage, "test")
            server.wait_for("run: running", 120)
            self.assertEqual(tenon("command", "emergency", "--domain", stage.domain, "--session", "test").returncode, 0)
            server.wait_for("run: emergency stop", 30)
            keys = subprocess.Popen([PROGRAMS / "tenon-command", "--keys", "--session", "test", "--domain", str(stage.domain)],
                                    stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
            said, _ = keys.communicate("ncr ?q", timeout=60)
            for what in ("skip", "clear", "resume"):
                self.assertRegex(said, f"(?m)^{what}: not (sent|done): the emergency stop came after it$")
            self.assertIn("emergency: accepted", said)
            server.wait_for("engaged by command line", 30)
            self.assertNotIn("cleared by", server.text())

    def test_a_seat_that_was_lost_in_silence_is_taken_again_by_the_keys(self):
        with Stage(lockstep=False) as stage:
            server, _ = peg_session(stage, "test")
            server.wait_for("run: running", 120)
            keys = subprocess.Popen([PROGRAMS / "tenon-command", "--keys", "--session", "test", "--domain", str(stage.domain)],
                                    stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True, bufsize=1)

            def press(key):
                """What is said of it."""
                keys.stdin.write(key)
                keys.stdin.flush()
                line = keys.stdout.readline()
                while line and not re.match(r"pause: |resume: |not sent", line):
                    line = keys.stdout.readline()
                return line

            try:
                self.assertEqual(press("p"), "pause: accepted\n")
                # a machine that sleeps: it has heard nothing of the loss
                keys.send_signal(signal.SIGSTOP)
                try:
                    server.wait_for(r"command line \(instructor\) has left", 30)
                finally:
                    keys.send_signal(signal.SIGCONT)
                end = time.monotonic() + 30
                while (said := press("r")) != "resume: accepted\n":
                    self.assertLess(time.monotonic(), end, said)
                    time.sleep(0.2)
            finally:
                keys.communicate("q", timeout=60)

    def test_with_a_wrong_key_the_space_bar_still_raises_it(self):
        with Stage(lockstep=False) as stage:
            server, trainee = peg_session(stage, "test")
            server.wait_for("run: running", 120)
            wrong = stage.out / "wrong"
            wrong.write_text("ab" * 32, encoding="utf-8")
            wrong.chmod(0o600)
            for i, (key, why) in enumerate(((wrong, "the key is not the one of this session"), (stage.out / "nosuch", "nosuch: cannot be read"))):
                keys = subprocess.Popen([PROGRAMS / "tenon-command", "--keys", "--key", key, "--session", stage.session, "--domain", str(stage.domain),
                                         "--person", f"Eve {i}"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, bufsize=1)
                try:
                    line = seen = keys.stdout.readline()
                    while line and "the emergency stop alone can be raised" not in line:
                        line = keys.stdout.readline()
                        seen += line
                    self.assertIn(why, seen)
                    keys.stdin.write("p ")
                    keys.stdin.flush()
                    server.wait_for(f"engaged by Eve {i}", 30)
                finally:
                    said, _ = keys.communicate("q", timeout=60)
                self.assertIn("pause: not sent: ", said)
                self.assertIn("emergency: accepted", said)
                self.assertEqual(keys.returncode, 1, "it could not join")
            trainee.wait_for("emergency stop by Eve 0", 30)


if __name__ == "__main__":
    unittest.main()
