#!/usr/bin/env python3
"""A whole session in one process, cut off after twelve seconds of its time: it says so, ends with exit code 1 and a state hash,
and a sanitizer, if the program was built with one, has nothing to report."""
import os
import re
import subprocess
import sys
from pathlib import Path

scenario = Path(__file__).resolve().parents[1] / "scenarios" / "peg_and_box"
program = Path(os.environ["TENON_PROGRAMS"]) / "tenon-rehearse"
done = subprocess.run([program, scenario, "--detail", "0.12", "--seconds", "12", "--workers", "2", "--quiet"], capture_output=True, text=True, check=False)
print(done.stdout, done.stderr)
faults = [fault for fault, there in (
    (f"exit code {done.returncode} instead of 1 (not everything was mounted)", done.returncode != 1),
    ("no state hash", not re.search(r"final state hash: [0-9a-f]{16}", done.stdout)),
    ("a sanitizer's report", re.search(r"Sanitizer|runtime error", done.stdout + done.stderr) is not None)) if there]
print(*faults, sep="\n")
sys.exit(1 if faults else 0)
