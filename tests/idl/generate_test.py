#!/usr/bin/env python3
"""What idl/generate.py writes from the IDL, and what it says to a line it does not understand."""
import contextlib
import io
import sys
import tempfile
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
sys.path.insert(0, str(ROOT / "idl"))

import generate  # noqa: E402

HEAD = "module tenon {\n"  # line 1 of every text here
TAIL = "};\n"


def run(*arguments):
    """Exit code of a call, and what it says."""
    said = io.StringIO()
    with contextlib.redirect_stderr(said):
        code = generate.main([str(argument) for argument in arguments])
    return code, said.getvalue()


def written(text):
    """Exit code, what is said, and the files written for `text`."""
    with tempfile.TemporaryDirectory() as folder:
        source, out = Path(folder) / "some.idl", Path(folder) / "out"
        source.write_text(text, encoding="utf-8")
        code, said = run(source, out)
        files = {file.name: file.read_text(encoding="utf-8") for file in out.rglob("*") if file.is_file()}
        return code, said.replace(folder + "/", ""), files


class Generate(unittest.TestCase):
    def fault(self, *lines):
        code, said, files = written(HEAD + "".join(line + "\n" for line in lines) + TAIL)
        self.assertEqual(code, 1, said)
        self.assertEqual(files, {}, "nothing is written when there is a fault")
        return said.strip()

    def topics(self, *lines):
        code, said, files = written(HEAD + "".join(line + "\n" for line in lines) + TAIL)
        self.assertEqual(code, 0, said)
        return files["topic_list.h"]

    def test_a_line_above_a_struct_is_a_topic(self):
        topics = self.topics("//@topic Wind stream", "@final struct Wind { @key uint32 id; };")
        self.assertIn('inline constexpr Topic<Wind> kWind{"Wind", QosClass::kStream, {}};', topics)
        self.assertIn("  visit(kWind);", topics)
        self.assertIn("#define TENON_WIRE_MESSAGES(X) \\\n  X(Wind)\n", topics)

    def test_a_struct_may_have_several_topics_and_is_one_message(self):
        topics = self.topics("//@topic Wind_1k stream", "//@topic Wind_30 stream", "@final struct Wind { uint32 id; };")
        self.assertIn("Topic<Wind> kWind1k{", topics)
        self.assertIn("Topic<Wind> kWind30{", topics)
        self.assertEqual(topics.count("X(Wind)"), 1)

    def test_parameters_become_those_of_the_topic_in_their_order_there(self):
        topics = self.topics("//@topic A stream lease_by_topic lease=50ms deadline=10ms", "@final struct A { uint32 id; };",
                             "//@topic B event late_joiner_depth=9 lifespan=5000ms", "@final struct B { uint32 id; };",
                             "//@topic C state latched of_server", "@final struct C { uint32 id; };",
                             "//@topic D event lifespan=5000ms request", "@final struct D { uint32 id; };")
        self.assertIn("{.deadline = Milliseconds{10}, .lease = Milliseconds{50}, .lease_by_topic = true}", topics)
        self.assertIn("{.lifespan = Milliseconds{5000}, .late_joiner_depth = 9}", topics)
        self.assertIn("{.late_joiner_depth = 1, .latched = true, .of_server = true}", topics)
        self.assertIn("{.lifespan = Milliseconds{5000}, .request = true}", topics)

    def test_enumerators_are_counted(self):
        topics = self.topics("enum Side { LEFT,  // of the trainee, not ours", "  RIGHT };", "@final @nested struct A { Side s; };")
        self.assertIn("#define TENON_WIRE_ENUMERATIONS(X) \\\n  X(Side, 2)\n", topics)

    def test_fields_are_counted_with_those_of_structs_and_elements(self):
        topics = self.topics("@final @nested struct P { double p[3]; double q[4]; };  // 2; not 3;",
                             "@final @nested struct S { P a; string<9> text; };  // 3",
                             "//@topic A stream",
                             "@final struct A { @key uint32 id; P two[2]; sequence<S, 4> list; sequence<octet, 9> bytes; };")
        self.assertIn("#define TENON_WIRE_FIELD_COUNTS(X) \\\n  X(A, 10)\n", topics)  # 1 + 2 * 2 + (1 + 3) + 1

    def test_the_text_is_kept_to_the_last_byte(self):
        text = HEAD + '@final @nested struct A { uint32 id; };  // "quoted" \\n\n' + TAIL
        _, _, files = written(text)
        self.assertIn(f'R"idl({text})idl"', files["idl_text.cpp"])

    def test_a_fault_names_the_line_and_what_to_write(self):
        struct = "@final struct A { uint32 id; };"
        usage = "write //@topic NAME stream|state|event [PARAMETER...]"
        for lines, expected in (
            (["//@topik A stream", struct], f"some.idl:2: '//@topik A stream' is not known: {usage}"),
            (["//@topic A", struct], f"some.idl:2: a topic needs a name and a class: {usage}"),
            (["//@topic A flow", struct], f"some.idl:2: 'flow' is not a class: {usage}"),
            (["//@topic 1k stream", struct], "some.idl:2: '1k' is not a topic name: write letters, digits and _, a letter first"),
            (["//@topic A stream lease=1s", struct],
             "some.idl:2: 'lease' needs a time in milliseconds: write lease=1000ms"),
            (["//@topic A stream lease=1ms lease=2ms", struct], "some.idl:2: 'lease' is there twice: write it once"),
            (["//@topic A stream lose=1ms", struct],
             "some.idl:2: 'lose' is not a parameter: write deadline=10ms, lease=1000ms, lifespan=5000ms, "
             "late_joiner_depth=1000, reader_depth=16, lease_by_topic, latched, of_server or request"),
            (["//@topic A stream lease=1ms lease_by_topic=yes", struct],
             "some.idl:2: 'lease_by_topic' has no value: write lease_by_topic"),
            (["//@topic A stream lease_by_topic", struct],
             "some.idl:2: 'lease_by_topic' says which lease is meant: write lease=50ms before it"),
            (["//@topic A event late_joiner_depth=0", struct],
             "some.idl:2: 'late_joiner_depth' needs a number of samples: write late_joiner_depth=1000"),
            (["//@topic A stream late_joiner_depth=1", struct],
             "some.idl:2: 'late_joiner_depth' is for events: leave it out (late joiners get the last sample of a state and "
             "none of a stream)"),
            (["//@topic A event latched", struct], "some.idl:2: 'latched' is for states: leave it out, or write A state latched"),
            (["//@topic A event of_server request", struct],
             "some.idl:2: 'request' is for events of clients, who wait for the server's answer: leave it out"),
            (["//@topic A stream", "", struct],
             "some.idl:2: no struct on the next line: write //@topic directly above the struct of the topic"),
            ([struct], "some.idl:2: 'A' has no topic: write //@topic A stream above it, or @nested when it is only part of "
                       "other messages"),
            (["//@topic A stream", "@final struct A {", "  uint32 id;", "  double a, b;", "};"],
             "some.idl:5: 'double a, b' is not a member: write TYPE NAME, TYPE NAME[COUNT] or sequence<TYPE, BOUND> NAME"),
            (["//@topic A stream", "@final @nested struct A { uint32 id; };"],
             "some.idl:3: 'A' is @nested, so it has no topic: remove @nested or the line //@topic"),
            (["//@topic A stream", "struct A { uint32 id; };"],
             "some.idl:3: 'A' is not @final: write @final before it, as every type of the protocol is"),
            (["//@topic A_1 stream", "//@topic A1 stream", struct],
             "some.idl:3: topic 'A1' has the constant kA1, as 'A_1' in line 2 has: write another name"),
        ):
            with self.subTest(lines=lines):
                self.assertEqual(self.fault(*lines), expected)

    def test_a_missing_file_and_a_wrong_call_are_told_apart(self):
        with tempfile.TemporaryDirectory() as folder:
            for arguments, code in (([f"{folder}/none.idl", folder], 1), ([folder], 2)):
                found, said = run(*arguments)
                self.assertEqual(found, code, said)
                self.assertIn("none.idl" if code == 1 else "usage:", said)

    def test_a_file_that_stays_the_same_is_left_alone(self):
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(run(ROOT / "idl/tenon.idl", folder), (0, ""))
            files = [file for file in Path(folder).rglob("*") if file.is_file()]
            before = [file.stat().st_mtime_ns for file in files]
            run(ROOT / "idl/tenon.idl", folder)
            self.assertEqual([file.stat().st_mtime_ns for file in files], before)
            self.assertEqual(len(files), 2)


if __name__ == "__main__":
    unittest.main()
