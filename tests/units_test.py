#!/usr/bin/env python3
"""Every `double` or `float` that a header declares as a member or parameter states its unit.

A member: `[unit]` in the comment on its line or in the comment block above it. A parameter: "`name` [unit]" in the comment
block above the function, or `[unit]` in a comment on its own line. `[-]` stands for a number without a unit; a name with a
frame (`x_W`) needs no unit. Run it from anywhere, with files or folders to check or none for all rooms; `--self-test` shows that
it can fail.
"""
import re
import sys
import tempfile
from pathlib import Path

ROOMS = ("idl", "server", "devices", "clients", "scenarios")
UNIT = re.compile(r"\[[^\[\]()=&*]{1,24}\]")
NUMBER = re.compile(r"(?<![\w:<])(?:double|float)\s*&?\s+&?([A-Za-z_]\w*)(?!\w*\s*\()((?:\s*(?:=[^,;()]*)?,\s*[A-Za-z_]\w*(?=\s*(?:[,;=)]|$)))*)")
SCOPE = re.compile(r"\b(namespace|class|struct|union|enum)\b[^;(){}]*$")
COMMENT = re.compile(r"//.*")
FRAME = re.compile(r"_[A-Z]\w*$")


def declarations(text):
    """(line number, declaration, comments above, comments on its lines) outside of function bodies."""
    stack, code, above, beside, start, parens = [], "", [], [], 0, 0
    for number, line in enumerate(text.splitlines(), 1):
        comment = COMMENT.search(line)
        words = (line[: comment.start()] if comment else line)
        if not code.strip() and not words.strip():
            above = above + [comment.group()] if comment else []
            continue
        if words.lstrip().startswith("#"):
            continue
        if comment:
            beside.append((comment.group(), len(code)))
        for character in words + "\n":
            if not code.strip() and not character.isspace():
                start = number
            parens += (character == "(") - (character == ")")
            if character == "{" and parens == 0:
                opened = SCOPE.search(code)
                if "body" in stack or not opened:
                    if "body" not in stack and "(" in code:
                        yield start, code, above, beside
                        code, above, beside = "", [], []
                    stack.append("body" if "(" in code or "body" in stack or code == "" else "value")
                else:
                    stack.append(opened.group(1))
                    code, above, beside = "", [], []
                continue
            if character == "}" and parens == 0:
                kind = stack.pop() if stack else ""
                if kind == "body" and "body" not in stack:
                    code, above, beside = "", [], []
                continue
            if "body" in stack:
                continue
            if character == ";" and parens == 0:
                if "value" not in stack:
                    # a comment may follow the semicolon on this line
                    yield start, code, above, beside
                    code, above, beside = "", [], []
                continue
            if "value" not in stack:
                code += character
        if re.fullmatch(r"\s*(public|private|protected)\s*:\s*", code):
            code, above, beside = "", [], []


def faults_in_text(text):
    found = []
    for number, code, above, beside in declarations(text):
        if re.match(r"\s*(using|typedef|static_assert|template\s*<[^>]*>\s*using|friend)\b", code):
            continue
        parameters = re.search(r"\(", code)
        block = " ".join(line.lstrip("/ <") for line in above)
        trailing = " ".join(line for line, _ in beside)
        for match in NUMBER.finditer(code):
            names = [match.group(1)] + re.findall(r",\s*([A-Za-z_]\w*)", match.group(2) or "")
            inside = parameters is not None and match.start() > parameters.start() and not re.match(
                r"\s*(?:static |inline |constexpr |const )*(?:double|float)\s+\w+\s*(=|$)", code)
            if inside:
                names = names[:1]
            for name in names:
                if FRAME.search(name):
                    continue
                if inside:
                    own = re.search(r"`?\b" + name + r"`?(?:,? (?:and|or|to|,) `?\w+`?)*(?:, `\w+`)* \[[^\]]+\]", block + " " + trailing)
                    line = next((text for text, at in beside if at >= match.start() and at - match.start() < 90), "")
                    if own or (UNIT.search(line) and len(beside) > 1):
                        continue
                elif UNIT.search(trailing) or UNIT.search(block):
                    continue
                found.append((number + code[: match.start()].lstrip("\n").count("\n"), name, "parameter" if inside else "member"))
    return found


def self_test():
    bad = """
namespace tenon {
struct A {
  double x = 0.0;
  double y;  ///< a height
  std::array<double, 3> skipped;
  void f(double a);
  /// Moves by `b` [m].
  void g(double b, double c);
};
}
"""
    good = """
namespace tenon {
struct A {
  double x = 0.0;  ///< [m]
  /// [1/s] a rate
  double y;
  double z_W, w_W;
  /// Moves by `b` [m], `c` [-].
  void g(double b, double c) { double local = 0.0; use(local); }
  inline double h() { double k = 1; return k; }
};
}
"""
    expected = ["x", "y", "a", "c"]
    found = [name for _, name, _ in faults_in_text(bad)]
    if found != expected or faults_in_text(good):
        print(f"the units test is blind: found {found} of {expected}, and {faults_in_text(good)} in good code")
        return 1
    print("units test: finds all planted faults")
    return 0


def main():
    words = sys.argv[1:]
    if "--self-test" in words:
        return self_test()
    root = Path(__file__).resolve().parent.parent
    places = [Path(word) for word in words] or [root / room for room in ROOMS]
    files = sorted(file for place in places for file in ([place] if place.is_file() else place.rglob("*.h")) if not file.name.endswith("_inl.h"))
    count = 0
    for file in files:
        for number, name, kind in faults_in_text(file.read_text(encoding="utf-8")):
            print(f"{file}:{number}: {kind} `{name}` has no [unit]")
            count += 1
    print(f"units: {count} numbers without a unit in {len(files)} headers")
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
