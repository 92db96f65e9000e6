"""Every verb of `tenon` has help, and what cannot be understood or done is refused with one line and its exit code."""
import re
import tempfile
import unittest
from pathlib import Path

from stage import PROGRAMS, SOURCE, tenon


def verbs():
    text = (SOURCE / "tenon").read_text(encoding="utf-8")
    listed = text[text.index("cat <<'TEXT'"):text.index("\nTEXT\n")]
    return re.findall(r"^  ([a-z]+)  ", listed, re.MULTILINE)


class Help(unittest.TestCase):
    def test_tenon_lists_its_verbs(self):
        done = tenon("--help")
        self.assertEqual(done.returncode, 0)
        self.assertGreater(len(verbs()), 10)
        for verb in verbs():
            self.assertIn(f"  {verb}  ", done.stdout)

    def test_every_verb_has_help(self):
        for verb in verbs():
            with self.subTest(verb=verb):
                done = tenon(verb, "--help")
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertRegex(done.stdout, r"(?im)^usage: ")
                self.assertGreater(len(done.stdout.splitlines()), 1)

    def test_every_role_has_help(self):
        for role in ("trainee", "instructor", "observer"):
            with self.subTest(role=role):
                done = tenon("join", "--role", role, "--help")
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("--session", done.stdout)

    def test_an_unknown_option_is_wrong_usage(self):
        for verb in ("serve", "check", "record", "report", "rehearse", "parts", "command", "bake", "probe", "contact", "voxels", "console"):
            with self.subTest(verb=verb):
                self.assertEqual(tenon(verb, "--fly").returncode, 2)
        for role in ("trainee", "instructor", "observer"):
            with self.subTest(role=role):
                self.assertEqual(tenon("join", "--role", role, "--fly").returncode, 2)

    def test_a_number_below_its_range_is_wrong_usage(self):
        for words in (("rehearse", "peg_and_box", "--seed", "-1"), ("join", "--role", "trainee", "--seed", "-1"), ("bake", "part.stl", "-o", "part.tenon", "--points", "-1")):
            with self.subTest(words=words):
                done = tenon(*words)
                self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
                self.assertIn("-1", done.stderr)

    def test_an_unknown_verb_is_one_clear_error(self):
        done = tenon("fly")
        self.assertEqual(done.returncode, 2)
        self.assertIn("there is no verb 'fly'", done.stderr)

    def test_an_unknown_role_is_one_clear_error(self):
        done = tenon("join", "--role", "pilot")
        self.assertEqual(done.returncode, 2)
        self.assertIn("there is no role 'pilot'", done.stderr)


