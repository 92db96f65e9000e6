#!/usr/bin/env python3
"""`tenon demo`: a whole training session with simulated people, as separate processes over DDS on the loopback interface."""
import argparse
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

sys.dont_write_bytecode = True  # an installation stays as it was installed
from demo_scene import shipped_as, trainee_hands


# what it writes into its folder
OUTPUTS = ("session.mcap", "journal.mcap", "report.html", "summary.json", "scene.png", "serve.log", "record.log", "observer.log",
           "trainee.log", "instructor.log")


def between(kind, low, high):
    """A type of argparse: a number from `low` to `high`."""
    def number(text):
        try:
            value = kind(text)
        except ValueError:
            value = None
        if value is None or not low <= value <= high:
            raise argparse.ArgumentTypeError(f"'{text}' is not a number from {low} to {high}")
        return value
    return number


def arguments():
    parser = argparse.ArgumentParser(
        prog="tenon demo",
        description="Runs a whole session: a server, a trainee with two arms, an instructor, an observer and a recorder, each a "
                    "process of its own. People and devices are simulated. Exit code: 0 when every part was mounted within "
                    "tolerance, 1 when not, 2 for wrong usage.")
    parser.add_argument("--scenario", default="engine_bay", help="a shipped scenario's name or a path (default: %(default)s)")
    parser.add_argument("--out", metavar="DIR", default="out/demo",
                        help="where recording, report and logs go (default: %(default)s)")
    parser.add_argument("--overwrite", action="store_true", help="replace those of an earlier demo in that folder")
    parser.add_argument("--seed", type=between(int, 0, 2**64 - 1), default=1, help="of the simulated people's skills and errors (default: %(default)s)")
    parser.add_argument("--detail", type=between(float, 0, 1), default=0.12, help="of the scene, 0 to 1; 1 is 1.8 million triangles (default: %(default)s)")
    parser.add_argument("--lockstep", action="store_true", help="ticks wait for each other instead of the clock: repeatable to the last bit")
    parser.add_argument("--headless", action="store_true", help="do not open the report in a browser at the end")
    parser.add_argument("--workers", type=between(int, 1, 64), default=1, help="threads of the server that compute contacts (default: %(default)s)")
    parser.add_argument("--no-instructor", action="store_true", help="nobody corrects the misplaced mount: its step runs out of time")
    parser.add_argument("--device", default="sigma7-sim", help="the instructor's device (default: %(default)s)")
    parser.add_argument("--domain", type=between(int, 0, 230), default=100 + os.getpid() % 100, help="DDS domain (default: one that is likely free)")
    parser.add_argument("--programs", required=True, help=argparse.SUPPRESS)
    parser.add_argument("--scenarios", required=True, help=argparse.SUPPRESS)
    return parser.parse_args()


class Processes:
    """The programs of a session; none is left running at the end."""

    def __init__(self, args, out):
        self.args, self.out = args, out
        self.programs = Path(args.programs)
        self.running = {}

    def start(self, name, *words, piped=False):
        """Starts tenon-<name>; its output goes to its log, or its standard output to a pipe."""
        log = open(self.out / f"{name}.log", "w", encoding="utf-8")
        shows_loading = name == "serve" and sys.stderr.isatty()
        self.running[name] = subprocess.Popen([self.programs / f"tenon-{name}", *map(str, words)], stdout=subprocess.PIPE if piped else log,
                                              stderr=None if shows_loading else log, text=True, start_new_session=True)
        return self.running[name]

    def common(self):
        words = ["--session", "demo", "--domain", self.args.domain]
        return words + (["--lockstep"] if self.args.lockstep else [])

    def stop(self):
        for number in (signal.SIGINT, signal.SIGKILL):
            alive = [process for process in self.running.values() if process.poll() is None]
            for process in alive:
                process.send_signal(number)
            deadline = time.monotonic() + 10
            for process in alive:
                try:
                    process.wait(max(0.1, deadline - time.monotonic()))
                except subprocess.TimeoutExpired:
                    pass

    def failed(self):
        return [name for name, process in self.running.items() if process.poll() not in (None, 0)]


