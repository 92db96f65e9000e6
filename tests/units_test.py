#!/usr/bin/env python3
"""Every `double` or `float` that a header declares as a member or parameter states its unit.

A member: `[unit]` in the comment on its lines, or in the comment block above it. A parameter: "`name` [unit]" in the comment
block above the function ("`a`, `b` [m]" and "`a` and `b` [m]" stand for both), or `[unit]` in a comment on its own line. `[-]`
stands for a number without a unit; a name with a frame (`x_W`) needs no unit. References, pointers and arrays of numbers count,
and so does what a container holds (`std::vector<double>`, `std::optional<float>`, also one in another); what other templates hold
(`std::map<int, double>`) and what a function returns (`Result<double>`) does not.

Run it from anywhere, with files or folders to check or none for all rooms; `--self-test` shows that it can fail.
"""
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from source_text import DIRECTIVE, TOKEN, blank, files_below, read

ROOMS = ("idl", "server", "devices", "clients", "scenarios")
UNITS = set("""- % 1 m mm µm km s ms µs ns min h kg g N mN kN Nm mNm rad deg ° Hz kHz Ns Nms J W V A K Pa dB bit bits byte bytes kB MB
px pixel pixels tick ticks step steps point points sample samples voxel voxels cell cells row rows contact contacts
brick bricks query queries kgm2 Nms kFarPerVoxel kQuantaPerVoxel SI""".split())
BRACKET = re.compile(r"\[([^\[\]]{1,40})\]")
SCOPE = re.compile(r"\b(namespace|class|struct|union|enum)\b[^;(){}=]*$|\bextern\s*$")
ALIGNED = re.compile(r"\balignas\s*\([^()]*\)")
NUMBER = re.compile(r"\b(?:double|float)\b")
CONTAINER = re.compile(r"\bstd::(?:vector|array|span|optional|deque|atomic|initializer_list)\s*<\s*(?:const\s+)?(?:double|float)"
                       r"\s*(?:,[^<>]*)?>")
FRAME = re.compile(r"_[A-Z]\w*$")
CLOSING = {")": "(", "]": "[", "}": "{", ">": "<"}


def is_unit(text):
    """`m/s`, `N·s²`, `1/s`, `Nm/rad`, `kg m^2`, `N or Nm`, `ns since 1970`, `unit of v`: units and their powers, no other words."""
    text = re.sub(r"\b(since 1970|of (this|its) level)\b|\bsqrt\b", "", text)
    if re.match(r"(any )?unit( of |: |$)", text.strip()):
        return True
    if re.search(r",|\bor\b", text):
        return all(is_unit(part) for part in re.split(r",\s*(?:or\b)?|\bor\b", text))
    words = [word for word in re.split(r"[\s/·*()]+", text.strip()) if word] or [text]
    return words != ["1"] and all(re.sub(r"(\^-?\d(\.\d)?|[²³]|-\d)$", "", word) in UNITS for word in words)


def has_unit(text):
    return any(is_unit(inside) for inside in BRACKET.findall(text))


class Declaration:
    """A statement at class or namespace scope: its code, the line of each character, the comments that belong to it."""

    def __init__(self, above):
        self.code, self.lines, self.above, self.beside = "", [], above, []  # beside: (line, comment)

    def add(self, character, line):
        self.code += character
        self.lines.append(line)


