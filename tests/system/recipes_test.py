"""The recipes of CONTRIBUTING.md, carried out as they are written there, in a copy of the tree.

A block of code after a line that ends in "in `file`:" is that file; after "in `file`, after `text`:" it is put behind the line of the
file that has the text; a block of `sh` is run. In the gate only the text is checked: each recipe can be applied, and the tree has no new
fault of tests/architecture_test.py. Nightly each is built and its tests run.
"""
import os
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NOT_COPIED = shutil.ignore_patterns("build", "out", ".git", "node_modules", "__pycache__", "results")
PLACE = re.compile(r"[Ii]n\s+`([^`]+)`(?:,\s+(after|before)\s+`([^`]+)`)?:$")
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.S | re.M)


class Step:
    """One block: a file, lines to put into a file, or commands."""

    def __init__(self, language, text, said):
        self.language, self.text = language, text
        found = PLACE.search(" ".join(said.split()))
        self.file, self.where, self.anchor = found.groups() if found else (None, None, None)

    def apply(self, tree):
        """Changes a file of the tree; fails when the text does not say which, or its place is not one line."""
        if self.file is None:
            raise AssertionError(f"no line before this block says which file it belongs to:\n{self.text}")
        file = tree / self.file
        if self.anchor is None:
            if file.exists():
                raise AssertionError(f"{self.file} exists already, and the recipe does not say after which line its block goes")
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(self.text, encoding="utf-8")
            return
        lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
        places = [index for index, line in enumerate(lines) if self.anchor in line]
        if len(places) != 1:
            raise AssertionError(f"`{self.anchor}` is in {len(places)} lines of {self.file}, so the recipe cannot mean one")
        lines.insert(places[0] + (self.where == "after"), self.text)
        file.write_text("".join(lines), encoding="utf-8")

    def run(self, tree):
        ccache = {"CCACHE_BASEDIR": str(tree), "CCACHE_NOHASHDIR": "1"}
        done = subprocess.run(["bash", "-euo", "pipefail", "-c", self.text], cwd=tree, env={**os.environ, **ccache}, text=True,
                              stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        if done.returncode != 0:
            raise AssertionError(f"exit {done.returncode} of\n{self.text}\n{done.stdout[-8000:]}")
        return done.stdout


def recipes(text):
    """Title -> its steps, for each `## Add a ...`."""
    found = {}
    for part in re.split(r"^## (?=Add a )", text, flags=re.M)[1:]:
        title, body = part.split("\n", 1)
        body = re.split(r"^#{1,2} ", body, flags=re.M)[0]
        steps, last = [], 0
        for block in BLOCK.finditer(body):
            steps.append(Step(block.group(1), block.group(2), body[last: block.start()].rstrip()))
            last = block.end()
        found[title.strip()] = steps
    return found


RECIPES = recipes((ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))


def architecture_faults(tree):
    done = subprocess.run([sys.executable, "tests/architecture_test.py"], cwd=tree, text=True, stdout=subprocess.PIPE, check=False)
    return done.stdout.splitlines()[:-1]


class Copy(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory(prefix="tenon_recipe_")
        self.addCleanup(folder.cleanup)
        self.tree = Path(folder.name) / "tenon"
        shutil.copytree(ROOT, self.tree, ignore=NOT_COPIED)


class RecipesText(Copy):
    def test_there_are_three(self):
        self.assertEqual(list(RECIPES), ["Add a device", "Add a scenario", "Add a topic"])
        for title, steps in RECIPES.items():
            self.assertIn("sh", [step.language for step in steps], title)

    def test_each_can_be_applied_and_keeps_to_the_architecture(self):
        before = architecture_faults(self.tree)
        for title, steps in RECIPES.items():
            with self.subTest(title):
                for step in steps:
                    if step.language != "sh":
                        step.apply(self.tree)
        self.assertEqual([fault for fault in architecture_faults(self.tree) if fault not in before], [])

    def test_a_recipe_that_is_no_longer_true_fails(self):
        stale = Step("cpp", "x\n", "In `devices/catalog.cpp`, after `a line that is not there`:")
        self.assertRaises(AssertionError, stale.apply, self.tree)
        self.assertRaises(AssertionError, Step("cpp", "x\n", "In `devices/catalog.cpp`:").apply, self.tree)
        self.assertRaises(AssertionError, Step("cpp", "x\n", "somewhere:").apply, self.tree)
        self.assertRaises(AssertionError, Step("sh", "false\ntrue\n", "").run, self.tree)


class RecipesNightly(unittest.TestCase):
    """All three in one copy, whose build they share: none changes what another one does."""

    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="tenon_recipe_")
        cls.addClassCleanup(folder.cleanup)
        cls.tree = Path(folder.name) / "tenon"
        shutil.copytree(ROOT, cls.tree, ignore=NOT_COPIED)
        Step("sh", "cmake --preset dev\n", "").run(cls.tree)

    def carry_out(self, title):
        output = ""
        for step in RECIPES[title]:
            if step.language == "sh":
                output += step.run(self.tree)
            else:
                step.apply(self.tree)
        return output

    def test_add_a_device(self):
        output = self.carry_out("Add a device")
        self.assertRegex(output, r"(?m)^\[  PASSED  \] \d{2,} tests?\.")  # its own, the catalog's and all of the conformance suite

    def test_add_a_scenario(self):
        self.assertIn("final state hash", self.carry_out("Add a scenario"))

    def test_add_a_topic(self):
        output = self.carry_out("Add a topic")
        self.assertIn("TypeParam = tenon::GripForce", output)  # the round-trip tests took it by themselves
        self.assertRegex(output, r"(?m)^\[  PASSED  \] [1-9]\d* tests?\.")


if __name__ == "__main__":
    unittest.main()
