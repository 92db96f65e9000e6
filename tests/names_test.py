#!/usr/bin/env python3
"""What names the tree may use: one namespace a room, no type name twice, no name of two anonymous namespaces that a unity build joins,
no word that the glossary replaced, nor as a part of a compound name.

Run by tests/architecture_test.py, which holds the rooms and their namespaces; alone, `tests/names_test.py WORD...` prints the
lines of the tree that retired words match in the given files or folders.
"""
import re
import sys
import tempfile
from fnmatch import fnmatch
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from source_text import code_of, files_below, line_at, read

TOPS = ("idl", "server", "devices", "clients", "scenarios", "tests")
# namespaces inside of a room's own, by room
INNER = {"idl/record": {"mcap"}, "scenarios/part_generator": {"engine_bay"},
         "server/collision": {"HWY_NAMESPACE", "cull", "exact"}}  # Highway compiles its own once for each instruction set
LANES = {"cull", "exact"}  # lanes of floats and of doubles have types of the same names
TEST_HELPERS = "tenon::test"
# files that define functions of the C library, which have no namespace: their helpers stand in an anonymous one
NO_NAMESPACE = {"tests/support/realtime_guard.cpp"}
OWN_NAMESPACE = {"tests/support": TEST_HELPERS, "tests/bench": "tenon::bench"}

NAMESPACE = re.compile(r"(?:^|[;})]|\s)(?:inline\s+)?namespace(?:\s+([A-Za-z_][\w:]*))?\s*$")
TYPE = re.compile(r"(?:^|[>;}\s])(?:class|struct|union|enum(?:\s+(?:class|struct))?)\s+"
                  r"(?:alignas\s*\([^()]*(?:\([^()]*\))?[^()]*\)\s*|\[\[[^\]]*\]\]\s*)*([A-Za-z_]\w*)(?:\s+final)?\s*(?::(?!:)[^(){}]*)?$")
ALIAS = re.compile(r"(?:^|[>\s])using\s+([A-Za-z_]\w*)\s*(?:\[\[[^\]]*\]\]\s*)?=")
TYPEDEF = re.compile(r"^\s*typedef\b.*?([A-Za-z_]\w*)\s*(?:\[[^\]]*\])?$", re.S)
# nothing but forward declarations, of another room's classes
FORWARD = re.compile(r"\s*(?:(?:class|struct)\s+\w+;\s*)+\}")
FUNCTION = re.compile(r"([A-Za-z_]\w*)\s*\((.*)\)", re.S)
VARIABLE = re.compile(r"\s([A-Za-z_]\w*)\s*(?:\[[^\]]*\]\s*)*$")
NO_OBJECT = re.compile(r"(?:using|typedef|static_assert|extern|namespace|class|struct|union|enum)\b")
# rooms that the sanitizers compile as unity builds, so that the anonymous namespaces of their .cpp files are one
UNITY = re.compile(r"(?:idl|server(?!/tools/)|devices|clients/(?:haptic|rehearse))/")
USING_ALL = re.compile(r"^\s*using\s+namespace\s+([\w:]+)")


def outline(code):
    """Of code without comments: namespaces (line, their names from the outside in), types (line, name), `using namespace`s
    (line, name) at namespace scope, and what anonymous namespaces define (line, name). An anonymous namespace is "", `extern "C"`
    is None."""
    scopes, spaces, types, usings, anonymous = [], [], [], [], []
    head, start, parens = [], 0, 0
    for found in re.finditer(r"[{};()]|[^{};()]+", code):
        token = found.group()
        if token not in "{};()" or parens or token in "()":
            parens = max(0, parens + (token == "(") - (token == ")"))
            if not head and token.strip():
                start = found.start() + len(token) - len(token.lstrip())
            head.append(token)
            continue
        text = "".join(head)
        outside = all(kind == "namespace" for kind, _ in scopes)
        if outside and scopes and scopes[-1][1] == "" and token != "}":
            name = anonymous_name(text, token == "{")
            anonymous += [(line_at(code, start), name)] if name else []
        if token == "{":
            space, type_ = NAMESPACE.search(text), TYPE.search(text)
            if outside and space:
                scopes.append(("namespace", space.group(1) or ""))
                if "::" not in (space.group(1) or "") or not FORWARD.match(code, found.end()):
                    spaces.append((line_at(code, start), [name for _, name in scopes]))
            elif outside and text.split()[:1] == ["extern"] and "(" not in text and "=" not in text:
                scopes.append(("namespace", None))
            else:
                if outside and type_ and not LANES & {name for _, name in scopes}:
                    types.append((line_at(code, start + text.strip().rfind(type_.group(1))), type_.group(1)))
                scopes.append(("body", None))
        elif token == "}":
            if scopes:
                scopes.pop()
        elif outside:
            alias = ALIAS.search(text) or TYPEDEF.search(text)
            if alias and re.search(r"::" + alias.group(1) + r"\s*$", text):
                alias = None  # a nested name without its class: the same type
            if alias and LANES & {name for _, name in scopes}:
                alias = None
            if alias:
                types.append((line_at(code, start), alias.group(1)))
            whole = USING_ALL.search(text)
            if whole:
                usings.append((line_at(code, start), whole.group(1)))
        head = []
    return spaces, types, usings, anonymous


