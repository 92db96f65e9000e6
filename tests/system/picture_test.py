"""Pictures of scenarios and recordings, drawn by the console's page."""
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import zlib
from pathlib import Path

from stage import COARSE, PROGRAMS, SOURCE, TENON, Stage, tenon

SIZE = (480, 300)


def pixels_of(png):
    """The pixels of a PNG as (red, green, blue), row by row."""
    width, height, depth, kind = struct.unpack(">IIBB", png[16:26])
    assert (depth, kind) in ((8, 2), (8, 6)), "eight bits a channel"
    channels = 3 if kind == 2 else 4
    packed, at = b"", 8
    while at < len(png):
        size, name = struct.unpack(">I4s", png[at:at + 8])
        packed += png[at + 8:at + 8 + size] if name == b"IDAT" else b""
        at += size + 12
    data, stride, rows, above = zlib.decompress(packed), width * channels, [], bytearray(width * channels)
    for y in range(height):
        kind, row = data[y * (stride + 1)], bytearray(data[y * (stride + 1) + 1:(y + 1) * (stride + 1)])
        for i in range(stride):
            left, up, corner = (row[i - channels], above[i], above[i - channels]) if i >= channels else (0, above[i], 0)
            nearest = min((left, up, corner), key=lambda known: abs(left + up - corner - known))
            row[i] = (row[i] + (0, left, up, (left + up) // 2, nearest)[kind]) & 255
        rows += [tuple(row[i:i + 3]) for i in range(0, stride, channels)]
        above = row
    return (width, height), rows


def orange(pixels):
    """Of the peg's colour, in light and in shade."""
    return sum(red > 90 and red > 1.25 * green and green > 1.3 * blue for red, green, blue in pixels)


class Drawn(unittest.TestCase):
    def setUp(self):
        self.folder = Path(self.enterContext(tempfile.TemporaryDirectory()))

    def picture(self, *words):
        file = self.folder / "picture.png"
        done = tenon("picture", *words, "-o", file, "--size", "x".join(map(str, SIZE)), "--overwrite")
        self.assertEqual((done.returncode, done.stdout.strip()), (0, str(file)), done.stderr)
        size, pixels = pixels_of(file.read_bytes())
        self.assertEqual(size, SIZE)
        return pixels


@unittest.skipUnless(shutil.which("chromium"), "no chromium: deploy/setup test")
class Picture(Drawn):
    def test_what_exists_is_kept(self):
        file = self.folder / "mine.png"
        file.write_bytes(b"mine")
        done = tenon("picture", "peg_and_box", "-o", file)
        self.assertEqual((done.returncode, file.read_bytes()), (1, b"mine"))
        self.assertIn("exists; --overwrite replaces it", done.stderr)

    def test_who_interrupts_it_sees_no_traceback(self):
        cache = self.folder / "cache"
        picture = subprocess.Popen([TENON, "picture", "engine_bay", "-o", self.folder / "mine.png"], start_new_session=True, text=True,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   env={**os.environ, "TENON_PROGRAMS": str(PROGRAMS), "TENON_CACHE": str(cache)})
        while not cache.exists() and picture.poll() is None:
            time.sleep(0.01)
        os.killpg(picture.pid, signal.SIGINT)  # as a terminal does
        errors = picture.communicate(timeout=60)[1]
        self.assertEqual(picture.returncode, 130, errors)
        self.assertNotIn("Traceback", errors)
        self.assertFalse((self.folder / "mine.png").exists())

    def test_what_cannot_be_drawn_is_said(self):
        none, cut = self.folder / "none.mcap", self.folder / "cut.mcap"
        none.write_bytes(b"no recording")
        cut.write_bytes(b"\x89MCAP0\r\n" + bytes(100))
        for file, says in (none, f"{re.escape(str(none))}: is not a recording .+"), (cut, f"{re.escape(str(cut))}: was cut off .+"):
            with self.subTest(file=file.name):
                done = tenon("picture", file, "-o", file.with_suffix(".png"))
                self.assertEqual(done.returncode, 1)
                self.assertRegex(done.stderr, rf"^tenon picture: {says}\n$")
                self.assertFalse(file.with_suffix(".png").exists())


@unittest.skipUnless(shutil.which("chromium"), "no chromium: deploy/setup test")
class PictureNightly(Drawn):
    def test_a_scenario_as_it_begins_and_a_recording_at_two_times(self):
        scenario = self.picture("peg_and_box", *COARSE)
        self.assertGreater(orange(scenario), 200, "the peg is there")
        with Stage() as stage:
            recording = stage.out / "session.mcap"
            server = stage.serve("peg_and_box", "--wait-for", "right,recorder")
            recorder = stage.start("record", "-o", recording)
            stage.start("trainee", "--seed", 1)
            self.assertEqual((server.wait(), recorder.wait()), (0, 0), server.text())
            start, end = self.picture(recording), self.picture(recording, "--at", "end")
        self.assertGreater(orange(start), 200)
        self.assertLess(orange(end), 0.9 * orange(start), "the peg is in its hole")


class WithoutBrowser(unittest.TestCase):
    def test_it_says_why_there_is_no_picture(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([sys.executable, SOURCE / "deploy" / "picture.py", "--programs", PROGRAMS, "--scenarios", SOURCE / "scenarios", "peg_and_box",
                                   "-o", f"{folder}/a.png"], capture_output=True, text=True, timeout=60, env={**os.environ, "PATH": folder}, check=False)
            self.assertEqual((done.returncode, os.listdir(folder)), (1, []))
            self.assertIn("there is no Chromium on this machine", done.stderr)


if __name__ == "__main__":
    unittest.main()