def declarations(text):
    """What a header declares outside of function bodies."""
    comments = {}
    for found in TOKEN.finditer(text):
        if found.group().startswith(("//", "/*")):
            for number, part in enumerate(found.group().split("\n"), text.count("\n", 0, found.start()) + 1):
                comments[number] = comments.get(number, "") + part
    code = DIRECTIVE.sub(lambda found: blank(found.group()), TOKEN.sub(lambda found: blank(found.group()), text))

    stack, done, now, above, depth, ended = [], [], None, [], 0, 0
    for number, line in enumerate(code.split("\n"), 1):
        comment = comments.get(number)
        if not line.strip() and now is None:
            if comment and comment.startswith(("///<", "//<", "//!<")) and done:
                done[-1].beside.append((done[-1].lines[-1], comment))
            else:
                above = above + [comment] if comment else []
            continue
        for character in line + "\n":
            if character in "([":
                depth += 1
            elif character in ")]":
                depth = max(0, depth - 1)
            inside = any(kind != "scope" for kind in stack)
            if character == "{" and depth == 0:
                opened = now is not None and SCOPE.search(ALIGNED.sub("", now.code))
                if inside:
                    stack.append("body")
                elif opened:
                    stack.append("scope")
                    now, above = None, []
                elif now is not None and "(" in now.code and not re.search(r"(?<![=!<>+\-*/%&|^])=(?!=)", now.code.split("(")[0].replace("operator=", "")):
                    done.append(now)
                    stack.append("body")
                    now, above = None, []
                else:
                    stack.append("value")
            elif character == "}" and depth == 0:
                if stack:
                    stack.pop()
                now, above = (now, above) if stack and stack[-1] == "value" or now is not None else (None, [])
            elif character == ";" and depth == 0:
                if not inside and now is not None:
                    done.append(now)
                    ended = number
                if not inside:
                    now, above = None, []
            elif not inside and (now is not None or not character.isspace()):
                if now is None:
                    now = Declaration(above)
                now.add(character, number)
                if re.fullmatch(r"\s*(public|private|protected)\s*:", now.code):
                    now, above = None, []
        if comment:  # of the declaration that continues, or else of the last one that this line holds a part of
            last = now
            if last is None and done and number in (done[-1].lines[-1], ended):
                last = done[-1]
            if last is not None:
                last.beside.append((number, comment))
    return done


def pieces(text, offset=0):
    """(offset, piece) between the commas of `text` that stand in no bracket."""
    found, depth, begin = [], 0, 0
    for at, character in enumerate(text):
        if character in "([{<":
            depth += 1
        elif character in ")]}" or (character == ">" and text[at - 1: at] not in ("-", "=")):
            depth -= 1
        elif character == "," and depth == 0:
            found.append((offset + begin, text[begin:at]))
            begin = at + 1
    return found + [(offset + begin, text[begin:])]


def without_templates(text):
    """The text with what stands in <...> blanked, and containers of numbers as the number; `operator<` stays."""
    text = re.sub(r"operator\s*(<=>|<<=?|>>=?|<=?|>=?|->\*?)", lambda found: "operator" + "_" * (len(found.group()) - 8), text)
    before = None
    while before != text:
        before = text
        text = CONTAINER.sub(lambda found: "double".ljust(len(found.group())), text)
    before = None
    while before != text:
        before = text
        text = re.sub(r"<[^<>;{}]*>", lambda found: blank(found.group()), text)
    return text


def group_from(text, at):
    """The end of the bracket that opens at `at`, one past it."""
    depth = 0
    for end in range(at, len(text)):
        depth += (text[end] == "(") - (text[end] == ")")
        if depth == 0:
            return end + 1
    return len(text)


def name_in(declarator):
    """The name of `double x`, `const double& x`, `double x[3] = {}`; "" where it has none."""
    declarator = re.split(r"=|\{|\[", declarator, maxsplit=1)[0]
    found = re.search(r"\b(?:double|float)\b(?:\s+const)?[\s&*.]*(?:const\s+)?([A-Za-z_]\w*)?", declarator)
    return (found.group(1) or "") if found else ""


