"""`tenon doctor --peer HOST` and `--listen`: what the link between two machines can and cannot do, and what to change.

The listener answers on every UDP port of docs/network.md that no program holds. The other side sends to all of them, asks the
listener to send back from a port that no firewall has seen, and exchanges datagrams of a hand's size for some seconds.
Stamps of received datagrams are the kernel's (SO_TIMESTAMPNS, CLOCK_REALTIME), so that a busy machine delays few of them.
"""
import errno
import json
import math
import os
import selectors
import signal
import socket
import struct
import sys
import time

MAGIC = b"tenon-link-1 "
PORTS = 64          # of 32 programs a machine, two each
GROUP = "239.255.0.1"
SAMPLE = 372        # [bytes] a hand's input on the wire
WHOLE = 1380        # [bytes] the longest datagram that Tenon sends (deploy/dds/wan.xml)
HEADERS = 28        # [bytes] IPv4 and UDP
SO_TIMESTAMPNS = 35
IP_MTU, IP_MTU_DISCOVER, IP_PMTUDISC_DO = 14, 10, 2
ECHO, HELLO, SEND_BACK, BACK = b"e", b"h", b"s", b"b"
MOST_LOSS = 0.2     # [-] each way: up to that much a port that passes is not called blocked
RARE = 1e-6         # [-] how often one is, then
BETWEEN_BACKS = 0.5  # [s] the listener sends back so often at most


def ports_of(domain):
    first = 7410 + 250 * domain
    return range(first, first + PORTS)


def bound(address, port):
    """A datagram socket whose receptions are stamped, or None when a program has the port."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    sock.setblocking(False)
    try:
        sock.bind((address, port))
    except OSError as error:
        sock.close()
        if error.errno == errno.EADDRINUSE:
            return None
        raise
    return sock


def receive(sock):
    """A datagram: its bytes, when it was received [ns], from where; None when there is none or its sender is refused."""
    try:
        data, control, _, sender = sock.recvmsg(2048, 256)
    except (BlockingIOError, ConnectionRefusedError):
        return None
    for level, kind, value in control:
        if level == socket.SOL_SOCKET and kind == SO_TIMESTAMPNS:
            seconds, nanoseconds = struct.unpack("qq", value[:16])
            return data, seconds * 10**9 + nanoseconds, sender
    return data, time.time_ns(), sender


def timer_lateness(seconds=0.5):
    """[s] How late a timer of 1 ms wakes this process, 99th percentile."""
    late = []
    for _ in range(int(seconds / 1e-3)):
        begin = time.monotonic_ns()
        time.sleep(1e-3)
        late.append((time.monotonic_ns() - begin) * 1e-9 - 1e-3)
    return percentile(late, 99)


def percentile(values, percent):
    ordered = sorted(values)
    return ordered[min(len(ordered) - 1, int(len(ordered) * percent / 100))]


def tries_for(heard, ports=1):
    """How often to try `ports` that pass a try with the probability `heard`, until all are heard but for RARE."""
    return math.ceil(math.log(RARE / ports) / math.log(1.0 - heard))


# ---- the side that answers

def listen(args):
    sockets = {port: sock for port in ports_of(args.domain) if (sock := bound("", port))}
    ports = ports_of(args.domain)
    if not sockets:
        print(f"tenon doctor: all UDP ports from {ports[0]} to {ports[-1]} are in use: end some programs of domain {args.domain}", file=sys.stderr)
        return 1
    group = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    group.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    group.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
    group.setblocking(False)
    group.bind((GROUP, 7400 + 250 * args.domain))
    for address in own_addresses():
        try:
            group.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(GROUP) + socket.inet_aton(address))
        except OSError:
            pass  # an interface without multicast
    unseen = bound("", 0)
    lateness = timer_lateness()
    selector = selectors.DefaultSelector()
    for sock in (*sockets.values(), group):
        selector.register(sock, selectors.EVENT_READ)
    ended = []
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.append(True))
    print(f"listening on UDP {ports[0]} to {ports[-1]}, {len(sockets)} of {PORTS} ports are free; on the other machine: "
          f"tenon doctor --peer {socket.gethostname()}\nuntil Ctrl-C", flush=True)
    seen, sent_back = set(), {}
    while not ended:
        for key, _ in selector.select(0.2):
            while (received := receive(key.fileobj)) is not None:
                answer(received, key.fileobj is group, key.fileobj if key.fileobj is not group else unseen, unseen, sorted(sockets), lateness, sent_back)
                host = received[2][0]
                if host not in seen and received[0].startswith(MAGIC):
                    seen.add(host)
                    print(f"checked from {host}", flush=True)
    return 0


def answer(received, by_group, sock, unseen, ports, lateness, sent_back):
    data, stamp, sender = received
    if not data.startswith(MAGIC):
        return
    kind = data[len(MAGIC):len(MAGIC) + 1]
    try:
        if kind == ECHO:
            reply = bytearray(data)
            reply[32:48] = struct.pack("qq", stamp, time.time_ns())
            sock.sendto(reply, sender)
        elif kind == HELLO:
            told = {"ports": ports, "late": lateness, "from": sender[0], "multicast": by_group}
            sock.sendto(MAGIC + HELLO + json.dumps(told).encode(), sender)
        elif kind == SEND_BACK and time.monotonic() - sent_back.get(sender[0], -1.0) > BETWEEN_BACKS:
            sent_back[sender[0]] = time.monotonic()
            for port in json.loads(data[len(MAGIC) + 1:])[:PORTS]:
                unseen.sendto(MAGIC + BACK, (sender[0], int(port)))
    except (OSError, ValueError):
        pass  # gone, or not of this protocol


def own_addresses():
    """IPv4 addresses of this machine's interfaces."""
    found = []
    try:
        import fcntl
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            for _, name in socket.if_nameindex():
                try:
                    found.append(socket.inet_ntoa(fcntl.ioctl(sock, 0x8915, struct.pack("256s", name.encode()[:15]))[20:24]))  # SIOCGIFADDR
                except OSError:
                    pass
    except OSError:
        pass
    return found


