"""Two network namespaces with a link of known delay, jitter and loss between them, made by link_relay (CMake's target of that name)."""
import os
import re
import signal
import subprocess
import threading
import unittest

from stage import PROGRAMS

RELAY = PROGRAMS / "link_relay"
A, B = "10.99.0.1", "10.99.0.2"


class Link:
    """A context manager; skips the test where namespaces or network devices are not permitted."""

    def __init__(self, **model):
        self.model = [f"{key}={value}" for key, value in model.items()]
        self.names = [f"tenon-{os.getpid()}-{threading.get_native_id()}-{side}" for side in "ab"]
        self.relay = None

    def __enter__(self):
        made = []
        try:
            for name in self.names:
                done = subprocess.run(["ip", "netns", "add", name], capture_output=True, text=True)
                if done.returncode != 0:
                    raise unittest.SkipTest(f"network namespaces are not permitted here: {done.stderr.strip()}")
                made.append(name)
            self.relay = subprocess.Popen([RELAY, self.names[0], A, self.names[1], B, *self.model], stdin=subprocess.PIPE,
                                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
            line = self.relay.stdout.readline()
            if line != "ready\n":
                self.relay.wait()
                raise unittest.SkipTest(f"network devices are not permitted here: {line.strip()}")
        except FileNotFoundError as missing:
            self.remove(made)
            raise AssertionError(f"{missing.filename} is missing: build the target link_relay, and install iproute2") from None
        except unittest.SkipTest:
            self.remove(made)
            raise
        return self

    def __exit__(self, *_):
        self.counts()
        self.remove(self.names)

    def remove(self, names):
        for name in names:
            subprocess.run(["ip", "netns", "del", name], capture_output=True)

    def inside(self, side):
        """What starts a command in namespace 0 or 1."""
        return ["ip", "netns", "exec", self.names[side]]

    def partition(self, seconds):
        """From now on for some seconds nothing passes."""
        self.relay.stdin.write(f"partition {seconds}\n")
        self.relay.stdin.flush()
        assert self.relay.stdout.readline().startswith("partition"), "the relay did not answer"

    def counts(self):
        """Ends the link; (frames, lost) of both directions."""
        if self.relay.poll() is None:
            text, _ = self.relay.communicate()
            self.found = [tuple(map(int, pair)) for pair in re.findall(r"(\d+) frames, (\d+) lost", text)]
        return self.found


class Running:
    """A command in a namespace whose output is kept; interrupted at the end of the block."""

    def __init__(self, arguments, env=None):
        self.popen = subprocess.Popen(list(map(str, arguments)), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                      env={**os.environ, **(env or {})})
        self.first = self.popen.stdout.readline()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if self.popen.poll() is None:
            self.popen.send_signal(signal.SIGINT)
        self.text = self.first + self.popen.communicate(timeout=60)[0]
