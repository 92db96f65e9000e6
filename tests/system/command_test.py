"""Commands to a running session are accepted and carried out, or refused with the reason."""
import os
import signal
import subprocess
import unittest

from stage import COARSE, PROGRAMS, SOURCE, Stage, tenon


class Commands(unittest.TestCase):
    def command(self, stage, *arguments):
        return tenon("command", *arguments, "--session", stage.session, "--domain", stage.domain)

    def assert_accepted(self, stage, *arguments):
        done = self.command(stage, *arguments)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("accepted", done.stdout)

    def assert_refused(self, stage, reason, *arguments):
        done = self.command(stage, *arguments)
        self.assertEqual(done.returncode, 1, done.stdout + done.stderr)
        self.assertIn("refused", done.stderr)
        self.assertIn(reason, done.stderr)

    def test_a_trainer_pauses_resumes_skips_and_ends_a_session(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            self.assert_refused(stage, "waits for people", "pause")
            self.assert_refused(stage, "waits for people", "release", "right")
            stage.start("trainee", "--seed", 1)
            server.wait_for("run: running", 60)
            self.assert_accepted(stage, "pause")
            server.wait_for("run: paused", 30)
            self.assert_refused(stage, "paused already", "pause")
            self.assert_refused(stage, "ask the instructor", "resume", "--role", "trainee")
            self.assert_refused(stage, "no signal 'trumpet'; it has none", "signal", "trumpet")
            self.assert_refused(stage, "'foot' is no hand of a trainee that displays forces in this scenario; it has: right", "guide", "show", "foot")
            self.assert_refused(stage, "`tenon command list` prints all names", "release", "foot")
            self.assert_refused(stage, "nobody is named 'Eve' in this session; it has: trainee", "kick", "Eve")
            self.assert_accepted(stage, "fulfilled", "--role", "trainee")
            self.assert_accepted(stage, "skip")
            server.wait_for("step skipped", 30)  # at once
            self.assertNotIn("command line: resume", server.text())
            self.assert_accepted(stage, "resume", "--role", "admin")
            self.assert_accepted(stage, "stop")
            server.wait_for("run: stopped", 30)
            self.assertEqual(server.wait(30), 1)

    def test_a_trainer_lists_goes_to_a_step_repeats_it_and_leaves_a_note(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            stage.start("trainee", "--seed", 1)
            server.wait_for("step: take_peg", 60)
            listed = self.command(stage, "list")
            self.assertEqual(listed.returncode, 0, listed.stderr)
            for line in (r"trainee +trainee +right", r"right +trainee", r"1 take_peg +now", r"peg +part", r"late ticks: \d+; writes to the bus"):
                self.assertRegex(listed.stdout, line)
            self.assert_refused(stage, "no step '9'", "goto", "9")
            self.assert_accepted(stage, "note", "grip", "too", "high")
            server.wait_for("command line: grip too high", 30)
            self.assert_accepted(stage, "goto", "2")
            server.wait_for("step: insert_peg", 30)
            self.assert_accepted(stage, "back")
            server.wait_for("command line: back", 30)
            self.assert_accepted(stage, "repeat")
            server.wait_for("everything is mounted", 240)
            self.assertEqual(server.wait(30), 0)

    def test_a_session_with_a_skipped_step_ends_with_1_unless_that_is_allowed(self):
        for words, code in (([], 1), (["--allow-skips"], 0)):
            with self.subTest(words=words), Stage(lockstep=False) as stage:
                server = stage.serve("peg_and_box", "--wait-for", "right", *words)
                stage.start("trainee", "--seed", 1)
                server.wait_for("run: running", 60)
                self.assert_accepted(stage, "skip")
                server.wait_for("step skipped: take_peg", 30)
                server.wait_for("ended, 1 step skipped", 240)
                self.assertEqual(server.wait(30), code)

    def test_an_emergency_stop_halts_all_until_the_instructor_clears_it(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            trainee = stage.start("trainee", "--seed", 1)
            server.wait_for("run: running", 60)
            self.assert_accepted(stage, "emergency", "a", "test", "--role", "trainee")
            trainee.wait_for("emergency stop by .*a test", 30)
            server.wait_for("run: emergency stop", 30)
            self.assert_refused(stage, "ask the instructor", "clear", "--role", "trainee")
            for words in (["skip"], ["goto", "2"], ["reset"], ["repeat"], ["give", "peg", "right"], ["resume"]):
                self.assert_refused(stage, "the emergency stop stands: clear it first", *words)
            self.assert_accepted(stage, "clear")
            trainee.wait_for("emergency stop cleared", 30)
            server.wait_for("run: paused", 30)
            self.assert_accepted(stage, "resume")
            server.wait_for("everything is mounted", 240)

    def test_keys_do_the_same_in_lockstep(self):
        with Stage() as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            stage.start("trainee", "--seed", 1)
            server.wait_for("run: running", 60)
            keys = subprocess.run([PROGRAMS / "tenon-command", "--keys", "--session", stage.session, "--domain",
                                   str(stage.domain)], input="?pprxey", capture_output=True, text=True, timeout=120)
            self.assertEqual(keys.returncode, 0, keys.stderr)
            self.assertIn("emergency stop", keys.stdout, "the legend lists every key")
            for line in ("pause: accepted", "pause: refused: the session is paused already", "resume: accepted",
                         "stop: accepted"):
                self.assertIn(line, keys.stdout)
            server.wait_for("run: stopped", 30)

    def test_a_wrong_command_line_is_refused_with_the_usage(self):
        for arguments, reason in ((["fly"], "unknown command 'fly'"), (["signal"], "usage: signal NAME"), ([], "no command given"),
                                  (["pause", "--loudly"], "--loudly")):
            with self.subTest(arguments=arguments):
                done = tenon("command", *arguments)
                self.assertEqual(done.returncode, 2)
                self.assertIn(reason, done.stderr)


class OutputThatNobodyReads(unittest.TestCase):
    """A terminal after Ctrl-S, a pager, a hung connection."""

    def fill(self, pipe):
        os.set_blocking(pipe, False)
        try:
            while True:
                os.write(pipe, b"." * 4096)
        except BlockingIOError:
            pass
        os.set_blocking(pipe, True)

    def test_a_server_goes_on_hearing(self):
        with Stage(lockstep=False) as stage:
            reader, writer = os.pipe()
            common = ["--session", stage.session, "--domain", str(stage.domain)]
            server = subprocess.Popen([PROGRAMS / "tenon-serve", SOURCE / "scenarios" / "peg_and_box", *common, *map(str, COARSE)],
                                      stdout=writer, stderr=subprocess.STDOUT)
            try:
                text = b""
                while b"is open" not in text:
                    text += os.read(reader, 4096)
                self.fill(writer)
                for word in ("one", "two"):
                    done = tenon("command", "note", word, *common)
                    self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
                server.send_signal(signal.SIGINT)
                server.wait(60)
            finally:
                server.kill()
                os.close(reader)
                os.close(writer)

if __name__ == "__main__":
    unittest.main()
