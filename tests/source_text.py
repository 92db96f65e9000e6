"""C++ text taken apart, for the tests that judge the tree itself: no compiler, and no code is run.

Threads: one.
"""
import re
from pathlib import Path

SKIPPED_FOLDERS = {"build", "out", "node_modules", "__pycache__"}
TOKEN = re.compile(r'//(?:\\\n|[^\n])*'                                     # a comment to the end of its line
                   r'|/\*.*?\*/'                                            # a comment between marks
                   r'|(?:u8|[uUL])?R"(?P<mark>[^()\\\s]{0,16})\(.*?\)(?P=mark)"'   # a raw string
                   r'|(?:\b(?:u8|[uUL]))?"(?:\\.|[^"\\\n])*"'               # a string
                   r"|(?<!\w)(?:u8|[uUL])?'(?:\\.[^'\n]*|[^'\\\n])'",       # a character; 1'000 is none
                   re.S)
DIRECTIVE = re.compile(r"^[ \t]*#(?:\\\n|[^\n])*", re.M)
INCLUDE = re.compile(r'^[ \t]*#[ \t]*include[ \t]*([<"])([^>"\n]+)[>"]', re.M)


def blank(text):
    """Spaces for everything but line ends, so that offsets and line numbers stay."""
    return re.sub(r"[^\n]", " ", text)


def line_at(text, offset):
    return text.count("\n", 0, offset) + 1


def code_of(text):
    """The text with comments, strings, characters and preprocessor lines blanked."""
    return DIRECTIVE.sub(lambda found: blank(found.group()), TOKEN.sub(lambda found: blank(found.group()), text))


def includes_of(text):
    """(line number, '<' or '"', header) of each #include that is no comment."""
    kept = TOKEN.sub(lambda found: found.group() if found.group()[0] in "\"'" else blank(found.group()), text)
    return [(line_at(text, found.start()), *found.groups()) for found in INCLUDE.finditer(kept)]


def files_below(root, tops, endings):
    """Files of `endings` below root/<top> of each top, sorted, as (path from the root, Path)."""
    found = []
    for top in tops:
        start = root / top
        for file in [start] if start.is_file() else start.rglob("*"):
            relative = file.relative_to(root)
            if file.suffix in endings and file.is_file() and not SKIPPED_FOLDERS & set(relative.parts):
                found.append((relative.as_posix(), file))
    return sorted(found)


def read(file):
    return Path(file).read_text(encoding="utf-8")
