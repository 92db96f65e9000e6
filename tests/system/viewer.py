"""A viewer of the Foxglove WebSocket protocol, with the standard library alone."""
import base64
import json
import os
import socket
import struct
import time


HANDS = 0xFFFFFFFF  # subscription of what the viewer's own hands are shown


class Refused(Exception):
    """The server answered the handshake otherwise; `status` is the HTTP status."""

    def __init__(self, status, text):
        super().__init__(f"{status}: {text}")
        self.status = status


class Closed(Exception):
    """The server has closed the connection, and says why; `code`: of the WebSocket protocol, None where the connection just ended."""

    def __init__(self, text, code=None):
        super().__init__(text)
        self.code = code


def connect(port, tls=None, timeout=20, receive_buffer=None):
    """A connection to a port of this machine; `tls`: an ssl.SSLContext."""
    connection = socket.socket()
    if receive_buffer:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_buffer)
    connection.settimeout(timeout)
    connection.connect(("127.0.0.1", port))
    return tls.wrap_socket(connection, server_hostname="localhost") if tls else connection


def request(port, head, body=b"", timeout=20, tls=None):
    """The status and the whole answer to an HTTP request of these bytes."""
    with connect(port, tls, timeout) as connection:
        connection.sendall(head.encode("latin-1") + body)
        answer = b""
        try:
            while data := connection.recv(65536):
                answer += data
        except ConnectionResetError:
            pass
    return int(answer.split(b" ", 2)[1]) if answer else None, answer


def get(port, path, host=None, method="GET", tls=None):
    return request(port, f"{method} {path} HTTP/1.1\r\nHost: {host or f'localhost:{port}'}\r\nConnection: close\r\n\r\n", tls=tls)


class Viewer:
    def __init__(self, port, subprotocol="foxglove.sdk.v1", origin=None, host=None, receive_buffer=None, path="/", tls=None):
        self.socket = connect(port, tls, 30, receive_buffer)
        lines = [f"GET {path} HTTP/1.1", f"Host: {host or f'localhost:{port}'}", "Upgrade: websocket", "Connection: Upgrade", "Sec-WebSocket-Version: 13",
                 f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}"]
        lines += [f"Sec-WebSocket-Protocol: {subprotocol}"] if subprotocol else []
        lines += [f"Origin: {origin}"] if origin else []
        self.socket.sendall(("\r\n".join(lines) + "\r\n\r\n").encode())
        self.buffer = b""
        while b"\r\n\r\n" not in self.buffer:
            self.fill()
        head, _, self.buffer = self.buffer.partition(b"\r\n\r\n")
        self.head = head.decode("latin-1")
        status = int(self.head.split(" ", 2)[1])
        if status != 101:
            self.close()
            raise Refused(status, self.buffer.decode("latin-1"))
        self.channels, self.subscriptions = {}, {}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        self.socket.close()

    def fill(self):
        data = self.socket.recv(1 << 16)
        if not data:
            raise Closed("the connection ended")
        self.buffer += data

    def take(self, count):
        while len(self.buffer) < count:
            self.fill()
        data, self.buffer = self.buffer[:count], self.buffer[count:]
        return data

    def send(self, payload, opcode=1):
        data = payload.encode() if isinstance(payload, str) else payload
        size = len(data)
        length = bytes([0x80 | size]) if size < 126 else b"\xfe" + struct.pack(">H", size) if size < 65536 else b"\xff" + struct.pack(">Q", size)
        self.socket.sendall(bytes([0x80 | opcode]) + length + bytes(4) + data)  # a mask of zeros is a mask

    def receive(self):
        """The next message: text as decoded JSON, bytes as (subscription, time in ns, payload)."""
        message = b""
        while True:
            first, second = self.take(2)
            size = second & 0x7F
            size = struct.unpack(">H", self.take(2))[0] if size == 126 else struct.unpack(">Q", self.take(8))[0] if size == 127 else size
            payload = self.take(size)
            opcode = first & 0x0F
            if opcode == 8:
                raise Closed(payload[2:].decode("utf-8", "replace"), int.from_bytes(payload[:2], "big"))
            if opcode == 9:
                self.send(payload, 10)
                continue
            if opcode in (1, 2):
                kind = opcode
            message += payload
            if first & 0x80:
                break
        if kind == 1:
            return json.loads(message)
        operation, subscription, time_ns = struct.unpack("<BIQ", message[:13])
        assert operation == 1, operation
        return subscription, time_ns, message[13:]

    def drain(self):
        """Reads until nothing comes any more; the number of bytes."""
        self.socket.settimeout(2)
        count = len(self.buffer)
        try:
            while data := self.socket.recv(1 << 16):
                count += len(data)
        except (TimeoutError, ConnectionError):
            pass
        return count

    def begin(self, *topics):
        """Awaits the channels and subscribes to these topics, or to all."""
        self.info = self.receive()
        for channel in self.receive()["channels"]:
            self.channels[channel["topic"]] = channel
        chosen = [self.channels[topic] for topic in topics] if topics else list(self.channels.values())
        self.subscriptions = {100 + channel["id"]: channel["topic"] for channel in chosen}
        self.send(json.dumps({"op": "subscribe", "subscriptions": [{"id": 100 + channel["id"], "channelId": channel["id"]} for channel in chosen]}))
        return self

    def ask(self, operation, seconds=60, **values):
        """The answer to a request to the desk; what else comes meanwhile is dropped."""
        self.asked = getattr(self, "asked", 0) + 1
        self.send(json.dumps({"op": operation, "id": self.asked, **values}))
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            message = self.receive()
            if isinstance(message, dict) and message["op"] in ("deskAnswer", "handAnswer") and message["id"] == self.asked:
                return message
        raise AssertionError(f"no answer to {operation}")

    def status(self, seconds=60):
        """The next thing that the gateway says about what was sent."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            message = self.receive()
            if isinstance(message, dict) and message["op"] == "status":
                return message["message"]
        raise AssertionError("no status")

    def hands(self, seconds=60):
        """What this viewer's hands are shown next, as bytes."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            message = self.receive()
            if isinstance(message, tuple) and message[0] == HANDS:
                return message[2]
        raise AssertionError("the hands are shown nothing")

    def messages(self, seconds=120):
        """(topic, payload) as they come, for so long."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            message = self.receive()
            if isinstance(message, tuple) and message[0] != HANDS:
                yield self.subscriptions[message[0]], message[2]


class Cdr:
    """Reads XCDR1, little-endian."""

    def __init__(self, data):
        assert data[:4] == b"\0\1\0\0", data[:4]
        self.data, self.at = data[4:], 0

    def number(self, code):
        size = struct.calcsize(code)
        self.at += -self.at % size
        (value,) = struct.unpack_from("<" + code, self.data, self.at)
        self.at += size
        return value

    def text(self):
        size = self.number("I")
        self.at += size
        return self.data[self.at - size:self.at - 1].decode()


def frame_transforms(payload):
    """Position of each child frame."""
    cdr = Cdr(payload)
    frames = {}
    for _ in range(cdr.number("I")):
        cdr.number("I"), cdr.number("I")
        parent, child = cdr.text(), cdr.text()
        pose = [cdr.number("d") for _ in range(7)]
        assert parent == "world", parent
        assert abs(sum(part * part for part in pose[3:]) - 1) < 1e-6, pose
        frames[child] = pose[:3]
    assert cdr.at == len(cdr.data), "more bytes than transforms"
    return frames
