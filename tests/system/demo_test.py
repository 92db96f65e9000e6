"""`tenon demo`: its lockstep recordings are complete, its reports repeatable, and it leaves no program running."""
import argparse
import contextlib
import io
import json
import os
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path

from stage import COARSE, PROGRAMS, SOURCE, TENON, final_hash, free_domain, tenon

sys.path.insert(0, str(SOURCE / "deploy"))
from demo import Program, has_opened, output_folder  # noqa: E402
from viewer import Viewer  # noqa: E402
from demo_scene import hands_of  # noqa: E402

PEG_AND_BOX = SOURCE / "scenarios" / "peg_and_box"


def samples_by_topic(recording):
    """Number of messages of each topic, from the channels and statistics at the end of an MCAP file."""
    data = Path(recording).read_bytes()
    at = struct.unpack("<Q", data[-28:-20])[0]  # the footer's first field: where the summary starts
    names, counts = {}, {}
    while at < len(data) - 8:
        kind, length = struct.unpack_from("<BQ", data, at)
        body = data[at + 9:at + 9 + length]
        if kind == 4:  # Channel: id, schema, topic
            size = struct.unpack_from("<I", body, 4)[0]
            names[struct.unpack_from("<H", body)[0]] = body[8:8 + size].decode()
        if kind == 11:  # Statistics: after 42 bytes the messages of each channel
            for entry in range(struct.unpack_from("<I", body, 42)[0] // 10):
                channel, count = struct.unpack_from("<HQ", body, 46 + 10 * entry)
                counts[channel] = count
        at += 9 + length
    return {names[channel]: count for channel, count in counts.items()}


def figures(summary):
    """What a report says of the session itself: without date, computation times, and who came first."""
    measured = ("began_ns", "compute_seconds", "messages", "people", "recording", "late_ticks", "slow_writes", "unsent_samples")
    # when a program joined depends on the machine
    events = [event for event in summary["events"] if event["kind"] not in ("join", "leave")]
    return {**{key: value for key, value in summary.items() if key not in measured}, "events": events}


class DemoCase(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="tenon-demo-")
        self.addCleanup(folder.cleanup)
        self.folder, self.domain = Path(folder.name), free_domain()

    def words(self, *more):
        return ["demo", *COARSE, "--headless", "--domain", self.domain, "--out", self.folder / "out", *more]

    def left_running(self):
        """The programs of this demo: process id -> command line."""
        found = {}
        for file in Path("/proc").glob("[0-9]*/cmdline"):
            try:
                words = file.read_bytes().decode(errors="replace").split("\0")
            except OSError:
                continue  # it has ended
            if words[0].startswith(str(PROGRAMS)) and "--domain" in words and words[words.index("--domain") + 1] == str(self.domain):
                found[int(file.parent.name)] = words
        return found

    def process_of(self, program):
        """`program`: or the role of a station."""
        return next(process for process, words in self.left_running().items()
                    if words[0].endswith(f"tenon-{program}") or (words[0].endswith("tenon-join") and program in words))

    def start(self, *more, lockstep=True):
        words = self.words("--scenario", PEG_AND_BOX, "--overwrite", *(["--lockstep"] if lockstep else []), *more)
        demo = subprocess.Popen([TENON, *map(str, words)], stdout=subprocess.PIPE,
                                stderr=subprocess.STDOUT, text=True, env={**os.environ, "TENON_PROGRAMS": str(PROGRAMS)})
        self.addCleanup(demo.stdout.close)
        self.addCleanup(demo.wait)
        self.addCleanup(lambda: demo.poll() is None and demo.kill())
        return demo

    def wait_for_first_step(self, demo):
        said = ""
        for line in demo.stdout:
            said += line
            if "step 1 of 2" in line:
                return said
        self.fail("the demo ended before its first step")

    def assert_nothing_runs(self):
        deadline = time.monotonic() + 30
        while self.left_running() and time.monotonic() < deadline:
            time.sleep(0.1)
        self.assertEqual(self.left_running(), {})

    def assert_recorded_as_published(self, scenario, out, manifolds_a_tick):
        """Every sample that the server published in the ticks of a lockstep session is in its recording."""
        again = tenon("resimulate", out / "session.mcap", scenario, *COARSE)
        # from the first checkpoint on
        compared = re.search(r"ticks (\d+) to (\d+): (\d+) compared, 0 gaps", again.stdout)
        self.assertTrue(compared, again.stdout + again.stderr)
        first, ticks = int(compared[1]), int(compared[2])
        self.assertEqual(int(compared[3]), ticks - first + 1)
        said = (out / "record.log").read_text(encoding="utf-8")
        self.assertIn(", 0 published samples missing\n", said)
        rows = {topic: (int(recorded), int(published))
                for topic, recorded, published in re.findall(r"(?m)^  (\w+): (\d+) of (\d+) samples$", said)}
        self.assertEqual(rows["TickInput"], (ticks, ticks))
        contained = samples_by_topic(out / "session.mcap")
        recorded, published = rows["HandManifold"]
        self.assertEqual(recorded, published)
        self.assertGreaterEqual(published, manifolds_a_tick * (ticks - 1000), "received and counted each")
        # of ten ticks one is kept
        self.assertGreaterEqual(contained["HandManifold"], manifolds_a_tick * (ticks // 10))
        self.assertLess(contained["HandManifold"], published // 5)
        for topic in ("WorldFrame_1k", "DeviceInput"):
            self.assertNotIn(topic, rows)
            self.assertEqual(contained.get(topic, 0), 0, topic)
        for topic in ("WorldFrame_100", "WorldFrame_30", "TickStats_100", "StepProgress", "ObjectSnapshot", "GrabState"):
            self.assertEqual(contained[topic], rows[topic][1], topic)
            self.assertEqual(*rows[topic], topic)
        self.assertGreaterEqual(rows["TickStats_100"][1], ticks // 10)


class You(DemoCase):
    """A person at the console in the place of a simulated one."""

    def await_line(self, demo, pattern):
        said = ""
        for line in demo.stdout:
            said += line
            if found := re.search(pattern, line):
                return found
        self.fail(f"the demo never said {pattern}:\n{said}")

    def page(self, port, secret=None, **values):
        page = Viewer(int(port), origin=f"http://localhost:{port}")
        self.addCleanup(page.close)
        page.begin("/console")
        taken = page.ask("handTake", name="Ada", key=secret or "", **values)
        self.assertTrue(taken["accepted"], taken)
        return page

    def process_when_it_runs(self, program):
        deadline = time.monotonic() + 120
        while time.monotonic() < deadline:
            try:
                return self.process_of(program)
            except StopIteration:
                time.sleep(0.2)
        self.fail(f"{program} never ran")

    def test_the_trainee_is_you_and_no_step_runs_out_of_time(self):
        demo = self.start("--you", "trainee", lockstep=False)
        port = self.await_line(demo, r"^your place as trainee: http://localhost:(\d+)/\?you=trainee$")[1]
        self.process_when_it_runs("observer")
        self.page(port, role="trainee", hands=["right"])
        self.await_line(demo, "step 1 of 2")
        self.assertEqual([words for words in self.left_running().values() if words[0].endswith("tenon-join") and "trainee" in words], [])
        served = (self.folder / "out" / "scenario_without_timeouts" / "peg_and_box" / "scenario.yaml").read_text(encoding="utf-8")
        self.assertNotIn("timeout:", served)
        self.assertIn("name: insert_peg", served)

    def test_the_instructor_is_you(self):
        demo = self.start("--you", "instructor", lockstep=False)
        found = self.await_line(demo, r"^your place as instructor: http://localhost:(\d+)/\?you=instructor#pass=(\w+)$")
        self.process_when_it_runs("trainee")
        self.page(found[1], found[2], role="instructor", hands=["instructor"])
        self.await_line(demo, "step 1 of 2")

    def test_a_simulated_person_makes_room(self):
        demo = self.start(lockstep=False)
        port = self.await_line(demo, r"^console: http://localhost:(\d+)/$")[1]
        self.await_line(demo, "step 1 of 2")
        self.page(port, role="trainee", hands=["right"])
        self.await_line(demo, "the simulated trainee makes room for you")

    def test_wrong_usage_is_said(self):
        for more in ("--no-console", "--lockstep"):
            done = tenon(*self.words("--you", "trainee", more))
            self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
            self.assertIn("--you needs the console", done.stderr)


class Lockstep(DemoCase):
    def run_demo(self, name, recorder_stalls):
        demo = self.start("--no-instructor", "--out", self.folder / name)
        self.wait_for_first_step(demo)
        if recorder_stalls:  # for long enough that the system drops what it is sent, and no longer than the server waits for it
            os.kill(self.process_of("record"), signal.SIGSTOP)
            time.sleep(2)
            os.kill(self.process_of("record"), signal.SIGCONT)
        said, _ = demo.communicate(timeout=900)
        self.assertEqual(demo.returncode, 0, said[-3000:])
        self.assert_recorded_as_published(PEG_AND_BOX, self.folder / name, manifolds_a_tick=1)
        return final_hash(said), json.loads((self.folder / name / "summary.json").read_text(encoding="utf-8"))

    def test_recordings_are_complete_and_reports_have_equal_figures_even_when_the_recorder_stalls(self):
        first_hash, first = self.run_demo("first", recorder_stalls=False)
        second_hash, second = self.run_demo("second", recorder_stalls=True)
        self.assertEqual(first_hash, second_hash)
        self.assertGreater(first["steps"][1]["contact_seconds"], 0.5)
        self.assertEqual(figures(first), figures(second))


class LockstepNightly(DemoCase):
    def test_the_recording_of_the_engine_bay_is_complete(self):
        engine_bay = SOURCE / "scenarios" / "engine_bay"
        done = tenon(*self.words("--scenario", engine_bay, "--lockstep"), timeout=1700)
        self.assertEqual(done.returncode, 0, done.stdout[-3000:] + done.stderr)
        self.assert_recorded_as_published(engine_bay, self.folder / "out", manifolds_a_tick=5)


class Endings(DemoCase):
    def test_whatever_signal_ends_it_nothing_is_left_running(self):
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP, signal.SIGKILL):
            with self.subTest(signal=number.name):
                demo = self.start()
                self.assertRegex(self.wait_for_first_step(demo), r"\Aconsole: http://localhost:\d+/\n", "where to look is said first")
                self.assertEqual(len(self.left_running()), 6)
                demo.send_signal(number)
                demo.communicate(timeout=120)
                self.assertEqual(demo.returncode, -number if number == signal.SIGKILL else 128 + number)
                self.assert_nothing_runs()

    def test_a_program_that_cannot_start_ends_it_with_its_reason(self):
        done = tenon(*self.words("--scenario", PEG_AND_BOX, "--lockstep", "--device", "nosuch"), timeout=300)
        self.assertEqual(done.returncode, 1, done.stdout)
        said = (self.folder / "out" / "instructor.log").read_text(encoding="utf-8").splitlines()
        reason = next(line for line in said if "nosuch" in line)
        self.assertIn(f"instructor has ended, so the session is stopped: {reason}", done.stdout)
        self.assert_nothing_runs()

    def test_a_trainee_that_ends_in_the_session_ends_it(self):
        demo = self.start()
        self.wait_for_first_step(demo)
        os.kill(self.process_of("trainee"), signal.SIGKILL)
        said, _ = demo.communicate(timeout=120)
        self.assertEqual(demo.returncode, 1, said)
        self.assertIn("trainee has ended, so the session is stopped", said)
        self.assert_nothing_runs()


class Opening(unittest.TestCase):
    def test_a_warning_of_the_bake_is_not_taken_for_the_session_and_is_shown(self):
        warning = "Engine bay: 26 % of the surface is of walls thinner than a voxel (2 mm), up to 1.3 mm thicker on each side; 0 % is open"
        with tempfile.TemporaryDirectory() as folder:
            server = object.__new__(Program)
            server.log, server.read_until = Path(folder) / "serve.log", 0
            server.log.write_text(f"{warning}\n", encoding="utf-8")
            said = io.StringIO()
            with contextlib.redirect_stdout(said):
                self.assertFalse(has_opened(server))
            self.assertEqual(said.getvalue(), f"{warning}\n")
            for line in ("session 'demo' is open, waiting for people", "session 'demo' is open again after tick 12000", "session 'demo' is open again, waiting for people"):
                with server.log.open("a", encoding="utf-8") as log:
                    log.write(f"{line}\n")
                self.assertTrue(has_opened(server), line)


class Folder(unittest.TestCase):
    def test_a_second_demo_goes_into_a_folder_of_its_own(self):
        with tempfile.TemporaryDirectory(prefix="tenon-demo-") as folder, contextlib.chdir(folder):
            for expected in ("out/demo", "out/demo-2", "out/demo-3"):
                args = argparse.Namespace(out=None, overwrite=False)
                self.assertEqual(output_folder(args), Path(expected))
                Path(expected).mkdir(parents=True)
                (Path(expected) / "report.html").touch()
            self.assertEqual(output_folder(argparse.Namespace(out=None, overwrite=True)), Path("out/demo"))
            self.assertEqual(output_folder(argparse.Namespace(out=Path("mine"), overwrite=False)), Path("mine"))


class RealTime(DemoCase):
    def test_its_end_is_what_the_server_says_and_a_normal_end_is_no_failure(self):
        scenario = self.folder / "hasty" / "scenario.yaml"
        scenario.parent.mkdir()
        text = (PEG_AND_BOX / "scenario.yaml").read_text(encoding="utf-8")
        scenario.write_text(text.replace("timeout: 60 s", "timeout: 4 s"), encoding="utf-8")
        demo = self.start("--scenario", scenario.parent, lockstep=False)
        said = self.wait_for_first_step(demo)
        trainee = self.process_of("trainee")
        with contextlib.suppress(ProcessLookupError):  # it ends with the session, after four seconds
            for _ in range(10):  # a station that stalls, as on a busy machine
                os.kill(trainee, signal.SIGSTOP)
                time.sleep(0.15)
                os.kill(trainee, signal.SIGCONT)
                time.sleep(0.05)
        said += demo.communicate(timeout=120)[0]
        self.assertEqual(demo.returncode, 1, said)
        server = (self.folder / "out" / "serve.log").read_text(encoding="utf-8")
        ended = re.search(r"(?m)^step '[a-z_]+' was not done in time: .* after .*$", server)
        self.assertTrue(ended, server)
        self.assertIn(ended[0], said.splitlines())
        self.assertIn(": failed after ", said)
        self.assertNotRegex(said, "(record|trainee|instructor|observer) failed")
        told = [float(second) for second in re.findall(r"(?m)^ *([0-9.]+) s  ! hands? .* held still: ", said)]
        self.assertTrue(told, said)
        for earlier, later in zip(told, told[1:]):
            self.assertGreaterEqual(later - earlier, 0.99, said)


class Instructor(DemoCase):
    def test_a_scenario_without_a_hand_for_one_starts_none_nightly(self):
        scenario = self.folder / "alone" / "scenario.yaml"
        scenario.parent.mkdir()
        text = (PEG_AND_BOX / "scenario.yaml").read_text(encoding="utf-8")
        scenario.write_text("".join(line for line in text.splitlines(True) if "role: instructor" not in line), encoding="utf-8")
        self.assertEqual(hands_of(PEG_AND_BOX), {"right": "trainee", "instructor": "instructor"})
        self.assertEqual(hands_of(scenario.parent), {"right": "trainee"})
        done = tenon(*self.words("--scenario", scenario.parent, "--lockstep"), timeout=900)
        self.assertEqual(done.returncode, 0, done.stdout[-3000:] + done.stderr)
        self.assertFalse((self.folder / "out" / "instructor.log").exists())
        self.assertRegex(done.stdout, r"everything is mounted after [0-9.]+ s; late ticks: 0")
        again = tenon(*self.words("--scenario", scenario.parent, "--lockstep", "--overwrite"), timeout=900)
        self.assertEqual(again.returncode, 0, again.stdout[-3000:] + again.stderr)
        self.assertNotIn("preparing the scene", again.stdout, "everything is baked")


if __name__ == "__main__":
    unittest.main()
