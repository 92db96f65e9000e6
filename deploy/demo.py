#!/usr/bin/env python3
"""`tenon demo`: a whole training session with simulated people, as separate processes over DDS on the loopback interface."""
import sys

sys.dont_write_bytecode = True  # an installation stays as it was installed
import interrupt  # noqa: F401 - before all others
import argparse
import functools
import itertools
import json
import os
import re
import shutil
import signal
import socket
import subprocess
import time
from pathlib import Path

import browser
import opened
from child import die_with_the_script
from demo_scene import hands_of, shipped_as
from number_option import between


# what it writes into its folder
OUTPUTS = ("session.mcap", "journal.mcap", "report.html", "summary.json", "scene.png", "serve.log", "record.log", "observer.log",
           "trainee.log", "instructor.log", "console.log")
CONSOLE_PORT = 8080


def arguments():
    parser = argparse.ArgumentParser(
        prog="tenon demo",
        description="Runs a whole session: a server, a trainee with two arms, an instructor, an observer and a recorder, each a "
                    "process of its own. People and devices are simulated. Exit code: 0 when every part was mounted within "
                    "tolerance, 1 when not, 2 for wrong usage.")
    parser.add_argument("--scenario", default="engine_bay", help="a shipped scenario's name or a path (default: %(default)s)")
    parser.add_argument("--out", metavar="DIR", type=Path,
                        help="where recording, report and logs go (default: out/demo; while that has an earlier demo, out/demo-2 and so on)")
    parser.add_argument("--overwrite", action="store_true", help="replace those of an earlier demo in that folder (default: out/demo)")
    parser.add_argument("--seed", type=between(int, 0, 10**18), default=1, help="of the simulated people's skills and errors (default: %(default)s)")
    parser.add_argument("--detail", type=between(float, 0, 1), default=1.0, help="mesh resolution of the scene, 0 to 1; 1: that of the paper, 1.8 million triangles (default: %(default)s)")
    parser.add_argument("--lockstep", action="store_true", help="ticks wait for each other instead of the clock: repeatable to the last bit")
    parser.add_argument("--headless", action="store_true", help="open nothing in a browser: neither the console at the start nor the report at the end")
    parser.add_argument("--no-console", action="store_true", help="do not serve the session to browsers")
    parser.add_argument("--workers", type=between(int, 1, 64), default=1, help="threads of the server that compute contacts (default: %(default)s)")
    parser.add_argument("--no-instructor", action="store_true", help="nobody corrects the misplaced mount: its step runs out of time")
    parser.add_argument("--device", default="sigma7-sim", help="the instructor's device (default: %(default)s)")
    parser.add_argument("--domain", type=between(int, 0, 230), default=100 + os.getpid() % 100, help="DDS domain (default: one that is likely free)")
    parser.add_argument("--you", choices=("trainee", "instructor"), help="take the place of the simulated one, with the mouse in the browser; no step runs out of time")
    parser.add_argument("--programs", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--scenarios", required=True, help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.you and (args.no_console or args.lockstep):
        parser.error("--you needs the console, and the pace of the clock: without --no-console and --lockstep")
    return args


class Stopped(Exception):
    """A signal asked the demo to end."""

    def __init__(self, number):
        super().__init__(number)
        self.number = number


def stop_at_signals():
    def stop(number, _frame):
        raise Stopped(number)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, stop)


def run(*words, **options):
    return subprocess.run(words, preexec_fn=die_with_the_script, check=False, **options)


class Program:
    """A program of the session, which writes to a log."""

    def __init__(self, name, words, log):
        self.name, self.log, self.read_until = name, log, 0
        shows_loading = name == "serve" and sys.stderr.isatty()
        with open(log, "wb") as out:
            self.process = subprocess.Popen(words, stdout=out, stderr=None if shows_loading else out, stdin=subprocess.DEVNULL,
                                            start_new_session=True, preexec_fn=die_with_the_script)

    def new_lines(self):
        """The lines that it has written since the last call."""
        with open(self.log, "rb") as file:
            file.seek(self.read_until)
            whole = file.read().rpartition(b"\n")[0:2]
        written = b"".join(whole)
        self.read_until += len(written)
        return written.decode("utf-8", "replace").splitlines()

    def lines(self):
        return self.log.read_text(encoding="utf-8", errors="replace").splitlines()

    def last_line(self):
        """What it said last; after an error of usage comes a hint to --help."""
        said = (line for line in reversed(self.lines()) if line.strip() and not line.startswith("Run with --help"))
        return next(said, "it said nothing")

    def is_running(self):
        return self.process.poll() is None

    def has_failed(self):
        """Whether it has ended and not as it should. The observer's exit code is that of the session, unless it names itself."""
        if self.process.poll() in (None, 0):
            return False
        return self.name != "observer" or self.process.returncode < 0 or self.last_line().startswith("tenon-observer:")


