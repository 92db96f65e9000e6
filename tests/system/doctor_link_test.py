"""What `tenon doctor --peer` says of the ports of a link that loses, duplicates or blocks datagrams: the listener here, with a link that is seeded."""
import random
import selectors
import sys
import threading
import unittest
from collections import Counter

from stage import SOURCE, free_domain

sys.path.insert(0, str(SOURCE / "deploy"))
import doctor_link  # noqa: E402

PEER = "127.0.0.2"  # so that both sides have all ports


class Peer:
    """The listener on PEER. Of each port, the n-th datagram is lost or duplicated by seed, port and n alone."""

    def __init__(self, domain, loss=0.0, duplicates=0.0, closed=(), unheard=()):
        self.loss, self.duplicates, self.closed, self.unheard = loss, duplicates, set(closed), set(unheard)
        self.counts = Counter()
        self.sockets = {port: doctor_link.bound(PEER, port) for port in doctor_link.ports_of(domain)}
        self.unseen = doctor_link.bound(PEER, 0)
        self.sent_back = {}
        self.ended = threading.Event()
        self.thread = threading.Thread(target=self.serve)

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.ended.set()
        self.thread.join()
        for sock in (*self.sockets.values(), self.unseen):
            sock.close()

    def chance(self, kind, port):
        self.counts[kind, port] += 1
        return random.Random(f"{kind} {port} {self.counts[kind, port]}").random()

    def through(self, sock, port):
        """A socket whose datagrams pass the link; `port` of this side."""
        peer = self

        class Out:
            def sendto(self, data, to):
                if to[1] in peer.unheard or peer.chance("down", (port, to[1] if port is None else 0)) < peer.loss:
                    return
                for _ in range(2 if peer.chance("again", port) < peer.duplicates else 1):
                    sock.sendto(data, to)
        return Out()

    def serve(self):
        selector = selectors.DefaultSelector()
        for port, sock in self.sockets.items():
            selector.register(sock, selectors.EVENT_READ, port)
        while not self.ended.is_set():
            for key, _ in selector.select(0.05):
                while (received := doctor_link.receive(key.fileobj)) is not None:
                    if key.data in self.closed or self.chance("up", key.data) < self.loss:
                        continue
                    doctor_link.answer(received, False, self.through(key.fileobj, key.data), self.through(self.unseen, None), sorted(self.sockets), 0.0, self.sent_back)


class Ports(unittest.TestCase):
    def setUp(self):
        self.domain = free_domain()

    def check(self, **conditions):
        with Peer(self.domain, **conditions):
            link = doctor_link.Link(PEER, self.domain)
            self.addCleanup(link.sock.close)
            return doctor_link.check_ports(link, {})

    def test_a_link_without_faults_passes(self):
        verdict, text, _ = self.check()
        self.assertEqual((verdict, text.endswith("(64 there and 64 here were free to try)")), ("good", True), text)

    def test_loss_is_not_taken_for_a_firewall(self):
        for loss in (0.02, 0.2):
            with self.subTest(loss=loss):
                verdict, text, _ = self.check(loss=loss)
                self.assertEqual(verdict, "good", text)

    def test_duplicates_are_not_taken_for_a_firewall(self):
        for duplicates in (0.02, 0.5):
            with self.subTest(duplicates=duplicates):
                verdict, text, _ = self.check(duplicates=duplicates)
                self.assertEqual((verdict, "64 there and 64 here" in text), ("good", True), text)

    def test_ports_that_are_blocked_are_counted_on_a_link_that_loses(self):
        first = doctor_link.ports_of(self.domain)[0]
        verdict, text, advice = self.check(loss=0.05, duplicates=0.1, closed=[first + 3], unheard=[first + 5, first + 9])
        self.assertEqual(verdict, "bad")
        self.assertRegex(text, r"does not hear 1 of 64 ports, \d+ times; this machine does not hear 2 of 64 ports, \d+ times")
        self.assertIn("permit UDP", advice)

    def test_tries_suffice_for_one_false_finding_in_a_million(self):
        self.assertLess(64 * 0.36 ** doctor_link.tries_for(0.64, 64), 1e-6)
        self.assertGreater(64 * 0.36 ** (doctor_link.tries_for(0.64, 64) - 1), 1e-6)


class Losses(unittest.TestCase):
    def test_two_per_cent_each_way_is_a_link_that_works(self):
        for lost, verdict in ((0, "good"), (40, "note"), (50, "note"), (80, "bad")):
            self.assertEqual(doctor_link.check_loss(None, {"sent": 1000, "found": [None] * (1000 - lost)})[0], verdict, lost)


if __name__ == "__main__":
    unittest.main()
