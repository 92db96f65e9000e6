#!/usr/bin/env python3
"""`tenon doctor`: what this machine can and cannot do for Tenon, and what to do about it. Exit 1 if a session cannot run."""
import sys

sys.dont_write_bytecode = True  # an installation stays as it was installed
import interrupt  # noqa: F401 - before all others
import argparse
import os
import resource
import shutil
import subprocess
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
import doctor_link
from number_option import between


def read(path):
    try:
        return Path(path).read_text(encoding="utf-8").strip()
    except OSError:
        return ""


def check_system(_):
    name = next((line.split("=", 1)[1].strip('"') for line in read("/etc/os-release").splitlines() if line.startswith("PRETTY_NAME=")), "unknown")
    if "Debian GNU/Linux 12" in name:
        return "good", name, ""
    return "note", name, "Tenon is made and tested for Debian 12"


def check_cores(_):
    cores = os.cpu_count() or 1
    if cores >= 4:
        return "good", f"{cores} cores", ""
    return "note", f"{cores} cores", "server, stations and observers share them: expect late ticks; --lockstep is not affected"


PRIORITY = 75  # of a station's servo thread; the server's tick has 70


def check_real_time(_):
    limit = resource.getrlimit(resource.RLIMIT_RTPRIO)[1]
    if os.geteuid() == 0 or limit >= PRIORITY:
        return "good", "real-time priority is permitted", ""
    return "note", f"real-time priority up to {limit}, {PRIORITY} is wanted", \
        "add 'YOURNAME - rtprio 80' to /etc/security/limits.d/tenon.conf and log in again; without it Tenon runs too, but late ticks are likelier"


def check_memory_lock(_):
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[1]
    if os.geteuid() == 0 or limit == resource.RLIM_INFINITY or limit >= 4 << 30:
        return "good", "memory may be locked", ""
    return "note", f"{limit >> 20} MiB of memory may be locked", "add 'YOURNAME - memlock unlimited' to /etc/security/limits.d/tenon.conf and log in again"


def check_programs(args):
    wanted = ("serve", "join", "observer", "command", "record", "report", "rehearse", "parts", "check", "bake", "probe",
              "contact", "voxels", "console")
    missing = [f"tenon-{name}" for name in wanted if not os.access(Path(args.programs) / f"tenon-{name}", os.X_OK)]
    if not missing:
        return "good", f"{len(wanted)} programs are there", ""
    return "bad", f"missing: {', '.join(missing)}", "install the package again; in a source tree ./tenon demo builds them"


def check_bus(args):
    observer = Path(args.programs) / "tenon-observer"
    if not os.access(observer, os.X_OK):
        return "note", "not tried", "the observer is missing"
    try:
        done = subprocess.run([observer, "--domain", "230", "--session", "of tenon doctor", "--wait", "1"], capture_output=True, text=True, timeout=30)
    except subprocess.TimeoutExpired:
        return "bad", "DDS hangs on this machine's network", "unset CYCLONEDDS_URI and try again"
    if "session" in (done.stdout + done.stderr).lower():
        return "good", "DDS works", ""
    lines = (done.stderr or done.stdout).strip().splitlines()
    return "bad", lines[-1] if lines else "DDS did not start", \
        "is the loopback interface up (ip link show lo)? are TENON_NETWORK or CYCLONEDDS_URI set to something else?"


def check_configuration(_):
    uri, network = os.environ.get("CYCLONEDDS_URI"), os.environ.get("TENON_NETWORK")
    if not uri and not network:
        return "good", "DDS uses Tenon's own loopback profile", ""
    if not uri:
        return "good", f"DDS uses the network '{network}' (TENON_NETWORK)", ""
    return "note", f"CYCLONEDDS_URI is set ({uri})", "Tenon follows it; unset it, or choose with --network or TENON_NETWORK what it is added to"


def check_disk(_):
    cache = Path(os.environ.get("TENON_CACHE") or Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tenon")
    place = next(folder for folder in (cache, *cache.parents) if folder.exists())
    free = shutil.disk_usage(place).free
    if not os.access(place, os.W_OK):
        return "bad", f"{place} cannot be written", "set TENON_CACHE to a folder of yours"
    if free < 2 << 30:
        return "note", f"{free >> 20} MiB free for the cache in {place}", "full-size scenes and recordings need about 2 GiB"
    return "good", f"{free >> 30} GiB free for the cache in {place}", ""


CHECKS = {
    "system": check_system,
    "processor": check_cores,
    "programs": check_programs,
    "real time": check_real_time,
    "memory": check_memory_lock,
    "bus": check_bus,
    "bus profile": check_configuration,
    "disk": check_disk,
}


def say(name, verdict, finding, advice):
    print(f"{verdict:5} {name:12} {finding}" + (f"\n{'':19}{advice}" if advice else ""), flush=True)
    return ("good", "note", "bad").index(verdict)


def main():
    parser = argparse.ArgumentParser(prog="tenon doctor", description=__doc__)
    parser.add_argument("--programs", required=True, help=argparse.SUPPRESS)
    way = parser.add_mutually_exclusive_group()
    way.add_argument("--peer", metavar="HOST", help="check the link to another machine, on which `tenon doctor --listen` runs")
    way.add_argument("--listen", action="store_true", help="answer the check of another machine, until Ctrl-C")
    parser.add_argument("--domain", type=int, choices=range(231), metavar="0..230", default=0, help="with --peer, --listen: the DDS domain, by which ports are chosen [0]")
    parser.add_argument("--seconds", type=between(float, 0.1, 3600), default=5.0, help="with --peer: how long delay and loss are measured [5]")
    args = parser.parse_args()
    if args.listen:
        return doctor_link.listen(args)
    if args.peer:
        return doctor_link.check_link(args, say)
    worst = 0
    for name, check in CHECKS.items():
        worst = max(worst, say(name, *check(args)))
    print(("All is well.", "Sessions run; the notes say what would make them better.", "Sessions cannot run yet: see what is 'bad'.")[worst])
    return 1 if worst == 2 else 0


if __name__ == "__main__":
    sys.exit(main())
