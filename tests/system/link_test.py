"""The link between two machines: the relay that stands for it in the tests, and what `tenon doctor --peer` finds on it."""
import re
import subprocess
import unittest

from link import A, B, Link, Running
from stage import PROGRAMS, TENON

# sends numbered datagrams at 500 Hz; receives them and prints their numbers
SENDER = f"""
import socket, time
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
for number in range(COUNT):
    s.sendto(str(number).encode(), ("{B}", 7410)); time.sleep(2e-3)
"""
RECEIVER = """
import socket
s = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
s.bind(("", 7410)); print("ready", flush=True)
s.settimeout(30)
try:
    while True:
        print(s.recv(100).decode(), flush=True); s.settimeout(2)
except socket.timeout:
    pass
"""


def sent_through(link, count):
    """The numbers that arrived of `count` datagrams from side 0 to side 1."""
    with Running([*link.inside(1), "python3", "-c", RECEIVER]) as receiver:
        subprocess.run([*link.inside(0), "python3", "-c", SENDER.replace("COUNT", str(count))], check=True, timeout=120)
        numbers = receiver.popen.communicate(timeout=60)[0]
    return [int(line) for line in numbers.split()]


class Relay(unittest.TestCase):
    def test_loss_follows_from_the_seed(self):
        runs = []
        for seed in (1, 1, 2):
            with Link(loss=0.1, burst=3, seed=seed) as link:
                # neighbours that are known cost no frames of their own
                link_addresses(link)
                runs.append(sent_through(link, 600))
        for numbers in runs:
            self.assertEqual(numbers, sorted(numbers))
            lost = 1 - len(numbers) / 600
            self.assertGreater(lost, 0.05)
            self.assertLess(lost, 0.16)
        missing = [sorted(set(range(600)) - set(numbers)) for numbers in runs]
        self.assertIn(missing[0][2] - missing[0][0], (2, 3, 4), "in bursts")
        self.assertNotEqual(missing[0], missing[2])

    def test_a_partition_loses_everything_and_ends_nightly(self):
        with Link() as link:
            link_addresses(link)
            self.assertEqual(sent_through(link, 50), list(range(50)))
            link.partition(3600)
            self.assertEqual(sent_through(link, 50), [])
            link.partition(0)
            self.assertEqual(sent_through(link, 50), list(range(50)))

    def test_wrong_usage_is_said(self):
        done = subprocess.run([PROGRAMS / "link_relay", "a"], capture_output=True, text=True)
        self.assertEqual((done.returncode, "usage:" in done.stderr), (2, True))


def link_addresses(link):
    """Fixes the neighbours' Ethernet addresses, so that no request for them is on the link."""
    hardware = []
    for side in (0, 1):
        text = subprocess.run([*link.inside(side), "ip", "link", "show", "link0"], capture_output=True, text=True, check=True).stdout
        hardware.append(re.search(r"link/ether (\S+)", text).group(1))
    for side, address in ((0, B), (1, A)):
        subprocess.run([*link.inside(side), "ip", "neigh", "replace", address, "lladdr", hardware[1 - side], "dev", "link0", "nud", "permanent"],
                       check=True)


def doctor(link, *arguments):
    return subprocess.run([*link.inside(1), TENON, "doctor", "--peer", A, "--seconds", "3", *map(str, arguments)], capture_output=True, text=True,
                          timeout=120)


def line(text, name):
    found = re.search(rf"(?m)^(good|note|bad) +{name} +(.*(?:\n {{19}}.*)?)", text)
    return found.groups() if found else ("", text)


class Doctor(unittest.TestCase):
    def test_a_good_link_is_good(self):
        with Link() as link, Running([*link.inside(0), TENON, "doctor", "--listen"]) as listener:
            self.assertIn("listening on UDP 7410 to 7473", listener.first)
            done = doctor(link)
            for name in ("ports", "address", "loss", "datagrams", "multicast"):
                self.assertEqual(line(done.stdout, name)[0], "good", done.stdout + done.stderr)
            self.assertEqual(done.returncode, 0)
        self.assertIn(f"checked from {B}", listener.text)

    def test_the_delay_is_within_its_stated_error(self):
        with Link(delay=0.05, loss=0.02, burst=3, jitter=0.005) as link, Running([*link.inside(0), TENON, "doctor", "--listen"]):
            done = doctor(link)
            verdict, text = line(done.stdout, "delay")
            self.assertEqual(verdict, "note", done.stdout + done.stderr)
            delay, error = map(float, re.match(r"([\d.]+) ms one way, \+-([\d.]+) ms", text).groups())
            # the shortest of some hundred round trips has nearly no jitter; 1 ms of it may remain
            self.assertLessEqual(delay - error, 51.0, text)
            self.assertGreaterEqual(delay + error, 50.0, text)
            self.assertEqual(line(done.stdout, "loss")[0], "note", done.stdout)

    def test_a_link_that_needs_a_change_is_told_which(self):
        with Link(mtu=1300) as link, Running([*link.inside(0), TENON, "doctor", "--listen"]):
            self.assertRegex(line(doctor(link).stdout, "datagrams")[1], r"(?s)do not pass whole.*set the MTU")
        with Link() as link:
            done = doctor(link)
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertRegex(line(done.stdout, "ports")[1], r"(?s)nothing answers.*tenon doctor --listen")

    def test_a_name_that_nobody_has_is_refused(self):
        done = subprocess.run([TENON, "doctor", "--peer", "no-such-host.invalid"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("no-such-host.invalid", done.stderr)


if __name__ == "__main__":
    unittest.main()
