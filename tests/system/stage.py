"""Shared by the system tests: runs Tenon's programs as processes over DDS and ends them with the test.

Scripts may run at the same time: each session has a DDS domain and a folder of its own. Baked parts are shared in a cache that is
apart from the user's.
"""
import fcntl
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(SOURCE / "deploy"))
import opened  # noqa: E402

PROGRAMS = Path(os.environ.get("TENON_PROGRAMS", SOURCE / "build" / "release" / "bin"))
TENON = SOURCE / "tenon"
# ctest names a cache of its build folder; a script that is started by hand uses one of its user
os.environ.setdefault("TENON_CACHE", str(Path(tempfile.gettempdir()) / f"tenon-test-cache-{os.getuid()}"))

# the key of the sessions and what a server keeps of an emergency stop, apart from the user's
state_folder = tempfile.TemporaryDirectory(prefix="tenon-state-")
os.environ["XDG_STATE_HOME"] = os.environ["XDG_RUNTIME_DIR"] = state_folder.name

# the shipped scenarios' parts, coarser than by default: they are baked in less time
COARSE = ["--detail", "0.12"]

claimed_domains = []  # locked files, until this process ends


def free_domain():
    """A DDS domain that no other test of this machine uses while this process runs. The C++ tests claim theirs likewise."""
    for domain in range(1, 100):
        file = os.open(Path(tempfile.gettempdir()) / f"tenon-test-domain-{domain}", os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(file)
            continue
        claimed_domains.append(file)
        return domain
    raise AssertionError("all DDS domains of the tests are in use")


def tenon(*arguments, timeout=600, env=None, input=None, cwd=None):
    """Runs `tenon` with the programs of this build and waits for its end."""
    return subprocess.run([TENON, *map(str, arguments)], capture_output=True, text=True, timeout=timeout, input=input, cwd=cwd,
                          env={**os.environ, "TENON_PROGRAMS": str(PROGRAMS), **(env or {})})


def final_hash(text):
    """The hash that ends a session's output; fails when there is none, so that two missing ones never count as equal."""
    found = re.findall(r"(?m)^final state hash: ([0-9a-f]{16})$", text)
    if not found:
        raise AssertionError(f"no final state hash in:\n{text[-2000:]}")
    return found[-1]


class Process:
    """A running program, or the station of a role, and its output."""

    def __init__(self, name, arguments, log, env=None, inside=()):
        """`inside`: what starts it elsewhere, as `ip netns exec NAME`."""
        self.name, self.log, self.lines = name, log, []
        program = ["join", "--role", name] if name in ("trainee", "instructor") else [name]
        self.popen = subprocess.Popen([*inside, PROGRAMS / f"tenon-{program[0]}", *program[1:], *map(str, arguments)], stdout=subprocess.PIPE,
                                      stdin=subprocess.DEVNULL, stderr=subprocess.STDOUT, text=True,
                                      env={**os.environ, **(env or {})})
        self.changed = threading.Condition()
        self.listener = threading.Thread(target=self.listen, daemon=True)
        self.listener.start()

    def listen(self):
        for line in self.popen.stdout:
            with self.changed:
                self.lines.append(line.rstrip("\n"))
                self.changed.notify_all()
        with self.changed:
            self.changed.notify_all()

    def text(self):
        with self.changed:
            return "\n".join(self.lines)

    def wait_for(self, pattern, seconds=120):
        """The first line that matches the pattern; fails with the newest output when none does in time."""
        deadline = time.monotonic() + seconds
        seen = 0
        with self.changed:
            while True:
                for line in self.lines[seen:]:
                    if re.search(pattern, line):
                        return line
                seen = len(self.lines)
                remaining = deadline - time.monotonic()
                ended = self.popen.poll() is not None
                if remaining <= 0 or (ended and not self.changed.wait(1) and seen == len(self.lines)):
                    output = "\n".join(self.lines[-40:])
                    raise AssertionError(f"{self.name} never printed {pattern!r}; its output:\n{output}")
                self.changed.wait(min(remaining, 1))

    def wait_until_open(self, seconds):
        """Of a server: until its session can be joined."""
        return self.wait_for(opened.LINE, seconds)

    def wait(self, seconds=300):
        """The exit code; all output is in text() then, but what a program that it left behind may print."""
        try:
            code = self.popen.wait(seconds)
            self.listener.join(5)
            return code
        except subprocess.TimeoutExpired:
            raise AssertionError(f"{self.name} did not end in {seconds} s; its output:\n{self.text()[-4000:]}") from None

    def signal(self, which):
        self.popen.send_signal(which)

    def processor_seconds(self):
        fields = Path(f"/proc/{self.popen.pid}/stat").read_text(encoding="utf-8").rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


class Stage:
    """The processes of one session, as a context manager that kills those left at its end."""

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

    def start(self, name, *arguments):
        common = ["--session", self.session, "--domain", self.domain] + (["--lockstep"] if self.lockstep else [])
        process = Process(name, [*arguments, *common, *(COARSE if name == "serve" else [])], self.out)
        self.processes.append(process)
        return process

    def serve(self, scenario, *arguments):
        server = self.start("serve", SOURCE / "scenarios" / scenario, *arguments)
        server.wait_until_open(600)
        return server
