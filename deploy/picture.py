#!/usr/bin/env python3
"""`tenon picture`: a picture of a scenario or of a recording, drawn by the console's page in a headless browser."""
import sys

sys.dont_write_bytecode = True  # an installation stays as it was installed
import interrupt  # noqa: F401 - before all others
import argparse
import os
import re
import signal
import subprocess
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import browser
import opened
from child import die_with_the_script
from number_option import between

LOADING = 1800  # [s] in which a server prepares a scene
DRAWING = 600  # [s] in which a page draws it, where there is no graphics hardware and much else to do
STATE = "document.body.dataset.picture || ''"  # of the page: empty until the picture is complete


def size(text):
    match = re.fullmatch(r"(\d{2,4})x(\d{2,4})", text)
    if not match:
        raise argparse.ArgumentTypeError(f"'{text}' is not WIDTHxHEIGHT in pixels, as 1600x1000")
    return int(match[1]), int(match[2])


def moment(text):
    if text not in ("start", "end") and not re.fullmatch(r"\d+(\.\d+)?", text):
        raise argparse.ArgumentTypeError(f"'{text}' is neither start nor end nor a number of seconds")
    return text


def arguments():
    parser = argparse.ArgumentParser(
        prog="tenon picture",
        description="Makes a picture of a scenario as it begins, or of a recording at any time. The console's page draws it, in a headless Chromium. "
                    "Exit code: 0 when the picture is there, 1 when it cannot be made, 2 for wrong usage.")
    parser.add_argument("what", metavar="SCENARIO|FILE.mcap", help="a shipped scenario's name, a scenario's folder, or a recording")
    parser.add_argument("-o", "--output", metavar="FILE.png", type=Path, help="default: its name, in this folder")
    parser.add_argument("--at", type=moment, default="start", help="of a recording: start, end, or seconds of the session (default: %(default)s)")
    parser.add_argument("--near", action="store_true", help="show the step's part and where it goes, not all of the scene")
    parser.add_argument("--size", type=size, default=(1600, 1000), metavar="WxH", help="in pixels (default: 1600x1000)")
    parser.add_argument("--dark", action="store_true", help="dark as the console's dark page")
    parser.add_argument("--detail", type=between(float, 0, 1), default=1.0, help="mesh resolution of a shipped scenario, 0 to 1 (default: %(default)s)")
    parser.add_argument("--overwrite", action="store_true", help="replace an output file that exists")
    parser.add_argument("--programs", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--scenarios", required=True, help=argparse.SUPPRESS)
    args = parser.parse_args()
    args.is_recording = args.what.endswith(".mcap")
    if not args.is_recording and args.at != "start":
        parser.error("--at is for recordings: a scenario alone has its start; `tenon demo --scenario NAME` makes a recording")
    return args


class Child:
    """A program that ends with this one; its lines are read until one says what is waited for."""

    def __init__(self, *words):
        self.process = subprocess.Popen([str(word) for word in words], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                        preexec_fn=die_with_the_script)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()

    def wait_for(self, pattern, seconds):
        """The match of the first line that has the pattern; what comes after it is not kept. Fails with the program's last words."""
        limit = threading.Timer(seconds, self.process.kill)
        limit.start()
        last = f"{self.process.args[0]} said nothing"
        try:
            for line in self.process.stdout:
                if match := re.search(pattern, line):
                    threading.Thread(target=self.process.stdout.read, daemon=True).start()
                    return match
                last = line.strip() or last
        finally:
            limit.cancel()
        raise RuntimeError(last.removeprefix(f"{Path(self.process.args[0]).name}: "))


def drawn(args, address):
    """The picture of the page at `address`."""
    options = [f"t={args.at}" if args.at != "start" else "", "near" if args.near else ""]
    query = "&".join(filter(None, ["picture", "drawing=full", *options]))
    with browser.Browser(browser.find_chromium(), *args.size, "dark" if args.dark else "light", preexec_fn=die_with_the_script) as page:
        page.open(f"{address}?{query}")
        end = time.monotonic() + DRAWING
        while (state := page.value(STATE)) != "ready":
            if state:
                raise RuntimeError(state)
            if time.monotonic() > end:
                raise RuntimeError(f"the page has not drawn it in {DRAWING} s")
            time.sleep(0.2)
        return page.picture()


def of_recording(args):
    with Child(Path(args.programs) / "tenon-console", args.what, "--port", 0) as console:
        return drawn(args, console.wait_for(r"http://\S+", 60)[0])


def of_scenario(args):
    scenario = Path(args.scenarios) / args.what
    session = ("--session", f"picture-{os.getpid()}", "--domain", 100 + os.getpid() % 100)
    server = (Path(args.programs) / "tenon-serve", scenario if scenario.exists() else args.what, "--detail", args.detail, "--wait-for", "observer", *session)
    with Child(*server) as serve:
        serve.wait_for(opened.LINE, LOADING)
        with Child(Path(args.programs) / "tenon-console", session[1], "--domain", session[3], "--port", 0) as console:
            return drawn(args, console.wait_for(r"http://\S+", 60)[0])


def check_output(out, may_overwrite):
    """Fails before anything is drawn where the picture cannot be written."""
    is_new = not out.exists()
    if not is_new and not may_overwrite:
        raise RuntimeError(f"{out}: exists; --overwrite replaces it, -o names another file")
    try:
        with open(out, "ab"):
            pass
        if is_new:
            out.unlink()
    except OSError as problem:
        raise RuntimeError(f"{out}: cannot be written ({problem.strerror}); -o names another file, in a folder that exists and is yours") from None


def main():
    args = arguments()
    out = args.output or Path(Path(args.what).stem or "scene").with_suffix(".png")
    try:
        check_output(out, args.overwrite)
        if browser.find_chromium() is None:
            raise RuntimeError(browser.MISSING)
        picture = of_recording(args) if args.is_recording else of_scenario(args)
        out.write_bytes(picture)
    except (RuntimeError, OSError) as problem:
        print(f"tenon picture: {problem}", file=sys.stderr)
        return 1
    print(out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