# ---- the side that asks

class Link:
    """Sockets on this machine's free ports, and the peer."""

    def __init__(self, host, domain):
        self.host, self.domain = host, domain
        self.address = socket.gethostbyname(host)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as route:
            route.connect((self.address, ports_of(domain)[0]))
            self.own = route.getsockname()[0]
        self.sock = bound(self.own, 0)

    def send(self, message, port):
        try:
            self.sock.sendto(MAGIC + message, (self.address, port))
        except OSError:
            pass

    def greet(self):
        """What each port answers to a greeting, by port, and how many tries that took. Ports that are not heard are tried again, after waits
        that grow, so that loss is not taken for a firewall. The listener's answer names the ports that it has."""
        heard, wanted = {}, set(ports_of(self.domain))
        tries = tries_for((1.0 - MOST_LOSS) ** 2, PORTS)
        for number in range(tries):
            for port in sorted(wanted - set(heard)):
                self.send(HELLO, port)
            end = time.monotonic() + (min(0.4, 0.1 * 1.5 ** number) if number + 1 < tries else 1.0)
            while time.monotonic() < end and wanted - set(heard):
                received = receive(self.sock)
                if received is None:
                    time.sleep(1e-3)
                elif received[0].startswith(MAGIC + HELLO):
                    heard.setdefault(received[2][1], json.loads(received[0][len(MAGIC) + 1:]))
                    wanted = set(next(iter(heard.values()))["ports"])
            if not wanted - set(heard):
                return heard, number + 1
        return heard, tries

    def call_back(self, port, sockets):
        """Has the listener send to `sockets`, by port; returns the ports that hear nothing, and how many tries that took."""
        deaf = set(sockets)
        tries = tries_for((1.0 - MOST_LOSS ** 2) * (1.0 - MOST_LOSS), PORTS)
        for number in range(tries):
            for _ in range(2):  # the listener obeys the first that arrives
                self.send(SEND_BACK + json.dumps(sorted(deaf)).encode(), port)
            end = time.monotonic() + BETWEEN_BACKS + 0.05 * (number + 1)
            while time.monotonic() < end and deaf:
                deaf -= {one for one in deaf if receive(sockets[one]) is not None}
                time.sleep(1e-3)
            if not deaf:
                return deaf, number + 1
        return deaf, tries