class Programs:
    """The programs of a session; none is left running at the end."""

    def __init__(self, args, out):
        self.args, self.out, self.folder = args, out, Path(args.programs)
        self.started = {}

    def start(self, name, *words):
        """Starts tenon-<name>, or a station of the role; its output goes to its log."""
        program = ["join", "--role", name] if name in ("trainee", "instructor") else [name]
        words = [self.folder / f"tenon-{program[0]}", *program[1:], *map(str, words), "--session", "demo", "--domain", str(self.args.domain)]
        if self.args.lockstep and name not in ("observer", "console"):
            words.append("--lockstep")
        self.started[name] = Program(name, words, self.out / f"{name}.log")
        return self.started[name]

    def stop(self):
        for number in (signal.SIGINT, signal.SIGKILL):
            alive = [program.process for program in self.started.values() if program.is_running()]
            for process in alive:
                process.send_signal(number)
            deadline = time.monotonic() + 10
            for process in alive:
                try:
                    process.wait(max(0.1, deadline - time.monotonic()))
                except subprocess.TimeoutExpired:
                    pass

    def failed(self):
        """Programs without which the session cannot continue, and that have failed."""
        return [program for program in self.started.values() if program.name not in ("serve", "console") and program.has_failed()]


def say(text):
    print(text, flush=True)


def wait_until(done, seconds=None, meanwhile=lambda: None):
    """Whether `done` came true in time."""
    deadline = None if seconds is None else time.monotonic() + seconds
    while not done():
        if deadline is not None and time.monotonic() > deadline:
            return False
        meanwhile()
        time.sleep(0.05)
    return True


def say_new_lines(program):
    for line in program.new_lines():
        say(line)


def has_opened(server):
    """Whether the session is open; says what the server says while it prepares the scene."""
    for line in server.new_lines():
        if opened.is_open(line):
            return True
        say(line)
    return False


def port_for_console():
    """The console's usual port; 0, any, when another program has it."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", CONSOLE_PORT))
            return CONSOLE_PORT
        except OSError:
            return 0


def open_in_browser(address):
    try:
        run("xdg-open", address, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    except FileNotFoundError:
        pass  # a machine without a desktop: the address was said


def has_desktop():
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def start_console(args, programs):
    """Serves the session to browsers, says where, and opens it where there is a desktop. The demo continues without it."""
    if not (programs.folder / "tenon-console").exists():
        return
    console = programs.start("console", "--port", port_for_console(), "--role", "instructor")
    said = []

    def has_said_where():
        said.extend(console.new_lines())
        return any(line.startswith("console:") for line in said) or not console.is_running()

    wait_until(has_said_where, 20)
    for line in said:
        say(line)
    addresses = [re.search(r"http\S+", line)[0] for line in said if "http" in line]
    if not addresses:
        say(f"the session cannot be seen in a browser: {console.last_line()}")
        return
    address = addresses[-1]  # with the pass, if there is one
    if args.you:
        plain, _, secret = (addresses[0] if args.you == "trainee" else address).partition("#")
        address = f"{plain}?you={args.you}" + ("#" + secret if secret else "")
        say(f"your place as {args.you}: {address}\nthe session begins when you have taken it")
    if not args.headless and has_desktop():
        open_in_browser(address)


def without_timeouts(scenario, folder):
    """A copy of a scenario below `folder` in which no step runs out of time."""
    source = scenario if scenario.is_dir() else scenario.parent
    copy = folder / "scenario_without_timeouts" / source.name
    shutil.rmtree(copy.parent, ignore_errors=True)
    shutil.copytree(source, copy)
    file = copy / ("scenario.yaml" if scenario.is_dir() else scenario.name)
    text = file.read_text(encoding="utf-8")
    file.write_text(re.sub(r"(?m)^\s*(timeout|on_timeout):.*\n", "", text), encoding="utf-8")
    return copy if scenario.is_dir() else file


def make_room(programs, roles):
    """A simulated person leaves when somebody at the console asks for a hand of it; `roles` of the hands by name."""
    console = programs.started.get("console")
    for line in console.new_lines() if console else []:
        asked = re.match(r"hand '(\S+)' is asked for by a browser", line)
        person = programs.started.get(roles.get(asked[1])) if asked else None
        if person and person.is_running():
            say(f"the simulated {person.name} makes room for you")
            person.process.send_signal(signal.SIGINT)


def session_result(server):
    """How the session ended, in the server's words; None when the server ended without saying it."""
    return next((line for line in server.lines() if re.search(r" after [0-9.]+ s; late ticks: ", line)), None)