SCENARIO = SOURCE / "scenarios" / "peg_and_box"
# exit code, command line, what its answer says
TABLE = (
    (2, ["version", "--foo"], "version takes no options: '--foo'"),
    (2, ["serve"], "name a scenario, as in: tenon serve scenarios/engine_bay"),
    (2, ["serve", SCENARIO, "--wait-for", "nobody"], "--wait-for: cannot wait for 'nobody'"),
    (2, ["serve", SCENARIO, "--workers", 0], "--workers"),
    (2, ["serve", SCENARIO, "--domain", 500], "--domain"),
    (2, ["serve", SCENARIO, "--session", "a*"], "--session: 'a*' is no name of a session: expected 1 to 63 bytes of UTF-8"),
    (2, ["serve", SCENARIO, "--session", ""], "--session: '' is no name of a session"),
    (2, ["serve", SCENARIO, "--session", "a" * 64], "is no name of a session"),
    (2, ["serve", SCENARIO, "--session", "a" * 5000], "is no name of a session"),
    (2, ["join", "--role", "trainee", "--session", "?"], "--session: '?' is no name of a session"),
    (2, ["join", "--role", "observer", "--session", "a/b"], "--session: 'a/b' is no name of a session"),
    (2, ["record", "-o", "a.mcap", "--session", ""], "--session: '' is no name of a session"),
    (1, ["serve", "nosuch"], "nosuch"),
    (2, ["serve", SCENARIO, "--detail", "nan"], "--detail: 'nan' is not a number from 0 to 1"),
    (2, ["serve", SCENARIO, "--tick-goal", "nan"], "--tick-goal: 'nan' is not a number from 0 to 1"),
    (2, ["serve", SCENARIO, "--critical-load", "nan"], "--critical-load: 'nan' is not a number from 1 to 1000"),
    (2, ["serve", SCENARIO, "--budget", "-1"], "--budget: Value -1 not in range 0 to 1000000000"),
    (2, ["check", SCENARIO, "--detail", "nan"], "--detail: 'nan' is not a number from 0 to 1"),
    (2, ["parts", "peg_and_box", "a", "--detail", "nan"], "--detail: 'nan' is not a number from 0 to 1"),
    (2, ["parts", "peg_and_box", "a", "--triangles", "-1"], "--triangles: Value -1 not in range"),
    (2, ["rehearse", SCENARIO, "--detail", "nan"], "--detail: 'nan' is not a number from 0 to 1"),
    (2, ["rehearse", SCENARIO, "--seconds", "nan"], "--seconds nan: expected 0.001 to 1000000"),
    (2, ["doctor", "--peer", "localhost", "--seconds", "nan"], "'nan' is not a number from 0.1 to 3600"),
    (2, ["picture", "peg_and_box", "--detail", "nan"], "'nan' is not a number from 0 to 1"),
    (2, ["check"], "scenario is required"),
    (2, ["check", SCENARIO, "--device", "nosuch"], "--device: unknown device 'nosuch'"),
    (2, ["command"], "no command given"),
    (2, ["command", "foo"], "unknown command 'foo'"),
    (2, ["command", "list", "steps"], "usage: list, without 'steps': it prints people, hands, steps and objects"),
    (2, ["command", "pause", "--person", "x" * 300], "is no name of a person: expected 1 to 63 bytes of UTF-8"),
    (2, ["command", "list", "--person", ""], "--person: '' is no name of a person"),
    (2, ["command", "note", "x" * 256], "a note has at most 255 bytes, this one has 256"),
    (2, ["command", "--keys", "pause"], "--keys takes no command: each key sends one"),
    (2, ["command", "--keys", "--signal", "x" * 256], "--signal: a signal has at most 255 bytes, this one has 256"),
    (2, ["join", "--role", "trainee", "--name", "x" * 64], "--name: '" + "x" * 63 + "' is no name of a person"),
    (2, ["join", "--role", "observer", "--name", "x" * 64], "is no name of a person"),
    (2, ["join", "--role", "trainee", "--hands", "x" * 32 + ",left"], "is no name of a hand: expected 1 to 31 bytes"),
    (2, ["command", "signal"], "usage: signal NAME"),
    (2, ["join", "--role", "trainee", "--device", "nosuch"], "--device: unknown device 'nosuch'; known devices: sigma7-sim"),
    (2, ["join", "--role", "trainee", "--tracker", "nosuch"], "--tracker: unknown tracker 'nosuch'; known trackers: body-sim"),
    (2, ["join", "--role", "trainee", "--person", "nosuch"], "--person: nosuch: cannot be read"),
    (2, ["join", "--role", "trainee", "--person", "foot=a.csv"], "--person foot=a.csv: this station has no hand 'foot'; it has: right, left"),
    (2, ["join", "--role", "trainee", "--device", "sigma7-sim", "--person", "left=a.csv"], "this station has no hand 'left'; it has: right"),
    (2, ["join", "--role", "trainee", "--person", "=a.csv"], "--person '=a.csv': expected [HAND=]FILE.csv"),
    (2, ["join", "--role", "trainee", "--person", "right=a.csv,right=a.csv"], "--person right=a.csv: another file moves hand 'right' already"),
    (2, ["join", "--role", "trainee", "--device", "sigma7-sim,"], "--device: a name of 'sigma7-sim,' is empty"),
    (2, ["join", "--role", "trainee", "--hands", "right,"], "--hands: a name of 'right,' is empty"),
    (2, ["join", "--role", "trainee", "--mounting", "1:0:0:0"], "expected one for each --device at most"),
    (2, ["join", "--role", "trainee", "--device", "falcon-sim", "--mounting", "1:1:0:0"], "--mounting 1:1:0:0: expected a unit quaternion"),
    (2, ["join", "--role", "trainee", "--serial", "1001"], "--address, --serial, --mounting: expected one for each --device at most"),
    (2, ["join", "--role", "trainee", "--device", "remote", "--serial", "1001"], "--serial 1001: device 'remote' has no serial number"),
    (1, ["join", "--role", "trainee", "--device", "falcon-sim", "--serial", "77"], "device 'falcon-sim': none with serial number '77' is there; there are: 1001, 1002"),
    (1, ["join", "--role", "trainee", "--device", "falcon-sim,falcon-sim", "--serial", "1002,1002"], "with serial number 1002 is given twice"),
    (2, ["join", "--role", "trainee", "--device", "falcon-sim", "--hands", "right,left"], "--hands: the devices have 1 arms for 2 hands"),
    (2, ["join", "--role", "trainee", "--device", "falcon-sim,falcon-sim", "--hands", "right,right"], "--hands: a name is given twice"),
    (2, ["join", "--role", "trainee", "--device", "vibrotac-sim"], "--device vibrotac-sim: moves no hand"),
    (2, ["join", "--role", "trainee", "--tactors", "falcon-sim"], "--tactors falcon-sim: is no bracelet; expected vibrotac-sim"),
    (2, ["join", "--role", "trainee", "--tracker", "none", "--tactors", "vibrotac-sim"], "--tactors: a bracelet is on the forearm"),
    (2, ["join", "--role", "trainee", "--tactors", "nosuch"], "--tactors: unknown device 'nosuch'; known devices: sigma7-sim"),
    (2, ["join", "--role", "instructor", "--device", "nosuch"], "--device: unknown device 'nosuch'; known devices: sigma7-sim"),
    (2, ["join", "--role", "observer", "--domain", 999], "--domain"),
    (2, ["demo", "--workers", 0], "'0' is not a number from 1 to 64"),
    (2, ["demo", "--detail", 7], "'7' is not a number from 0 to 1"),
    (2, ["demo", "--domain", 500], "'500' is not a number from 0 to 230"),
    (2, ["demo", "--seed", "one"], "'one' is not a number"),
    (2, ["bake", "a.stl", "-o", "a.tenon", "--voxel", "-1mm"], "--voxel -1mm: is -1 mm, expected between 20 um and 100 mm"),
    (2, ["bake", "a.stl", "-o", "a.tenon", "--voxel", "2"], "--voxel 2: is 2 m, expected between 20 um and 100 mm"),
    (2, ["bake", "a.stl", "-o", "a.tenon", "--voxel", "2 foot"], "--voxel: '2 foot' is not a length"),
    (2, ["bake", "a.stl", "-o", "a.tenon", "--unit", "km"], "--unit: 'km' is not a unit of length"),
    (2, ["bake", "a.stl", "-o", "a.tenon", "--refine", "1,2,3"], "--refine 1,2,3: expected x0,y0,z0,x1,y1,z1"),
    (2, ["bake", "a.stl", "-o", "a.tenon", "--refinement", 3], "the refinement must be 1, 2, 4 or 8"),
    (2, ["bake", "a.stl", "-o", "a.tenon", "--points", 0], "the number of shell points must be 1 to 1,000,000"),
    (2, ["bake", "a.stl", "-o", "a.tenon", "--spacing", "0mm"], "--spacing 0mm: must be greater than 0"),
    (2, ["bake", "a.stl", "-o", "a.tenon", "--spacing", "1mm", "--points", 100], "--points excludes --spacing"),
    (1, ["bake", "nosuch.stl", "-o", "a.tenon"], "nosuch.stl"),
    (2, ["contact", "a", "b", "--poses", "c", "--isa", "foo"], "--isa foo: this processor has scalar"),
    (2, ["contact", "a", "b", "--poses", "c", "--stiffness", "-3"], "--stiffness: must be a number greater than 0"),
    (1, ["contact", "a", "b", "--poses", "c"], "a: cannot be read"),
    (2, ["voxels", "a", "--cell", "0mm"], "--cell 0mm: must be greater than 0"),
    (1, ["probe", "nosuch"], "nosuch: cannot be read"),
    (2, ["parts", "nosuch", "a"], "no scenario 'nosuch'"),
    (2, ["rehearse", SCENARIO, "--seconds", "-1"], "--seconds -1: expected 0.001 to 1000000"),
    (2, ["rehearse", SCENARIO, "--device", "nosuch"], "--device: unknown device 'nosuch'"),
    (1, ["report", "nosuch.mcap"], "nosuch.mcap"),
    (1, ["report", SCENARIO / "scenario.yaml"], "is not a recording (no MCAP file): `tenon record -o FILE` writes one"),
    (2, ["join", "--role", "trainee", "--force-model", "x"], "--force-model: x not in {auto,manifold,scene-copy}"),
    (2, ["rehearse", SCENARIO, "--force-model", "0"], "--force-model: 0 not in {manifold,scene-copy}"),
    (2, ["serve", SCENARIO, "--journal", ""], "--journal: names no file"),
    (2, ["serve", SCENARIO, "--key", ""], "--key: names no file"),
    (2, ["join", "--role", "trainee", "--key", ""], "--key: names no file"),
    (2, ["join", "--role", "observer", "--key", ""], "--key: names no file"),
    (2, ["record", "-o", "a.mcap", "--key", ""], "--key: names no file"),
    (2, ["console", "--key", ""], "--key: names no file"),
    (2, ["command", "pause", "--key", ""], "--key: names no file"),
    (2, ["command", "stop", "--session", ""], "--session: names no session"),
    (1, ["join", "--role", "trainee", "--key", "nosuch"], "--key: nosuch: cannot be read"),
    (1, ["join", "--role", "observer", "--key", "nosuch"], "--key: nosuch: cannot be read"),
    (1, ["record", "-o", "a.mcap", "--key", "nosuch"], "--key: nosuch: cannot be read"),
    (1, ["console", "--key", "nosuch"], "--key: nosuch: cannot be read"),
    (1, ["command", "pause", "--key", "nosuch"], "--key: nosuch: cannot be read"),
    (2, ["command", "--role", "boss", "pause"], "--role: boss not in {admin,instructor,trainee}"),
    (1, ["resimulate", "nosuch.mcap"], "tenon resimulate: nosuch.mcap: cannot be opened (No such file or directory)"),
    (1, ["resimulate", SCENARIO / "scenario.yaml"], "scenario.yaml: is not a recording (no MCAP file)"),
    (1, ["resimulate", "nosuch.mcap", SCENARIO], "nosuch.mcap: cannot be opened (No such file or directory)"),
    (1, ["picture", SCENARIO, "-o", "/proc/x.png"], "/proc/x.png: cannot be written (No such file or directory); -o names another file"),
    (1, ["picture", SCENARIO, "-o", "nosuch/x.png"], "nosuch/x.png: cannot be written (No such file or directory); -o names another file"),
    (2, ["resimulate", "nosuch.mcap", "--fly"], "--fly"),
)


