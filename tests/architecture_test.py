#!/usr/bin/env python3
"""Holds the include table of ARCHITECTURE.md: who may include whom, and which library has which door.

Run it from anywhere; it reads the tree it lies in. `--self-test` shows that it can fail.
"""
import re
import sys
import tempfile
from pathlib import Path

ANY_ROOM = {"idl/types", "idl/threads", "idl/wire", "idl/record", "server/structures", "server/bake",
            "server/collision", "server/simulation", "server/game_control", "server/session", "devices",
            "devices/simulated", "clients/haptic", "clients/trainee", "clients/instructor", "clients/observer",
            "clients/recorder", "clients/tell", "clients/report", "scenarios", "tests"}
IDL = {"idl/types", "idl/threads", "idl/wire", "idl/record"}
SERVER = {room for room in ANY_ROOM if room.startswith("server")}
DEVICES = {"devices", "devices/simulated"}

# room: (rooms it may include, libraries it may include beside std and Eigen)
ROOMS = {
    "idl/types": (set(), {"tl"}),
    "idl/threads": ({"idl/types"}, {"posix"}),
    "idl/wire": ({"idl/types", "idl/threads"}, {"dds", "posix"}),
    "idl/record": ({"idl/types"}, {"zstd", "lz4", "posix"}),
    "server/structures": ({"idl/types"}, {"hwy", "xxhash", "posix"}),
    "server/bake": ({"idl/types", "server/structures"}, {"assimp", "octomap", "meshoptimizer", "xxhash", "posix", "fmt", "cli11"}),
    "server/collision": ({"idl/types", "server/structures"}, {"hwy"}),
    "server/simulation": ({"idl/types", "idl/threads", "server/structures", "server/collision"}, {"bullet"}),
    "server/game_control": ({"idl/types", "server/simulation", "server/structures"}, {"yaml-cpp", "fmt"}),
    "server/session": (IDL | SERVER, {"fmt", "posix"}),
    "server": (IDL | SERVER, {"fmt", "cli11", "posix"}),
    "devices": ({"idl/types", "idl/threads", "devices/simulated"}, set()),
    "devices/simulated": ({"idl/types", "idl/threads", "devices"}, set()),
    "clients/haptic": (IDL | DEVICES | {"server/structures", "server/collision"}, {"fmt", "cli11", "posix"}),
    "clients/trainee": (IDL | DEVICES | {"clients/haptic"}, {"fmt", "cli11"}),
    "clients/instructor": (IDL | DEVICES | {"clients/haptic"}, {"fmt", "cli11"}),
    "clients/observer": (IDL, {"fmt", "cli11", "json", "posix"}),
    "clients/recorder": (IDL, {"fmt", "cli11", "posix"}),
    "clients/tell": (IDL, {"fmt", "cli11", "posix"}),
    "clients/report": (IDL, {"fmt", "cli11", "json"}),
    "scenarios": ({"idl/types"}, {"png", "fmt", "cli11"}),
}

LIBRARIES = {
    "tl": r"tl/", "dds": r"(dds/|tenon\.h$)", "zstd": r"zstd\.h$", "lz4": r"lz4", "hwy": r"hwy/", "xxhash": r"xxhash\.h$",
    "assimp": r"assimp/", "octomap": r"octomap/", "meshoptimizer": r"meshoptimizer\.h$", "yaml-cpp": r"yaml-cpp/",
    "fmt": r"fmt/", "cli11": r"CLI/", "json": r"nlohmann/", "png": r"png\.h$", "bullet": r"(btBullet|Bullet|LinearMath/)",
    "posix": r"(sys/|unistd\.h$|fcntl\.h$|poll\.h$|termios\.h$|spawn\.h$|pthread\.h$|sched\.h$|signal\.h$|arpa/|netinet/|linux/|time\.h$)",
}
# the one file of a room that may know a library
ONE_FILE = {"bullet": "server/simulation/rigid_body.cpp"}
EVERYWHERE = r"(Eigen/|[a-z_0-9]+$|expected\.hpp$)"  # Eigen and the standard library

