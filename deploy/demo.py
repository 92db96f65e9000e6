#!/usr/bin/env python3
"""`tenon demo`: a whole training session with simulated people, as separate processes on loopback DDS."""
import argparse
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path


def arguments():
    parser = argparse.ArgumentParser(
        prog="tenon demo",
        description="Runs a whole session: a server, a trainee with two arms, an instructor, an observer and a recorder, each a "
                    "process of its own. The people are simulated. Exit code 0 only if every part was mounted within tolerance.")
    parser.add_argument("--scenario", default="engine_bay", help="a shipped scenario's name or a path (default: %(default)s)")
    parser.add_argument("--out", metavar="DIR", help="where recording, report and logs go (default: out/demo)")
    parser.add_argument("--seed", type=int, default=1, help="who the simulated people are (default: %(default)s)")
    parser.add_argument("--detail", type=float, default=0.12, help="of the scene, 0 to 1; 1 is 1.8 million triangles (default: %(default)s)")
    parser.add_argument("--lockstep", action="store_true", help="ticks wait for each other instead of the clock: repeatable to the last bit")
    parser.add_argument("--headless", action="store_true", help="do not open the report in a browser at the end")
    parser.add_argument("--workers", type=int, default=1, help="threads of the server that compute contacts (default: %(default)s)")
    parser.add_argument("--no-instructor", action="store_true", help="nobody helps: the step that needs a push runs out of time")
    parser.add_argument("--device", default="sigma7-sim", help="the instructor's device (default: %(default)s)")
    parser.add_argument("--domain", type=int, default=100 + os.getpid() % 100, help="DDS domain (default: one that is likely free)")
    parser.add_argument("--programs", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--scenarios", required=True, help=argparse.SUPPRESS)
    return parser.parse_args()


class Cast:
    """The processes of a session; whatever happens, none stays behind."""

    def __init__(self, args, out):
        self.args, self.out = args, out
        self.programs = Path(args.programs)
        self.processes = {}

    def start(self, name, *words, show=False):
        log = open(self.out / f"{name}.log", "w", encoding="utf-8")
        pipe = subprocess.PIPE if show else log
        self.processes[name] = subprocess.Popen([self.programs / f"tenon-{name}", *map(str, words)], stdout=pipe,
                                                stderr=None if name == "serve" and sys.stderr.isatty() else log, text=True,
                                                start_new_session=True)
        return self.processes[name]

    def common(self):
        words = ["--session", "demo", "--domain", self.args.domain]
        return words + (["--lockstep"] if self.args.lockstep else [])

    def stop(self):
        for sign in (signal.SIGINT, signal.SIGKILL):
            alive = [process for process in self.processes.values() if process.poll() is None]
            for process in alive:
                process.send_signal(sign)
            deadline = time.monotonic() + 10
            for process in alive:
                try:
                    process.wait(max(0.1, deadline - time.monotonic()))
                except subprocess.TimeoutExpired:
                    pass

    def fallen(self):
        """Names of those that ended badly."""
        return [name for name, process in self.processes.items() if process.poll() not in (None, 0)]


def echo(process, keep):
    for line in process.stdout:
        print(line, end="", flush=True)
        keep.write(line)


def lines_until(process, needle, keep):
    """Reads a program's lines until one holds `needle`; False when it ended before."""
    for line in process.stdout:
        keep.write(line)
        keep.flush()
        if needle in line:
            return True
    return False


def say(text):
    print(text, flush=True)


def play(args, out, cast):
    scenario = Path(args.scenarios) / args.scenario
    scenario = scenario if scenario.exists() else Path(args.scenario)
    recording = out / "session.mcap"
    hands = "right,left,forearm,head" if args.scenario == "engine_bay" else "right"
    people = [hands, "recorder", "observer"] + ([] if args.no_instructor else ["instructor"])

    say("preparing the scene (the first time this takes a minute: parts are made and baked)")
    server = cast.start("serve", scenario, "--session", "demo", "--domain", args.domain, "--detail", args.detail,
                        "--wait-for", ",".join(people), "--workers", args.workers, "--journal", out / "journal.mcap",
                        *(["--lockstep"] if args.lockstep else []), show=True)
    server_log = open(out / "serve.log", "a", encoding="utf-8")
    if not lines_until(server, "is open", server_log):
        say(f"the server did not start; its last words:\n{(out / 'serve.log').read_text(encoding='utf-8')[-2000:]}")
        return 1
    threading.Thread(target=lines_until, args=(server, "\0", server_log), daemon=True).start()

    cast.start("record", "-o", recording, *cast.common())
    observer = cast.start("observer", "--session", "demo", "--domain", args.domain, show=True)
    watching = threading.Thread(target=echo, args=(observer, open(out / "observer.log", "w", encoding="utf-8")), daemon=True)
    watching.start()
    misplaced = ["--misplace-mount", 2] if scenario.name == "engine_bay" else []
    cast.start("trainee", "--device", "hug-sim", "--seed", args.seed, *misplaced, *cast.common())
    if not args.no_instructor:
        cast.start("instructor", "--device", args.device, "--seed", args.seed, *cast.common())

    outcome = server.wait()
    for name in ("record", "observer", "trainee", "instructor"):
        if name in cast.processes:
            try:
                cast.processes[name].wait(15)
            except subprocess.TimeoutExpired:
                say(f"{name} did not leave by itself")
    watching.join(5)
    if bad := [name for name in cast.fallen() if name not in ("serve", "observer")]:
        say(f"these programs ended badly: {', '.join(bad)} (see {out}/*.log)")
        outcome = outcome or 1

    say("")
    picture = [cast.programs / "tenon-parts", scenario.name, "--picture", out / "scene.png", "--detail", str(args.detail)]
    if subprocess.run(picture, capture_output=True).returncode != 0:
        say("no picture of the scene could be made")
    report = subprocess.run([cast.programs / "tenon-report", recording, "-o", out])
    say(f"\nrecording: {recording}\nreport:    {out / 'report.html'}")
    if not args.headless:
        subprocess.run(["xdg-open", out / "report.html"], stderr=subprocess.DEVNULL, check=False)
    if args.lockstep:
        last = [line for line in (out / "serve.log").read_text(encoding="utf-8").splitlines() if "final state hash" in line]
        say(last[-1] if last else "final state hash: unknown")
    return outcome or report.returncode


def main():
    args = arguments()
    out = Path(args.out or "out/demo")
    out.mkdir(parents=True, exist_ok=True)
    cast = Cast(args, out)
    try:
        return play(args, out, cast)
    except KeyboardInterrupt:
        say("\nstopped")
        return 130
    finally:
        cast.stop()


if __name__ == "__main__":
    sys.exit(main())
