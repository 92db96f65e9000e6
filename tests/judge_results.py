#!/usr/bin/env python3
"""Sums up test results: prints what failed with its output and what was skipped with its reason, and fails on either,
unless tests/allowed_skips.txt allows the skip."""
import re
import sys
import xml.etree.ElementTree as xml
from pathlib import Path

here = Path(__file__).resolve().parent


def allowed():
    lines = (here / "allowed_skips.txt").read_text(encoding="utf-8").splitlines()
    return [re.compile(line.split("#")[0].strip()) for line in lines if line.split("#")[0].strip()]


def reason(output):
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    told = [line for line in lines if not line.startswith(("[", "Note:", "Running", "/"))]
    return told[-1] if told else "no reason given"


def main(files):
    passed, failed, skipped, forbidden = 0, [], [], []
    patterns = allowed()
    for file in files:
        preset = Path(file).parent.name
        for case in xml.parse(file).getroot().iter("testcase"):
            name, output = f"{preset}: {case.get('name')}", case.findtext("system-out") or ""
            if case.get("status") == "run":
                passed += 1
            elif case.get("status") == "notrun" or case.find("skipped") is not None:
                skipped.append(f"{name}: {reason(output)}")
                if not any(pattern.fullmatch(name) for pattern in patterns):
                    forbidden.append(name)
            else:
                failed.append(name)
                print(f"---- failed: {name}\n{output[-6000:]}")
    for line in skipped:
        print(f"skipped: {line}")
    for name in forbidden:
        print(f"skipped, and tests/allowed_skips.txt does not allow it: {name}")
    for name in failed:
        print(f"failed: {name}")
    print(f"{passed} passed, {len(failed) + len(forbidden)} failed, {len(skipped)} skipped")
    return 1 if failed or forbidden or passed == 0 else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