# What would block or allocate has no place where every millisecond counts.
ONE_KILOHERTZ = ("server/collision", "server/simulation", "server/structures")
BLOCKING = {"mutex", "condition_variable", "shared_mutex", "iostream", "fstream", "future", "semaphore", "regex"}
# files that work at load time only
LOAD_TIME = {"server/structures/structure_file.cpp", "server/structures/field_builder.cpp",
             "server/structures/shell_builder.cpp"}

INCLUDE = re.compile(r'^\s*#\s*include\s*([<"])([^>"]+)[>"]')


def room_of(path):
    """The most specific room that holds a path, or None."""
    parts = Path(path).parts
    for depth in range(len(parts) - 1, 0, -1):
        room = "/".join(parts[:depth])
        if room in ROOMS or room == "tests":
            return room
    return None


def library_of(header):
    for name, pattern in LIBRARIES.items():
        if re.match(pattern, header):
            return name
    return None


def judge(path, kind, header):
    """Why this include is wrong, or None."""
    room = room_of(path)
    if room is None or room == "tests":
        return None
    rooms, libraries = ROOMS[room]
    if kind == '"' and not library_of(header):
        target = room_of(header)
        if target is None:
            return f'"{header}" does not name its room from the root'
        if target != room and target not in rooms:
            return f"{room} may not include {target}"
        return None
    library = library_of(header)
    if library in ONE_FILE and path != ONE_FILE[library]:
        return f"only {ONE_FILE[library]} knows {library} (<{header}>)"
    if library is not None:
        return None if library in libraries else f"{room} is not the door of {library} (<{header}>)"
    if room in ONE_KILOHERTZ and header in BLOCKING and path not in LOAD_TIME:
        return f"<{header}> can block: not in {room}"
    if not re.match(EVERYWHERE, header):
        return f"<{header}> is a library that {room} has no door for"
    return None


def faults_in(root):
    faults = []
    for top in ("idl", "server", "devices", "clients", "scenarios"):
        for file in sorted((root / top).rglob("*")):
            if file.suffix not in {".h", ".cpp"}:
                continue
            path = file.relative_to(root).as_posix()
            if room_of(path) is None:
                faults.append(f"{path}: stands in no room of the plan")
            for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), 1):
                include = INCLUDE.match(line)
                fault = include and judge(path, *include.groups())
                if fault:
                    faults.append(f"{path}:{number}: {fault}")
    return faults


def self_test():
    cases = {
        "server/collision/a.cpp": ['#include "server/simulation/environment.h"', "#include <mutex>", "#include <dds/dds.h>"],
        "devices/b.h": ['#include "clients/haptic/coupling.h"'],
        "server/simulation/c.cpp": ["#include <assimp/scene.h>", '#include "force_buffer.h"', "#include <BulletDynamics/a.h>"],
        "clients/report/d.cpp": ['#include "server/session/session_simulation.h"'],
    }
    good = {"server/simulation/e.cpp": ['#include "server/collision/pair_query.h"', "#include <vector>", "#include <Eigen/Core>"]}
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for path, lines in {**cases, **good}.items():
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            (root / path).write_text("\n".join(lines) + "\n", encoding="utf-8")
        found = faults_in(root)
    expected = sum(len(lines) for lines in cases.values())
    if len(found) != expected:
        print(f"the architecture test is blind: {len(found)} of {expected} planted faults found", *found, sep="\n")
        return 1
    print(f"architecture test: finds all {expected} planted faults")
    return 0


def main():
    if "--self-test" in sys.argv:
        return self_test()
    faults = faults_in(Path(__file__).resolve().parent.parent)
    for fault in faults:
        print(fault)
    print(f"architecture: {len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
