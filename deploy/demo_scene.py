"""What `tenon demo` has to know of a scenario before its server has read it."""
import re
from pathlib import Path


def hands_of(scenario):
    """Role by name of each hand of a scenario (a folder or YAML file); a hand without `role:` is the trainee's."""
    file = scenario / "scenario.yaml" if scenario.is_dir() else scenario
    if not file.is_file():
        return {}  # the server says so
    text = re.sub(r"(?m)(^|\s)#.*$", "", file.read_text(encoding="utf-8", errors="replace"))
    hands = re.search(r"(?ms)^hands:(.*?)(?=^\w|\Z)", text)
    entries = re.split(r"(?:^|\n)\s*-\s|\[\s*\{|\}\s*,\s*\{", hands[1])[1:] if hands else []
    value = r":\s*[\"']?([^\s,}\"']+)"
    return {name[1]: role[1] if (role := re.search(r"\brole" + value, entry)) else "trainee" for entry in entries
            if (name := re.search(r"\bname" + value, entry))}


def shipped_as(scenario, scenarios):
    """Under which name a scenario is shipped in the folder `scenarios`, itself or unchanged as a copy; None: it is another one."""
    file = scenario / "scenario.yaml" if scenario.is_dir() else scenario
    if file.is_file():
        for shipped in sorted(Path(scenarios).glob("*/scenario.yaml")):
            if shipped.read_bytes() == file.read_bytes():
                return shipped.parent.name
    return None
