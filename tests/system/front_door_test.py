"""The front door: its verbs, and the package lists that it installs."""
import os
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from stage import PROGRAMS, SOURCE

TENON = SOURCE / "tenon"
LISTS = ("run", "build", "test", "bench")


def packages(name):
    """A list of deploy/packages: package -> reason."""
    lines = (SOURCE / "deploy" / "packages" / f"{name}.txt").read_text(encoding="utf-8").splitlines()
    rows = [re.split(r"\s+#\s*", line, maxsplit=1) for line in lines if line.strip() and not line.startswith("#")]
    return {row[0].strip(): row[1] if len(row) > 1 else "" for row in rows}


def write_program(path, script):
    path.write_text(f"#!/bin/sh\n{script}\n", encoding="utf-8")
    path.chmod(0o755)


class Verbs(unittest.TestCase):
    """Which program a verb starts, with which arguments: every program is a stub that prints its own."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.programs = Path(folder.name)
        for name in ("serve", "command", "join", "observer", "bench"):
            write_program(self.programs / f"tenon-{name}", f'echo "{name}:$*"')

    def tenon(self, *words):
        return subprocess.run([TENON, *words], capture_output=True, text=True, timeout=60,
                              env={**os.environ, "TENON_PROGRAMS": str(self.programs)})

    def assert_started(self, words, expected):
        done = self.tenon(*words)
        self.assertEqual((done.returncode, done.stdout.strip()), (0, expected), done.stderr)

    def assert_wrong_usage(self, words, *expected):
        done = self.tenon(*words)
        self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
        self.assertEqual(done.stdout, "")
        self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        for text in expected:
            self.assertIn(text, done.stderr)

    def test_a_verb_starts_its_program_with_all_its_arguments(self):
        self.assert_started(["command", "signal", "help"], "command:signal help")
        self.assert_started(["resimulate", "a.mcap", "--despite-changes"], "serve:--resimulate a.mcap --despite-changes")
        self.assert_started(["join", "--seed", "3", "--role", "trainee"], "join:--role trainee --seed 3")
        self.assert_started(["join", "--role=observer", "--json"], "observer:--json")
        self.assert_started(["bench", "engine"], "bench:engine")

    def test_old_verbs_name_the_new_ones(self):
        self.assert_wrong_usage(["tell", "pause"], "'tell' is now 'command'")
        self.assert_wrong_usage(["rerun", "a.mcap"], "'rerun' is now 'resimulate'")

    def test_wrong_usage_is_one_line_that_says_what_to_do(self):
        self.assert_wrong_usage(["fly"], "there is no verb 'fly'", "tenon --help")
        self.assert_wrong_usage(["join"], "--role trainee")
        self.assert_wrong_usage(["join", "--role", "pilot"], "there is no role 'pilot'", "observer")
        self.assert_wrong_usage(["resimulate"], "tenon resimulate out/demo/journal.mcap")
        self.assert_wrong_usage(["resimulate", "--despite-changes"], "name a journal or recording first")

    def test_no_verb_at_all_is_wrong_usage_and_shows_the_verbs(self):
        done = self.tenon()
        self.assertEqual(done.returncode, 2)
        self.assertIn("resimulate", done.stderr)

    def test_a_missing_program_is_named(self):
        (self.programs / "tenon-serve").unlink()
        done = self.tenon("serve")
        self.assertEqual(done.returncode, 1)
        self.assertIn("tenon-serve is missing", done.stderr)

    def test_help_of_the_benchmark_does_not_build_it(self):
        (self.programs / "tenon-bench").unlink()
        done = self.tenon("bench", "--help")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("engine", done.stdout)


class Packages(unittest.TestCase):
    def test_every_package_has_a_reason_and_stands_in_one_list(self):
        seen = {}
        for name in LISTS:
            for package, reason in packages(name).items():
                self.assertTrue(reason, f"{name}.txt: {package} has no reason")
                self.assertNotIn(package, seen, f"{name}.txt: {package} is in {seen.get(package)}.txt as well")
                seen[package] = name

    def test_who_runs_the_demo_installs_nothing_that_only_tests_or_benchmarks_need(self):
        asked = self.asked_for("run", "build")
        for word in ("gtest", "gmock", "benchmark", "fcl", "node", "npm", "spdlog", "lz4"):
            self.assertFalse([package for package in asked if word in package], word)
        self.assertEqual(asked, self.asked_for(), "run and build are the default")

    def test_setup_asks_for_exactly_the_lists_it_was_given(self):
        for names in (("run",), ("run", "build", "test"), ("run", "build", "bench")):
            with self.subTest(lists=names):
                self.assertEqual(self.asked_for(*names), {package for name in names for package in packages(name)})

    def asked_for(self, *names):
        """What setup would install on a machine that has none of it: its tools are stubs."""
        with tempfile.TemporaryDirectory() as folder:
            tools = Path(folder)
            for tool in ("bash", "cat", "grep", "dirname", "env"):
                (tools / tool).symlink_to(shutil.which(tool))
            write_program(tools / "id", "echo 0")
            write_program(tools / "dpkg-query", "exit 1")
            write_program(tools / "apt-get", f'echo "$@" >> {tools}/asked')
            done = subprocess.run([SOURCE / "deploy" / "setup", *names], capture_output=True, text=True,
                                  env={"PATH": folder}, timeout=60)
            self.assertEqual(done.returncode, 0, done.stderr)
            update, install = (tools / "asked").read_text(encoding="utf-8").splitlines()
            self.assertTrue(update.startswith("update"))
            self.assertIn("--no-install-recommends", install)
            asked = {word for word in install.split() if not word.startswith("-") and word != "install"}
            for package in asked:
                self.assertIn(f"  {package}  ", done.stdout, "what is installed is announced with its reason")
            return asked

    def test_an_unknown_list_is_wrong_usage(self):
        done = subprocess.run([SOURCE / "deploy" / "setup", "games"], capture_output=True, text=True, timeout=60)
        self.assertEqual(done.returncode, 2)
        self.assertIn("there is no list 'games'", done.stderr)

    def test_the_run_list_is_what_the_programs_link(self):
        linked = set()
        for program in PROGRAMS.glob("tenon-*"):
            if not program.name.startswith("tenon-bench"):
                listed = subprocess.run(["objdump", "-p", program], capture_output=True, text=True, check=True, timeout=60)
                linked |= set(re.findall(r"NEEDED\s+(\S+)", listed.stdout))
        self.assertTrue(linked, f"no programs in {PROGRAMS}")
        machine = subprocess.run(["gcc", "-print-multiarch"], capture_output=True, text=True, check=True, timeout=60).stdout.strip()
        owners = set()
        for library in linked:
            done = subprocess.run(["dpkg-query", "-S", f"*/{machine}/{library}"], capture_output=True, text=True, timeout=60)
            self.assertEqual(done.returncode, 0, f"{library} belongs to no Debian package")
            owners.add(done.stdout.splitlines()[0].split(":")[0])
        always_there = {"libc6", "libgcc-s1", "libstdc++6"}
        sanitizers = {package for package in owners if re.fullmatch(r"lib(asan|tsan|ubsan)\d+", package)}
        self.assertEqual(owners - always_there - sanitizers, set(packages("run")) - {"python3", "openssl"})  # programs that scripts start


class Pages(unittest.TestCase):
    def test_every_link_between_pages_leads_somewhere(self):
        pages = [*SOURCE.glob("*.md"), *SOURCE.glob("docs/**/*.md")]
        self.assertIn(SOURCE / "README.md", pages)
        for page in pages:
            for target in re.findall(r"\]\(([^)#\s]+)[^)]*\)", page.read_text(encoding="utf-8")):
                if not re.match(r"[a-z]+:", target):
                    self.assertTrue((page.parent / target).exists(), f"{page.relative_to(SOURCE)}: {target} is not there")

    def test_every_verb_that_a_page_names_is_one(self):
        text = (SOURCE / "tenon").read_text(encoding="utf-8")
        verbs = set(re.findall(r"^  ([a-z]+)  ", text[text.index("cat <<'TEXT'"):text.index("\nTEXT\n")], re.MULTILINE))
        self.assertIn("demo", verbs)
        for page in (SOURCE / "README.md", SOURCE / "CONTRIBUTING.md", SOURCE / "ARCHITECTURE.md", *SOURCE.glob("docs/**/*.md")):
            named = set(re.findall(r"(?:\./|`)tenon ([a-z]+)", page.read_text(encoding="utf-8")))
            self.assertLessEqual(named, verbs, page.relative_to(SOURCE))


if __name__ == "__main__":
    unittest.main()
