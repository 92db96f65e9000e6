"""The console: what viewers of its WebSocket get of a session, what it refuses, and its page in a browser."""
import contextlib
import http.server
import json
import math
import os
import re
import shutil
import signal
import socket
import struct
import subprocess
import sys
import threading
import time
import unittest
import urllib.parse
import zlib
from pathlib import Path

from stage import COARSE, PROGRAMS, Process, SOURCE, Stage, final_hash, tenon
from viewer import Closed, Refused, Viewer, frame_transforms, get, request

sys.path.insert(0, str(SOURCE / "clients" / "remote_hand"))
from remote_hand import ACTIVE, FORCES_ON, View

TOOLS = SOURCE / "tests" / "system" / "public_tools"
NAMES = ("foxglove.sdk.v1", "foxglove.websocket.v1")
PAGE = PROGRAMS.parent / "console_page_build"
SCENARIO = "peg_and_box"


def start_console(stage, port=0, *arguments, shown=None, **env):
    """The gateway of this session, and its port."""
    shown = [stage.session] if shown is None else shown
    console = Process("console", [*shown, "--domain", stage.domain, "--port", port, *arguments], stage.out, env)
    stage.processes.append(console)
    line = console.wait_for(r"^console: https?://\S+:\d+/$")
    return console, int(re.search(r":(\d+)/$", line)[1])


def at_work(stage, *arguments):
    """A session in which a trainee works, with its gateway: server, console and port."""
    server = stage.serve("stacking", "--wait-for", "right")
    console, port = start_console(stage, 0, *arguments)
    console.wait_for("joined session 'test'")
    stage.start("trainee", "--seed", 1)
    server.wait_for("run: running")
    return server, console, port


def memory(process):
    """Resident memory of a process, in MB."""
    status = Path(f"/proc/{process.popen.pid}/status").read_text(encoding="utf-8")
    return int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1024


def recorded(test, stage):
    """The recording of a whole session; its journal is beside it."""
    recording = stage.out / "session.mcap"
    server = stage.serve(SCENARIO, "--wait-for", "right,recorder", "--journal", stage.out / "journal.mcap")
    recorder = stage.start("record", "-o", recording)
    stage.start("trainee", "--seed", 1)
    test.assertEqual((server.wait(), recorder.wait()), (0, 0), server.text())
    return recording


def taken_of(connection, frame, seconds):
    """Bytes that the other side takes of a frame that is sent again and again for so long."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 16)
    connection.settimeout(0.2)
    taken, end = 0, time.monotonic() + seconds
    with contextlib.suppress(ConnectionError):
        while time.monotonic() < end:
            with contextlib.suppress(TimeoutError):
                taken += connection.send(frame * 4000)
    return taken


class Gateway(unittest.TestCase):
    def test_viewers_see_a_session_under_both_names_and_one_that_never_reads_costs_nothing(self):
        with Stage() as stage:
            server = stage.serve(SCENARIO, "--wait-for", "right,observer")
            console, port = start_console(stage)
            console.wait_for("joined session 'test'")
            topics = ("/tf", "/scene", "/log", "/console", "SceneObject", "WorldFrame_30")
            viewers = [Viewer(port, name).begin(*topics) for name in NAMES]
            with Viewer(port, receive_buffer=4096) as deaf:
                deaf.begin()
                stage.start("trainee", "--seed", 1)
                for viewer, name in zip(viewers, NAMES):
                    self.assertIn(f"sec-websocket-protocol: {name}", viewer.head.lower())
                    self.assertEqual(viewer.info["op"], "serverInfo")
                    self.follow(viewer)
                before = memory(console)
                self.assertEqual(server.wait(), 0, server.text())
                for viewer in viewers:
                    self.assertEqual(self.last_state(viewer), "ended")
                    viewer.close()
                self.assertLess(memory(console) - before, 20, "MB, while a viewer did not read")
                # of each instance the newest alone has waited for it, and the buffers of its connection
                self.assertLess(deaf.drain(), 2_000_000)
            alone = tenon("rehearse", SOURCE / "scenarios" / SCENARIO, *COARSE, "--seed", 1, "--no-instructor")
            self.assertEqual(final_hash(server.text()), final_hash(alone.stdout), "viewers change nothing")

    def follow(self, viewer):
        """Reads until all kinds of messages have come and the hand's pointer has moved by 5 cm."""
        seen, models, first, moved = set(), {}, None, 0.0
        for topic, payload in viewer.messages():
            seen.add(topic)
            if topic == "/tf":
                frames = frame_transforms(payload)
                pointer = frames.get("object/pointer")
                first = first or pointer
                moved = max(moved, math.dist(first, pointer) if pointer else 0)
            elif topic == "/scene" and (at := payload.find(b"glTF")) >= 0:
                models[bytes(payload[at:at + 4])] = len(payload)
            if moved > 0.05 and models and seen == set(viewer.subscriptions.values()):
                return
        self.fail(f"seen {seen}, models {models}, moved {moved} m")

    def last_state(self, viewer):
        for topic, payload in viewer.messages():
            if topic == "/console" and json.loads(payload)["state"] != "joined":
                return json.loads(payload)["state"]
        return None

    def test_a_pipe_is_no_recording(self):
        with Stage() as stage:
            pipe = stage.out / "a.mcap"
            os.mkfifo(pipe)
            for program in ("console", "report"):
                done = subprocess.run([PROGRAMS / f"tenon-{program}", pipe], capture_output=True, text=True, timeout=60)
                self.assertEqual(done.returncode, 1, program)
                self.assertIn(f"tenon-{program}: {pipe}: is empty or not a file", done.stderr)

    @unittest.skipUnless((TOOLS / "node_modules").exists(), "the public tools are not installed: npm ci in tests/system/public_tools")
    def test_foxgloves_own_client_decodes_every_channel(self):
        with Stage() as stage:
            stage.serve(SCENARIO, "--wait-for", "right,observer")
            console, port = start_console(stage)
            console.wait_for("joined session 'test'")
            topics = ("/tf", "/scene", "/log", "/console", "SceneObject", "ObjectSnapshot", "WorldFrame_30", "WorldFrame_100", "HandState_100",
                      "ContactPairs_100", "TickStats_100", "StepState", "StepProgress", "RunState", "GrabState", "Presence", "EventLog")
            clients = [subprocess.Popen(["node", TOOLS / "foxglove_client.mjs", f"ws://localhost:{port}/", name, *topics], stdout=subprocess.PIPE,
                                        stderr=subprocess.STDOUT, text=True) for name in NAMES]
            stage.start("trainee", "--seed", 1)
            for client in clients:
                told, _ = client.communicate(timeout=300)
                self.assertEqual(client.returncode, 0, told)

    def test_what_it_refuses(self):
        with Stage() as stage:
            console, port = start_console(stage)
            self.assertIn(get(port, "/")[0], (200, 503))
            before = memory(console)
            for path in ("/../../etc/passwd", "/..%2f..%2fetc%2fpasswd", "/assets/../../../../etc/passwd", "/page/../../secret", "//etc/passwd"):
                status, answer = get(port, path)
                self.assertEqual(status, 404, path)
                self.assertNotIn(b"root:", answer)
            status, answer = get(port, "/", host="evil.example")
            self.assertEqual(status, 403, "a name that is pointed here by somebody else's DNS")
            self.assertIn(b"default-src 'none'", answer)
            self.assertEqual(get(port, "/", method="POST")[0], 405)
            self.assertNotEqual(request(port, "GET / HTTP/1.1\r\nHost: localhost\r\nX: " + 100_000 * "x" + "\r\n\r\n")[0], 200)
            self.assertNotEqual(request(port, f"POST / HTTP/1.1\r\nHost: localhost:{port}\r\nContent-Length: 100000000\r\n\r\n")[0], 200)
            self.assertNotEqual(request(port, "\0\1\2garbage\r\n\r\n")[0], 200)

            for options, status in (({"origin": "http://evil.example"}, 403), ({"origin": "null"}, 403), ({"host": "evil.example"}, 403),
                                    ({"subprotocol": None}, 400), ({"subprotocol": "other"}, 400)):
                with self.subTest(options=options), self.assertRaises(Refused) as refused:
                    Viewer(port, **options)
                self.assertEqual(refused.exception.status, status)

            with Viewer(port, origin=f"http://localhost:{port}") as viewer:
                viewer.begin("/console")
                viewer.send('{"op":"subscribe","subscriptions":[{"id":1,"channelId":999}]}')
                viewer.send("nonsense")
                viewer.send(b"\1\2\3", opcode=2)
                told = []
                while len(told) < 3:
                    message = viewer.receive()
                    if isinstance(message, dict) and message["op"] == "status":
                        told.append(message["message"])
                self.assertIn("there is no channel 999", told[0])

            with Viewer(port) as other, Viewer(port) as huge:
                other.begin("/console")
                huge.begin("/console")
                huge.send(b'"' + (64 * 1024 - 2) * b"x" + b'"')
                self.assertIn("not understood", huge.status(), "as long as a message may be")
                huge.send(b'"' + 1_000_000 * b"x" + b'"')
                with self.assertRaises(Closed) as closed:
                    while True:
                        huge.receive()
                self.assertEqual((closed.exception.code, str(closed.exception)), (1009, "a message longer than 64 kB"))
                self.assertEqual(json.loads(next(other.messages())[1])["state"], "searching", "others are not disturbed")
            with Viewer(port) as flood, self.assertRaises((Closed, ConnectionError)) as closed:
                for _ in range(10_000):
                    flood.send('{"op":"unsubscribe","subscriptionIds":[1]}')
                while True:
                    flood.receive()
            # frames that are no messages: pings, and fragments without content
            for first in (b"\x89", b"\x00"):
                with Viewer(port) as flood:
                    flood.begin("/console")
                    if first == b"\x00":
                        flood.socket.sendall(b"\x01\x80" + bytes(4))
                    self.assertLess(taken_of(flood.socket, first + b"\x80" + bytes(4), 4), 3_000_000, "bytes, of which most wait in buffers")
            # connections that ask for nothing keep nobody out
            idle = [socket.create_connection(("127.0.0.1", port)) for _ in range(300)]
            self.assertIn(get(port, "/")[0], (200, 503))
            for connection in idle:
                connection.close()
            with Viewer(port) as viewer:  # nobody else was disturbed
                viewer.begin("/console")
                self.assertEqual(json.loads(next(viewer.messages())[1])["state"], "searching")
            self.assertLess(memory(console) - before, 30, f"MB; {closed.exception}")
            console.signal(signal.SIGTERM)
            self.assertEqual(console.wait(20), 0, console.text())

    def test_a_port_that_is_taken_is_said(self):
        with Stage() as stage:
            _, port = start_console(stage)
            done = tenon("console", "--domain", stage.domain, "--port", port)
            self.assertEqual(done.returncode, 1)
            self.assertRegex(done.stderr, rf"^tenon-console: port {port} of 127\.0\.0\.1: .*; name another one with --port")


def pass_of(console):
    """What the gateway printed for its user alone."""
    return re.search(r"#pass=(\w+)$", console.wait_for("#pass="))[1]


