#!/usr/bin/env python3
"""Writes the C++ that follows from idl/tenon.idl; the build runs it: generate.py IDL_FILE FOLDER

FOLDER/idl/wire/idl_text.cpp   the text of the IDL file, the schema in recordings
FOLDER/idl/wire/topic_list.h   the topics by the lines `//@topic` of the IDL file, its messages and enumerations

Fails with FILE:LINE and what to write there when a line `//@...` cannot be understood.
"""
import re
import sys
from pathlib import Path

USAGE = "//@topic NAME stream|state|event [PARAMETER...]"
CLASSES = {"stream": "kStream", "state": "kState", "event": "kEvent"}
TIMES = ("deadline", "lease", "lifespan")
DEPTHS = {"late_joiner_depth": 1000, "reader_depth": 16}  # and an example
FLAGS = ("lease_by_topic", "latched", "of_server", "request")
MEMBERS = ("deadline", "lease", "lease_by_topic", "lifespan", "late_joiner_depth", "reader_depth", "latched", "of_server", "request")  # of TopicParameters
PARAMETERS = "deadline=10ms, lease=1000ms, lifespan=5000ms, late_joiner_depth=1000, reader_depth=16, lease_by_topic, latched, of_server or request"


class Fault(Exception):
    """A line of the IDL file that says what no topic can be."""

    def __init__(self, line, what):
        super().__init__(what)
        self.line = line


class Topic:
    def __init__(self, line, words):
        if len(words) < 2:
            raise Fault(line, f"a topic needs a name and a class: write {USAGE}")
        self.line, self.name, self.qos_class = line, words[0], words[1]
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", self.name):
            raise Fault(line, f"'{self.name}' is not a topic name: write letters, digits and _, a letter first")
        if self.qos_class not in CLASSES:
            raise Fault(line, f"'{self.qos_class}' is not a class: write {USAGE}")
        self.parameters = {}
        for word in words[2:]:
            self.add(*word.partition("="))
        self.check()

    @property
    def constant(self):
        return "k" + self.name[0].upper() + self.name[1:].replace("_", "")

    def add(self, key, equals, value):
        if key in self.parameters:
            raise Fault(self.line, f"'{key}' is there twice: write it once")
        if key in TIMES:
            if not re.fullmatch(r"[1-9][0-9]*ms", value):
                raise Fault(self.line, f"'{key}' needs a time in milliseconds: write {key}=1000ms")
            self.parameters[key] = f"Milliseconds{{{value[:-2]}}}"
        elif key in DEPTHS:
            if not re.fullmatch(r"[1-9][0-9]*", value):
                raise Fault(self.line, f"'{key}' needs a number of samples: write {key}={DEPTHS[key]}")
            self.parameters[key] = value
        elif key in FLAGS:
            if equals:
                raise Fault(self.line, f"'{key}' has no value: write {key}")
            self.parameters[key] = "true"
        else:
            raise Fault(self.line, f"'{key}' is not a parameter: write {PARAMETERS}")

    def check(self):
        if "late_joiner_depth" in self.parameters and self.qos_class != "event":
            raise Fault(self.line, "'late_joiner_depth' is for events: leave it out (late joiners get the last sample "
                                   "of a state and none of a stream)")
        if "reader_depth" in self.parameters and self.qos_class != "stream":
            raise Fault(self.line, "'reader_depth' is for streams: leave it out (readers keep all events, and of a state the last)")
        if "latched" in self.parameters and self.qos_class != "state":
            raise Fault(self.line, f"'latched' is for states: leave it out, or write {self.name} state latched")
        if "request" in self.parameters and (self.qos_class != "event" or "of_server" in self.parameters):
            raise Fault(self.line, "'request' is for events of clients, who wait for the server's answer: leave it out")
        if "lease_by_topic" in self.parameters and "lease" not in self.parameters:
            raise Fault(self.line, "'lease_by_topic' says which lease is meant: write lease=50ms before it")
        if self.qos_class == "state":
            self.parameters["late_joiner_depth"] = "1"

    def initializer(self):
        members = ", ".join(f".{key} = {self.parameters[key]}" for key in MEMBERS if key in self.parameters)
        return f'{{"{self.name}", QosClass::{CLASSES[self.qos_class]}, {{{members}}}}}'


def read_topics(text):
    """Pairs of message name and topic, in the order of the file."""
    found, waiting = [], []
    for number, line in enumerate(text.splitlines(), 1):
        line = line.strip()
        if line.startswith("//@"):
            words = line[3:].split()
            if not words or words[0] != "topic":
                raise Fault(number, f"'{line}' is not known: write {USAGE}")
            waiting.append(Topic(number, words[1:]))
            continue
        struct = re.search(r"\bstruct\s+(\w+)", line.partition("//")[0])
        if struct:
            check_struct(number, line, struct[1], waiting)
            found += [(struct[1], topic) for topic in waiting]
        elif waiting:
            raise Fault(waiting[-1].line, "no struct on the next line: write //@topic directly above the struct of the topic")
        waiting = []
    if waiting:
        raise Fault(waiting[-1].line, "no struct on the next line: write //@topic directly above the struct of the topic")
    check_names(found)
    return found


def check_struct(number, line, name, topics):
    if not line.startswith("@final"):
        raise Fault(number, f"'{name}' is not @final: write @final before it, as every type of the protocol is")
    nested = re.search(r"@nested\b", line) is not None
    if nested and topics:
        raise Fault(number, f"'{name}' is @nested, so it has no topic: remove @nested or the line //@topic")
    if not nested and not topics:
        raise Fault(number, f"'{name}' has no topic: write //@topic {name} stream above it, or @nested when it is "
                            "only part of other messages")