class ExitCodes(unittest.TestCase):
    def test_wrong_usage_is_2_and_could_not_is_1_each_with_one_line(self):
        with tempfile.TemporaryDirectory() as folder:
            for code, words, said in TABLE:
                with self.subTest(command=" ".join(map(str, words))):
                    done = tenon(*words, cwd=folder)
                    self.assertEqual(done.returncode, code, done.stdout + done.stderr)
                    self.assertEqual(done.stdout, "")
                    answer = [line for line in done.stderr.splitlines() if not line.startswith(("usage: ", " ", "Run with --help"))]
                    self.assertEqual(len(answer), 1, done.stderr)
                    self.assertIn(said, answer[0])
                    if "resimulate" in words:
                        self.assertNotIn("name it as well", answer[0])
                    self.assertLess(len(answer[0]), 250)
            self.assertEqual(list(Path(folder).iterdir()), [], "nothing was begun")

    def test_a_line_of_a_station_file_that_is_no_option_is_wrong_usage(self):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "desk.toml"
            for content, key in ((b"devcie = 'falcon-sim'\n", "'devcie' is no option"), (b"# a desk\ndomain = 7\nhallo welt\n", "'hallo welt' is no option"),
                                 (b"[desk]\ndomain = 7\n", "is no option"), ((PROGRAMS / "tenon-join").read_bytes()[:4096], "is no option"),
                                 (b"station = other.toml\n", "station")):
                with self.subTest(content=content[:20]):
                    file.write_bytes(content)
                    done = tenon("join", "--role", "trainee", "--station", file)
                    self.assertEqual(done.returncode, 2, done.stdout + done.stderr)
                    self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
                    self.assertIn(f"--station {file}: ", done.stderr)
                    self.assertIn(key, done.stderr)
            # a good one is read: its device is asked for in the catalog
            file.write_text("# a desk\n\ndomain = 7\nhands = [\"right\", \"left\"]\ndevice = nosuch\n", encoding="utf-8")
            self.assertIn("unknown device 'nosuch'", tenon("join", "--role", "trainee", "--station", file).stderr)


if __name__ == "__main__":
    unittest.main()
