"""Every verb of `tenon` has help, and unknown ones are refused."""
import re
import unittest

from stage import SOURCE, tenon


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
                if verb != "version":  # takes nothing, and prints its one line whatever follows
                    self.assertRegex(done.stdout, r"(?im)^usage: ")
                    self.assertGreater(len(done.stdout.splitlines()), 2)

    def test_every_role_has_help(self):
        for role in ("trainee", "instructor", "observer"):
            with self.subTest(role=role):
                done = tenon("join", "--role", role, "--help")
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("--session", done.stdout)

    def test_an_unknown_option_is_wrong_usage(self):
        for verb in ("serve", "record", "report", "rehearse", "parts", "command", "bake", "probe", "contact", "voxels"):
            with self.subTest(verb=verb):
                self.assertEqual(tenon(verb, "--fly").returncode, 2)
        for role in ("trainee", "instructor", "observer"):
            with self.subTest(role=role):
                self.assertEqual(tenon("join", "--role", role, "--fly").returncode, 2)

    def test_an_unknown_verb_is_one_clear_error(self):
        done = tenon("fly")
        self.assertEqual(done.returncode, 2)
        self.assertIn("there is no verb 'fly'", done.stderr)

    def test_an_unknown_role_is_one_clear_error(self):
        done = tenon("join", "--role", "pilot")
        self.assertEqual(done.returncode, 2)
        self.assertIn("there is no role 'pilot'", done.stderr)


if __name__ == "__main__":
    unittest.main()
