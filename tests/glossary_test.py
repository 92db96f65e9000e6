#!/usr/bin/env python3
"""docs/ and the code say the same: each entry in the glossary's code column exists, each link of a page leads somewhere, and the
table of docs/devices.md has the numbers of devices/simulated.

An entry is found when each of its words occurs in code, without comments: `IslandSolver::solve` is two words, `traverse…` the
beginning of one, `_1k` the end of one. Run it from anywhere; `--self-test` shows that it can fail.
"""
import re
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))
from source_text import SKIPPED_FOLDERS

ROOMS = ("idl", "server", "devices", "clients", "scenarios", "tenon")
SUFFIXES = {".h", ".cpp", ".idl", ".json", ""}
COMMENT = re.compile(r"//.*|^\s*#(?!include|define).*", re.MULTILINE)
WORD = re.compile(r"[A-Za-z_][A-Za-z_0-9]*|--[a-z][a-z-]*")
FRAME = re.compile(r"[A-Z](?:/[A-Z])?|[XpVF]_[A-Za-z]+(?:_[A-Z])?")  # frames and quantities: rules, not names


def words_of_code(root):
    words = set()
    for room in ROOMS:
        for file in [root / room, *(root / room).rglob("*")]:
            if file.is_file() and file.suffix in SUFFIXES and not SKIPPED_FOLDERS.intersection(file.relative_to(root).parts):
                words.update(WORD.findall(COMMENT.sub("", file.read_text(encoding="utf-8"))))
    return words


def entries(glossary):
    """(line number, entry) of the code column."""
    for number, line in enumerate(glossary.splitlines(), 1):
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if line.startswith("|") and len(cells) == 4:
            for entry in re.findall(r"`([^`]+)`", cells[2]):
                yield number, entry


def exists(entry, words):
    if FRAME.fullmatch(entry):
        return True
    if entry.endswith("…"):
        return any(word.startswith(entry[:-1]) and word != entry[:-1] for word in words)
    if entry.startswith("_"):
        return any(word.endswith(entry) for word in words)
    return all(part in words for part in entry.split("::"))


def glossary_faults(root):
    words = words_of_code(root)
    glossary = (root / "docs" / "glossary.md").read_text(encoding="utf-8")
    found = list(entries(glossary))
    if not found:
        yield "docs/glossary.md: has no table with four columns"
    for number, entry in found:
        if not exists(entry, words):
            yield f"docs/glossary.md:{number}: `{entry}` is not in the code"


def anchor(heading):
    """As GitHub makes it."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def link_faults(root):
    for page in sorted((root / "docs").glob("*.md")):
        for number, line in enumerate(page.read_text(encoding="utf-8").splitlines(), 1):
            for target in re.findall(r"\]\(([^)\s]+)\)", line):
                if "://" in target:
                    continue
                path, _, fragment = target.partition("#")
                file = (page.parent / path) if path else page
                if not file.exists():
                    yield f"docs/{page.name}:{number}: there is no {target}"
                elif fragment and fragment not in {anchor(heading) for heading in
                                                   re.findall(r"(?m)^#+ (.*)$", file.read_text(encoding="utf-8"))}:
                    yield f"docs/{page.name}:{number}: {file.name} has no heading for #{fragment}"


def device_faults(root):
    """Compares the table of docs/devices.md with the numbers of each device."""
    page = (root / "docs" / "devices.md").read_text(encoding="utf-8")
    for name, file in (("hug", "hug"), ("sigma7", "sigma7"), ("omega3", "omega3"), ("falcon", "falcon")):
        code = (root / "devices" / "simulated" / f"{file}.cpp").read_text(encoding="utf-8")

        def cap(key):
            found = re.search(rf"caps\.{key} = ([^;]+);", code)
            return found[1] if found else "0"

        row = re.search(rf"(?m)^\| `{name}-sim` \|.*$", page)
        cells = [cell.strip() for cell in row[0].strip("|").split("|")] if row else []
        torque = float(cap("torque"))
        wanted = {2: "6" if cap("dof_mask") == "kAllDofs" else "3", 3: f"{1e3 * float(cap('workspace_radius')):g} mm",
                  4: f"{float(cap('continuous_force')):g} N / {float(cap('peak_force')):g} N",
                  5: f"{torque:g} Nm" if torque else "none", 6: f"{float(cap('rate')):g} Hz"}
        for column, text in wanted.items():
            if len(cells) <= column or cells[column] != text:
                yield f"docs/devices.md: the row of {name}-sim does not say '{text}', as its code does"


def faults(root):
    return [*glossary_faults(root), *link_faults(root), *device_faults(root)]


def self_test():
    source = Path(__file__).resolve().parent.parent
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for name in ("docs", "devices/simulated", "idl"):
            (root / name).mkdir(parents=True)
        for file in (source / "devices" / "simulated").glob("*.cpp"):
            (root / "devices" / "simulated" / file.name).write_text(file.read_text(encoding="utf-8"), encoding="utf-8")
        (root / "idl" / "a.h").write_text("class Known { void solve(); };  // Gone is only in a comment\nvoid traverseTree();\n", encoding="utf-8")
        (root / "docs" / "glossary.md").write_text(
            "# Glossary\n| paper | field | code | meaning |\n|---|---|---|---|\n| – | k | `Known`, `Known::solve`, `traverse…`, `X_AB` | x |\n"
            "| – | g | `Gone` | x |\n| – | n | `Known::none`, `wander…` | x |\n[a](none.md) [b](#glossary) [c](#gone)\n", encoding="utf-8")
        devices = (source / "docs" / "devices.md").read_text(encoding="utf-8").replace("400 mm", "410 mm")
        (root / "docs" / "devices.md").write_text(re.sub(r"\]\([^)]*\)", "]", devices), encoding="utf-8")
        found = faults(root)
    expected = ["`Gone` is not", "`Known::none` is not", "`wander…` is not", "there is no none.md", "no heading for #gone", "does not say '400 mm'"]
    if len(found) != len(expected) or any(text not in fault for text, fault in zip(expected, found)):
        print("the glossary test is blind: it found", *found, sep="\n")
        return 1
    print(f"glossary test: finds all {len(expected)} planted faults")
    return 0


def main():
    if "--self-test" in sys.argv:
        return self_test()
    found = faults(Path(__file__).resolve().parent.parent)
    for fault in found:
        print(fault)
    print(f"glossary: {len(found)} faults")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
