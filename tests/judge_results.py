#!/usr/bin/env python3
"""Sums up the test results of the build folders given: prints what failed with its output and what was skipped with its reason, and
fails on either, unless tests/allowed_skips.txt lists the skip.

A folder holds ctest's `results.xml`, and in `results/` a file per GoogleTest suite, whose cases are counted one by one; of a
script (Python's unittest, verbose) the cases are counted from its output; anything else is one test.
"""
import re
import sys
import tempfile
import xml.etree.ElementTree as xml
from pathlib import Path

here = Path(__file__).resolve().parent
# a case of unittest's verbose output; what it prints itself may stand between the name and the result
CASE = re.compile(r"^(test_\w+) \(([\w.]+)\)(?:\n[^\n]*?)?? \.\.\. (?:.*?\n)*?.*?(ok|FAIL|ERROR|skipped '[^\n]*')$", re.M)


def allowed():
    lines = (here / "allowed_skips.txt").read_text(encoding="utf-8").splitlines()
    return [re.compile(line.split("#")[0].strip()) for line in lines if line.split("#")[0].strip()]


def cases_of(suite_file):
    """(name, 'passed' | 'failed' | 'skipped', text) of each case of a GoogleTest suite."""
    for case in xml.parse(suite_file).getroot().iter("testcase"):
        name = f"{case.get('classname')}.{case.get('name')}"
        failures = [failure.get("message") or failure.text or "" for failure in case.iter("failure")]
        skipped = case.find("skipped")
        if failures:
            yield name, "failed", "\n".join(failures)
        elif skipped is not None or case.get("result") == "skipped":
            lines = [line for line in ((skipped.get("message") if skipped is not None else "") or "").splitlines() if line.strip()]
            yield name, "skipped", lines[-1].strip() if lines else "no reason given"
        else:
            yield name, "passed", ""


def results_of(folder):
    for test in xml.parse(folder / "results.xml").getroot().iter("testcase"):
        name, output = test.get("name"), test.findtext("system-out") or ""
        good = test.get("status") == "run"
        suite = folder / "results" / f"{name}.xml"
        scripted = CASE.findall(output)
        if suite.exists():
            cases = list(cases_of(suite))
            yield from cases
            if not good and not any(verdict == "failed" for _, verdict, _ in cases):
                yield name, "failed", output[-6000:]
            if good and not cases:
                yield name, "failed", "the suite ran no case"
        elif scripted:
            for case, where, verdict in scripted:
                kind = {"ok": "passed", "FAIL": "failed", "ERROR": "failed"}.get(verdict, "skipped")
                yield f"{name}.{case}", kind, verdict if kind == "skipped" else ""
            if not good:
                yield name, "failed", output[-6000:]
        elif test.get("status") in ("notrun", "disabled") or test.find("skipped") is not None:
            yield name, "skipped", "not run"
        else:
            yield name, "passed" if good else "failed", "" if good else output[-6000:]


def judge(folders, patterns, show=print):
    counts, faults = {"passed": 0, "failed": 0, "skipped": 0}, []
    for folder in map(Path, folders):
        for name, verdict, text in results_of(folder):
            name = f"{folder.name}: {name}"
            if verdict == "skipped":
                show(f"skipped: {name}: {text}")
                if not any(pattern.fullmatch(name) for pattern in patterns):
                    faults.append(f"skipped, and tests/allowed_skips.txt does not allow it: {name}")
            if verdict == "failed":
                show(f"---- failed: {name}\n{text}")
                faults.append(f"failed: {name}")
            counts[verdict] += 1
    counts["failed"] = len(faults)
    for fault in faults:
        show(fault)
    show(f"{counts['passed']} passed, {counts['failed']} failed, {counts['skipped']} skipped")
    return 1 if faults or counts["passed"] == 0 else 0


def self_test():
    """Each kind of bad result fails the run, and a good one does not."""
    def verdict(status, suite=None, output="", patterns=()):
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place) / "dev"
            (folder / "results").mkdir(parents=True)
            (folder / "results.xml").write_text(
                f'<testsuite><testcase name="room.Suite" status="{status}"><system-out>{output}</system-out></testcase>'
                '<testcase name="other" status="run"/></testsuite>', encoding="utf-8")
            if suite is not None:
                (folder / "results" / "room.Suite.xml").write_text(
                    f'<testsuites><testsuite name="Suite">{suite}</testsuite></testsuites>', encoding="utf-8")
            return judge([folder], [re.compile(p) for p in patterns], show=lambda text: None)

    good, skip = '<testcase classname="Suite" name="A" result="completed"/>', '<testcase classname="Suite" name="B" result="skipped"><skipped message="x"/></testcase>'
    bad = '<testcase classname="Suite" name="C" result="completed"><failure message="no"/></testcase>'
    script = "test_a (verbs.Verbs.test_a) ... ok\ntest_b (verbs.Verbs.test_b) ... "
    expected = [(verdict("run", good), 0), (verdict("run", good + skip), 1), (verdict("run", good + skip, patterns=["dev: Suite.B"]), 0),
                (verdict("fail", good + bad), 1), (verdict("fail", good), 1), (verdict("fail"), 1), (verdict("run", ""), 1),
                (verdict("run", output=script + "ok\n"), 0), (verdict("run", output=script + "skipped 'no'\n"), 1), (verdict("notrun"), 1)]
    if any(got != wanted for got, wanted in expected):
        print(f"the judge of results is blind: {expected}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(self_test() or judge(sys.argv[1:], allowed()))