def parameter_types(text):
    """"const A& a, int b = 1" -> "const A&, int"."""
    kept, depth = [""], 0
    for sign in text:
        depth += (sign in "<([{") - (sign in ">)]}")
        if sign == "," and not depth:
            kept.append("")
        else:
            kept[-1] += sign
    return ", ".join(re.sub(r"(?<=[\s&*>])\w+$", "", " ".join(one.split("=")[0].split())).strip() for one in kept)


def anonymous_name(text, is_body):
    """The name, a function's with the types of its parameters, that a definition in an anonymous namespace adds; None: none."""
    text = re.sub(r"^\s*template\s*<[^{}]*?>\s*(?=[\w\[])", "", text.strip())
    if NO_OBJECT.match(text):
        return None
    before = text.split("=")[0].rstrip()
    function = FUNCTION.search(text) if "(" in before else None
    if function:
        return f"{function.group(1)}({parameter_types(function.group(2))})" if is_body else None
    variable = VARIABLE.search(before)
    return variable.group(1) if variable else None


def allowed_namespaces(path, namespaces):
    """(names that the file's outermost namespace may have, names that may stand inside of it)."""
    folder = str(Path(path).parent)
    for place, namespace in OWN_NAMESPACE.items():
        if folder == place or folder.startswith(place + "/"):
            return {namespace}, set()
    room = folder[len("tests/"):] if folder.startswith("tests/") else folder
    while room not in namespaces and "/" in room:
        room = room.rsplit("/", 1)[0]
    names = {namespaces[room]} if room in namespaces else set()
    if folder.startswith("tests"):
        names = names | {TEST_HELPERS}
    return names, INNER.get(room, set())


def namespace_faults(path, code, spaces, usings, namespaces):
    faults = []
    names, inner = allowed_namespaces(path, namespaces)
    said = " or ".join(sorted(names))
    is_main = re.search(r"\bint\s+main\s*\(", code) is not None
    for line, space in spaces:
        outermost = space[0]
        if outermost == "" and (is_main or path in NO_NAMESPACE) and len(space) == 1:
            continue
        within = [name for name in names if outermost == name or (outermost or "").startswith(name + "::")]
        rest = (outermost[len(within[0]):].split("::")[1:] if within else []) + [name for name in space[1:] if name]
        if not within:
            faults.append(f"{path}:{line}: opens namespace {outermost or '(anonymous)'}, its room's is {said}")
        elif not set(rest) <= inner:
            faults.append(f"{path}:{line}: opens namespace {'::'.join(rest)} inside of {within[0]}: one namespace a room")
        elif space[-1] == "" and path.endswith(".h"):
            faults.append(f"{path}:{line}: an anonymous namespace in a header is another one in each .cpp")
    if not spaces and not is_main and code.strip():
        faults.append(f"{path}:1: opens no namespace, its room's is {said}")
    faults += [f"{path}:{line}: using namespace {name}: name what is used" for line, name in usings]
    return faults


def type_faults(types):
    """types: name -> places. A name stands for one type in the whole tree."""
    return [f"{places[-1]}: type {name} is there {len(places)} times, also {', '.join(places[:-1])}: one name, one type"
            for name, places in sorted(types.items()) if len(places) > 1]


def anonymous_faults(names):
    """names: (folder, name) -> files and lines."""
    return [f"{places[-1]}: {name} is in another anonymous namespace of {folder} too, {places[0]}: unity builds join them"
            for (folder, name), places in sorted(names.items()) if len({place.split(":")[0] for place in places}) > 1]


# ---- retired words

TEXT_TOPS = TOPS + ("deploy", "docs", "tenon", "README.md", "ARCHITECTURE.md", "DECISIONS.md", "CONTRIBUTING.md", "CHANGELOG.md",
                    "CMakeLists.txt", "CMakePresets.json")
TEXT_ENDINGS = {".h", ".cpp", ".py", ".idl", ".yaml", ".json", ".md", ".txt", ".sh", ".mjs", ".cmake", ".in", ""}
WORD_LIST = "tests/retired_words.txt"


