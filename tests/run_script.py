#!/usr/bin/env python3
"""Runs the cases of one script of tests/system: `run_script.py NAME gate|nightly`. A class whose name ends with Nightly is nightly, and
a case whose name ends with _nightly."""
import sys
import time
import unittest

name, label = sys.argv[1:]
sys.path.insert(0, ".")
loaded = unittest.defaultTestLoader.loadTestsFromName(name)


def is_nightly(case):
    return type(case).__name__.endswith("Nightly") or case.id().endswith("_nightly")


def cases(suite):
    for entry in suite:
        if isinstance(entry, unittest.TestSuite):
            yield from cases(entry)
        elif is_nightly(entry) == (label == "nightly"):
            yield entry


class TimedResult(unittest.TextTestResult):
    """Says after each case how long it took."""

    def startTest(self, test):
        self.began = time.monotonic()
        super().startTest(test)

    def stopTest(self, test):
        super().stopTest(test)
        self.stream.writeln(f"    {time.monotonic() - self.began:.1f} s")


chosen = unittest.TestSuite(cases(loaded))
result = unittest.TextTestRunner(stream=sys.stdout, verbosity=2, resultclass=TimedResult).run(chosen)
sys.exit(0 if result.wasSuccessful() and result.testsRun > 0 else 1)
