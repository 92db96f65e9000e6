"""The Debian packages, as somebody gets them who has nothing else: in a clean Debian 12, as an ordinary user.

Needs root, debootstrap and a Debian mirror (the one that this machine's apt uses); without them it is skipped. The clean system
is made once and kept in $TENON_CLEAN_ROOT (default: the user's cache folder, in tenon-tests/debian12)."""
import os
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from stage import COARSE, PROGRAMS, free_domain

BUILD = PROGRAMS.parent
CACHE = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
CLEAN_ROOT = Path(os.environ.get("TENON_CLEAN_ROOT") or CACHE / "tenon-tests" / "debian12")
SUITE = "bookworm"


def run(*words, **options):
    return subprocess.run([str(word) for word in words], **{"capture_output": True, "text": True, "timeout": 3000, **options})


def mirror():
    """Where this machine's apt gets Debian 12 from, or None."""
    listed = run("apt-get", "indextargets", "--format", "$(CODENAME) $(REPO_URI)", "Created-By: Packages").stdout
    return next((line.split()[1] for line in listed.splitlines() if line.split()[:1] == [SUITE]), None)


def clean_root():
    """A Debian 12 with nothing in it; made when there is none yet. Raises SkipTest when that is not possible here."""
    if os.geteuid() != 0:
        raise unittest.SkipTest("a clean Debian needs root")
    if not shutil.which("debootstrap"):
        raise unittest.SkipTest("a clean Debian needs debootstrap")
    if not (CLEAN_ROOT / "etc" / "debian_version").exists():
        source = mirror()
        if source is None:
            raise unittest.SkipTest(f"this machine's apt has no source of Debian {SUITE}")
        CLEAN_ROOT.parent.mkdir(parents=True, exist_ok=True)
        half = CLEAN_ROOT.with_name(CLEAN_ROOT.name + ".half")
        shutil.rmtree(half, ignore_errors=True)
        made = run("debootstrap", "--variant=minbase", SUITE, half, source)
        if made.returncode != 0:
            raise unittest.SkipTest(f"debootstrap could not make a clean Debian: {(made.stdout + made.stderr)[-300:]}")
        half.rename(CLEAN_ROOT)
    return CLEAN_ROOT


class PackagesNightly(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        original = clean_root()
        folder = tempfile.TemporaryDirectory(prefix="tenon-packages-")
        cls.addClassCleanup(folder.cleanup)
        cls.packages = Path(folder.name) / "packages"
        made = run("cpack", "-B", cls.packages, cwd=BUILD)
        assert made.returncode == 0, made.stdout + made.stderr
        cls.root = Path(folder.name) / "root"
        assert run("cp", "-a", "--reflink=auto", original, cls.root).returncode == 0
        for apt in Path("/etc/apt/apt.conf.d").glob("*"):  # proxies and mirrors of this machine
            if apt.is_file():
                shutil.copy(apt, cls.root / "etc" / "apt" / "apt.conf.d" / apt.name)
        shutil.copy("/etc/resolv.conf", cls.root / "etc" / "resolv.conf")
        updated = cls.inside("apt-get", "update")
        if updated.returncode != 0:
            raise unittest.SkipTest(f"no network for apt in the clean Debian: {updated.stderr[-300:]}")
        shutil.copytree(cls.packages, cls.root / "packages", ignore=shutil.ignore_patterns("_CPack*"))
        names = sorted(f"/packages/{file.name}" for file in cls.packages.glob("*.deb"))
        cls.installed = cls.inside("apt-get", "install", "-y", *names)
        assert cls.inside("useradd", "--create-home", "trainer").returncode == 0

    @classmethod
    def inside(cls, *words, user=None):
        """Runs a command in the clean system, with a /proc and process ids of its own."""
        home = f"/home/{user}" if user else "/root"
        place = ["chroot", *(["--userspec", f"{user}:{user}"] if user else []), cls.root, "env", "-i", f"HOME={home}",
                 "PATH=/usr/sbin:/usr/bin:/sbin:/bin", "DEBIAN_FRONTEND=noninteractive", "sh", "-c", f'cd {home} && exec "$@"', "sh"]
        return run("unshare", "--mount", "--pid", "--fork", f"--mount-proc={cls.root}/proc", *place, *words)

    def test_packages_are_named_and_described_as_debian_does(self):
        files = sorted(file.name for file in self.packages.glob("*.deb"))
        self.assertEqual([re.sub(r"_[0-9.]+_", "_V_", name) for name in files],
                         ["tenon-doc_V_all.deb", f"tenon_V_{run('dpkg', '--print-architecture').stdout.strip()}.deb"])
        for name in files:
            control = run("dpkg-deb", "--field", self.packages / name).stdout
            self.assertRegex(control, r"(?m)^Description: virtual assembly training with force feedback")
            self.assertNotRegex(control, r"(?m)^Recommends:")
            contents = run("dpkg-deb", "--contents", self.packages / name).stdout
            self.assertIn(f"./usr/share/doc/{name.split('_')[0]}/copyright", contents)
        depends = run("dpkg-deb", "--field", self.packages / files[1], "Depends").stdout
        for package in ("python3", "libddsc0debian", "libassimp5", "libbullet3.24"):
            self.assertIn(package, depends)

    def test_apt_installs_them(self):
        self.assertEqual(self.installed.returncode, 0, self.installed.stdout[-3000:] + self.installed.stderr)
        listed = self.inside("dpkg-query", "-W", "-f", "${Package} ${Status}\n").stdout
        for package in ("tenon", "tenon-doc"):
            self.assertIn(f"{package} install ok installed", listed)
        for package in ("g++", "cmake", "libgtest-dev", "nodejs", "libfcl0.7", "xdg-utils"):
            self.assertNotIn(f"\n{package} ", listed, "nobody needs it to run Tenon")

    def test_an_ordinary_user_sees_a_whole_demo(self):
        done = self.inside("tenon", "demo", *COARSE, "--scenario", "peg_and_box", "--headless", "--lockstep", "--domain", free_domain(), user="trainer")
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        self.assertIn("Peg is mounted, with an error of", done.stdout)
        for file in ("report.html", "session.mcap", "journal.mcap"):
            self.assertGreater((self.root / "home" / "trainer" / "out" / "demo" / file).stat().st_size, 0, file)

    def test_doctor_finds_all_programs_for_an_ordinary_user(self):
        done = self.inside("tenon", "doctor", user="trainer")
        self.assertRegex(done.stdout, r"(?m)^good +programs", done.stderr)


if __name__ == "__main__":
    unittest.main()