def run_session(args, out, programs):
    scenario = Path(args.scenarios) / args.scenario
    scenario = scenario if scenario.exists() else Path(args.scenario)
    recording = out / "session.mcap"
    shipped = shipped_as(scenario, args.scenarios)
    hands = hands_of(scenario)
    has_instructor = not args.no_instructor and "instructor" in hands.values()
    trainees = [name for name, role in hands.items() if role == "trainee"]
    if args.you == "trainee":
        trainees = [name for name in trainees if name in ("right", "left")]  # nobody tracks who sits at a browser
    if args.you == "instructor" and not has_instructor:
        say(f"{scenario}: has no hand of an instructor: take part with --you trainee")
        return 1
    awaited = [*trainees, "recorder", "observer"]

    if not args.no_console:
        start_console(args, programs)
    if args.you:
        if "console" not in programs.started:
            say("the console is not built, so --you has no place for you")
            return 1
        scenario = without_timeouts(scenario, out)
    server = programs.start("serve", scenario, "--detail", args.detail, "--workers", args.workers, "--journal", out / "journal.mcap",
                            "--wait-for", ",".join(awaited + (["instructor"] if has_instructor else [])))
    is_open = False
    while not is_open and server.is_running():
        is_open = has_opened(server)
        time.sleep(0.05)
    if not is_open:
        say("the server did not start:\n" + "\n".join(server.lines()[-20:]))
        return 1

    programs.start("record", "-o", recording)
    observer = programs.start("observer")
    misplaced = ["--misplace-mount", 2] if shipped == "engine_bay" else []
    if args.you != "trainee":
        programs.start("trainee", "--device", "hug-sim", "--seed", args.seed, *misplaced)
    if has_instructor and args.you != "instructor":
        programs.start("instructor", "--device", args.device, "--seed", args.seed)

    show = functools.partial(say_new_lines, observer)

    def show_and_make_room():
        show()
        make_room(programs, hands)

    wait_until(lambda: not server.is_running() or programs.failed(), meanwhile=show_and_make_room)
    # a server that fails takes the others with it
    if not wait_until(lambda: not server.is_running(), 3, show):
        for program in programs.failed():
            say(f"{program.name} has ended, so the session is stopped: {program.last_line()}")
        return 1
    outcome = server.process.returncode
    others = [program for program in programs.started.values() if program.name not in ("serve", "console")]
    wait_until(lambda: not any(program.is_running() for program in others), 20, show)
    show()
    for program in others:
        if program.is_running():
            say(f"{program.name} did not end by itself")
        elif program.has_failed():
            say(f"{program.name} failed: {program.last_line()}")
            outcome = outcome or 1
    say(session_result(server) or f"the server ended without a result: {server.last_line()}")

    say("")
    report, page = run(programs.folder / "tenon-report", recording, "-o", out), out / "report.html"
    say(f"\nrecording: {recording}" + (f"\nreport:    {page}" if page.exists() else ""))
    say(picture_of(recording, out / "scene.png", programs))
    if page.exists() and not args.headless:
        open_in_browser(page)
    if args.lockstep:
        hashes = [line for line in server.lines() if "final state hash" in line]
        say(hashes[-1] if hashes else "final state hash: unknown")
    return 1 if outcome or report.returncode and not has_succeeded_without_page(out) else 0


def picture_of(recording, file, programs):
    """Makes a picture of how the session ended; where it is, or why there is none."""
    if browser.find_chromium() is None:
        return f"no picture: {browser.MISSING}"
    if not (programs.folder / "tenon-console").exists():
        return "no picture: the console is not built, and its page draws the pictures"
    made = run(sys.executable, Path(__file__).with_name("picture.py"), recording, "--at", "end", "-o", file, "--overwrite", "--programs", programs.folder,
               "--scenarios", programs.args.scenarios, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    return f"picture:   {file}" if made.returncode == 0 else f"no picture: {made.stderr.strip().removeprefix('tenon picture: ')}"


def has_succeeded_without_page(out):
    """Where the report's page is not built the summary alone is there; the session is none the worse."""
    summary = out / "summary.json"
    return not (out / "report.html").exists() and summary.exists() and json.loads(summary.read_text(encoding="utf-8"))["succeeded"]


def has_demo(folder):
    return any((folder / name).exists() for name in OUTPUTS)


def output_folder(args):
    """Where the files go: what was asked for, else a folder without an earlier demo."""
    first = Path("out/demo")
    if args.out or args.overwrite or not has_demo(first):
        return args.out or first
    return next(folder for number in itertools.count(2) if not has_demo(folder := Path(f"out/demo-{number}")))


def main():
    args = arguments()
    out = output_folder(args)
    try:
        out.mkdir(parents=True, exist_ok=True)
        for file in (out / name for name in OUTPUTS):
            if file.exists() and not args.overwrite:
                print(f"tenon demo: {file}: exists; --overwrite replaces it, --out DIR names another folder", file=sys.stderr)
                return 1
            file.unlink(missing_ok=True)
        (out / "serve.log").write_text("", encoding="utf-8")
    except OSError as problem:
        print(f"tenon demo: nothing can be written to {out} ({problem.strerror}): name a folder of yours with --out DIR", file=sys.stderr)
        return 1
    stop_at_signals()
    programs = Programs(args, out)
    try:
        return run_session(args, out, programs)
    except Stopped as stopped:
        say("\nstopped")
        return 128 + stopped.number
    except BrokenPipeError:  # nobody reads what is said any more, as in `tenon demo | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    finally:
        programs.stop()


if __name__ == "__main__":
    sys.exit(main())