def with_signals(stage):
    """A copy of the scenario `stacking` whose first two steps wait for signals, without a time limit."""
    folder = stage.out / "stacking"
    shutil.copytree(SOURCE / "scenarios" / "stacking", folder)
    waits = "".join(f"\n  - name: {name}\n    title: {{en: Wait, de: Warten}}\n    conditions: {{signal: {signal}}}\n" for name, signal in (("rung", "bell"), ("closed", "gripper_closed")))
    scenario = folder / "scenario.yaml"
    scenario.write_text(scenario.read_text(encoding="utf-8").replace("\nstates:\n", f"\nstates:{waits}\n"), encoding="utf-8")
    return folder


class Desk(unittest.TestCase):
    """What a page asks of the desk, asked by a program."""

    def test_a_viewer_is_told_the_signals_and_the_titles_of_the_scenario(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve(with_signals(stage), "--wait-for", "observer")
            _, port = start_console(stage)
            server.wait_for("run: running")
            told = {}
            with Viewer(port) as viewer:
                viewer.begin("SceneSignal", "SceneTitle")
                for topic, payload in viewer.messages():
                    told.setdefault(topic, []).append(bytes(payload))
                    if sum(map(len, told.values())) == 3:
                        break
            self.assertEqual([name in message for name, message in zip((b"bell\0", b"gripper_closed\0"), sorted(told["SceneSignal"], key=lambda message: message[4]))], [True, True])
            self.assertTrue(all(title.encode() in told["SceneTitle"][0] for title in ("Three blocks", "Drei Klötze")))

    def test_rights_come_from_the_key_and_the_server_answers(self):
        with Stage(lockstep=False) as stage:
            server, console, port = at_work(stage, "--role", "instructor")
            own = f"http://localhost:{port}"
            with Viewer(port, origin=own) as observer:
                observer.begin("/console")
                refused = observer.ask("deskCommand", words=["skip"])
                self.assertFalse(refused["accepted"])
                self.assertIn("an observer gives no commands", refused["text"])
                for key in ("", "1234", 64 * "a"):
                    refused = observer.ask("deskSit", role="instructor", name="Eve", key=key)
                    self.assertEqual((refused["accepted"], refused["role"]), (False, ""), key)
                self.assertIn("key", refused["text"])
                self.assertFalse(observer.ask("deskSit", role="admin", name="Eve", key=pass_of(console))["accepted"], "the pass is for one role")
            with Viewer(port, origin=own) as desk:
                desk.begin("/console")
                seated = desk.ask("deskSit", role="instructor", name="Ada", key=pass_of(console))
                self.assertEqual((seated["accepted"], seated["role"]), (True, "instructor"), seated)
                server.wait_for(r"Ada \(instructor\) has joined")
                self.assertTrue(desk.ask("deskCommand", words=["note", "mind the edge"])["accepted"])
                server.wait_for("Ada: mind the edge")
                refused = desk.ask("deskCommand", words=["goto", "nowhere"])
                self.assertIn("this scenario has no step 'nowhere'", refused["text"])
                self.assertIn("unknown command", desk.ask("deskCommand", words=["conquer"])["text"])
                self.assertTrue(desk.ask("deskCommand", words=["pause"])["accepted"])
                self.assertTrue(desk.ask("deskCommand", words=["resume"])["accepted"])
            server.wait_for(r"Ada \(instructor\) has left")
            key = (Path(os.environ["XDG_RUNTIME_DIR"]) / "tenon" / "key").read_text(encoding="utf-8").strip()
            with Viewer(port, origin=own) as desk:
                desk.begin("/console")
                self.assertTrue(desk.ask("deskSit", role="instructor", name="Bob", key=key)["accepted"], "the session's key, typed")

    def test_forces_are_frozen_and_a_person_is_removed(self):
        with Stage(lockstep=False) as stage:
            journal = stage.out / "journal.mcap"
            server = stage.serve("peg_and_box", "--wait-for", "right", "--journal", journal)
            console, port = start_console(stage, 0, "--role", "instructor")
            console.wait_for("joined session 'test'")
            trainee = stage.start("trainee", "--seed", 1)
            server.wait_for("run: running")
            with Viewer(port, origin=f"http://localhost:{port}") as desk:
                desk.begin("/console")
                refused = desk.ask("deskCommand", words=["freeze", "on"])
                self.assertEqual((refused["accepted"], refused["code"]), (False, "no_seat"))
                self.assertTrue(desk.ask("deskSit", role="instructor", name="Ada", key=pass_of(console))["accepted"])
                refused = desk.ask("deskCommand", words=["goto", "nowhere"])
                self.assertEqual((refused["accepted"], refused["code"]), (False, "unknown_name"))
                self.assertEqual(desk.ask("deskCommand", words=["resume"])["code"], "already")
                self.assertTrue(desk.ask("deskCommand", words=["freeze", "on"])["accepted"])
                server.wait_for("run: forces frozen")
                self.assertTrue(desk.ask("deskCommand", words=["skip"])["accepted"], "steps go on")
                server.wait_for("step skipped")
                self.assertTrue(desk.ask("deskCommand", words=["freeze", "off"])["accepted"])
                self.assertEqual(desk.ask("deskCommand", words=["kick", "nobody"])["code"], "unknown_name")
                self.assertTrue(desk.ask("deskCommand", words=["kick", "trainee"])["accepted"])
                server.wait_for(r"trainee \(trainee\) was removed by Ada")
                self.assertEqual(trainee.wait(60), 1, "it does not get its seat again")
                self.assertIn("you were removed from this session", trainee.text())
                self.assertTrue(desk.ask("deskCommand", words=["stop"])["accepted"])
                server.wait(30)
            again = tenon("resimulate", journal)
            self.assertEqual(again.returncode, 0, again.stdout + again.stderr)

    def test_a_page_from_elsewhere_looks_on_and_no_more(self):
        with Stage() as stage:
            console, port = start_console(stage, 0, "--role", "instructor", "--allow-origin", "https://viewer.example")
            with Viewer(port, origin="https://viewer.example") as viewer:
                viewer.begin("/console")
                for operation, values in (("deskSit", {"role": "instructor", "name": "Eve", "key": pass_of(console)}), ("deskCommand", {"words": ["emergency"]})):
                    refused = viewer.ask(operation, **values)
                    self.assertEqual((refused["accepted"], refused["text"]), (False, "pages from elsewhere may look on only"))

    def test_the_stop_is_raised_when_no_server_answers(self):
        with Stage(lockstep=False) as stage:
            server, console, port = at_work(stage)
            with Viewer(port, origin=f"http://localhost:{port}") as viewer:
                viewer.begin("/console")
                server.signal(signal.SIGSTOP)
                answer = viewer.ask("deskCommand", words=["emergency", "for a test"])
                server.signal(signal.SIGCONT)
                self.assertEqual((answer["accepted"], answer["code"]), (False, "stop_devices"), answer)
                self.assertRegex(answer["text"], "1 station has stopped; no server has answered")
                server.wait_for("emergency stop|engaged by console: for a test")
                self.assertTrue(viewer.ask("deskCommand", words=["emergency", "for a test"])["accepted"])

    def test_the_lobby_lists_the_sessions_that_there_are(self):
        with Stage() as stage:
            stage.serve(SCENARIO, "--wait-for", "right")
            _, port = start_console(stage, shown=[])
            with Viewer(port, path="/lobby") as lobby:
                lobby.begin("/lobby")
                listed = next(state for _, payload in lobby.messages() if (state := json.loads(payload)["sessions"]))
                self.assertEqual([(session["session"], session["title"]) for session in listed], [("test", "Peg and box")])
            with Viewer(port, path="/live/test") as viewer:
                viewer.begin("/console")
                states = (json.loads(payload)["state"] for _, payload in viewer.messages())
                self.assertIn("joined", states)
            with Viewer(port, path="/live/other") as viewer, self.assertRaises(Closed) as closed:
                viewer.receive()
            self.assertRegex(str(closed.exception), "^there is no such session")


@contextlib.contextmanager
def files_elsewhere(folder):
    """Another web server with the files of a folder: below /open/ pages from elsewhere may read them, in parts; below /whole/ as wholes alone; else they may not."""
    class Files(http.server.BaseHTTPRequestHandler):
        def do_GET(self):
            _, kind, name = self.path.split("/", 2)
            file = folder / name
            if not file.is_file():
                return self.send_error(404)
            data, part = file.read_bytes(), re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
            has_parts = part is not None and kind == "open"
            first, last = (int(part[1]), min(int(part[2]), len(data) - 1)) if has_parts else (0, len(data) - 1)
            self.send_response(206 if has_parts else 200)
            if has_parts:
                self.send_header("Content-Range", f"bytes {first}-{last}/{len(data)}")
            if kind in ("open", "whole"):
                self.send_header("Access-Control-Allow-Origin", "*")
            self.send_header("Content-Length", last + 1 - first)
            self.end_headers()
            if self.command == "GET":
                self.wfile.write(data[first:last + 1])

        do_HEAD = do_GET

        def log_message(self, *_):
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Files) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://localhost:{server.server_port}"
        finally:
            server.shutdown()


def targets(*places, buttons=4, seq=1):
    """Targets of hands, as docs/devices.md has them; a place is in the frame of its device."""
    return b"".join(struct.pack("<IHHII3d4dd", 0x444E4854, 1, 1, seq, buttons, *place, 1, 0, 0, 0, 0) for place in places)


