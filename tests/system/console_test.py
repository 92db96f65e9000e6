"""The console: what viewers of its WebSocket get of a session, what it refuses, and its page in a browser."""
import json
import math
import os
import re
import shutil
import signal
import subprocess
import unittest
from pathlib import Path

from stage import COARSE, Process, SOURCE, Stage, final_hash, tenon
from viewer import Closed, Refused, Viewer, frame_transforms, get, request

TOOLS = SOURCE / "tests" / "system" / "public_tools"
NAMES = ("foxglove.sdk.v1", "foxglove.websocket.v1")
SCENARIO = "peg_and_box"


def start_console(stage, port=0, **env):
    """The gateway of this session, and its port."""
    console = Process("console", [stage.session, "--domain", stage.domain, "--port", port], stage.out, env)
    stage.processes.append(console)
    line = console.wait_for(r"^console: http://localhost:\d+/$")
    return console, int(re.search(r":(\d+)/$", line)[1])


def memory(process):
    """Resident memory of a process, in MB."""
    status = Path(f"/proc/{process.popen.pid}/status").read_text(encoding="utf-8")
    return int(re.search(r"VmRSS:\s+(\d+)", status)[1]) / 1024


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
                pointer = frames.get("pointer")
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

            with Viewer(port) as huge, self.assertRaises((Closed, ConnectionError)):
                huge.send(b'"' + 1_000_000 * b"x" + b'"')
                while True:
                    huge.receive()
            with Viewer(port) as flood, self.assertRaises((Closed, ConnectionError)) as closed:
                for _ in range(10_000):
                    flood.send('{"op":"unsubscribe","subscriptionIds":[1]}')
                while True:
                    flood.receive()
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


class Browser:
    """Chromium with the page."""

    def __init__(self):
        self.process = subprocess.Popen(["node", TOOLS / "console_page.mjs", shutil.which("chromium")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
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
            browser("await", expression="document.querySelector('.top .badge').textContent === 'Verbinde neu'")
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


if __name__ == "__main__":
    unittest.main()