def check_names(found):
    lines = {}
    for _, topic in found:
        first = lines.setdefault(topic.constant, topic)
        if first is not topic:
            raise Fault(topic.line, f"topic '{topic.name}' has the constant {topic.constant}, as '{first.name}' in "
                                    f"line {first.line} has: write another name")


def read_enumerations(text):
    """Pairs of enumeration name and number of its enumerators."""
    code = re.sub(r"//[^\n]*", "", text)
    return [(name, len([word for word in body.split(",") if word.strip()]))
            for name, body in re.findall(r"\benum\s+(\w+)\s*\{([^}]*)\}", code)]


MEMBER = re.compile(r"(?:sequence<\s*(?P<element>\w+)(?:<\d+>)?\s*,\s*\d+\s*>|(?P<type>\w+)(?:<\d+>)?)"
                    r"\s+\w+(?:\[(?P<size>\d+)\])?")


def count_fields(text):
    """For each struct, how many numbers, texts, arrays and lists it has, those in its structs and list elements too."""
    code = re.sub(r"//[^\n]*", lambda comment: " " * len(comment[0]), text)
    counts = {}
    for struct in re.finditer(r"\bstruct\s+(\w+)\s*\{([^}]*)\}", code):
        counts[struct[1]] = 0
        for statement in re.finditer(r"[^;]+", struct[2]):
            member = re.sub(r"@\w+", "", statement[0]).strip()
            if not member:
                continue
            found = MEMBER.fullmatch(member)
            if not found:
                at = struct.start(2) + statement.start() + re.match(r"\s*", statement[0]).end()
                raise Fault(code.count("\n", 0, at) + 1, f"'{member}' is not a member: write TYPE NAME, TYPE NAME[COUNT] or "
                                                         "sequence<TYPE, BOUND> NAME")
            if found["element"] == "octet":
                counts[struct[1]] += 1
            elif found["element"]:
                counts[struct[1]] += 1 + counts.get(found["element"], 1)
            elif found["type"] in counts:
                counts[struct[1]] += counts[found["type"]] * int(found["size"] or 1)
            else:
                counts[struct[1]] += 1
    return counts


def idl_text(text):
    if ')idl"' in text:
        line = text[:text.index(')idl"')].count("\n") + 1
        raise Fault(line, "')idl\"' ends the text in idl_text.cpp: write something else")
    return f"""// Written by idl/generate.py from idl/tenon.idl.
#include "idl/wire/codec.h"

namespace tenon::wire {{

std::string_view idlText() {{
  return R"idl({text})idl";
}}

}}  // namespace tenon::wire
"""


def topic_list(text):
    topics = read_topics(text)
    messages = list(dict.fromkeys(message for message, _ in topics))
    declared = "\n".join(f"struct {message};" for message in messages)
    constants = "\n".join(f"inline constexpr Topic<{message}> {topic.constant}{topic.initializer()};"
                          for message, topic in topics)
    visits = "\n".join(f"  visit({topic.constant});" for _, topic in topics)
    each_message = " \\\n".join(f"  X({message})" for message in messages)
    counts = count_fields(text)
    each_count = " \\\n".join(f"  X({message}, {counts[message]})" for message in messages)
    each_enumeration = " \\\n".join(f"  X({name}, {count})" for name, count in read_enumerations(text))
    return f"""// Written by idl/generate.py from idl/tenon.idl; included by idl/wire/topics.h.
#pragma once

namespace tenon {{
{declared}
}}  // namespace tenon

namespace tenon::wire {{

{constants}

/// Calls visit(topic) for every topic, in the order of idl/tenon.idl.
template <class Visit>
void forEachTopic(Visit&& visit) {{
{visits}
}}

/// Every message type once: `#define X(M) ...` then `TENON_WIRE_MESSAGES(X)`.
#define TENON_WIRE_MESSAGES(X) \\
{each_message}

/// Every message type and the number of its fields, by which the tests find a field that idl/wire/fields.h leaves out.
#define TENON_WIRE_FIELD_COUNTS(X) \\
{each_count}

/// Every enumeration and the number of its enumerators: `#define X(E, COUNT) ...` then `TENON_WIRE_ENUMERATIONS(X)`.
#define TENON_WIRE_ENUMERATIONS(X) \\
{each_enumeration}

}}  // namespace tenon::wire
"""


def write(file, text):
    """Leaves a file alone that has this text already, so that nothing is compiled again."""
    file.parent.mkdir(parents=True, exist_ok=True)
    if not file.exists() or file.read_text(encoding="utf-8") != text:
        file.write_text(text, encoding="utf-8")


def main(arguments):
    if len(arguments) != 2:
        print("usage: generate.py IDL_FILE FOLDER", file=sys.stderr)
        return 2
    source, folder = Path(arguments[0]), Path(arguments[1])
    try:
        text = source.read_text(encoding="utf-8")
        topics, schema = topic_list(text), idl_text(text)
    except OSError as problem:
        print(f"{source}: {problem.strerror}", file=sys.stderr)
        return 1
    except Fault as fault:
        print(f"{source}:{fault.line}: {fault}", file=sys.stderr)
        return 1
    write(folder / "idl/wire/topic_list.h", topics)
    write(folder / "idl/wire/idl_text.cpp", schema)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