class Hands(unittest.TestCase):
    """Who takes part at a browser, played by a program."""

    def test_a_hand_is_a_station_that_moves_is_armed_and_leaves_with_its_browser(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve(SCENARIO, "--wait-for", "right")
            console, port = start_console(stage)
            console.wait_for("joined session 'test'")
            own = f"http://localhost:{port}"
            with Viewer(port, origin=own) as page, Viewer(port, origin=own) as other:
                page.begin("/console"), other.begin("/console")
                taken = page.ask("handTake", role="trainee", name="Ada", hands=["right"])
                self.assertEqual((taken["op"], taken["accepted"], taken["role"]), ("handAnswer", True, "trainee"), taken)
                server.wait_for(r"Ada \(trainee\) has joined")
                view = View(page.hands())
                self.assertFalse(view.has(FORCES_ON), "nothing on the bus arms a hand")
                start, goal = view.hand, tuple(x + 0.05 for x in view.hand)
                for seq in range(1000):
                    # the arming button, then the way
                    place = tuple(a - b for a, b in zip(goal if view.has(ACTIVE) else view.hand, view.centre))
                    page.send(targets(place, buttons=4 | (2 if not view.has(FORCES_ON) and seq % 30 < 15 else 0), seq=seq), opcode=2)
                    view = View(page.hands())
                    if math.dist(view.hand, goal) < 1e-3:
                        break
                self.assertLess(math.dist(view.hand, goal), 1e-3, f"from {start}")

                # bad messages are refused with a reason, and the hand stays
                for bad in (b"", b"x", targets(goal)[:-1], targets(goal) * 2, targets((math.nan, 0, 0)), targets((1e9, 0, 0)), b"\0" * 80):
                    page.send(bad, opcode=2)
                    self.assertIn("no target of this viewer's hands", page.status())
                for request, reason in (({"role": "trainee", "hands": []}, "list 'hands'"), ({"role": "trainee", "hands": [7]}, "no text"),
                                        ({"role": "trainee", "hands": ["right"] * 3}, "list 'hands'")):
                    other.send(json.dumps({"op": "handTake", "id": 9, **request}))
                    self.assertIn(reason, other.status())
                for request, reason in (({"role": "observer", "hands": ["right"]}, "no seat for"), ({"role": "instructor", "hands": ["instructor"]}, "needs the key"),
                                        ({"role": "trainee", "hands": ["instructor"]}, "belongs to the instructor"),
                                        ({"role": "trainee", "hands": ["right"]}, "already moved by"), ({"role": "trainee", "hands": ["nowhere"]}, "no such hand")):
                    page.send(targets(place), opcode=2)  # it is still there
                    refused = other.ask("handTake", name="Eve", **request)
                    self.assertFalse(refused["accepted"], request)
                    self.assertIn(reason, refused["text"], request)
                console.wait_for("hand 'right' is asked for by a browser")
                other.send(targets((1.0, 0.0, 0.0)), opcode=2)  # who has no hand moves none
                page.send(targets(place), opcode=2)
                self.assertLess(math.dist(View(page.hands()).hand, goal), 2e-3)
            server.wait_for(r"Ada \(trainee\) has left")


@unittest.skipUnless((PAGE / "node_modules").exists(), "the console's page is not built: deploy/setup console")
class Player(unittest.TestCase):
    def test_a_place_of_a_recording_is_shown_as_it_was(self):
        self.run_with_page("play_recordings.mjs")

    def test_what_the_page_says_and_lists(self):
        self.run_with_page("page_modules.mjs")

    def run_with_page(self, script):
        done = subprocess.run(["node", TOOLS / script, SOURCE / "clients" / "console" / "web" / "src", PAGE], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)


class Browser:
    """Chromium with the page."""

    def __init__(self, **env):
        self.process = subprocess.Popen(["node", TOOLS / "console_page.mjs", shutil.which("chromium")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                        env={**os.environ, **env})
        self.problems = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.stdin.close()
        try:
            self.process.wait(60)
        except subprocess.TimeoutExpired:
            self.process.kill()
        self.process.stdout.close()

    def __call__(self, what, **values):
        self.process.stdin.write(json.dumps({"do": what, **values}) + "\n")
        self.process.stdin.flush()
        answer = json.loads(self.process.stdout.readline())
        self.problems += answer["problems"]
        if "problem" in answer:
            raise AssertionError(f"{what} {values}: {answer['problem']}; {self.problems}")
        return answer["value"]


def damaged_copies(recording):
    """One with a damaged chunk, one whose footer and one whose index point elsewhere, behind right checksums."""
    whole = recording.read_bytes()
    records, at = {}, 8
    while at + 9 <= len(whole) - 8:
        length = struct.unpack_from("<Q", whole, at + 1)[0]
        records.setdefault(whole[at], []).append((at, at + 9 + length))
        at += 9 + length
    footer, summary, index, chunk = records[2][0][0], records[15][0][1], records[8][1][0], records[6][1][1]

    def write(name, at, count=1, is_in_summary=True):
        content = bytearray(whole)
        content[at] = (content[at] + count) % 256
        if is_in_summary:
            struct.pack_into("<I", content, len(whole) - 12, zlib.crc32(content[summary:-12]))
        file = recording.parent / name
        file.write_bytes(content)
        return file

    return write("chunk.mcap", chunk - 1, is_in_summary=False), write("moved.mcap", footer + 9), write("wrong.mcap", index + 9 + 16)


@unittest.skipUnless(shutil.which("chromium") and (TOOLS / "node_modules").exists(), "no chromium or no playwright-core: deploy/setup test, and npm ci in tests/system/public_tools")
class Page(unittest.TestCase):
    def test_the_page_follows_a_session_and_a_gateway_that_was_killed(self):
        pictures = os.environ.get("TENON_PICTURES")
        with Stage() as stage, Browser() as browser:
            console, port = start_console(stage)
            browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="dark")
            browser("await", expression="document.querySelector('.cover').dataset.state === 'searching'")
            server = stage.serve(SCENARIO, "--wait-for", "right,observer")
            browser("await", expression="document.querySelector('.top .badge').textContent === 'Live'")
            self.assertEqual(browser("value", expression="document.title"), "Peg and box – Tenon")
            browser("await", expression="tenon.view.models >= 3 && tenon.view.pictures > 0")
            stage.start("trainee", "--seed", 1)
            # from the wire to what is drawn
            browser("await", expression="tenon.session.tick > 0 && tenon.view.positionOf('peg') !== undefined")
            browser("await", expression="(window.first ??= tenon.view.positionOf('peg')) && Math.hypot(...tenon.view.positionOf('peg').map((p, i) => p - window.first[i])) > 0.05")
            self.assertRegex(browser("value", expression="document.querySelector('.step-title').textContent"), r"\w+")
            browser("value", expression="(s => { s.value = 'de'; s.dispatchEvent(new Event('change')); })(document.querySelector('select'))")
            browser("await", expression="document.querySelector('.panel-steps h2').textContent === 'Schritte'")

            console.signal(signal.SIGKILL)
            console.wait()
            browser("await", expression="document.querySelector('.top .badge').textContent === 'Getrennt'")
            browser.problems.clear()  # the browser reports the connection that was refused
            start_console(stage, port)
            # a fast machine may be through the session by now: then the gateway searches for the next one
            is_searching = "document.querySelector('.cover').dataset.state === 'searching'"
            browser("await", expression=f"document.querySelector('.top .badge').textContent === 'Live' || {is_searching}")
            browser.problems.clear()
            self.assertEqual(server.wait(), 0, server.text())
            browser("await", expression=f"tenon.session.isOver || {is_searching}")
            if pictures:
                browser("picture", file=f"{pictures}/{SCENARIO}.png")
            self.assertEqual(browser.problems, [])

    def test_a_page_that_makes_room_for_newer_ones_says_so_nightly(self):
        with Stage() as stage, Browser() as browser:
            _, port = start_console(stage)
            browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="dark")
            browser("await", expression="document.querySelector('.cover').dataset.state === 'searching'")
            viewers = [Viewer(port) for _ in range(192)]
            browser("await", expression="document.querySelector('.cover').textContent.includes('a newer page came, and no more than 192')")
            for viewer in viewers:
                viewer.socket.close()
            browser("await", expression="document.querySelector('.cover').dataset.state === 'searching'")

    def test_an_instructor_skips_a_step_and_stops_the_forces(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server, console, port = at_work(stage, "--role", "instructor")
            # who has the plain address looks on
            browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="light")
            browser("await", expression="document.querySelector('.top .badge').textContent === 'Live'")
            self.assertTrue(browser("value", expression="document.querySelector('.desk').hidden"))

            browser("open", url=f"http://localhost:{port}/#pass={pass_of(console)}", width=1280, height=800, theme="light")
            browser("await", expression="document.querySelector('.desk')?.hidden === false")
            self.assertEqual(browser("value", expression="location.hash"), "", "the pass does not stay in the address")
            browser("value", expression="document.querySelector('[data-command=pause]').click()")
            browser("await", expression="tenon.session.run.phase === 2")
            # each block has the colour that its instruction names
            browser("await", expression="tenon.view.models >= 4")
            colors = "['red', 'green', 'blue'].map(name => [...tenon.view.parts.all.values()].find(p => p.object.name === name).material).map(m => m.vertexColors ? '' : m.color.getHexString()).join()"
            self.assertEqual(browser("value", expression=colors), "c0392b,27ae60,2980b9")
            # a space in a text is a space
            browser("type", selector=".desk input", text="mind the edge")
            browser("key", key="Enter")
            server.wait_for("mind the edge")
            self.assertEqual(browser("value", expression="tenon.session.standing.length"), 0)
            browser("value", expression="document.querySelector('[data-command=reset]').click()")
            permitted = "document.querySelector('dialog[open] .primary').ariaDisabled === null"
            self.assertTrue(browser("value", expression=permitted))
            browser("key", key="Space")
            browser("await", expression="document.querySelector('.strip').classList.contains('raised')")
            server.wait_for("pressed in the browser")
            browser("await", expression=f"!({permitted})")
            browser("key", key="Escape")
            # what the server refuses now is forbidden, with the reason, and not asked of it
            forbidden = "[...document.querySelectorAll('.desk > [aria-disabled=true]')].filter(b => !b.hidden).map(b => b.dataset.command)"
            browser("await", expression=f"{forbidden}.join() === 'resume,back,repeat,skip'")
            stands = "the emergency stop stands: clear it first"
            self.assertEqual(browser("value", expression="[document.querySelector('[data-command=skip]').title, document.querySelector('.desk .why').textContent]"), [stands, stands])
            browser("value", expression="document.querySelector('[data-command=skip]').click()")
            browser("await", expression=f"[...document.querySelectorAll('.notice.bad')].some(n => n.textContent === 'Skip: {stands}')")
            self.assertNotIn("'skip'", server.text())
            browser("value", expression="document.querySelector('.clear').click()")
            browser("await", expression="!document.querySelector('.strip').classList.contains('raised')")
            browser("await", expression=f"{forbidden}.length === 0 && document.querySelector('.desk .why').offsetHeight === 0")
            browser("value", expression="document.querySelector('[data-command=resume]').click()")
            browser("await", expression="tenon.session.run.phase === 1")
            # the lists change all the time, and neither a press nor the focus is lost
            row = ".steps li:last-child button.name"
            step, asked = f"document.querySelector('{row}')", "document.querySelector('dialog[open] .primary') !== null"
            browser("press", selector=row, milliseconds=400)
            browser("await", expression=asked)
            browser("key", key="Escape")
            browser("value", expression=f"{step}.focus()")
            changed = browser("value", expression="tenon.session.tick")
            browser("await", expression=f"tenon.session.tick > {changed} + 1000")
            self.assertTrue(browser("value", expression=f"document.activeElement === {step}"))
            browser("key", key="Enter")
            browser("await", expression=asked)
            browser("key", key="Escape")
            browser("value", expression="document.querySelector('[data-command=skip]').click()")
            browser("await", expression="[...document.querySelectorAll('.notice')].some(n => n.textContent === 'Skip: accepted')")
            server.wait_for("step skipped")
            self.assertEqual(browser.problems, [])

    def test_all_signals_and_the_title_of_a_scenario_are_told_and_a_session_elsewhere_is_said_to_be_so(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server = stage.serve(with_signals(stage), "--wait-for", "observer")
            console, port = start_console(stage, 0, "--role", "instructor")
            server.wait_for("run: running")
            browser("open", url=f"http://localhost:{port}/#pass={pass_of(console)}", width=1280, height=800, theme="light", language="de-DE")
            browser("await", expression="document.querySelector('.desk')?.hidden === false && document.querySelector('.title').textContent === 'Drei Klötze'")
            # one that the step waits for comes first, and says so
            select = "document.querySelector('.desk .rows select[aria-label=Signal]')"
            options = f"[...{select}.options].map(option => option.textContent).join()"
            browser("await", expression=f"{options} === 'bell (erwartet),gripper closed'")
            browser("value", expression=f"{select}.value = 'bell', document.querySelector('.desk .rows [data-command=signal]').click()")
            browser("await", expression="[...document.querySelectorAll('.notice.good')].some(n => n.textContent === 'Signal senden: angenommen')")
            browser("await", expression=f"tenon.session.step.name === 'closed' && {options} === 'gripper closed (erwartet),bell'")
            browser("open", url=f"http://localhost:{port}/?session=monday", width=1280, height=800, theme="light")
            browser("await", expression="document.querySelector('.cover').dataset.state === 'elsewhere' && document.querySelector('.cover').textContent.includes('This console shows test, and nothing else')")
            browser("value", expression="document.querySelector('.cover a').click()")
            browser("await", expression="document.querySelector('.top .badge').textContent === 'Live' && document.querySelector('.title').textContent === 'Three blocks'")
            self.assertEqual(browser.problems, [])

    def test_a_stop_is_unconfirmed_while_the_gateway_hangs(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server, console, port = at_work(stage)
            for language, unconfirmed, confirmed in (("en-GB", "Stop not confirmed. Use the emergency stop switch at the device", "Emergency stop: confirmed"),
                                                     ("de-DE", "Halt nicht bestätigt. Benutze den Not-Halt-Schalter am Gerät", "Not-Halt: bestätigt")):
                browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="light", language=language)
                browser("await", expression="document.querySelector('.top .badge').textContent === 'Live' && tenon.session.run !== undefined")
                says = f"document.querySelector('.alarm[role=alert]').textContent.startsWith({json.dumps(unconfirmed)}) && document.querySelector('.alarm').offsetHeight > 0"
                self.assertFalse(browser("value", expression=says))
                console.signal(signal.SIGSTOP)
                browser("key", key="Space")
                browser("await", expression=says)
                console.signal(signal.SIGCONT)
                browser("await", expression=f"!document.body.classList.contains('unconfirmed') && [...document.querySelectorAll('.notice.good')].some(n => n.textContent === {json.dumps(confirmed)})")
                browser("await", expression="document.querySelector('.strip').classList.contains('raised')")
            server.wait_for("pressed in the browser")
            self.assertEqual(browser.problems, [])

    def test_nothing_is_claimed_of_the_stop_while_nothing_is_heard(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server, console, port = at_work(stage)
            strip, badge = "document.querySelector('.strip-text')", "document.querySelector('.top .badge').textContent"
            live, raised = f"{badge} === 'Live'", "document.querySelector('.strip').classList.contains('raised')"
            # also on a phone, where the strip says nothing while nothing is wrong
            unknown = f"{strip}.textContent.startsWith('Not known whether forces are stopped') && {strip}.offsetHeight > 0 && !({raised})"
            none = f"{strip}.textContent === 'No emergency stop active'"
            known = f"{strip}.textContent.includes('Last known: Emergency stop by')"
            browser("open", url=f"http://localhost:{port}/", width=390, height=844, theme="light")
            browser("await", expression=f"{live} && {none}")
            # a connection that is open and silent is given up
            console.signal(signal.SIGSTOP)
            browser("await", expression=f"{badge} === 'No data' && {unknown}")
            browser("await", expression=f"{badge} === 'Reconnecting' && {unknown}")
            console.signal(signal.SIGCONT)
            browser("await", expression=f"{live} && {none}")
            browser("key", key="Space")
            browser("await", expression=f"{raised} && [...document.querySelectorAll('.notice')].some(n => n.textContent === 'Emergency stop: confirmed')")
            console.signal(signal.SIGKILL)
            console.wait()
            browser("await", expression=f"{badge} === 'Reconnecting' && {unknown} && {known} && document.querySelector('.stop span').textContent === 'Emergency stop'")
            start_console(stage, port)
            browser("await", expression=f"{live} && {raised} && !({known})")
            browser.problems.clear()  # the browser reports the connections that were refused
            server.signal(signal.SIGKILL)
            browser("await", expression=f"document.querySelector('.cover').dataset.state === 'lost' && {unknown} && {known}")
            self.assertEqual(browser.problems, [])

    def test_a_hand_that_is_lost_with_the_gateway_is_offered_again(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server = stage.serve(without_timeouts(SCENARIO, stage.out), "--wait-for", "right")
            console, port = start_console(stage)
            console.wait_for("joined session 'test'")
            browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="light")
            browser("await", expression="tenon.view.models >= 3 && document.querySelector('.take')?.hidden === false")
            browser("sit down")
            server.wait_for("armed by the person at the station|run: running")
            # a short hang costs nothing: what the page would have sent meanwhile is not held against it
            console.signal(signal.SIGSTOP)
            time.sleep(3)  # shorter than a gateway that is given up
            console.signal(signal.SIGCONT)
            browser("await", expression="document.querySelector('.top .badge').textContent === 'Live' && tenon.part.hand !== undefined")
            console.signal(signal.SIGKILL)
            console.wait()
            offer = "document.querySelector('.notice[data-offer=\"hand\"]')"
            browser("await", expression=f"{offer}?.textContent.startsWith('You no longer move a hand: the connection to the gateway was lost')")
            browser.problems.clear()  # the browser reports the connections that were refused
            start_console(stage, port)
            browser("await", expression=f"{offer}.hidden === false && tenon.part.hand === undefined")

    def test_a_session_that_is_not_running_is_named_and_looked_for_nightly(self):
        with Stage() as stage, Browser() as browser:
            _, port = start_console(stage, shown=[])
            browser("open", url=f"http://localhost:{port}/?session=test", width=1280, height=800, theme="dark")
            browser("await", expression="document.querySelector('.cover h2')?.textContent === 'Session test is not running'")
            self.assertEqual(browser("value", expression="[document.querySelector('.cover a').getAttribute('href'), document.querySelector('.cover a').textContent]"), ["/", "All sessions"])
            stage.serve(SCENARIO, "--wait-for", "right")
            browser("await", expression="document.title === 'Peg and box – Tenon' && document.querySelector('.cover').hidden")
            self.assertEqual(browser.problems, [])

    def test_a_file_that_is_dropped_by_mistake_ends_no_session_nightly(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            _, console, port = at_work(stage, "--role", "instructor")
            browser("open", url=f"http://localhost:{port}/#pass={pass_of(console)}", width=1280, height=800, theme="light")
            browser("await", expression="document.querySelector('.desk')?.hidden === false")
            drop = "(data => { data.items.add(new File(['x'], '%s')); dispatchEvent(new DragEvent('drop', { dataTransfer: data })); })(new DataTransfer())"
            browser("value", expression=drop % "me.png")
            browser("await", expression="[...document.querySelectorAll('.notice.bad')].some(n => n.textContent.startsWith('me.png is no recording'))")
            browser("value", expression=drop % "monday.mcap")
            browser("await", expression="document.querySelector('dialog[open] h2')?.textContent === 'Leave the session?'")
            browser("key", key="Escape")
            browser("await", expression="document.querySelector('dialog[open]') === null")
            self.assertTrue(browser("value", expression="!document.querySelector('.desk').hidden && document.querySelector('.stop') !== null && tenon.player === undefined"))
            browser("value", expression=drop % "monday.mcap")
            browser("await", expression="document.querySelector('dialog[open] .primary') !== null")
            browser("value", expression="document.querySelector('dialog[open] .primary').click()")
            browser("await", expression="document.querySelector('.cover').dataset.state === 'file' && document.querySelector('.desk') === null")
            self.assertEqual(browser.problems, [])

    def test_where_site_data_is_blocked_there_is_a_stop_and_a_seat_nightly(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server, console, port = at_work(stage, "--role", "instructor")
            browser("open", url=f"http://localhost:{port}/#pass={pass_of(console)}", width=1280, height=800, theme="light", blocked=True)
            browser("await", expression="document.querySelector('.desk')?.hidden === false")
            browser("value", expression="document.querySelector('.stop').click()")
            server.wait_for("^engaged by somebody at the console: pressed in the browser|^engaged by console: pressed in the browser")
            browser("await", expression="document.querySelector('.strip').classList.contains('raised')")
            self.assertEqual(browser.problems, [])

    def test_who_has_left_the_seat_does_not_get_it_again_by_a_reload_nightly(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            _, console, port = at_work(stage, "--role", "instructor")
            browser("open", url=f"http://localhost:{port}/#pass={pass_of(console)}", width=1280, height=800, theme="light")
            seated = "document.querySelector('.desk')?.hidden === false"
            browser("await", expression=seated)
            browser("value", expression="location.reload()")
            browser("await", expression=f"{seated} && performance.getEntriesByType('navigation')[0].type === 'reload'")
            browser("value", expression="document.querySelector('.sit').click()")
            browser("await", expression="document.querySelector('.desk').hidden && sessionStorage.getItem('role') === null")
            browser("value", expression="window.isOld = true, location.reload()")
            browser("await", expression="window.isOld === undefined && document.querySelector('.top .badge').textContent === 'Live' && tenon.session.people.size > 0")
            self.assertTrue(browser("value", expression=f"!({seated}) && sessionStorage.getItem('role') === null"))
            self.assertEqual(browser.problems, [])

    def test_a_trainees_pass_does_not_hide_the_key_of_an_instructors_hand_nightly(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            _, console, port = at_work(stage, "--role", "trainee")
            browser("open", url=f"http://localhost:{port}/#pass={pass_of(console)}", width=1280, height=800, theme="light")
            browser("await", expression="document.querySelector('.take')?.hidden === false && tenon.session.sceneHands.size > 1")
            browser("value", expression="document.querySelector('.take').click()")
            browser("await", expression="document.querySelector('dialog[open] select') !== null")
            shown = "document.querySelector('dialog[open] input[type=password]').offsetHeight > 0"
            self.assertFalse(browser("value", expression=shown), "nobody elsewhere reaches this gateway")
            browser("value", expression="(s => { s.value = 'instructor'; s.dispatchEvent(new Event('change')); })(document.querySelector('dialog[open] select'))")
            self.assertTrue(browser("value", expression=shown))
            name = "document.getElementById(document.querySelector('dialog[open]').getAttribute('aria-labelledby')).textContent"
            self.assertEqual(browser("value", expression=name), browser("value", expression="document.querySelector('dialog[open] h2').textContent"))
            self.assertEqual(browser.problems, [])

    def test_a_stop_that_was_pressed_without_a_gateway_reaches_the_session_with_the_next_one(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server, console, port = at_work(stage)
            unconfirmed = "document.body.classList.contains('unconfirmed')"

            def press_and_lose(console):
                """The gateway hangs, the stop is pressed, the gateway is killed."""
                browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="light")
                browser("await", expression="document.querySelector('.top .badge').textContent === 'Live' && tenon.session.run !== undefined")
                browser("value", expression="(now => { Date.now = () => now + (window.later ?? 0); })(Date.now())")  # however long a gateway takes to start
                console.signal(signal.SIGSTOP)
                browser("key", key="Space")
                browser("await", expression=unconfirmed)
                console.signal(signal.SIGKILL)
                console.wait()
                browser("await", expression="document.querySelector('.top .badge').textContent === 'Reconnecting'")
                self.assertTrue(browser("value", expression=unconfirmed))

            # more than 10 s later it is not sent, and that is said
            press_and_lose(console)
            browser("value", expression="window.later = 10000")
            console, _ = start_console(stage, port)
            says = "document.querySelector('.alarm[role=alert]').textContent.startsWith({})"
            browser("await", expression=says.format("'The stop did not reach the session. Press again'"))
            browser("await", expression="document.querySelector('.top .badge').textContent === 'Live'")
            browser("value", expression="(s => { s.value = 'de'; s.dispatchEvent(new Event('change')); })(document.querySelector('select'))")
            browser("await", expression=says.format("'Der Halt kam nicht in der Sitzung an. Drück noch einmal'"))
            self.assertNotIn("engaged by", server.text())

            press_and_lose(console)
            console, _ = start_console(stage, port)
            server.wait_for("^engaged by console: pressed in the browser")
            server.wait_for("^run: emergency stop")
            browser("await", expression=f"!{unconfirmed} && document.querySelector('.strip').classList.contains('raised')")
            browser("await", expression="[...document.querySelectorAll('.notice.good')].some(n => n.textContent === 'Emergency stop: confirmed')")
            server.signal(signal.SIGTERM)

    def test_a_seat_that_the_server_has_ended_is_shown_as_lost(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server, console, port = at_work(stage, "--role", "instructor")
            browser("open", url=f"http://localhost:{port}/#pass={pass_of(console)}", width=1280, height=800, theme="light")
            browser("await", expression="document.querySelector('.desk')?.hidden === false")
            client = browser("value", expression="[...tenon.session.people.values()].find(({ name, alive }) => alive && name === 'somebody at the console').client_id")
            with Viewer(port, origin=f"http://localhost:{port}") as desk:
                desk.begin("/console")
                self.assertTrue(desk.ask("deskSit", role="instructor", name="Bob", key=pass_of(console))["accepted"])
                self.assertTrue(desk.ask("deskCommand", words=["kick", str(client)])["accepted"])
                browser("await", expression="document.querySelector('[data-offer=seat]')?.textContent.startsWith('Your role has been withdrawn: Bob has removed you')")
                self.assertTrue(browser("value", expression="document.querySelector('.desk').hidden && document.querySelector('.sit').textContent === 'Take a role'"))
                # who was removed comes back by a decision alone: with the key, and for all to see
                self.assertTrue(browser("value", expression="sessionStorage.getItem('role') === null && sessionStorage.getItem('pass') === null"))
                self.assertEqual(browser("value", expression="document.querySelector('[data-offer=seat] button').textContent"), "Got it")
                browser("value", expression="document.querySelector('[data-offer=seat] button').click()")
                self.assertTrue(browser("value", expression="document.querySelector('[data-offer=seat]') === null && document.querySelector('dialog[open]') === null"))
                browser("value", expression="document.querySelector('.sit').click()")
                browser("await", expression="document.querySelector('dialog[open] .removed')?.textContent.startsWith('You were removed from this session')")
                browser("value", expression="document.querySelector('dialog[open] .primary').click()")
                browser("await", expression="[...document.querySelectorAll('.notice.bad')].some(n => n.textContent.includes('needs the key of the session'))")
                browser("value", expression=f"document.querySelector('dialog[open] input[type=password]').value = '{pass_of(console)}', document.querySelector('dialog[open] .primary').click()")
                browser("await", expression="document.querySelector('.desk').hidden === false && document.querySelector('dialog[open]') === null")
                told = "tenon.session.events.filter(({ kind, text }) => ['join', 'leave'].includes(kind) && text.startsWith('somebody')).map(({ text }) => text.replace('somebody at the console (instructor) ', '')).join()"
                browser("await", expression=f"{told} === 'has joined,was removed by Bob,has joined'")
            self.assertEqual(browser.problems, [])

    def test_while_gateway_or_server_are_lost_one_notice_says_so_and_nothing_is_asked_of_them(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server = stage.serve(without_timeouts(SCENARIO, stage.out), "--wait-for", "right")
            console, port = start_console(stage, 0, "--role", "instructor")
            console.wait_for("joined session 'test'")
            badge, cover = "document.querySelector('.top .badge').textContent", "document.querySelector('.cover')"
            browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="light")
            browser("await", expression=f"{badge} === 'Live' && document.querySelector('.sit').hidden === false")
            # a message that is too long: the gateway says why it has closed the connection
            browser("value", expression="document.querySelector('.sit').click(), document.querySelector('dialog[open] input[type=password]').value = 'x'.repeat(70000), document.querySelector('dialog[open] .primary').click()")
            browser("await", expression=f"{cover}.textContent.includes('this page sent a message longer than 64 kB')")
            browser("await", expression=f"{badge} === 'Live' && {cover}.hidden")

            browser("open", url=f"http://localhost:{port}/#pass={pass_of(console)}", width=1280, height=800, theme="light")
            browser("await", expression="document.querySelector('.desk')?.hidden === false && tenon.view.models >= 3")
            browser("sit down")
            browser("await", expression="tenon.part.hand?.isOn === true")
            commands = "[...document.querySelectorAll('.desk > button[data-command]')].filter(b => !b.hidden)"
            browser("await", expression=f"{commands}.every(b => b.ariaDisabled === null)")
            console.signal(signal.SIGSTOP)
            browser("await", expression=f"{commands}.length > 4 && {commands}.every(b => b.ariaDisabled === 'true') && document.querySelector('.desk .why').textContent === 'nothing is heard of the gateway'")
            self.assertTrue(browser("value", expression="document.querySelector('.desk input').disabled && document.querySelector('.sit').ariaDisabled === 'true' && document.querySelector('.people button') === null"))
            self.assertTrue(browser("value", expression="[...document.querySelectorAll('.hand-tools button')].slice(0, 4).every(b => b.disabled) && document.querySelector('.stop').ariaDisabled === null"))
            console.signal(signal.SIGCONT)
            browser("await", expression=f"{badge} === 'Live' && {commands}.every(b => b.ariaDisabled === null) && !document.querySelector('.desk input').disabled")

            server.signal(signal.SIGKILL)
            browser("await", expression=f"{cover}.dataset.state === 'lost' && tenon.part.hand === undefined && document.querySelector('[data-offer=seat]') !== null")
            notices = "[...document.querySelectorAll('.notice')].filter(n => n.offsetHeight > 0).map(n => n.textContent)"
            take = "[document.querySelector('.take').ariaDisabled, document.querySelector('.take').title]"
            self.assertEqual(browser("value", expression=f"[{notices}, {take}]"), [[], ["true", "the server is gone"]])
            console.signal(signal.SIGKILL)
            browser("await", expression=f"{badge} === 'Reconnecting' && {cover}.dataset.state === 'reconnecting'")
            self.assertEqual(browser("value", expression=f"[{notices}, {take}]"), [[], ["true", "there is no connection to the gateway"]])
            browser("value", expression="document.querySelector('.take').click()")
            self.assertTrue(browser("value", expression="document.querySelector('dialog[open]') === null"))

    def test_a_mouse_mounts_the_first_part_and_the_session_resimulates(self):
        mouse_mounts(self, 1)

    def test_keys_and_a_gamepad_move_a_hand_and_a_stop_switches_it_off(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server = stage.serve(SCENARIO, "--wait-for", "right")
            console, port = start_console(stage)
            console.wait_for("joined session 'test'")
            browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="light")
            browser("await", expression="tenon.view.models >= 3 && !document.querySelector('.take').hidden")
            browser("value", expression="document.querySelector('.take').click(), document.querySelector('dialog[open] .primary').click()")
            browser("await", expression="document.querySelector('.lesson').offsetHeight > 0 && document.querySelector('.arm').offsetHeight > 0")
            beside = "document.querySelector('.lesson').getBoundingClientRect().left >= document.querySelector('.stage').getBoundingClientRect().right"
            self.assertTrue(browser("value", expression=beside), "it covers neither a part nor its target")
            browser("value", expression="document.querySelector('.lesson .primary').click()")
            # Enter is for what has the focus; only from the scene it switches the hand on
            browser("value", expression="(a => { a.href = '#'; document.body.append(a); a.textContent = 'elsewhere'; a.focus(); })(document.createElement('a'))")
            browser("key", key="Enter")
            self.assertEqual(browser("value", expression="tenon.part.hand.armUntil"), 0)
            browser("value", expression="tenon.view.canvas.focus()")
            browser("key", key="Enter")
            browser("await", expression="tenon.part.hand.isOn")
            height = "[...tenon.session.hands.values()][0].X_WH.p[2]"
            browser("value", expression=f"window.first = {height}")
            browser("value", expression="document.activeElement.blur()")
            browser("key down", key="ArrowUp")
            browser("await", expression=f"{height} > window.first + 0.02")
            browser("key up", key="ArrowUp")
            browser("value", expression=f"window.first = {height}")
            browser("value", expression="navigator.getGamepads = () => [{axes: [0, 1, 0, 0], buttons: []}]")
            browser("await", expression=f"{height} < window.first - 0.02")
            browser("value", expression="navigator.getGamepads = () => []")
            # help with the depth
            browser("key", key="d")
            browser("await", expression="Math.abs(tenon.part.hand.guide?.farther ?? 1) < 0.003 && !tenon.part.hand.isDeepening")
            # a button that is held by its key
            browser("value", expression="document.querySelector('.hand-tools button').focus()")
            browser("key down", key="Enter")
            browser("await", expression="Math.abs(tenon.part.hand.guide?.farther ?? 0) > 0.02")
            browser("key up", key="Enter")
            browser("value", expression="document.activeElement.blur()")
            browser("key", key="d")
            browser("await", expression="Math.abs(tenon.part.hand.guide?.farther ?? 1) < 0.003 && !tenon.part.hand.isDeepening")
            # a button that is held, and the release of which is not heard of
            browser("value", expression="document.querySelector('.hand-tools button').dispatchEvent(new PointerEvent('pointerdown'))")
            browser("await", expression="Math.abs(tenon.part.hand.guide?.farther ?? 0) > 0.02")
            browser("value", expression="dispatchEvent(new Event('blur')), window.place = undefined")
            rests = "(p => { const is = window.place === p; window.place = p; return is; })(tenon.part.hand.now?.hand.p.toArray().map(x => x.toFixed(4)).join())"
            browser("await", expression=rests)
            browser("key", key="Space")
            browser("await", expression="!tenon.part.hand.isOn && document.querySelector('.arm').hidden")
            server.wait_for("pressed in the browser")
            browser("value", expression="document.querySelector('.take').click()")
            server.wait_for(r"\(trainee\) has left")
            self.assertEqual(browser.problems, [])

    def test_a_finger_and_a_gamepad_move_a_hand_which_vibrates_on_contact(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            stage.serve(without_timeouts(SCENARIO, stage.out), "--wait-for", "right")
            console, port = start_console(stage)
            console.wait_for("joined session 'test'")
            browser("open", url=f"http://localhost:{port}/", width=390, height=844, theme="light", touch=True)
            browser("await", expression="tenon.view.models >= 3 && !document.querySelector('.take').hidden")
            browser("sit down")
            lesson = browser("value", expression="document.querySelector('.lesson').textContent")
            self.assertTrue("One finger" in lesson and "Two fingers" in lesson and "Ctrl" not in lesson, lesson)
            browser("await", expression="tenon.part.hand.isOn && tenon.part.hand.now.isActive")
            box = browser("value", expression="(b => [b.left + b.width / 2, b.top + b.height / 2])(tenon.view.canvas.getBoundingClientRect())")
            height = "[...tenon.session.hands.values()][0].X_WH.p[2]"
            browser("value", expression=f"window.first = {height}")
            browser("touch", **{"from": [box[0], box[1] + 20], "to": [box[0], box[1] - 30]})
            browser("await", expression=f"{height} > window.first + 0.005")
            # a second finger: the two turn the view, and the hand stays
            browser("value", expression="window.before = [tenon.part.hand.targets[0].p.clone(), tenon.view.axes().away]")
            browser("touch", **{"from": box, "beside": [box[0] + 60, box[1]], "to": [box[0], box[1] + 60]})
            browser("await", expression="tenon.view.axes().away.angleTo(before[1]) > 0.05")
            self.assertLess(browser("value", expression="tenon.part.hand.targets[0].p.distanceTo(before[0])"), 0.002)
            # sticks as somebody moves them who follows the line of the way
            browser("value", expression="""(() => {
              window.felt = [];
              navigator.vibrate = (ms) => felt.push(ms);
              const bound = (x) => Math.max(-1, Math.min(1, x));
              const pad = (axes) => [{ axes, buttons: [], vibrationActuator: { playEffect: (kind, { strongMagnitude }) => Promise.resolve(felt.push([kind, strongMagnitude])) } }];
              navigator.getGamepads = () => {
                const guide = tenon.part.hand?.guide;
                if (guide === undefined) return pad([0, 0, 0, 0]);
                const [from, to] = [tenon.view.project(guide.from), tenon.view.project(guide.to)];
                return pad([bound((to.x - from.x) / 40), bound((to.y - from.y) / 40), 0, bound(-guide.farther / 0.02)]);
              };
            })()""")
            browser("await", expression="felt.some((ms) => ms > 0) && felt.some((effect) => effect[0] === 'dual-rumble' && effect[1] > 0)")
            browser("await", expression="tenon.session.step.name === 'insert_peg'")
            self.assertEqual(browser.problems, [])

    def test_no_serious_fault_of_accessibility_nightly(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server = stage.serve("stacking", "--wait-for", "right")
            _, lobby = start_console(stage, shown=[])
            console, port = start_console(stage, 0, "--role", "instructor")
            console.wait_for("joined session 'test'")
            stage.start("trainee", "--seed", 1)
            server.wait_for("run: running")
            with Viewer(port, origin=f"http://localhost:{port}") as desk:  # so that it lasts as long as this test
                desk.begin("/console")
                self.assertTrue(desk.ask("deskSit", role="instructor", name="Ada", key=pass_of(console))["accepted"])
                self.assertTrue(desk.ask("deskCommand", words=["pause"])["accepted"])
            for theme, width, language in (("dark", 1280, "de-DE"), ("light", 1280, "en-GB"), ("light", 390, "de-DE")):
                with self.subTest(theme=theme, width=width):
                    browser("open", url=f"http://localhost:{lobby}/", width=width, height=844, theme=theme, language=language)
                    browser("await", expression="document.querySelector('.session h2')?.textContent.length > 0")
                    self.assertEqual(browser("axe"), [], "the list of sessions")
                    browser("open", url=f"http://localhost:{port}/#pass={pass_of(console)}", width=width, height=844, theme=theme, language=language)
                    browser("await", expression="document.querySelector('.desk')?.hidden === false && document.querySelector('.step-title') !== null")
                    self.assertEqual(browser("axe"), [], "the session and the desk")
                    browser("value", expression="document.querySelector('.desk .more').open = true")
                    browser("await", expression="document.querySelector('.pairs .switch') !== null")
                    self.assertEqual(browser("axe"), [], "all of the desk")
                    browser("value", expression="document.querySelector('.desk .more').open = false, document.querySelector('.sit').click()")
                    browser("await", expression="document.querySelector('.desk').hidden")
                    browser("value", expression="document.querySelector('.sit').click()")
                    browser("await", expression="document.querySelector('dialog[open]') !== null")
                    self.assertEqual(browser("axe"), [], "the request for a seat")
            self.assertEqual(browser.problems, [])

    def test_a_recording_shows_its_parts_where_there_are_no_assets_and_in_public_viewers_nightly(self):
        with Stage() as stage, Browser() as browser:
            recording = recorded(self, stage)
            _, port = start_console(stage, 0, "--cache", stage.out / "empty", shown=[recording])
            browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="dark")
            browser("await", expression="tenon.view?.models >= 3")
            # the asset that is not there
            self.assertTrue(all("404" in problem for problem in browser.problems), browser.problems)
            browser.problems.clear()
            listed = subprocess.run(["node", TOOLS / "read_recording.mjs", recording], capture_output=True, text=True, check=True).stdout
            counts = {name: int(count) for name, count in map(str.split, listed.strip().splitlines())}
            self.assertGreater(counts["/tf"], 100, listed)
            self.assertEqual(counts["/tf"], counts["WorldFrame_30"])
            self.assertEqual(counts["/log"], counts["EventLog"])
            for topic in ("/scene/peg", "/scene/box", "/target"):
                self.assertIn(topic, counts)
            report = stage.out / "report"
            report.mkdir()
            done = tenon("report", recording, "-o", report, env={"TENON_CACHE": str(stage.out / "empty")})
            self.assertEqual(done.returncode, 0, done.stderr)
            browser("open", url=(report / "report.html").as_uri(), width=1280, height=800, theme="dark")
            browser("await", expression="globalThis.tenon?.isReady && tenon.view.models >= 3")

    def test_a_recording_is_played_without_a_server(self):
        with Stage() as stage, Browser() as browser:
            recording = recorded(self, stage)
            _, port = start_console(stage, shown=[recording])
            browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="dark")
            browser("await", expression="tenon.player !== undefined && tenon.session.steps.length === 2")
            browser("await", expression="tenon.view.models >= 3")
            end = browser("value", expression="Number(document.querySelector('.timeline').ariaValueMax ?? document.querySelector('.timeline').getAttribute('aria-valuemax'))")
            self.assertGreater(end, 5)
            places = {}
            for time in (0.2 * end, 0.95 * end, 0.2 * end):
                browser("value", expression=f"tenon.player.seek({time})")
                browser("await", expression=f"Math.abs(tenon.player.time - {time}) < 0.01 && Math.abs(tenon.player.recording.secondsOf(tenon.session.tick) - {time}) < 0.2")
                # what is drawn is where the recording has it
                state = "[...tenon.session.states.values()].find(s => tenon.session.objects.get(s.object_id).name === 'peg')"
                browser("await", expression=f"JSON.stringify(tenon.view.positionOf('peg')) === JSON.stringify(Array.from({state}?.X_WO.p ?? []))")
                places.setdefault(round(time, 3), []).append(browser("value", expression="tenon.view.positionOf('peg')"))
            first, again = places[round(0.2 * end, 3)]
            self.assertEqual(first, again, "a place is the same from both sides")
            self.assertNotEqual(first, places[round(0.95 * end, 3)][0])
            # while it plays, rows of events come before the one that has the focus
            browser("await", expression="(window.row = document.querySelector('.events button'))?.closest('li').dataset.tick <= tenon.session.tick")
            browser("value", expression="window.row.focus()")
            browser("key", key="Space")
            browser("await", expression="document.querySelector('.events button') !== window.row")
            self.assertTrue(browser("value", expression="document.activeElement === window.row"))
            # and a seek to a row of a list leaves the focus there
            browser("key", key="Space")
            slow = "(r => { const { seek } = Object.getPrototypeOf(r); r.seek = async (to) => { await new Promise(done => setTimeout(done, 300)); await seek.call(r, to); }; })(tenon.player.recording)"
            browser("value", expression=slow)
            for row in (".events li:nth-last-child(2) button", ".steps li:last-child button"):
                browser("value", expression="tenon.player.seek(1e9)")
                browser("await", expression=f"!tenon.player.isReading && tenon.session.isOver && (window.row = document.querySelector('{row}')) !== null")
                browser("value", expression="window.row.focus(); window.row.click()")
                browser("await", expression="!tenon.player.isReading && !tenon.session.isOver")
                browser("value", expression="new Promise(done => setTimeout(done, 300))")  # the lists are shown anew
                self.assertTrue(browser("value", expression="document.activeElement === window.row"), row)
            browser("value", expression=f"document.activeElement.blur(); delete tenon.player.recording.seek; tenon.player.seek({0.2 * end})")
            browser("key", key="Space")
            browser("await", expression=f"tenon.player.time > {0.2 * end + 0.5}")
            self.look(browser)
            self.beside(browser)
            # what cannot be read is said, and the next place can be
            fail_once = "((r, name) => { r[name] = () => { delete r[name]; return Promise.reject(new Error('the disk is gone')); }; })(tenon.player.recording, 'NAME')"
            is_said = "!document.querySelector('.cover').hidden && document.querySelector('.cover').textContent.includes('A part of it is damaged')"
            browser("value", expression=fail_once.replace("NAME", "advance"))
            browser("await", expression=is_said)
            self.assertFalse(browser("value", expression="tenon.player.isPlaying"))
            browser("key", key="Space")
            browser("await", expression="tenon.player.isPlaying && tenon.player.problem === undefined && document.querySelector('.cover').hidden")
            browser("value", expression=fail_once.replace("NAME", "seek") + "; tenon.player.seek(1)")
            browser("await", expression=is_said)
            browser("value", expression="tenon.player.seek(1e9)")
            browser("await", expression="tenon.session.isOver && document.querySelector('.cover').hidden")
            self.assertEqual(browser.problems, [])

            # what the device reaches is shown on request
            self.assertEqual(browser("value", expression="tenon.session.devices.get('right').radius"), 0.4)
            browser("value", expression="document.querySelector('.timeline').focus(), tenon.player.seek(3)")
            browser("await", expression="!tenon.player.isReading && !tenon.session.isOver && tenon.session.hands.size > 0")
            self.assertFalse(browser("value", expression="tenon.view.hasWorkspace"))
            browser("key", key="w")
            browser("await", expression="tenon.view.hasWorkspace && !document.querySelector('.key-workspace').hidden")
            browser("key", key="w")
            browser("await", expression="!tenon.view.hasWorkspace")
            self.assertEqual(browser.problems, [])
            self.elsewhere(stage, browser, recording)

            # files that are none, by their address
            cut = stage.out / "cut.mcap"
            cut.write_bytes(recording.read_bytes()[:100_000])
            with files_elsewhere(stage.out) as files:
                _, port = start_console(stage, 0, "--recordings-from", files, shown=[])
                for name, reason in (("cut", "cut.mcap cannot be playedIt was cut off before its end. tenon report cut.mcap shows"), ("journal", "It is the journal of a server")):
                    browser("open", url=f"http://localhost:{port}/?file={urllib.parse.quote(f'{files}/open/{name}.mcap', safe='')}", width=1280, height=800, theme="dark")
                    browser("await", expression=f"document.querySelector('.cover').textContent.includes('{reason}')")

    def test_a_file_that_cannot_be_played_is_named_at_the_start_nightly(self):
        with Stage() as stage:
            journal, recording, foreign = (stage.out / name for name in ("journal.mcap", "session.mcap", "foreign.mcap"))
            server = stage.serve(SCENARIO, "--wait-for", "right,recorder", "--journal", journal)
            recorder = stage.start("record", "-o", recording)
            stage.start("trainee", "--seed", 1)
            self.assertEqual((server.wait(), recorder.wait()), (0, 0), server.text())
            foreign.write_bytes(b"no recording")
            cut, soon = stage.out / "cut.mcap", stage.out / "soon.mcap"
            whole = recording.read_bytes()
            cut.write_bytes(whole[:len(whole) * 2 // 3])
            soon.write_bytes(whole[:1000])
            chunk, moved, wrong = damaged_copies(recording)
            for file, reason in ((journal, f"is the journal of a server.*`tenon resimulate {journal}`"), (cut, f"was cut off.*`tenon report {cut}`"), (chunk, f"1 of its .* chunks are damaged.*`tenon report {chunk}`"),
                                 (moved, f"the summary at its end.*`tenon report {moved}`"), (wrong, f"1 of its .* chunks are damaged or not where its index says.*`tenon report {wrong}`"), (soon, "was cut off so soon"), (foreign, "is not a recording"), (stage.out / "none.mcap", "")):
                refused = tenon("console", file, "--port", 0)
                self.assertEqual(refused.returncode, 1, refused.stderr)
                self.assertRegex(refused.stderr, rf"^tenon-console: {file}: .*{reason}")
            refused = tenon("report", journal)
            self.assertEqual(refused.returncode, 1, refused.stdout)
            self.assertRegex(refused.stderr, f"^tenon-report: {journal}: is the journal of a server")

    def elsewhere(self, stage, browser, recording):
        """A recording by its address, of another server, which both the console and that server have to permit."""
        def open_page(port, address):
            browser("open", url=f"http://localhost:{port}/?file={urllib.parse.quote(address, safe='')}", width=1280, height=800, theme="dark")

        plays = "tenon.player !== undefined && tenon.session.steps.length === 2"
        with files_elsewhere(recording.parent) as files:
            _, permitted = start_console(stage, 0, "--recordings-from", files, shown=[])
            _, strict = start_console(stage, shown=[])
            for kind in ("open", "whole"):
                open_page(permitted, f"{files}/{kind}/session.mcap")
                browser("await", expression=plays)
                browser("await", expression="document.querySelector('.title').textContent === 'Peg and box · session.mcap' && !document.querySelector('.all').hidden")
            for port, address, reason in ((permitted, f"{files}/closed/session.mcap", f"--recordings-from {files}"), (strict, f"{files}/open/session.mcap", f"--recordings-from {files}"),
                                          (permitted, f"{files}/open/none.mcap", "--recordings-from"), (permitted, "/none.mcap", "the server answers 404"), (permitted, "file:///etc/passwd", "is no address of a recording")):
                open_page(port, address)
                browser("await", expression=f"document.querySelector('.cover').dataset.state === 'file' && document.querySelector('.cover').textContent.includes('{reason}')")
                self.assertEqual(browser("value", expression="document.querySelector('.top .badge').textContent"), "Not readable")
        refused = tenon("console", "--recordings-from", "https://files.example/; script-src *", "--port", 0)
        self.assertEqual(refused.returncode, 1)
        self.assertIn("is no server's origin", refused.stderr)
        browser.problems.clear()  # the browser reports what it was asked elsewhere, and what it refused

    def beside(self, browser):
        """The same recording beside itself, and back to where this one was."""
        browser("value", expression="tenon.player.isPlaying && tenon.player.toggle()")
        time = browser("value", expression="tenon.player.time")
        choose = """fetch('/recording.mcap').then(answer => answer.blob()).then(bytes => {
          const [input, data] = [document.querySelector('.player input[type=file]'), new DataTransfer()];
          data.items.add(new File([bytes], 'second.mcap'));
          input.files = data.files;
          input.dispatchEvent(new Event('change'));
        })"""
        browser("value", expression=choose)
        players = "[...document.querySelectorAll('iframe')].map(frame => frame.contentWindow.tenon?.player)"
        browser("await", expression=f"{players}.length === 2 && {players}.every(player => player !== undefined && !player.isReading)")
        browser("value", expression=f"{players}[0].seek(1), {players}[0].toggle()")
        browser("await", expression=f"{players}.every(player => player.isPlaying && player.time > 1.5)")
        self.assertLess(browser("value", expression=f"(([a, b]) => Math.abs(a.time - b.time))({players})"), 1)
        browser("value", expression="document.querySelector('.beside .close').click()")
        browser("await", expression=f"document.querySelector('iframe') === null && Math.abs(tenon.player.time - {time}) < 0.01 && document.querySelector('.player') !== null")
        browser("value", expression=f"tenon.player.seek({time} - 1)")
        browser("await", expression=f"!tenon.player.isReading && Math.abs(tenon.player.recording.secondsOf(tenon.session.tick) - {time} + 1) < 0.2")
        browser("value", expression="tenon.player.toggle()")
        browser("await", expression=f"tenon.player.time > {time}")

    def parts_by_keys(self, browser):
        """Parts are listed, picked, hidden, shown alone, followed and measured without a pointer, and it is said."""
        active = "document.getElementById(document.activeElement.getAttribute('aria-activedescendant') ?? '')"
        hidden = "[...tenon.view.parts.hidden].map(id => tenon.session.objects.get(id).name)"
        said = "document.querySelector('.tools .unseen[role=status]').textContent"
        browser("key", key="p")
        browser("await", expression="document.activeElement.getAttribute('role') === 'listbox'")
        for key, name in (("Home", "Box"), ("ArrowDown", "Peg"), ("ArrowDown", "Peg"), ("ArrowUp", "Box"), ("End", "Peg")):
            browser("key", key=key)
            browser("await", expression=f"{active}?.querySelector('.name').textContent === '{name}' && {active}.ariaSelected === 'true' && document.querySelector('.toolrow b').textContent === '{name}'")
        browser("key", key="o")
        self.assertEqual(browser("value", expression=f"[{hidden}, {said}]"), [["peg"], "Peg is hidden"])
        browser("await", expression=f"{active}.textContent.includes('hidden')")
        browser("key", key="o")
        self.assertEqual(browser("value", expression=f"[{hidden}, {said}]"), [[], "Peg is shown"])
        browser("key", key="i")
        self.assertEqual(browser("value", expression="[...tenon.view.parts.all.values()].filter(p => p.group.visible).map(p => p.object.name)"), ["peg"])
        browser("key", key="a")
        self.assertEqual(browser("value", expression=f"[{hidden}, {said}]"), [[], "All parts are shown"])
        browser("key", key="v")
        browser("await", expression=f"document.querySelector('.toolrow [data-key=chase]').ariaPressed === 'true' && {said} === 'The view follows Peg'")
        # the distance of two parts says of what it is
        browser("key", key="b")
        browser("key", key="Enter")
        browser("key", key="Home")
        browser("key", key="Enter")
        measured = "document.querySelector('.toolrow[role=status]').textContent"
        browser("await", expression=f"/^[0-9.]+ mmPeg – Box: (nearest points of their drawn surfaces|their drawn surfaces meet)along x .* mm; centres of their boxes [0-9.]+ mm apart$/.test({measured})")
        browser("await", expression=f"{measured}.startsWith(document.querySelector('.label.measured')?.textContent ?? 'none')")
        browser("key", key="b")
        browser("key", key="Escape")
        browser("await", expression="document.activeElement.tagName === 'CANVAS' && document.querySelector('.partlist').hidden")
        browser("key", key="1")
        # all keys are in a dialog
        browser("key", key="?")
        browser("await", expression="document.querySelector('dialog[open] h2')?.textContent === 'Keys' && document.querySelectorAll('dialog[open] kbd').length > 20")
        browser("key", key="Escape")
        browser("await", expression="document.querySelector('dialog[open]') === null")
        # the cursor of the plots
        browser("value", expression="document.querySelector('.panel-plots .body').focus()")
        browser("key", key="ArrowLeft")
        browser("await", expression="[...document.querySelectorAll('.chart:not(.none) .u-cursor-x')].every(line => !line.classList.contains('u-off'))")
        browser("value", expression="document.activeElement.blur()")

    def look(self, browser):
        """Section, hiding, measuring and the choice of plots, by clicks and keys."""
        # where an object is, and still is 12 pixels beside
        place = browser("value", expression="""(() => {
          const isThere = (x, y) => document.elementFromPoint(x, y)?.tagName === "CANVAS" && tenon.view.pick(x, y) !== undefined;
          for (let y = 60; y < innerHeight; y += 10)
            for (let x = 60; x < innerWidth; x += 10) if ([0, 6, 12].every((beside) => isThere(x + beside, y))) return [x, y];
        })()""")
        browser("click", at=place)
        browser("await", expression="document.querySelectorAll('.toolrow b').length === 1")
        browser("key", key="i")
        self.assertEqual(browser("value", expression="[...tenon.view.parts.all.values()].filter(p => p.group.visible).length"), 1)
        browser("key", key="a")
        self.assertGreater(browser("value", expression="[...tenon.view.parts.all.values()].filter(p => p.group.visible).length"), 1)
        browser("key", key="b")
        for x in (0, 12):
            browser("click", at=[place[0] + x, place[1]])
        browser("await", expression="/^[0-9.]+ mm/.test(document.querySelector('.label.measured')?.textContent ?? '')")
        browser("key", key="b")
        # what is cut away is not there to be clicked
        before = browser("value", expression=f"tenon.view.pick({place[0]}, {place[1]})?.point.z")
        browser("key", key="s")
        browser("value", expression="document.querySelectorAll('.toolrow .word')[2].click(); (s => { s.value = 0; s.dispatchEvent(new Event('input')); })(document.querySelector('.toolrow input'))")
        whole = browser("value", expression=f"tenon.view.pick({place[0]}, {place[1]})?.point.z")
        self.assertAlmostEqual(whole, before, 6, "cut below all of it")
        browser("value", expression="(s => { s.value = 1; s.dispatchEvent(new Event('input')); })(document.querySelector('.toolrow input'))")
        self.assertIsNone(browser("value", expression=f"tenon.view.pick({place[0]}, {place[1]}) ?? null"))
        browser("key", key="s")
        for plot in ("gap", "compute", "age"):
            browser("value", expression=f"document.querySelector('[data-plot={plot}]').click()")
        browser("await", expression="document.querySelectorAll('.chart:not(.none) canvas').length >= 3")
        self.parts_by_keys(browser)
        # zoom and turn by keys
        off = "tenon.view.camera.position.clone().sub(tenon.view.controls.target)"
        browser("value", expression=f"window.before = {off}")
        browser("key", key="-")
        browser("await", expression=f"{off}.length() > 1.05 * before.length()")
        browser("key", key="+")
        browser("key", key="e")
        browser("await", expression=f"Math.abs({off}.length() / before.length() - 1) < 0.01 && {off}.angleTo(before) > 0.02 && Math.abs({off}.z - before.z) < 0.01")

    def test_the_lobby_leads_to_a_session(self):
        with Stage() as stage, Browser() as browser:
            stage.serve(SCENARIO, "--wait-for", "right")
            _, port = start_console(stage, shown=[])
            browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="dark")
            browser("await", expression="document.querySelector('.session h2')?.textContent === 'Peg and box'")
            browser("await", expression="document.querySelector('.session canvas')?.width > 100")
            # nobody is there whom it waits for: things are where they begin
            browser("await", expression="document.querySelector('.session .badge')?.textContent === 'Waiting for people'")
            browser("value", expression="document.querySelector('.session').click()")
            browser("await", expression="location.search === '?session=test' && window.tenon !== undefined && document.title === 'Peg and box – Tenon'")
            browser("await", expression="document.querySelector('.card .step-title')?.textContent === 'Peg and box' && tenon.view.models >= 3 && tenon.view.pictures > 0")
            self.assertTrue(browser("value", expression="tenon.session.isWaiting && [...tenon.view.parts.all.values()].some(part => part.object.name === 'peg' && part.group.visible)"))
            self.assertEqual(browser.problems, [])


@unittest.skipUnless(shutil.which("chromium") and (TOOLS / "node_modules").exists(), "no chromium or no playwright-core: deploy/setup test, and npm ci in tests/system/public_tools")
class Screen(unittest.TestCase):
    def test_on_a_wall_a_pixel_of_the_mouse_and_of_the_picture_is_one_of_the_screen(self):
        with Stage() as stage, Browser() as browser:
            _, port = start_console(stage)
            for size, zoom in (((1280, 800), 1), ((2560, 1440), 1.25), ((3840, 2160), 1.75)):
                with self.subTest(size=size):
                    browser("open", url=f"http://localhost:{port}/", width=size[0], height=size[1], theme="dark")
                    browser("await", expression="window.tenon?.view !== undefined")
                    self.assertEqual(browser("value", expression="Number(getComputedStyle(document.getElementById('app')).zoom)"), zoom)
                    moved, resolution = browser("value", expression="""(() => {
                      const { view } = tenon;
                      const from = view.controls.target.clone();
                      const to = from.clone().addScaledVector(view.axes().right, 100 * view.metresPerPixel(from));
                      return [view.project(to).x - view.project(from).x, view.canvas.width / view.canvas.getBoundingClientRect().width / view.pace.quality.ratio];
                    })()""")
                    self.assertAlmostEqual(moved, 100, delta=0.5)
                    self.assertAlmostEqual(resolution, 1, delta=0.01)
            self.assertEqual(browser.problems, [])

    def test_on_a_phone_the_stop_the_view_and_the_lists_are_within_reach_nightly(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            stage.serve(SCENARIO, "--wait-for", "right")
            console, port = start_console(stage)
            console.wait_for("joined session 'test'")
            for size in ((390, 844), (844, 390), (667, 375)):
                with self.subTest(size=size):
                    browser("open", url=f"http://localhost:{port}/", width=size[0], height=size[1], theme="light", touch=True)
                    browser("await", expression="window.tenon?.view?.models >= 3 && document.querySelector('.step-title') !== null")
                    for stage_of in ("looks on", "takes part"):
                        if stage_of == "takes part":
                            browser("sit down")
                            browser("await", expression="tenon.part.hand.isOn")
                        covered = browser("value", expression="""['.stop', '.tool:nth-child(1)', '.tool:nth-child(2)', '.step-title'].filter((name) => {
                          const element = document.querySelector(name);
                          const { left, top, width, height } = element.getBoundingClientRect();
                          return !element.contains(document.elementFromPoint(left + width / 2, top + height / 2));
                        })""")
                        self.assertEqual(covered, [], stage_of)
                    browser("value", expression="document.querySelector('.take').click()")
                    browser("await", expression="tenon.part.hand === undefined")
            browser("open", url=f"http://localhost:{port}/", width=390, height=844, theme="light", touch=True)
            browser("await", expression="window.tenon?.view?.models >= 3 && document.querySelector('.events li') !== null")
            browser("value", expression="[...document.querySelectorAll('.tabs button')].at(-1).click()")
            browser("await", expression="document.querySelector('.events li').offsetHeight > 0 && document.querySelector('.steps').offsetHeight === 0")
            self.assertEqual(browser.problems, [])


def without_timeouts(scenario, folder):
    """A copy in which no step runs out of time, as `tenon demo --you` makes it."""
    copy = folder / scenario
    shutil.copytree(SOURCE / "scenarios" / scenario, copy)
    file = copy / "scenario.yaml"
    file.write_text(re.sub(r"(?m)^\s*(timeout|on_timeout):.*\n", "", file.read_text(encoding="utf-8")), encoding="utf-8")
    return copy


def mouse_mounts(test, seed, scenario=SCENARIO, part="peg"):
    """A scripted mouse mounts the first part within two minutes; the journal of it re-simulates."""
    with Stage(lockstep=False) as stage, Browser() as browser:
        journal = stage.out / "journal.mcap"
        folder = without_timeouts(scenario, stage.out)
        server = stage.serve(folder, "--wait-for", "right", "--journal", journal)
        console, port = start_console(stage)
        console.wait_for("joined session 'test'")
        browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="dark")
        browser("await", expression="tenon.view.models >= 3 && !document.querySelector('.take').hidden")
        browser("sit down")
        server.wait_for("armed by the person at the station|run: running")
        done = browser("mount", seed=seed, seconds=120, steps=[f"take_{part}", f"{'insert' if part == 'peg' else 'mount'}_{part}"])
        if os.environ.get("TENON_MOUSE_LOG"):
            print(f"{scenario}, seed {seed}: {done.get('seconds')} s", *done["log"], sep="\n", flush=True)
        test.assertIsNotNone(done.get("seconds"), "\n".join(done["log"][-40:]))
        if scenario != SCENARIO:
            server.signal(signal.SIGTERM)  # after the first part the session would go on
            server.wait(60)
        else:
            test.assertEqual(server.wait(60), 0, server.text())
        again = tenon("resimulate", journal, folder, *COARSE)
        test.assertEqual(again.returncode, 0, again.stdout + again.stderr)
        test.assertEqual(final_hash(again.stdout), final_hash(server.text()))
        test.assertEqual(browser.problems, [])


@unittest.skipUnless(shutil.which("chromium") and (TOOLS / "node_modules").exists(), "no chromium or no playwright-core: deploy/setup test, and npm ci in tests/system/public_tools")
class DeskNightly(unittest.TestCase):
    def test_an_instructor_records_switches_a_pair_and_reads_german(self):
        with Stage(lockstep=False) as stage, Browser() as browser:
            server = stage.serve("stacking", "--wait-for", "right")
            folder = stage.out / "recordings"
            console, port = start_console(stage, 0, "--role", "instructor", "--recordings", folder)
            console.wait_for("joined session 'test'")
            stage.start("trainee", "--seed", 1)
            server.wait_for("run: running")
            browser("open", url=f"http://localhost:{port}/#pass={pass_of(console)}", width=1280, height=800, theme="light", language="de-DE")
            browser("await", expression="document.querySelector('.desk')?.hidden === false")
            browser("value", expression="document.querySelector('[data-command=\"record start\"]').click()")
            browser("await", expression="tenon.session.recorder?.recording === true && document.querySelector('[data-command=\"record start\"]').hidden")
            browser("value", expression="document.querySelector('.desk .more').open = true")
            switch = "[...document.querySelectorAll('.pairs li')].find(row => row.dataset.state !== 'off').querySelector('.switch')"
            browser("await", expression="document.querySelector('.pairs .switch') !== null")
            browser("value", expression=f"(window.row = {switch}).click()")
            server.wait_for("collision .* |: collision")
            browser("await", expression="window.row.getAttribute('aria-checked') === 'false'")
            # the server's English in this page's language
            browser("await", expression="[...document.querySelectorAll('.events li')].some(row => row.textContent.includes('Kollisionen'))")
            browser("value", expression="document.querySelector('[data-command=\"resume\"]').click()")
            browser("await", expression="[...document.querySelectorAll('.notice')].some(n => n.textContent === 'Weiter: das ist schon so')")
            browser("value", expression="document.querySelector('[data-command=\"freeze on\"]').click()")
            browser("await", expression="[...document.querySelectorAll('.badge')].some(b => b.textContent === 'Kräfte eingefroren')")
            browser("await", expression="document.querySelector('[data-command=\"freeze on\"]').hidden")
            titles = "[...tenon.session.objects.keys()].map(id => tenon.session.titleOf(id))"
            self.assertIn("Klotz", " ".join(browser("value", expression=titles)))
            browser("value", expression="document.querySelector('[data-command=\"record stop\"]').click()")
            browser("await", expression="[...document.querySelectorAll('.notice')].some(n => /Aufzeichnung beenden: .*\\.mcap/.test(n.textContent))")
            [file] = folder.iterdir()
            self.assertRegex(file.name, r"^test-\d{8}-\d{6}\.mcap$")
            self.assertGreater(file.stat().st_size, 10_000)
            self.assertEqual(browser.problems, [])
            # its parts are in it: other machines show them, too
            _, port = start_console(stage, 0, "--cache", stage.out / "empty", shown=[file])
            browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="light")
            browser("await", expression="tenon.view?.models >= 3 && !tenon.view.parts.areBoxes")
            self.assertTrue(all("404" in problem for problem in browser.problems), browser.problems)


@unittest.skipUnless(shutil.which("chromium") and (TOOLS / "node_modules").exists(), "no chromium or no playwright-core: deploy/setup test, and npm ci in tests/system/public_tools")
class MouseNightly(unittest.TestCase):
    def test_a_mouse_mounts_the_first_part(self):
        for seed in range(2, 6):
            with self.subTest(seed=seed):
                mouse_mounts(self, seed)

    def test_a_mouse_mounts_the_first_part_of_the_engine_bay(self):
        for seed in range(1, 6):
            with self.subTest(seed=seed):
                mouse_mounts(self, seed, "engine_bay", "control_box")


@unittest.skipUnless(shutil.which("chromium") and (TOOLS / "node_modules").exists(), "no chromium or no playwright-core: deploy/setup test, and npm ci in tests/system/public_tools")
class FollowNightly(unittest.TestCase):
    def test_the_page_follows_the_engine_bay_to_its_fifth_part(self):
        with Stage() as stage, Browser() as browser:
            server = stage.serve("engine_bay", "--wait-for", "right,left,instructor")
            console, port = start_console(stage)
            console.wait_for("joined session 'test'")
            browser("open", url=f"http://localhost:{port}/", width=1280, height=800, theme="dark")
            browser("await", expression="tenon.view.models >= 10 && tenon.view.pictures > 0")
            stage.start("trainee", "--seed", 1, "--device", "hug-sim", "--misplace-mount", 2)
            stage.start("instructor", "--seed", 1, "--device", "sigma7-sim")
            parts, end = [], time.monotonic() + 1500
            while server.popen.poll() is None and time.monotonic() < end:
                # what the list of steps says, beside what is drawn
                now = browser("value", expression="""(() => {
                    const row = document.querySelector('.panel-steps li.now');
                    const step = tenon.session.step;
                    const drawn = step && tenon.view.positionOf(tenon.session.objects.get(step.object_id)?.name ?? '');
                    return row && drawn ? [step.part, row.dataset.step, step.name] : null;
                })()""")
                if now is not None and now[0] not in parts:
                    parts.append(now[0])
                time.sleep(0.2)
            self.assertEqual(server.wait(60), 0, server.text()[-2000:])
            self.assertEqual(len(parts), 5, parts)
            browser("await", expression="tenon.session.isOver")
            self.assertEqual(browser("value", expression="document.querySelectorAll('.panel-steps li .badge.good').length"), 15)
            self.assertEqual(browser.problems, [])


if __name__ == "__main__":
    unittest.main()