def echo(process, log):
    for line in process.stdout:
        print(line, end="", flush=True)
        log.write(line)


def log_until(process, text, log):
    """Logs a program's output up to the line that holds `text`; False when the program ended before."""
    for line in process.stdout:
        log.write(line)
        log.flush()
        if text in line:
            return True
    return False


def say(text):
    print(text, flush=True)


def run_session(args, out, processes):
    scenario = Path(args.scenarios) / args.scenario
    scenario = scenario if scenario.exists() else Path(args.scenario)
    recording = out / "session.mcap"
    shipped = shipped_as(scenario, args.scenarios)
    awaited = [*trainee_hands(scenario), "recorder", "observer"] + ([] if args.no_instructor else ["instructor"])

    say("preparing the scene (the first time this takes a minute: parts are made and baked)")
    server = processes.start("serve", scenario, "--session", "demo", "--domain", args.domain, "--detail", args.detail,
                             "--wait-for", ",".join(awaited), "--workers", args.workers, "--journal", out / "journal.mcap",
                             *(["--lockstep"] if args.lockstep else []), piped=True)
    server_log = open(out / "serve.log", "a", encoding="utf-8")
    if not log_until(server, "is open", server_log):
        say(f"the server did not start:\n{(out / 'serve.log').read_text(encoding='utf-8')[-2000:]}")
        return 1
    threading.Thread(target=log_until, args=(server, "\0", server_log), daemon=True).start()

    processes.start("record", "-o", recording, *processes.common())
    observer = processes.start("observer", "--session", "demo", "--domain", args.domain, piped=True)
    watching = threading.Thread(target=echo, args=(observer, open(out / "observer.log", "w", encoding="utf-8")), daemon=True)
    watching.start()
    misplaced = ["--misplace-mount", 2] if shipped == "engine_bay" else []
    processes.start("trainee", "--device", "hug-sim", "--seed", args.seed, *misplaced, *processes.common())
    if not args.no_instructor:
        processes.start("instructor", "--device", args.device, "--seed", args.seed, *processes.common())

    outcome = server.wait()
    for name in ("record", "observer", "trainee", "instructor"):
        if name in processes.running:
            try:
                processes.running[name].wait(15)
            except subprocess.TimeoutExpired:
                say(f"{name} did not end by itself")
    watching.join(5)
    if failed := [name for name in processes.failed() if name not in ("serve", "observer")]:
        say(f"these programs failed: {', '.join(failed)} (see {out}/*.log)")
        outcome = outcome or 1

    say("")
    if shipped is None:
        say("no picture: those of the shipped scenarios only can be drawn")
    elif subprocess.run([processes.programs / "tenon-parts", shipped, "--picture", out / "scene.png", "--detail", str(args.detail)],
                        capture_output=True).returncode != 0:
        say("no picture of the scene could be made")
    report = subprocess.run([processes.programs / "tenon-report", recording, "-o", out])
    say(f"\nrecording: {recording}\nreport:    {out / 'report.html'}")
    if not args.headless:
        try:
            subprocess.run(["xdg-open", out / "report.html"], stderr=subprocess.DEVNULL, check=False)
        except FileNotFoundError:
            pass  # a machine without a desktop: the report's path was said
    if args.lockstep:
        hashes = [line for line in (out / "serve.log").read_text(encoding="utf-8").splitlines() if "final state hash" in line]
        say(hashes[-1] if hashes else "final state hash: unknown")
    return 1 if outcome or report.returncode else 0


def main():
    args = arguments()
    out = Path(args.out)
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
    processes = Processes(args, out)
    try:
        return run_session(args, out, processes)
    except KeyboardInterrupt:
        say("\nstopped")
        return 130
    finally:
        processes.stop()


if __name__ == "__main__":
    sys.exit(main())