def retired_words(text):
    """(pattern, what to write instead, globs of files that may have it) of each line of tests/retired_words.txt."""
    words, allowed = [], []
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        fields = [field.strip() for field in line.split(" | ")]
        if fields[0] == "allow":
            allowed += fields[1].split()
            continue
        if len(fields) not in (2, 3) or not all(fields[:2]):
            raise ValueError(f"{WORD_LIST}:{number}: wants `pattern | what to write instead | files that may have it`")
        words.append((re.compile(fields[0]), fields[1], (fields[2].split() if len(fields) == 3 else [])))
    return words, allowed


COMPOUND = re.compile(r"\b(?=\w*(?:[a-z0-9][A-Z]|[A-Z]{2}[a-z]|[A-Za-z]\d|_))[A-Za-z_]\w*")
PART = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+|\d+")


def compound_faults(identifier, words):
    """What to write instead of retired words that are parts of an identifier: "kinkAngle" and "kink_angle" are judged as "kink angle"."""
    parts = " ".join(PART.findall(identifier))
    return [instead for pattern, instead in words
            if not pattern.search(identifier) and (pattern.search(parts) or pattern.search(parts.lower()))]


def word_faults_in_text(path, text, words, allowed):
    if path in (WORD_LIST, "tests/names_test.py") or any(fnmatch(path, glob) for glob in allowed):
        return []
    faults = []
    words = [(pattern, instead) for pattern, instead, globs in words if not any(fnmatch(path, glob) for glob in globs)]
    for pattern, instead in words:
        for found in pattern.finditer(text):
            shown = " ".join(found.group().split())
            faults.append(f"{path}:{line_at(text, found.start())}: `{shown}`: write {instead}")
    for identifier in sorted(set(COMPOUND.findall(text))):
        for instead in compound_faults(identifier, words):
            line = line_at(text, re.search(rf"\b{identifier}\b", text).start())
            faults.append(f"{path}:{line}: `{identifier}`: write {instead}")
    return faults


def word_faults(root, tops=TEXT_TOPS):
    words, allowed = retired_words(read(root / WORD_LIST))
    faults = []
    for path, file in files_below(root, [top for top in tops if (root / top).exists()], TEXT_ENDINGS):
        try:
            faults += word_faults_in_text(path, read(file), words, allowed)
        except UnicodeDecodeError:
            continue  # not a text
    return faults


def faults_in(root, namespaces):
    faults, types, anonymous = [], {}, {}
    for path, file in files_below(root, TOPS, {".h", ".cpp"}):
        code = code_of(read(file))
        spaces, named, usings, hidden = outline(code)
        faults += namespace_faults(path, code, spaces, usings, namespaces)
        for line, name in named:
            types.setdefault(name, []).append(f"{path}:{line}")
        for line, name in hidden if path.endswith(".cpp") and UNITY.match(path) else ():
            anonymous.setdefault((str(Path(path).parent), name), []).append(f"{path}:{line}")
    return faults + type_faults(types) + anonymous_faults(anonymous) + word_faults(root)


