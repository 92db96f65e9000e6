"""What the system tests share: Tenon's programs as processes on loopback DDS, none of which stays behind."""
import os
import re
import signal
import subprocess
import tempfile
import threading
import time
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
PROGRAMS = Path(os.environ.get("TENON_PROGRAMS", SOURCE / "build" / "release" / "bin"))
FRONT_DOOR = SOURCE / "tenon"


def free_domain():
    """A DDS domain that other tests on this machine are not likely to use."""
    return 1 + os.getpid() % 90


def tenon(*words, timeout=600, env=None, input=None):
    """Runs the front door to its end, on the programs of this build."""
    return subprocess.run([FRONT_DOOR, *map(str, words)], capture_output=True, text=True, timeout=timeout, input=input,
                          env={**os.environ, "TENON_PROGRAMS": str(PROGRAMS), **(env or {})})


def final_hash(text):
    found = re.findall(r"final state hash: ([0-9a-f]{16})", text)
    return found[-1] if found else None


class Process:
    """A running program with its output so far."""

    def __init__(self, name, words, log):
        self.name, self.log, self.lines = name, log, []
        self.popen = subprocess.Popen([PROGRAMS / f"tenon-{name}", *map(str, words)], stdout=subprocess.PIPE,
                                      stderr=subprocess.STDOUT, text=True)
        self.news = threading.Condition()
        threading.Thread(target=self.listen, daemon=True).start()

    def listen(self):
        for line in self.popen.stdout:
            with self.news:
                self.lines.append(line.rstrip("\n"))
                self.news.notify_all()
        with self.news:
            self.news.notify_all()

    def text(self):
        with self.news:
            return "\n".join(self.lines)

    def wait_for(self, pattern, seconds=120):
        """The first line that holds the pattern; fails with all the program said when none comes in time."""
        deadline = time.monotonic() + seconds
        seen = 0
        with self.news:
            while True:
                for line in self.lines[seen:]:
                    if re.search(pattern, line):
                        return line
                seen = len(self.lines)
                left = deadline - time.monotonic()
                ended = self.popen.poll() is not None
                if left <= 0 or (ended and not self.news.wait(1) and seen == len(self.lines)):
                    said = "\n".join(self.lines[-40:])
                    raise AssertionError(f"{self.name} never said {pattern!r}; it said:\n{said}")
                self.news.wait(min(left, 1))

    def wait(self, seconds=300):
        try:
            return self.popen.wait(seconds)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self.name} did not end in {seconds} s; it said:\n{self.text()[-4000:]}") from None

    def signal(self, which):
        self.popen.send_signal(which)


class Stage:
    """A session's processes; use it with `with`."""

    def __init__(self, **options):
        self.folder = tempfile.TemporaryDirectory(prefix="tenon-")
        self.out = Path(self.folder.name)
        self.domain = free_domain()
        self.session = options.get("session", "test")
        self.lockstep = options.get("lockstep", True)
        self.processes = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        for process in self.processes:
            if process.popen.poll() is None:
                process.signal(signal.SIGKILL)
            process.popen.wait()
        self.folder.cleanup()

    def start(self, name, *words):
        common = ["--session", self.session, "--domain", self.domain] + (["--lockstep"] if self.lockstep else [])
        process = Process(name, [*words, *common], self.out)
        self.processes.append(process)
        return process

    def serve(self, scenario, *words):
        server = self.start("serve", SOURCE / "scenarios" / scenario, *words)
        server.wait_for("is open", 600)
        return server
