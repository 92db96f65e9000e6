"""Sessions between two machines, which are network namespaces here: lan and wan, keys, and what goes wrong."""
import os
import re
import subprocess
import tempfile
import time
import unittest
from pathlib import Path

from link import A, Link
from stage import COARSE, PROGRAMS, SOURCE, Process, Stage, tenon

PEG = SOURCE / "scenarios" / "peg_and_box"


class Machines(Stage):
    """A session whose server is on side 0 of a link. Each side has a runtime folder, and so a key, of its own."""

    def __init__(self, link, **options):
        super().__init__(lockstep=False, **options)
        self.link = link

    def start(self, side, name, *arguments):
        runtime = self.out / f"side{side}"
        runtime.mkdir(mode=0o700, exist_ok=True)
        common = ["--session", self.session, "--domain", self.domain]
        process = Process(name, [*arguments, *common, *(COARSE if name == "serve" else [])], self.out,
                          {"XDG_RUNTIME_DIR": str(runtime)}, inside=self.link.inside(side))
        self.processes.append(process)
        return process

    @property
    def key(self):
        return self.out / "side0" / "tenon" / "key"


def mount(test, machines, server_options, station_options):
    server = machines.start(0, "serve", PEG, "--wait-for", "right", *server_options)
    server.wait_until_open(600)
    trainee = machines.start(1, "trainee", "--seed", 1, "--key", machines.key, *station_options)
    test.assertEqual(server.wait(400), 0, server.text()[-3000:] + trainee.text()[-2000:])
    test.assertEqual(trainee.wait(60), 0, trainee.text()[-3000:])
    test.assertRegex(server.text(), "mounted")
    return server


class Networks(unittest.TestCase):
    def test_a_part_is_mounted_over_a_local_network(self):
        with Link(delay=0.0002) as link, Machines(link) as machines:
            server = mount(self, machines, ["--network", "lan"], ["--network", "lan"])
            self.assertIn("heard on link0 by every program in 10.99.0.1/24", server.text())
            self.assertIn("all who join need its key", server.text())

    def test_beyond_loopback_everybody_needs_the_key_unless_the_session_is_open(self):
        with Link() as link, Machines(link) as machines:
            server = machines.start(0, "serve", PEG, "--network", "lan")
            server.wait_until_open(600)
            stranger = machines.start(1, "observer", "--network", "link0")
            self.assertEqual(stranger.wait(60), 1)
            self.assertIn("needs the key of this session", stranger.text())
            machines.start(1, "observer", "--network", "link0", "--key", machines.key)
            server.wait_for(r"observer \(observer\) has joined", 60)
        with Link() as link, Machines(link) as machines:
            server = machines.start(0, "serve", PEG, "--network", "lan", "--open")
            server.wait_until_open(600)
            self.assertIn("whoever hears it may join", server.text())
            machines.start(1, "observer", "--network", "lan")
            server.wait_for(r"observer \(observer\) has joined", 60)


class NetworksNightly(unittest.TestCase):
    def test_a_part_is_mounted_over_a_campus_by_unicast(self):
        with Link(delay=0.005, loss=0.001, seed=3) as link, Machines(link) as machines:
            mount(self, machines, ["--network", "wan"], ["--network", f"wan,{A}"])

    def test_a_part_is_mounted_over_a_wan_with_bursts_of_loss(self):
        with Link(delay=0.05, jitter=0.005, loss=0.02, burst=3, seed=1) as link, Machines(link) as machines:
            mount(self, machines, ["--network", "wan"], ["--network", f"wan,{A}"])


class LimitsOfALink(unittest.TestCase):
    def test_they_follow_from_what_the_link_does_are_shown_and_resimulate(self):
        # inputs come up to 60 ms apart, which alone would hold the hand still again and again
        with Link(delay=0.005, jitter=0.03, loss=0.02, burst=3, seed=2) as link, Machines(link) as machines:
            journal = machines.out / "journal.mcap"
            server = machines.start(0, "serve", PEG, "--network", "wan", "--wait-for", "right", "--journal", journal)
            server.wait_until_open(600)
            machines.start(1, "trainee", "--seed", 1, "--key", machines.key, "--network", f"wan,{A}")
            granted = r"right +trainee +\S+ +without input still after ([6-9]|1\d)\d ms, parked after 1\d\d\d ms"
            until = time.monotonic() + 120
            while True:
                lists = machines.start(0, "command", "list", "--network", "wan")
                self.assertEqual(lists.wait(60), 0, lists.text())
                if re.search(granted, lists.text()) or time.monotonic() > until:
                    break
            self.assertRegex(lists.text(), granted)
            self.assertRegex(lists.text(), r"instructor +instructor +\S+ +without input still after 50 ms, parked after 1000 ms")
            stop = machines.start(0, "command", "stop", "--network", "wan")
            self.assertEqual(stop.wait(60), 0, stop.text())
            server.wait(120)
            again = tenon("resimulate", journal, PEG, *COARSE)
            self.assertEqual(again.returncode, 0, again.stdout + again.stderr)


class WrongNetworks(unittest.TestCase):
    def test_what_cannot_be_is_said_with_what_to_do(self):
        for text, answer in (("lna", "'lna' is neither loopback, lan nor wan, nor an interface"), ("loopback,10.0.0.1", "loopback has no peers"),
                             ("wan,no-such-host.invalid", "the peer 'no-such-host.invalid' has no IPv4 address")):
            for program in ("serve", "observer", "record", "command", "console", "join"):
                with self.subTest(text=text, program=program):
                    done = self.run_program(program, "--network", text)
                    self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
                    self.assertIn(answer, done.stderr + done.stdout)
        with tempfile.TemporaryDirectory() as folder:
            done = self.run_program("serve", PEG, *COARSE, "--journal", Path(folder) / "j", env={"TENON_NETWORK": "lna"})
            self.assertEqual(done.returncode, 1)
            self.assertIn("TENON_NETWORK: network 'lna'", done.stderr)

    def run_program(self, program, *arguments, env=None):
        extra = ["-o", "none.mcap"] if program == "record" else ["--role", "trainee"] if program == "join" else []
        return subprocess.run([PROGRAMS / f"tenon-{program}", *map(str, (*extra, *arguments))], capture_output=True, text=True, timeout=120,
                              env={**os.environ, **(env or {})})


if __name__ == "__main__":
    unittest.main()