def self_test():
    rooms = {"server/collision": "tenon::collision", "idl/record": "tenon::record", "clients/station": "tenon::station"}
    planted = [  # path, text, a part of each fault that must be found
        ("server/collision/a.h", "namespace tenon {\nclass A;\n}\n", ["a.h:1: opens namespace tenon,"]),
        ("server/collision/b.h", "namespace tenon::collision { struct B { struct Cell {}; }; }\n", []),
        ("server/collision/c.h", "namespace tenon::collision { namespace { int x; } }\n", ["anonymous namespace in a header"]),
        ("server/collision/c.cpp", "namespace tenon::collision { namespace { struct Cell final : B { int x = f({1}); }; } }\n", []),
        ("server/collision/d.cpp", "namespace tenon::collision { namespace detail { } }\n", ["opens namespace detail inside"]),
        ("server/collision/e.cpp", "namespace tenon::collision {}\nnamespace tenon::station {}\n", ["e.cpp:2: opens namespace tenon::station"]),
        ("server/collision/f.cpp", "namespace { int x; }\n", ["f.cpp:1: opens namespace (anonymous)"]),
        ("server/collision/g.cpp", "int x;\n", ["opens no namespace"]),
        ("server/collision/h.cpp", "namespace tenon::collision { using namespace std; }\n", ["using namespace std"]),
        ("server/collision/i_inl.h", "namespace tenon::collision { namespace HWY_NAMESPACE { struct Ball {}; namespace cull { struct Box {}; } } }\n", []),
        ("server/collision/j.h", "namespace tenon::station {\nclass Ball;\n}\nnamespace tenon::collision { using Cell = Ball::Cell; }\n", []),
        ("idl/record/mcap.h", "namespace tenon::record::mcap { enum class Cell : char { kOne }; }\n",
         ["type Cell is there 2 times"]),
        ("server/collision/k.cpp", "namespace tenon::collision { namespace {\nconstexpr int kA = 1;\nint f(int a, const B& b) { return 1; }\n"
         "template <class T> void g(T a) {} } }\n", []),
        ("server/collision/l.cpp", "namespace tenon::collision { namespace {\nconstexpr std::array<int, 2> kA{1, 2};\n"
         "int f(double a, const B& b) { return 1; }\nbool g(T other) {} } }\n", ["l.cpp:2: kA is in another", "l.cpp:4: g(T) is in another"]),
        ("server/collision/m.cpp", "namespace tenon::collision { namespace { int f(int c,\n const B& d = {}) { int kA = 1; } } }\n",
         ["m.cpp:1: f(int, const B&) is in another"]),
        ("clients/station/main.cpp", "namespace { int x; }\nint main() {}\n", []),
        ("clients/station/other_main.cpp", "using namespace tenon;\nint main() {}\n", ["using namespace tenon"]),
        ("clients/station/j.cpp", "namespace tenon::station { using Ball = int; using std::vector; template <class T> using Box = T; }\n",
         ["type Ball is there 2 times"]),
        ("tests/clients/station/k_test.cpp", "namespace tenon::station { struct alignas(64) Box { int a; }; struct Box2; void f(struct Box3* b); }\n",
         ["type Box is there 2 times"]),
        ("tests/clients/station/helper.h", "namespace tenon::test { class [[nodiscard]] Helper {}; template <> struct Helper2<int> {}; }\n", []),
        ("tests/support/l.h", "namespace tenon::station { }\n", ["its room's is tenon::test"]),
        ("tests/support/m.h", "namespace tenon::test { constexpr auto kText = R\"(struct Box {)\"; // struct Box {\n typedef int Helper; }\n",
         ["type Helper is there 2 times"]),
    ]
    missed = []
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for path, text, _ in planted:
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text(text, encoding="utf-8")
        (root / WORD_LIST).write_text(r"""# a comment
\brub(s|bed)?\b | friction | docs/old.md
who\s+pays | who bears it
allow | server/words.h
""", encoding="utf-8")
        (root / "docs").mkdir()
        (root / "docs/new.md").write_text("a rubber that rubs\nwho\npays, rub_count rub_count\n", encoding="utf-8")
        (root / "docs/compound.md").write_text("rubber_count scrubAll rUb\nfooRubAll kRub\nCPURub who_pays whoPays\n", encoding="utf-8")
        (root / "docs/old.md").write_text("a rub\n", encoding="utf-8")
        (root / "docs/picture.txt").write_bytes(b"\xff\xfe rub")
        (root / "server/words.h").write_text("// rubbed\nnamespace tenon::collision { }\n", encoding="utf-8")
        found = faults_in(root, {**rooms, "server": "tenon::collision"})
    expected = [said for _, _, faults in planted for said in faults]
    expected += ["docs/new.md:1: `rubs`: write friction", "docs/new.md:2: `who pays`: write who bears it",
                 "docs/new.md:3: `rub_count`: write friction", "docs/compound.md:2: `fooRubAll`: write friction",
                 "docs/compound.md:2: `kRub`: write friction", "docs/compound.md:3: `CPURub`: write friction",
                 "docs/compound.md:3: `who_pays`: write who bears it", "docs/compound.md:3: `whoPays`: write who bears it"]
    left = list(found)
    for said in expected:
        hit = next((fault for fault in left if said in fault), None)
        if hit is None:
            missed.append(f"not found: {said}")
        else:
            left.remove(hit)
    missed += [f"found without reason: {fault}" for fault in left]
    try:
        retired_words("only a pattern\n")
        missed.append("not found: a line of the word list without what to write instead")
    except ValueError:
        pass
    for line in missed:
        print(line)
    print(f"names test: {'is blind' if missed else 'finds what it must'}: {len(expected)} planted faults")
    return 1 if missed else 0


def main():
    root, places = Path(__file__).resolve().parent.parent, sys.argv[1:]
    if places in (["-h"], ["--help"]):
        print("usage: tests/names_test.py [--self-test | FILE or FOLDER...]   retired words in them, or in the whole tree")
        return 0
    if places == ["--self-test"]:
        return self_test()
    faults = word_faults(root, [Path(place).resolve().relative_to(root).as_posix() for place in places] or TEXT_TOPS)
    for fault in faults:
        print(fault)
    print(f"names: {len(faults)} retired words")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