def echoes(link, port, seconds, size=SAMPLE, rate=200):
    """Round trips: (sent, answered) and for each (round trip, offset of the peer's clock) [s], smallest delay first."""
    found, sent = {}, 0
    begin = time.monotonic()
    while True:
        now = time.monotonic()
        if now > begin + seconds + 1.0:
            break
        if now < begin + seconds and sent <= (now - begin) * rate:
            packet = bytearray(size)
            packet[:len(MAGIC) + 1] = MAGIC + ECHO
            packet[16:24] = struct.pack("q", sent)
            packet[24:32] = struct.pack("q", time.time_ns())
            try:
                link.sock.sendto(packet, (link.address, port))
            except OSError:
                pass
            sent += 1
        while (received := receive(link.sock)) is not None:
            data, stamp, _ = received
            if data.startswith(MAGIC + ECHO) and len(data) >= 48:
                number, t0, t1, t2 = struct.unpack("qqqq", data[16:48])
                found.setdefault(number, ((stamp - t0 - (t2 - t1)) * 1e-9, ((t1 - t0) + (t2 - stamp)) * 0.5e-9))
        time.sleep(2e-4)
    return sent, sorted(found.values())


def own_floor():
    """[s] Shortest round trip of the same exchange inside of this machine: what it costs without a link."""
    one, other = bound("127.0.0.1", 0), bound("127.0.0.1", 0)
    shortest = 1.0
    for _ in range(200):
        begin = time.time_ns()
        one.sendto(b"x" * SAMPLE, other.getsockname())
        received = None
        while received is None:
            received = receive(other)
        shortest = min(shortest, 2e-9 * (received[1] - begin))
    one.close()
    other.close()
    return shortest


def check_ports(link, state):
    ports = ports_of(link.domain)
    answers, tries = link.greet()
    span = f"UDP {ports[0]} to {ports[-1]}"
    if not answers:
        return "bad", f"nothing answers at {link.host} ({link.address}), {span}, {tries} times", \
            f"run `tenon doctor --listen` there, permit {span} in its firewall, and see whether there is a route: ip route get {link.address}"
    port, told = next(iter(answers.items()))
    state.update(told, port=port)
    silent = [port for port in state["ports"] if port not in answers]
    mine = {port: sock for port in ports if (sock := bound(link.own, port))}
    deaf, tries_back = link.call_back(state["port"], mine)
    for sock in mine.values():
        sock.close()
    if silent or deaf:
        where = ([f"{link.host} does not hear {len(silent)} of {len(state['ports'])} ports, {tries} times"] if silent else []) + \
            ([f"this machine does not hear {len(deaf)} of {len(mine)} ports, {tries_back} times"] if deaf else [])
        return "bad", "; ".join(where), f"permit {span} there, from the other machine, in both directions (nftables: udp dport {ports[0]}-{ports[-1]} accept)"
    return "good", f"{span} pass both ways ({len(answers)} there and {len(mine)} here were free to try)", ""


def check_address(link, state):
    if state["from"] == link.own:
        return "good", f"{link.own} is seen as itself", ""
    return "bad", f"{link.own} is seen there as {state['from']}: addresses are translated (NAT)", \
        "DDS does not pass NAT: connect both machines by a VPN, as deploy/wireguard.md says"


def check_size(link, state):
    sock = bound(link.own, 0)
    sock.setsockopt(socket.IPPROTO_IP, IP_MTU_DISCOVER, IP_PMTUDISC_DO)
    sock.connect((link.address, state["port"]))
    largest = 0
    for size in (512, 1200, 1280, WHOLE, 1392, 1472):
        for _ in range(tries_for((1.0 - MOST_LOSS) ** 2) if size <= WHOLE else 6):
            packet = bytearray(size)
            packet[:len(MAGIC) + 1] = MAGIC + ECHO
            try:
                sock.send(packet)
            except OSError:
                continue
            end = time.monotonic() + max(0.1, 3 * state.get("round_trip", 0.1))
            while time.monotonic() < end and largest < size:
                received = receive(sock)
                if received is not None and len(received[0]) == size:
                    largest = size
                time.sleep(1e-3)
            if largest == size:
                break
        if largest < size:
            break
    mtu = sock.getsockopt(socket.IPPROTO_IP, IP_MTU)
    sock.close()
    if largest >= WHOLE:
        return "good", f"datagrams of {largest} bytes pass whole (MTU {mtu})", ""
    return "bad", f"datagrams above {largest} bytes do not pass whole (MTU {mtu}); Tenon sends up to {WHOLE}", \
        f"set the MTU of the interface or the VPN to {WHOLE + HEADERS + 12} or more; let ICMP 'fragmentation needed' pass"


