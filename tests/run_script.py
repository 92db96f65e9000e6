#!/usr/bin/env python3
"""Runs the cases of one script of tests/system: `run_script.py NAME gate|nightly`. A class whose name ends with Nightly is nightly."""
import sys
import unittest

name, label = sys.argv[1:]
sys.path.insert(0, ".")
loaded = unittest.defaultTestLoader.loadTestsFromName(name)


def cases(suite):
    for entry in suite:
        if isinstance(entry, unittest.TestSuite):
            yield from cases(entry)
        elif type(entry).__name__.endswith("Nightly") == (label == "nightly"):
            yield entry


chosen = unittest.TestSuite(cases(loaded))
result = unittest.TextTestRunner(stream=sys.stdout, verbosity=2).run(chosen)
sys.exit(0 if result.wasSuccessful() and result.testsRun > 0 else 1)