def numbers_of(code):
    """(offset, name, is a parameter) of each double or float that a declaration names."""
    plain = without_templates(code)
    if re.match(r"\s*(using|typedef|static_assert|friend)\b", plain) or re.match(r"\s*template\s*using\b", plain):
        return []
    paren = plain.find("(")
    value = re.search(r"(?<![=!<>+\-*/%&|^])=(?!=)", re.sub(r"operator\s*\S+?\s*(?=\()", lambda found: "o" * len(found.group()), plain))
    if paren < 0 or (value and value.start() < paren):  # members, with or without a value
        found = []
        if NUMBER.search(plain[: value.start() if value else None]):
            for index, (at, piece) in enumerate(pieces(plain)):
                name = name_in(piece) if index == 0 else (re.match(r"\s*[&*]*\s*([A-Za-z_]\w*)", piece) or [None, ""])[1]
                if name:
                    found.append((at + len(piece) - len(piece.lstrip()), name, False))
        return found
    found = []
    pointer = re.match(r"\(\s*(?:\w+::)*[*&]+\s*(?:const\s*)?\w*\s*(?:\[\w*\])?\s*\)\s*\(", plain[paren:])
    if pointer:  # a pointer to a function: its parameters stand in the second bracket
        paren += pointer.end() - 1
    elif re.search(r"\b(alignas|decltype|noexcept|explicit|requires|__attribute__)\s*$", plain[:paren]) or plain[:paren].rstrip().endswith("operator"):
        end = group_from(plain, paren)
        return [(at + end, *rest) for at, *rest in numbers_of(blank(code[:end])[end:] + code[end:])]
    inside = plain[paren + 1: group_from(plain, paren) - 1]
    for at, piece in pieces(inside, paren + 1):
        if not NUMBER.search(piece.split("=")[0]):
            continue
        nested = re.match(r"[^()]*\(\s*[*&]+\s*\w*\s*\)\s*\(", piece)  # a pointer to a function as a parameter
        if nested:
            found += [(at + offset, name, True) for offset, name, _ in numbers_of(piece) if name]
            continue
        found.append((at + len(piece) - len(piece.lstrip()), name_in(piece), True))
    return found


def states_unit(name, comment):
    """Whether the text says "`name` [unit]", or so for a list of names that has it."""
    for found in re.finditer(r"`" + re.escape(name) + r"`((?:,? (?:and|or|to)|,) `\w+`)*,? " + BRACKET.pattern, comment):
        if is_unit(found.group(2)):
            return True
    return False


def faults_in_text(text):
    """(line, name, "member" or "parameter") of each number without a unit."""
    found = []
    for declaration in declarations(text):
        above = " ".join(re.sub(r"^[/*!<\s]+", "", comment) for comment in declaration.above)
        above = re.sub(r"\s+", " ", above)
        beside = " ".join(re.sub(r"^[/*!<\s]+", "", comment) for _, comment in declaration.beside)
        numbers = numbers_of(declaration.code)
        for at, name, parameter in numbers:
            line = declaration.lines[min(at, len(declaration.lines) - 1)]
            if FRAME.search(name):
                continue
            if parameter:
                others = [1 for other, _, _ in numbers if declaration.lines[min(other, len(declaration.lines) - 1)] == line]
                on_line = " ".join(comment for where, comment in declaration.beside if where == line)
                alone = len(others) == 1 and declaration.lines[0] != line
                if name and (states_unit(name, above + " " + beside) or (alone and has_unit(on_line))):
                    continue
            elif has_unit(beside) or has_unit(above):
                continue
            found.append((line, name or "(without a name)", "parameter" if parameter else "member"))
    return found


def faults_in(root, places=()):
    """One sentence for each number without a unit below root, or in the places."""
    places = list(places) or [room for room in ROOMS if (root / room).exists()]
    return [f"{path}:{number}: {kind} `{name}` has no [unit]"
            for path, file in files_below(root, places, {".h"}) if not path.endswith("_inl.h")
            for number, name, kind in faults_in_text(read(file))]