def check_delay(link, state):
    floor = own_floor()
    sent, found = echoes(link, state["port"], state["seconds"])
    if not found:
        return "bad", f"none of {sent} datagrams came back", "see 'ports'"
    trips = [trip for trip, _ in found]
    state.update(found=found, sent=sent, round_trip=trips[0])
    longest = trips[0] / 2
    shortest = max(0.0, longest - floor / 2 - (percentile(trips, 10) - trips[0]) / 2)
    text = (f"{(longest + shortest) / 2 * 1e3:.2f} ms one way, +-{(longest - shortest) / 2 * 1e3:.2f} ms if both directions are alike "
            f"(half of the shortest of {len(trips)} round trips; median {percentile(trips, 50) * 5e2:.2f} ms)")
    if longest > 0.15:
        return "bad", text, "above 150 ms contacts are not felt, guidance alone: take a server that is nearer"
    if longest > 0.025:
        return "note", text, "above 25 ms people notice the delay at the hand; use --network wan"
    return "good", text, ""


def check_jitter(link, state):
    trips = [trip for trip, _ in state["found"]]
    jitter = percentile(trips, 99) - trips[0]
    text = f"{jitter * 1e3:.2f} ms between the shortest round trip and the 99th percentile; timers here are {state['late_here'] * 1e3:.2f} ms late, there {state['late'] * 1e3:.2f} ms"
    if jitter <= 0.010:
        return "good", text, ""
    if state["late_here"] + state["late"] > jitter / 2:
        return "note", text, "much of it is the machines themselves: see 'scheduling'"
    return "note", text, "contacts fade when they are 20 ms late beyond the usual delay: use a cable instead of WLAN, or give UDP of these ports priority"


def check_loss(link, state):
    lost = state["sent"] - len(state["found"])
    share = lost / state["sent"]
    text = f"{lost} of {state['sent']} round trips lost ({100 * share:.1f} %)"
    if share <= 0.001:
        return "good", text, ""
    # 2 % each way, and what may be counted of it in so few
    if lost <= 0.04 * state["sent"] + 3.0 * math.sqrt(0.04 * state["sent"]):
        return "note", text, "a session runs with it; on a cable in a lab it means a bad cable, switch or full link"
    return "bad", text, "more than 2 % each way: use a cable, or another route"


def check_clock(link, state):
    trip, offset = state["found"][0]
    text = f"the clock there is {offset * 1e3:+.2f} ms off, +-{trip * 5e2:.2f} ms"
    if abs(offset) <= 0.1 + trip / 2:
        return "good", text, ""
    return "note", text, "sessions do not need equal clocks, files of both machines do: run chrony on both"


def check_multicast(link, state):
    sock = bound(link.own, 0)
    sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton(link.own))
    heard = False
    for _ in range(tries_for((1.0 - MOST_LOSS) ** 2)):
        try:
            sock.sendto(MAGIC + HELLO, (GROUP, 7400 + 250 * link.domain))
        except OSError:
            break
        end = time.monotonic() + max(0.2, 3 * state.get("round_trip", 0.1))
        while time.monotonic() < end and not heard:
            heard = receive(sock) is not None
            time.sleep(1e-3)
        if heard:
            break
    sock.close()
    if heard:
        return "good", "passes: `--network lan` finds programs by itself", ""
    return "note", f"does not pass: name the peers, as in --network lan,{link.address} or --network wan,{link.address}", \
        "usual on routes, in a VPN and on many WLANs"


def check_scheduling(_, state):
    text = f"a timer of 1 ms is late by {state['late_here'] * 1e3:.2f} ms here, {state['late'] * 1e3:.2f} ms there (99th percentile)"
    if max(state["late_here"], state["late"]) <= 2e-3:
        return "good", text, ""
    return "note", text, "less load, real-time priority (`tenon doctor`), or a machine of its own for the server"


CHECKS = {
    "ports": check_ports, "address": check_address, "delay": check_delay, "jitter": check_jitter, "loss": check_loss, "datagrams": check_size,
    "clock": check_clock, "multicast": check_multicast, "scheduling": check_scheduling,
}


def check_link(args, say):
    """Prints a line for each check with `say`; returns the exit code."""
    try:
        link = Link(args.peer, args.domain)
    except OSError as error:
        print(f"tenon doctor: {args.peer}: {error.strerror or error}: mistyped, or no route to it", file=sys.stderr)
        return 1
    state = {"seconds": args.seconds, "late_here": timer_lateness()}
    worst = 0
    for name, check in CHECKS.items():
        verdict, finding, advice = check(link, state)
        worst = max(worst, say(name, verdict, finding, advice))
        if "port" not in state or (name == "delay" and "found" not in state):
            break
    print(("All is well.", "Sessions run over this link; the notes say what would make them better.",
           "A session does not run over this link yet: see what is 'bad'.")[worst])
    return 1 if worst == 2 else 0
