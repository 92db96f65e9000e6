#!/usr/bin/env python3
"""A remote hand as a program: takes a part and brings it to its place, over the socket of a station with `--device remote`.

It knows of the scene what it is told by arguments and what the socket gives back, nothing else. An example of a client of one's own:
docs/devices.md has the messages. Standard library only.
"""
import argparse
import math
import os
import select
import socket
import struct
import sys
import time
from pathlib import Path

MAGIC, VERSION, TARGET, VIEW = 0x444E4854, 1, 1, 2
HEADER = "<IHHII"                          # magic, version, kind, sequence number, buttons or flags
TARGET_FORMAT = HEADER + "3d4dd"           # p_DT, q_DT, grip
VIEW_FORMAT = HEADER + "Q7d7d7d3d3d3dII"   # cycle, X_DH, X_DS, X_DO, p_WC, force, torque, object, -
ARM, HELD = 2, 4                           # buttons
FORCES_ON, ACTIVE, CONTACT = 1, 2, 4       # flags
NEAR = 0.02                                # [m] nothing pushes back, so the hand stays as near to the proxy
SPEED, SLOW = 0.25, 0.03                   # [m/s] in free space, along the approach


def add(a, b, scale=1.0):
    return tuple(x + scale * y for x, y in zip(a, b))


def norm(v):
    return math.sqrt(sum(x * x for x in v))


def towards(start, goal, length):
    """The point on the way from start to goal that is at most `length` away."""
    off = add(goal, start, -1.0)
    return goal if norm(off) <= length else add(start, off, length / norm(off))


class View:
    """What the device has sent; poses in the world, whose axes are those of the device."""

    def __init__(self, data):
        numbers = struct.unpack(VIEW_FORMAT, data)
        magic, version, kind, _, self.flags, self.cycle = numbers[:6]
        if (magic, version, kind) != (MAGIC, VERSION, VIEW):
            raise ConnectionError(f"not a view of version {VERSION}")
        self.centre = numbers[27:30]
        self.hand, self.proxy, self.part = (add(numbers[at:at + 3], self.centre) for at in (6, 13, 20))
        self.force = norm(numbers[30:33])
        self.object = numbers[36]

    def has(self, flag):
        return bool(self.flags & flag)


class Hand:
    """A connection to a device, and where the hand is to be."""

    def __init__(self, path, seconds):
        self.until, self.seq = time.monotonic() + seconds, 0
        self.elapsed = 1  # [ms] of the station between the last two views
        self.arrived = False  # the part is in its place
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self.socket.settimeout(5)
        self.socket.connect(str(path))
        self.view = self.receive()
        self.wanted = self.view.hand

    def receive(self):
        """The newest view; waits for one."""
        data = None
        while data is None or select.select([self.socket], [], [], 0)[0]:
            data = self.socket.recv(512)
            if not data:
                raise ConnectionError("the station has closed the connection")
        return View(data)

    def cycle(self, goal, speed):
        """Until the next view: the hand is wanted nearer to `goal`, in the world, and is near the proxy at a contact."""
        if time.monotonic() > self.until:
            raise TimeoutError("it has taken too long")
        self.wanted = towards(self.wanted, goal, speed * 1e-3 * self.elapsed)
        if self.view.has(ACTIVE) and self.view.has(CONTACT):
            self.wanted = towards(self.view.proxy, self.wanted, NEAR)
        self.seq += 1
        buttons = HELD | (0 if self.view.has(FORCES_ON) or self.seq % 400 < 200 else ARM)  # it presses until it is armed
        place = add(self.wanted, self.view.centre, -1.0)
        self.socket.send(struct.pack(TARGET_FORMAT, MAGIC, VERSION, TARGET, self.seq, buttons, *place, 1.0, 0.0, 0.0, 0.0, 0.0))
        before = self.view.cycle
        self.view = self.receive()
        self.elapsed = min(self.view.cycle - before, 20)

    def bring_part(self, goal):
        """Where the hand has to be so that the part, which keeps its orientation, is at `goal`."""
        return add(goal, add(self.view.proxy, self.view.part, -1.0))


def mount(hand, args):
    own = None
    while not hand.view.has(ACTIVE) or own is None:
        hand.cycle(hand.view.hand, SPEED)
        own = hand.view.object if hand.view.has(ACTIVE) else None
    print(f"armed; goes to the part at {args.touch}", flush=True)
    # its own object is replaced by the part when it has touched that long enough
    while hand.view.object == own:
        hand.cycle(args.touch, SPEED)
    print("holds the part", flush=True)
    above = add(args.target, args.approach, -args.distance)
    over = (*above[:2], max(above[2], hand.view.part[2] + 0.05))
    for goal, speed in (((*hand.view.part[:2], over[2]), SPEED), (over, SPEED), (above, SPEED), (args.target, SLOW)):
        while norm(add(hand.view.part, goal, -1.0)) > args.within:
            hand.cycle(hand.bring_part(goal), speed)
    print(f"the part is within {1e3 * args.within:g} mm of its place, {hand.view.force:.1f} N", flush=True)
    hand.arrived = True
    for _ in range(2000):  # a session takes the part when it has been in its place for a while
        if hand.view.object == own:
            return print("the session has taken it", flush=True)
        hand.cycle(hand.bring_part(args.target), SLOW)


def vector(text):
    numbers = tuple(float(part) for part in text.split(","))
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        raise argparse.ArgumentTypeError(f"'{text}' is not X,Y,Z")
    return numbers


def default_socket():
    folder = os.environ.get("XDG_RUNTIME_DIR") or f"/run/user/{os.getuid()}"
    return Path(folder) / "tenon" / "remote-right.sock"


def main():
    parser = argparse.ArgumentParser(prog="remote_hand.py", description=__doc__.split("\n")[0],
                                     epilog="Exit code: 0 the part is in its place, 1 it is not, 2 wrong usage.")
    parser.add_argument("--socket", type=Path, default=default_socket(), help="of the device (default: %(default)s)")
    parser.add_argument("--touch", type=vector, required=True, metavar="X,Y,Z", help="[m] where the part can be touched")
    parser.add_argument("--target", type=vector, required=True, metavar="X,Y,Z", help="[m] where it belongs")
    parser.add_argument("--approach", type=vector, default=(0.0, 0.0, -1.0), metavar="X,Y,Z", help="direction of its last way (default: down)")
    parser.add_argument("--distance", type=float, default=0.1, help="[m] length of that way (default: %(default)s)")
    parser.add_argument("--within", type=float, default=0.001, help="[m] of a place counts as there (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=120, help="[s] at most (default: %(default)s)")
    args = parser.parse_args()
    hand = None
    try:
        hand = Hand(args.socket, args.seconds)
        mount(hand, args)
    except (OSError, TimeoutError) as problem:
        if hand and hand.arrived:
            return 0  # the session is over
        print(f"remote_hand.py: {args.socket}: {problem}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