BAD = """
namespace tenon {
struct A {
  double x = 0.0;
  double y;  ///< a height
  std::array<double, 3> three;
  std::vector<std::array<float, kSize>> nested;
  std::optional<double> maybe = std::nullopt;  ///< when known
  void spans(std::span<const double> all, const std::vector<float>& some, std::optional<double> one = {}, std::vector<int> ints = {});
  std::atomic<double> shared{0.0}, other_shared;
  void f(double a);
  /// Moves by `b` [m].
  void g(double b, double c);
  float z = 0.0f;  ///< see [paper]
  double first, second{1.0};
  const double* samples;
  double table[3];
  double split =
      0.0;
  void defaults(int n, double d = f(1, 2), std::vector<int> v = {}, float e = 1.0f);
  /// Long: `near` [m].
  Result<double> longOne(const std::map<int, std::pair<double, double>>& skipped, double near,
                         double far,
                         const double& third,  ///< [m]
                         double fourth  ///< a number
  ) const noexcept;
  double (*pointer)(double argument);
  void callback(double (*f)(double inner), int n);
  void unnamed(double);
  double last = 1e-3;  ///< two lines,
                       ///< and none says a unit
  explicit A(double k) : x(k) {}
  A& operator=(double o);
  A operator*(double p) const;
  [[nodiscard]] double gap(double q) const { return q; }
  enum class Kind { kOne };
  double index = 0.0;  ///< by cell [i], see [1], [measured], [0]
};
struct alignas(64) Lanes {
  std::array<double, 8> lanes;
};
double outside(double r);
inline constexpr double kConstant = 1.0;
}
"""
BAD_NAMES = ["x", "y", "three", "nested", "maybe", "all", "some", "one", "shared", "other_shared", "a", "c", "z", "first", "second", "samples", "table", "split", "d", "e", "far", "fourth", "argument", "inner",
             "(without a name)", "last", "k", "o", "p", "q", "index", "lanes", "r", "kConstant"]
GOOD = """
#include <vector>
namespace tenon {
/// The [m] of a class is not one of a member.
struct A {
  double x = 0.0;  ///< [m]
  /// [1/s] a rate
  double y;
  double z_W, w_W;
  /// Moves by `b` [m], `c` [-].
  void g(double b, double c) { double local = 0.0; use(local); }
  inline double h() { double k = 1; return k; }
  /// Both `near`, `far` [m]; and `low` to `high` [N/m,
  /// or Nm/rad].
  void many(double near, double far,
            double low, double high);
  void alone(int n,
             double d = 0.0,  ///< [kg m²]
             float e = 1.0f   ///< [Nm/rad]
  );
  Result<double> returned();
  std::optional<double> held;  ///< [m]
  std::array<std::vector<double>, 10> columns, rows;  ///< [N]
  /// Adds to `all` [N], by `index`.
  std::span<const double> sum(std::span<double> all, std::span<const int> index, std::array<float, 3> p_W);
  std::map<int, double> by_name;
  std::vector<std::pair<int, double>> pairs;
  std::function<double(double)> called;
  /// `s` [s]
  double (*pointer)(double s);
  double first = 0.0;  ///< over two lines,
                       ///< [mm]
  double second{1.0};  ///< [N s]
  double relative;     ///< [unit of `first`]
  static constexpr double kThird = sqrt(2.0);  ///< [m^3] a volume
 private:
  std::vector<double> values_;  // [s]
  std::vector<int> counts_;
  bool operator<(const A& other) const;
};
}
"""


def self_test():
    found = [name for _, name, _ in faults_in_text(BAD)]
    good = faults_in_text(GOOD)
    lines = {name: line for line, name, _ in faults_in_text(BAD)}
    shown = BAD.split("\n")
    astray = [name for name, line in lines.items() if not name.startswith("(") and name not in shown[line - 1]]
    if found != BAD_NAMES or good or astray:
        print(f"units test: is blind: missed {[name for name in BAD_NAMES if name not in found]}, "
              f"found without reason {[name for name in found if name not in BAD_NAMES] + good}, on a wrong line {astray}")
        return 1
    print(f"units test: finds what it must: {len(BAD_NAMES)} planted faults")
    return 0


def main():
    words, root = sys.argv[1:], Path(__file__).resolve().parent.parent
    if words in (["-h"], ["--help"]):
        print("usage: tests/units_test.py [--self-test | FILE or FOLDER...]")
        return 0
    if words == ["--self-test"]:
        return self_test()
    faults = faults_in(root, [Path(word).resolve().relative_to(root).as_posix() for word in words])
    for fault in faults:
        print(fault)
    print(f"units: {len(faults)} numbers without a unit")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
