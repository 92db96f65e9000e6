"""Runs the pages of docs/ as a reader would: writes their YAML files, executes their commands, finds what they say is printed.

In a page, a block ```sh is executed line by line in a scratch folder, each with `tenon` of this build, and must succeed; a block
```sh fails must not. Each line of the ```text block that follows is in what was printed (runs of spaces count as one). A block
```yaml FILE is written to FILE; ```yaml FILE after: LINE is inserted below the first such line of FILE.
"""
import os
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from stage import COARSE, PROGRAMS, SOURCE, TENON

BLOCK = re.compile(r"^```([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)


def plain(text):
    return re.sub(r"[ \t]+", " ", text)


class Page(unittest.TestCase):
    """A page in its scratch folder."""

    def setUp(self):
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)
        bin_folder = self.folder / "bin"
        bin_folder.mkdir()
        (bin_folder / "tenon").symlink_to(TENON)
        self.work = self.folder / "work"
        self.work.mkdir()
        self.env = {**os.environ, "TENON_PROGRAMS": str(PROGRAMS), "PATH": f"{bin_folder}:{os.environ['PATH']}"}
        self.env.setdefault("TENON_CACHE", str(self.folder / "cache"))

    def run_commands(self, commands, succeeds):
        printed = ""
        for command in filter(None, commands.splitlines()):
            done = subprocess.run(["bash", "-c", command], cwd=self.work, env=self.env, capture_output=True, text=True,
                                  timeout=900, check=False)
            printed += done.stdout + done.stderr
            self.assertEqual(done.returncode == 0, succeeds, f"{command}\n{done.stdout}\n{done.stderr}")
        return printed

    def write(self, info, text):
        name, _, after = info.partition(" after: ")
        file = self.work / name
        if after:
            before = file.read_text(encoding="utf-8")
            found = [line for line in before.splitlines() if line.strip() == after]
            self.assertTrue(found, f"{name} has no line '{after}'")
            text = before.replace(found[0] + "\n", found[0] + "\n" + text, 1)
        file.write_text(text, encoding="utf-8")

    def follow(self, name):
        """Executes the page; the number of its blocks of each kind."""
        page = (SOURCE / "docs" / name).read_text(encoding="utf-8")
        printed, counts = "", {}
        for info, text in BLOCK.findall(page):
            kind, _, rest = info.partition(" ")
            counts[kind] = counts.get(kind, 0) + 1
            if kind == "sh":
                printed = plain(self.run_commands(text, succeeds=rest != "fails"))
            elif kind == "yaml":
                self.write(rest, text)
            elif kind == "text":
                for line in text.splitlines():
                    self.assertIn(plain(line), printed)
        return counts


class FirstScenario(Page):
    def test_two_stl_files_become_a_mounted_part(self):
        counts = self.follow("first_scenario.md")
        self.assertGreaterEqual(counts["sh"], 5)
        self.assertEqual(counts["yaml"], 2)
        self.assertGreaterEqual(counts["text"], 5)


class Bake(Page):
    def test_what_the_page_says_is_printed(self):
        counts = self.follow("bake.md")
        self.assertGreaterEqual(counts["sh"], 6)
        self.assertGreaterEqual(counts["text"], 6)


class TheReader(Page):
    """What the test above is made of finds faults."""

    def test_a_command_that_fails_and_a_claim_that_is_not_printed_are_found(self):
        for page in ("```sh\nfalse\n```\n", "```sh fails\ntrue\n```\n", "```sh\necho one\n```\n```text\ntwo\n```\n"):
            (self.work / "page.md").write_text(page, encoding="utf-8")
            with self.assertRaises(AssertionError, msg=page):
                self.follow(str(self.work / "page.md"))


class CopiedScenario(unittest.TestCase):
    def test_a_shipped_scenario_works_under_another_name(self):
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "mine"
            shutil.copytree(SOURCE / "scenarios" / "peg_and_box", copy)
            results = []
            for scenario in (SOURCE / "scenarios" / "peg_and_box", copy):
                done = subprocess.run([TENON, "rehearse", scenario, *COARSE, "--quiet"], capture_output=True, text=True, timeout=900, check=False,
                                      env={**os.environ, "TENON_PROGRAMS": str(PROGRAMS)})
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("everything is mounted", done.stdout)
                results.append(done.stdout.splitlines()[-1])
            self.assertEqual(*results)

    def test_a_demo_of_it_has_its_picture_nightly(self):
        with tempfile.TemporaryDirectory() as folder:
            copy = Path(folder) / "mine"
            shutil.copytree(SOURCE / "scenarios" / "peg_and_box", copy)
            done = subprocess.run([TENON, "demo", *COARSE, "--scenario", copy, "--headless", "--lockstep", "--out", Path(folder) / "out"],
                                  capture_output=True, text=True, timeout=900, check=False,
                                  env={**os.environ, "TENON_PROGRAMS": str(PROGRAMS)})
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
            self.assertEqual((Path(folder) / "out" / "scene.png").exists(), shutil.which("chromium") is not None, done.stdout)
            self.assertTrue((Path(folder) / "out" / "report.html").exists(), done.stdout)


if __name__ == "__main__":
    unittest.main()
