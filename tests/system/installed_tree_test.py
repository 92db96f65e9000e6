"""What `cmake --install` leaves is whole: a session runs from it while the source tree is out of reach."""
import os
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from stage import COARSE, PROGRAMS, SOURCE, free_domain

BUILD = PROGRAMS.parent


def hidden(folder):
    """The start of a command line that runs the rest with an empty folder in the place of `folder`, for that process and
    its children alone; None where this system does not permit it."""
    script = f'mount -t tmpfs tmpfs "{folder}" && exec "$@"'
    for unshare in (["unshare", "--mount"], ["unshare", "--mount", "--map-root-user"]):
        start = [*unshare, "sh", "-c", script, "sh"]
        if shutil.which("unshare") and subprocess.run([*start, "test", "!", "-e", folder / "tenon"], capture_output=True).returncode == 0:
            return start
    return None


class InstalledTree(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory(prefix="tenon-installed-")
        cls.addClassCleanup(folder.cleanup)
        cls.root = Path(folder.name)
        cls.prefix = cls.root / "prefix"
        done = subprocess.run(["cmake", "--install", BUILD, "--prefix", cls.prefix, "--strip"], capture_output=True, text=True, timeout=600)
        assert done.returncode == 0, done.stdout + done.stderr

    def run_installed(self, *words, start=()):
        home = self.root / "home"
        home.mkdir(exist_ok=True)
        environment = {"HOME": str(home), "PATH": os.environ["PATH"], "LANG": "C.UTF-8"}  # nothing of a test's own
        return subprocess.run([*start, self.prefix / "bin" / "tenon", *map(str, words)], capture_output=True, text=True, timeout=850,
                              env=environment, cwd=home)

    def test_a_whole_demo_runs_from_it_without_the_source_tree(self):
        start = hidden(SOURCE)
        if start is None:
            print("this system permits no mount namespace: the source tree stayed where it was")
        out = self.root / "out"
        done = self.run_installed("demo", *COARSE, "--scenario", "peg_and_box", "--headless", "--lockstep", "--domain", free_domain(),
                                  "--out", out, start=start or ())
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        told = re.findall(r"(?m)^ *(\d+\.\d\d) s  (.*)$", done.stdout)
        self.assertGreater(len(told), 10, done.stdout)
        self.assertEqual([time for time, _ in told], sorted((time for time, _ in told), key=float), "lines in order of time")
        self.assertEqual(len(told), len(set(told)), "each event once")
        for sentence in ("step 1 of 2: Take the peg", "step 1 of 2: done", "Peg is taken by trainee", "Peg is mounted, with an error of",
                         "the session has succeeded"):
            self.assertEqual(sum(sentence in text for _, text in told), 1, sentence)
        for file in ("report.html", "session.mcap", "journal.mcap", *(["scene.png"] if shutil.which("chromium") else [])):
            self.assertGreater((out / file).stat().st_size, 0, file)
        self.assertTrue((self.root / "home" / ".cache" / "tenon").is_dir(), "parts are made in the user's own cache")

    def test_it_names_no_folder_of_the_source_tree(self):
        """Where programs look for libraries, and what scripts and data say."""
        for file in self.prefix.rglob("*"):
            if not file.is_file():
                continue
            text = file.read_bytes()
            if text.startswith(b"\x7fELF"):
                text = subprocess.run(["readelf", "-d", file], capture_output=True, check=True, timeout=60).stdout
            self.assertNotIn(str(SOURCE).encode(), text, file)

    def test_it_holds_programs_scripts_scenarios_and_pages_and_nothing_else(self):
        for name in ("bin/tenon", "lib/tenon/tenon-serve", "lib/tenon/tenon-command", "share/tenon/VERSION", "share/tenon/deploy/demo.py",
                     "share/tenon/deploy/doctor.py", "share/tenon/deploy/picture.py", "share/tenon/deploy/doctor_link.py", "share/tenon/deploy/number_option.py", "share/tenon/deploy/interrupt.py", "share/tenon/deploy/make-cert", "share/tenon/deploy/dds/loopback.xml", "share/tenon/scenarios/scenario.schema.json",
                     "share/tenon/scenarios/engine_bay/scenario.yaml", "share/doc/tenon/README.md", "share/doc/tenon/copyright"):
            self.assertTrue((self.prefix / name).is_file(), name)
        for file in self.prefix.rglob("*"):
            self.assertNotIn(file.suffix, (".cpp", ".h", ".a", ".cmake"), file)
            self.assertNotIn(file.name, ("tenon-bench", "part_generator", "__pycache__"), file)

    def test_links_between_its_pages_lead_somewhere(self):
        pages = list((self.prefix / "share" / "doc" / "tenon").rglob("*.md"))
        self.assertGreater(len(pages), 3)
        for page in pages:
            for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8")):
                if not re.match(r"[a-z]+:", target):
                    self.assertTrue((page.parent / target).exists(), f"{page.relative_to(self.prefix)}: {target} is not there")

    def test_its_verbs_know_that_there_is_no_source_tree(self):
        version = self.run_installed("version")
        self.assertRegex(version.stdout, r"^tenon \d+\.\d+\.\d+$")
        for verb in ("test", "bench"):
            done = self.run_installed(verb)
            self.assertEqual(done.returncode, 1)
            self.assertIn("source tree", done.stderr)
        doctor = self.run_installed("doctor")
        self.assertRegex(doctor.stdout, r"(?m)^good +programs")


if __name__ == "__main__":
    unittest.main()
