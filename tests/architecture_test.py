#!/usr/bin/env python3
"""Who may include whom: the one source of the table in ARCHITECTURE.md, and the judge of the tree.

  tests/architecture_test.py             judges the tree it lies in: includes, names (names_test.py), units (units_test.py)
  tests/architecture_test.py --table     prints the table; with --write puts it into ARCHITECTURE.md
  tests/architecture_test.py --self-test plants a fault of each kind and demands that it is found

Exit 0: no fault. 1: faults, one a line. 2: wrong usage.
"""
import os
import re
import sys
import tempfile
from fnmatch import fnmatchcase
from pathlib import Path

sys.dont_write_bytecode = True  # the tree that is judged stays as it is
sys.path.insert(0, str(Path(__file__).resolve().parent))
import names_test
import units_test
from source_text import SKIPPED_FOLDERS, files_below, includes_of, read

IDL = ["idl/types", "idl/threads", "idl/wire", "idl/record"]
STATION = IDL + ["devices", "clients/haptic"]
DECIDES = ["server/structures", "server/bake", "server/collision", "server/simulation", "server/game_control"]

# room: its namespace, the rooms it may include, the libraries it may include beside the standard library and Eigen
ROOMS = {
    "idl/types": ("tenon", [], ["expected"]),
    "idl/threads": ("tenon::threads", ["idl/types"], ["POSIX"]),
    "idl/wire": ("tenon::wire", ["idl/types", "idl/threads"], ["DDS", "libsodium", "POSIX"]),
    "idl/record": ("tenon::record", ["idl/types"], ["zstd", "POSIX"]),
    "server/structures": ("tenon::structures", ["idl/types"], ["xxHash", "POSIX"]),
    "server/bake": ("tenon::bake", ["idl/types", "server/structures"], ["assimp", "OctoMap", "meshoptimizer", "xxHash", "POSIX"]),
    "server/collision": ("tenon::collision", ["idl/types", "server/structures"], ["Highway"]),
    "server/simulation": ("tenon::simulation", ["idl/types", "idl/threads", "server/structures", "server/collision"],
                          ["Bullet"]),
    "server/game_control": ("tenon::game_control", ["idl/types", "server/structures", "server/simulation"], ["yaml-cpp", "fmt"]),
    "server/check": ("tenon::check", ["idl/types", "server/structures", "server/collision", "server/simulation",
                                      "server/game_control", "devices"], ["fmt"]),  # devices: their catalog, for limits
    "server/session": ("tenon::session", IDL + DECIDES, ["fmt", "POSIX"]),
    # the limits of devices, asked of their catalog, are what a check is made against
    "server/tools": ("tenon::tools", ["idl/types"] + DECIDES + ["server/check", "server/session", "devices"],
                     ["fmt", "CLI11", "JSON", "POSIX"]),
    "server": ("tenon::session", IDL + DECIDES + ["server/check", "server/session"], ["fmt", "CLI11"]),
    "devices": ("tenon::devices", ["idl/types", "idl/threads", "devices/simulated", "devices/drivers"], []),
    "devices/simulated": ("tenon::devices", ["idl/types", "idl/threads", "devices"], []),
    "devices/drivers": ("tenon::devices", ["idl/types", "idl/threads", "devices"], ["POSIX"]),
    # a station's copy of the scene is the server's own simulation
    "clients/haptic": ("tenon::haptic", IDL + ["devices", "server/structures", "server/collision", "server/simulation"],
                       ["POSIX"]),
    "clients/simulated_person": ("tenon::simulated_person", STATION, []),
    "clients/station": ("tenon::station", STATION + ["devices/simulated", "clients/simulated_person"], ["fmt", "CLI11", "POSIX"]),
    "clients/observer": ("tenon::observer", IDL, ["fmt", "CLI11", "JSON"]),
    "clients/foxglove": ("tenon::foxglove", IDL, ["fmt", "JSON"]),
    "clients/recorder": ("tenon::recorder", IDL + ["clients/foxglove"], ["fmt", "CLI11"]),
    "clients/command": ("tenon::command", IDL, ["fmt", "CLI11", "POSIX"]),
    "clients/report": ("tenon::report", IDL + ["clients/foxglove"], ["fmt", "CLI11", "JSON"]),
    # who takes part in a browser is a station of its own
    "clients/console": ("tenon::console", STATION + ["devices/drivers", "clients/command", "clients/foxglove", "clients/recorder", "clients/station"], ["fmt", "CLI11", "JSON", "Boost", "OpenSSL"]),
    "clients/other_vendor": ("tenon::other_vendor", [], ["Fast DDS"]),  # of ours it knows the IDL file alone
    "clients/rehearse": ("tenon::rehearse", [], ["fmt", "CLI11"]),  # the rooms: see EXCEPTION
    "scenarios/part_generator": ("tenon::part_generator", ["idl/types"], ["fmt", "CLI11"]),
}
# folders inside of a room
SUBFOLDERS = {"idl/types/messages": "idl/types"}
# The one declared exception: server and clients in one process, so it may include every room. No room includes it.
EXCEPTION = "clients/rehearse"
# What no other room includes: programs, and what stands on all others.
NOT_INCLUDED = {EXCEPTION, "server", "server/tools", "tests"}

LIBRARIES = {
    "expected": r"tl/expected\.hpp$", "DDS": r"(dds/|ddsc/|org/eclipse/cyclonedds/|tenon\.h$)", "zstd": r"(zstd|zstd_\w+|zdict)\.h$",
    "Fast DDS": r"(fastdds|fastrtps|fastcdr)/",
    "Highway": r"hwy/", "xxHash": r"xxh(ash|3)\.h$", "assimp": r"assimp/", "OctoMap": r"octomap/",
    "meshoptimizer": r"meshoptimizer\.h$",
    "libsodium": r"sodium(\.h$|/)", "yaml-cpp": r"yaml-cpp/", "fmt": r"fmt/", "CLI11": r"CLI/", "JSON": r"nlohmann/",
    "Boost": r"boost/", "OpenSSL": r"openssl/",
    "Bullet": r"(bullet/|btBullet|Bullet|LinearMath/)", "Eigen": r"Eigen/",
    "POSIX": r"((sys|arpa|netinet|net|linux)/|(ifaddrs|netdb|unistd|fcntl|poll|termios|spawn|pthread|sched|signal|time|dirent|dlfcn|errno|semaphore)\.h$)",
}
# a library, or a part of a room, that one file of the room alone may include
ONE_FILE = {"Bullet": "server/simulation/rigid_body.cpp", "OctoMap": "server/bake/octree_file.cpp",
            "assimp": "server/bake/import_child.cpp", "libsodium": "idl/wire/identity.cpp", "Boost": "clients/console/web_stream.h", "OpenSSL": "clients/console/certificate.cpp",
            "devices/simulated": "devices/catalog.cpp", "devices/drivers": "devices/catalog.cpp"}
# made at build time, so not in the tree; their room alone includes them
GENERATED = {"tenon.h": "idl/wire", "idl/wire/topic_list.h": "idl/wire", "tenonPubSubTypes.h": "clients/other_vendor"}
# a room whose .cpp files may include any <header> of no room's door: the library of the device they drive
VENDOR_ROOM = "devices/drivers"

# Rooms with code of the 1 kHz loops: what can block has no place there, not even by way of another header of ours.
ONE_KILOHERTZ = ["server/structures", "server/collision", "server/simulation", "devices", "devices/simulated",
                 "devices/drivers", "clients/haptic"]
BLOCKING = ["condition_variable", "fstream", "future", "iostream", "mutex", "regex", "semaphore", "shared_mutex"]
# files of those rooms that run outside of the loop: why each may
OUTSIDE_THE_LOOP = {
    "server/structures/structure_file.cpp": "reads and writes structure files at start and in `tenon bake`",
    "clients/haptic/seat_file.cpp": "reads and writes the file of a station's seat, on the wire thread",
    "clients/haptic/station_program.cpp": "reads a station's options and runs its threads; no loop of its own",
    "clients/haptic/copy_loader.h": "loads the compiled scene on a thread of its own, beside the session",
    "clients/haptic/copy_loader.cpp": "likewise",
}

STANDARD = set("""algorithm any array atomic barrier bit bitset cassert cctype cerrno cfenv cfloat charconv chrono cinttypes
climits clocale cmath codecvt compare complex concepts condition_variable coroutine csetjmp csignal cstdarg cstddef cstdint
cstdio cstdlib cstring ctime cuchar cwchar cwctype deque exception execution filesystem format forward_list fstream
functional future initializer_list iomanip ios iosfwd iostream istream iterator latch limits list locale map memory
memory_resource mutex new numbers numeric optional ostream queue random ranges ratio regex scoped_allocator semaphore set
shared_mutex source_location span sstream stack stdexcept stop_token streambuf string string_view strstream syncstream
system_error thread tuple type_traits typeindex typeinfo unordered_map unordered_set utility valarray variant vector
version""".split())

# Units: a header and the .cpp of its name. These are units of more files: an interface and internals that know it.
UNITS = {
    # the stages of one bake; bake.h has their options and results
    "server/bake/bake": "server/bake/{air_gaps,brick_level,exposed_surface,face_sides,feature_bake,field_bake,field_size,filled_spaces,flood,narrow_gaps,"
                        "outside,parallel,refined_bricks,shell_bake,slope_limit,thin_bricks,thin_places,triangle_pieces,valley_bake,"
                        "welded_mesh}",
    "server/collision/pair_query": "server/collision/{contact_blocks,contact_reducer,query_kernels,ridge_correction,tangent_probes,valley_correction,"
                                   "*_lanes_inl}",
    "server/collision/island_solver": "server/collision/island_*",
    "server/collision/motion_solver": "server/collision/motion_workspace",
    "server/structures/pointshell": "server/structures/level_areas",
    "server/simulation/environment": "server/simulation/{engine,environment_*}",
    "server/game_control/scenario": "server/game_control/{condition_reader,named_values,scenario_*,yaml_reader}",
}

TOPS = ("idl", "server", "devices", "clients", "scenarios", "tests")
SOURCES = {".h", ".cpp"}
# what C++, C and CUDA files are called elsewhere; whatever else a file includes is "not in the tree"
OTHER_SOURCES = set(""".hpp .hh .hxx .h++ .H .HPP .cc .cxx .c++ .cp .C .CC .CPP .c .inl .inc .ipp .tpp .txx .tcc .icc .ixx .cppm .mpp .ii .def
.cu .cuh .m .mm""".split())
BEGIN = "<!-- printed by tests/architecture_test.py --table -->"
END = "<!-- end of what is printed -->"


def room_of(path):
    """The room that a file stands in, or None. Of folders inside of rooms there are those of SUBFOLDERS; tests have any."""
    folder = SUBFOLDERS.get(Path(path).parent.as_posix(), Path(path).parent.as_posix())
    return "tests" if Path(path).parts[0] == "tests" else folder if folder in ROOMS else None


def library_of(header):
    return next((name for name, pattern in LIBRARIES.items() if re.match(pattern, header)), None)


def judge_ours(path, room, header):
    """Why `room` may not include our own `header`, or None."""
    target = room_of(header)
    if target is None:
        return f'"{header}" does not name its room from the root'
    if room == "tests" or target == room:
        return None
    if target in NOT_INCLUDED:
        return f"no room may include {target}"
    if room == EXCEPTION:
        return None
    if target not in ROOMS[room][1]:
        return f"{room} may not include {target}"
    if room == str(Path(ONE_FILE.get(target, "/")).parent) and path != ONE_FILE[target]:
        return f"only {ONE_FILE[target]} includes {target}"
    return None


def judge(path, kind, header):
    """Why this include is wrong, or None."""
    room = room_of(path)
    if room == "tests" and kind == "<":
        return None
    library = library_of(header)
    if kind == '"' and library is None:
        return judge_ours(path, room, header)
    if header in GENERATED:
        return None if room in (GENERATED[header], "tests") else f"only {GENERATED[header]} includes {header}"
    if library == "Eigen":
        return None
    if library is not None:
        if library not in ROOMS[room][2]:
            return f"{room} is not the door of {library} (<{header}>)"
        if path != ONE_FILE.get(library, path):
            return f"only {ONE_FILE[library]} knows {library} (<{header}>)"
        return None
    if header in STANDARD:
        return None
    if room == VENDOR_ROOM:
        return None if path.endswith(".cpp") else f"<{header}>: a vendor's library belongs into the .cpp of its device"
    return f"<{header}> is a library that {room} has no door for"


def way_to_blocking(path, includes, seen):
    """The headers of ours by which a file reaches one that can block: [.., "mutex"], or None."""
    for _, kind, header in includes.get(path, []):
        if kind == "<" and header in BLOCKING:
            return [header]
    for _, kind, header in includes.get(path, []):
        if kind == '"' and header in includes and header not in seen:
            seen.add(header)
            way = way_to_blocking(header, includes, seen)
            if way:
                return [header] + way
    return None


def blocking_faults(includes):
    faults = []
    for path in includes:
        if room_of(path) not in ONE_KILOHERTZ or path in OUTSIDE_THE_LOOP:
            continue
        way = way_to_blocking(path, includes, {path})
        if way:
            by = f" (by way of {', '.join(way[:-1])})" if len(way) > 1 else ""
            faults.append(f"{path}: <{way[-1]}> can block: not in a 1 kHz room{by}. What runs outside of the loop is listed "
                          "in OUTSIDE_THE_LOOP of tests/architecture_test.py, with its reason")
    for path in OUTSIDE_THE_LOOP:
        if path in includes and not way_to_blocking(path, includes, {path}):
            faults.append(f"{path}: is listed in OUTSIDE_THE_LOOP, but includes nothing that can block: take it off the list")
    return faults


def unit_of(path, apart=None):
    """The unit of a file: its path without its ending, or the unit of more files that it belongs to; `apart` is none."""
    stem = os.path.splitext(path)[0]
    for unit, pattern in UNITS.items():
        folder, names = pattern.rsplit("/", 1)
        if unit != apart and stem.startswith(folder + "/"):
            if any(fnmatchcase(stem[len(folder) + 1:], name) for name in names.strip("{}").split(",")):
                return unit
    return stem


def circles(edges):
    """The strongly connected sets of more than one node (Tarjan), each sorted."""
    index, low, stack, found = {}, {}, [], []

    def visit(node):
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(edges.get(node, ())):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            members = stack[stack.index(node):]
            del stack[stack.index(node):]
            if len(members) > 1:
                found.append(sorted(members))

    for node in sorted(edges):
        if node not in index:
            visit(node)
    return found


def edges_of(includes, name):
    """Who includes whom, both by the name that name(path) gives."""
    edges = {}
    for path, found in includes.items():
        for _, kind, header in found:
            if kind == '"' and header in includes and name(path) != name(header):
                edges.setdefault(name(path), set()).add(name(header))
    return edges


def circle_faults(includes):
    found = circles(edges_of(includes, str)) or circles(edges_of(includes, unit_of))
    faults = [f"{members[0]}: includes run in a circle: {', '.join(members)}" for members in found]
    for unit in UNITS:
        if any(unit_of(path) == unit for path in includes) and not any(
                unit in members for members in circles(edges_of(includes, lambda path: unit_of(path, apart=unit)))):
            faults.append(f"{unit}: is in UNITS, but its files run in no circle: take it out of tests/architecture_test.py")
    return faults


def table_faults(includes):
    """What the data itself claim and the tree does not have."""
    faults = []
    rooms = {room: set(may) - {target for target in may if target in ONE_FILE} for room, (_, may, _) in ROOMS.items()}
    faults += [f"the include table: rooms in a circle: {', '.join(members)}" for members in circles(rooms)]
    used = {room: set() for room in ROOMS}
    for path, found in includes.items():
        if room_of(path) in used:
            used[room_of(path)] |= {library_of(header) for _, _, header in found}
    for room, (_, may, libraries) in ROOMS.items():
        if room != VENDOR_ROOM and any(room_of(path) == room for path in includes):
            faults += [f"{room}: nothing in it includes {library}: take the door out of ROOMS"
                       for library in libraries if library not in used[room]]
        faults += [f"{room}: may include {target}, which is no room" for target in may if target not in ROOMS]
    faults += [f"{path}: is in OUTSIDE_THE_LOOP, but not in the tree" for path in OUTSIDE_THE_LOOP if path not in includes]
    return faults


def table():
    """The data as Markdown."""
    lines = ["| room | namespace | may include | libraries beside std and Eigen |", "|---|---|---|---|"]
    short = [("idl/*", IDL), ("server/{structures,bake,collision,simulation,game_control}", DECIDES)]
    for room, (namespace, may, libraries) in ROOMS.items():
        words = [f"{target} (in {Path(ONE_FILE[target]).name} alone)" if room == str(Path(ONE_FILE.get(target, "/")).parent) else target
                 for target in may]
        for word, rooms in short:
            if set(rooms) <= set(words):
                at = words.index(rooms[0])
                words = words[:at] + [word] + [target for target in words[at:] if target not in rooms]
        doors = [f"{library} (in {Path(ONE_FILE[library]).name} alone)" if library in ONE_FILE else library for library in libraries]
        if room == VENDOR_ROOM:
            doors.append("a vendor's library, in the .cpp of its device alone")
        name = "server/main.cpp" if room == "server" else room
        what = "every room but tests, server/tools and main: the one declared exception" if room == EXCEPTION else ", ".join(words) or "–"
        lines.append(f"| {name} | `{namespace}` | {what} | {', '.join(doors) or '–'} |")
    lines.append("| tests | its room's, or `tenon::test` | everything; no room includes it | what a test needs |")
    lines += ["", "The rooms with code of a 1 kHz loop (" + ", ".join(ONE_KILOHERTZ) + ") include no header that can block (" +
              ", ".join(f"`<{header}>`" for header in BLOCKING) + "), not even by way of another. Outside of the loop, so free to:", "",
              "| file | why |", "|---|---|"]
    lines += [f"| {path} | {why} |" for path, why in OUTSIDE_THE_LOOP.items()]
    return "\n".join(lines) + "\n"


def text_with_table(text):
    """ARCHITECTURE.md with the table of the data; None when it has no place for it."""
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
        return None
    return text[: text.index(BEGIN)] + BEGIN + "\n" + table() + text[text.index(END):]


def include_faults(root):
    """Faults of includes, of circles and of what the data claim, in the tree below root."""
    folders = [folder.name for folder in root.iterdir() if folder.name not in SKIPPED_FOLDERS and not folder.name.startswith(".")]
    faults, includes = [], {}
    for path, _ in files_below(root, folders, OTHER_SOURCES):
        faults.append(f"{path}: sources end with .h or .cpp: no test, formatter or build reads others")
    for path, file in files_below(root, folders, SOURCES):
        includes[path] = includes_of(read(file))
        if room_of(path) is None:
            faults.append(f"{path}: stands in no room of the plan (ROOMS in tests/architecture_test.py)")
            del includes[path]
    for path, found in includes.items():
        for number, kind, header in found:
            fault = judge(path, kind, header)
            if not fault and kind == '"' and header not in includes and header not in GENERATED and library_of(header) is None:
                fault = f'"{header}" is not in the tree'
            if fault:
                faults.append(f"{path}:{number}: {fault}")
    return faults + blocking_faults(includes) + circle_faults(includes), includes


DECISION = re.compile(r"## D-(\d{3}) \S.*\S \((\d{4})-(\d{2})-(\d{2})\)$")


def decision_faults(text, references):
    """Headings of DECISIONS.md that are not `## D-<number> <title> (<date>)` in order, and references to none of them."""
    faults, count = [], 0
    for number, line in enumerate(text.splitlines(), 1):
        if not line.startswith("## "):
            continue
        count += 1
        found = DECISION.match(line)
        if not found or int(found.group(1)) != count:
            faults.append(f"DECISIONS.md:{number}: wants `## D-{count:03} Title (year-month-day)`, is `{line}`")
    return faults + [f"{place}: no decision is called D-{number}" for place, number in references if int(number) not in range(1, count + 1)]


def references_in(root):
    """(place, number) of each decision that a file names."""
    found = []
    for path, file in files_below(root, [top for top in TOPS + ("docs", "ARCHITECTURE.md", "CONTRIBUTING.md") if (root / top).exists()],
                                  {".h", ".cpp", ".md"}):
        for number, line in enumerate(read(file).splitlines(), 1):
            found += [(f"{path}:{number}", decision) for decision in re.findall(r"\bD-(\d{3})\b", line)]
    return found


def faults_in(root):
    faults, includes = include_faults(root)
    faults += table_faults(includes) + decision_faults(read(root / "DECISIONS.md"), references_in(root))
    plan = read(root / "ARCHITECTURE.md")
    if text_with_table(plan) != plan:
        faults.append("ARCHITECTURE.md: its include table is not the one of tests/architecture_test.py; "
                      "tests/architecture_test.py --table --write puts it there")
    namespaces = {room: namespace for room, (namespace, _, _) in ROOMS.items()}
    return faults + names_test.faults_in(root, namespaces) + units_test.faults_in(root)


# Planted faults: path, line, and a part of what must be said; None where nothing may be said.
PLANTED = [
    ("server/collision/a.cpp", '#include "server/simulation/environment.h"', "may not include server/simulation"),
    ("server/collision/a.cpp", "#include <mutex>", "can block"),
    ("server/collision/a.cpp", "#include <dds/dds.h>", "not the door of DDS"),
    ("server/collision/a.cpp", "// #include <fcl/fcl.h>", None),
    ("server/collision/a.cpp", '#include "pair_query.h"', "does not name its room"),
    ("server/simulation/engine.h", '#include "server/simulation/environment.h"', None),
    ("server/simulation/environment_forces.cpp", '#include "server/simulation/engine.h"', None),
    ("server/simulation/environment.cpp", '#include "server/simulation/engine.h"', None),
    ("server/structures/pointshell.h", "#include <vector>", "is in UNITS, but its files run in no circle"),
    ("server/collision/lost.cpp", '#include "server/collision/lost.h"', "is not in the tree"),
    ("server/structures/reader.h", '#include "idl/threads/latest.h"', "may not include idl/threads"),
    ("server/simulation/c.cpp", "#include <assimp/scene.h>", "not the door of assimp"),
    ("server/simulation/c.cpp", "#include <BulletDynamics/a.h>", "only server/simulation/rigid_body.cpp"),
    ("server/simulation/c.cpp", "#include <Eigen/Core>", None),
    ("server/simulation/c.cpp", "#include <unistd.h>", "not the door of POSIX"),
    ("server/simulation/c.cpp", '#include "tests/support/analytic.h"', "no room may include tests"),
    ("server/tools/probe.cpp", '#include "tests/support/analytic.h"', "no room may include tests"),
    ("server/bake/probe.cpp", '#include "server/session/session_server.h"', "may not include server/session"),
    ("server/main.cpp", '#include "tests/support/analytic.h"', "no room may include tests"),
    ("server/session/d.cpp", '#include "server/tools/lines.h"', "no room may include server/tools"),
    ("idl/types/messages/hands.h", "#include <vector>", None),
    ("idl/types/messages/hands.h", '#include "idl/wire/second.h"', "idl/types may not include idl/wire"),
    ("server/collision/a.hpp", "#include <mutex>", "sources end with .h or .cpp"),
    ("server/collision/a.cc", '#include "server/session/session_server.h"', "sources end with .h or .cpp"),
    ("clients/haptic/a_lanes.inl", "#include <vector>", "sources end with .h or .cpp"),
    ("tests/server/a_test.cxx", "#include <vector>", "sources end with .h or .cpp"),
    ("devices/a.H", "#include <vector>", "sources end with .h or .cpp"),
    ("server/collision/a.cpp", '#include "server/collision/a.table"', "is not in the tree"),
    ("build/dev/a.hpp", "#include <vector>", None),
    ("docs/e.cpp", "#include <vector>", "stands in no room"),
    ("deploy/e.hh", "#include <vector>", "sources end with .h or .cpp"),
    ("server/odd/e.cpp", "#include <vector>", "stands in no room"),
    ("clients/stray/f.cpp", "#include <vector>", "stands in no room"),
    ("devices/b.h", '#include "clients/haptic/coupling.h"', "may not include clients/haptic"),
    ("devices/safety.cpp", '#include "devices/simulated/hug.h"', "only devices/catalog.cpp"),
    ("devices/catalog.cpp", '#include "devices/simulated/hug.h"', None),
    ("devices/simulated/arm.cpp", '#include "idl/threads/clock.h"', "<condition_variable> can block"),
    ("devices/simulated/arm.cpp", "#include <libvendor.h>", "no door for"),
    ("devices/drivers/mouse.cpp", "#include <libvendor.h>", None),
    ("devices/drivers/mouse.cpp", "#include <linux/input.h>", None),
    ("devices/drivers/mouse.cpp", "#include <dds/dds.h>", "not the door of DDS"),
    ("devices/drivers/mouse.cpp", "#include <future>", "can block"),
    ("devices/drivers/mouse.h", "#include <libvendor.h>", "belongs into the .cpp"),
    ("clients/haptic/hand.cpp", "#include <shared_mutex>", "can block"),
    ("clients/haptic/station_program.cpp", "#include <mutex>", None),
    ("clients/simulated_person/g.cpp", '#include "clients/station/station.h"', "may not include clients/station"),
    ("clients/command/h.cpp", '#include "clients/haptic/coupling.h"', "may not include clients/haptic"),
    ("clients/command/h.cpp", "#include <tenon.h>", "only idl/wire includes tenon.h"),
    ("clients/command/h.cpp", "#include <fastdds/dds/topic/Topic.hpp>", "not the door of Fast DDS"),
    ("clients/other_vendor/o.cpp", "#include <fastdds/dds/topic/Topic.hpp>", None),
    ("clients/other_vendor/o.cpp", "#include <tenonPubSubTypes.h>", None),
    ("clients/other_vendor/o.cpp", '#include "idl/wire/second.h"', "may not include idl/wire"),
    ("clients/station/i.cpp", '#include "clients/rehearse/rehearsal.h"', "no room may include clients/rehearse"),
    ("clients/rehearse/rehearsal.h", '#include "server/session/session_server.h"', None),
    ("clients/rehearse/rehearsal.h", '#include "clients/station/station.h"', None),
    ("clients/rehearse/rehearsal.h", '#include "tests/support/analytic.h"', "no room may include tests"),
    ("scenarios/part_generator/j.cpp", '#include "server/structures/field.h"', "may not include server/structures"),
    ("tests/server/k_test.cpp", "#include <gtest/gtest.h>", None),
    ("tests/server/k_test.cpp", '#include "clients/rehearse/rehearsal.h"', None),
    ("idl/wire/first.h", '#include "idl/wire/second.h"', "run in a circle: idl/wire/first, idl/wire/second"),
    ("idl/wire/second.cpp", '#include "idl/wire/first.h"', None),
    # what the others include
    ("idl/threads/clock.h", "#include <condition_variable>", None),
    ("idl/threads/latest.h", "#include <atomic>", None),
    ("idl/wire/second.h", "#include <vector>", None),
    ("server/simulation/environment.h", '#include "server/collision/pair_query.h"', None),
    ("server/collision/pair_query.h", "#include <vector>", None),
    ("server/collision/pair_query.cpp", '#include "server/collision/contact_reducer.h"', None),
    ("server/collision/contact_reducer.h", '#include "server/collision/pair_query.h"', None),
    ("server/structures/field.h", "#include <vector>", None),
    ("server/session/session_server.h", "#include <vector>", None),
    ("server/tools/lines.h", "#include <vector>", None),
    ("devices/simulated/hug.h", "#include <vector>", None),
    ("clients/haptic/coupling.h", "#include <vector>", None),
    ("clients/station/station.h", "#include <vector>", None),
    ("tests/support/analytic.h", "#include <vector>", None),
]


def self_test():
    missed = []
    with tempfile.TemporaryDirectory() as folder:
        root = Path(folder)
        for path, line, _ in PLANTED:
            (root / path).parent.mkdir(parents=True, exist_ok=True)
            with open(root / path, "a", encoding="utf-8") as file:
                file.write(line + "\n")
        found, includes = include_faults(root)
        claims = table_faults(includes)
    left = list(found)
    for path, line, said in PLANTED:
        if said is None:
            continue
        hit = next((fault for fault in left if said in fault and fault.startswith((path, os.path.splitext(path)[0] + ":"))), None)
        if hit is None:
            missed.append(f"not found: {path}: {line} ({said})")
        else:
            left.remove(hit)
    missed += [f"found without reason: {fault}" for fault in left]
    if not any("take the door out of ROOMS" in fault for fault in claims):
        missed.append("not found: a door that nobody uses")
    wrong = BEGIN + "\n" + table().replace("| idl/types |", "| idl/everything |", 1) + END + "\n"
    if text_with_table(wrong) in (wrong, None) or text_with_table(text_with_table(wrong)) != text_with_table(wrong):
        missed.append("not found: a table in ARCHITECTURE.md that differs")
    if circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}}) != [["a", "b", "c"]] or circles({"a": {"b"}, "c": {"b"}}):
        missed.append("not found: a circle of three")
    decisions = "# Decisions\n## D-001 One (2026-11-21)\n## D-003 Three (2026-11-21)\n## D-003 Undated\n"
    if len(decision_faults(decisions, [("a.h:1", "002"), ("a.h:2", "004")])) != 3:
        missed.append("not found: a decision out of order, without a date, or one that does not exist")
    for line in missed:
        print(line)
    print(f"architecture test: {'is blind' if missed else 'finds what it must'}: {len(PLANTED)} planted lines")
    others = [test.self_test() for test in (names_test, units_test)]
    return 1 if missed or any(others) else 0


def main():
    words, root = sys.argv[1:], Path(__file__).resolve().parent.parent
    if words == ["--self-test"]:
        return self_test()
    if words == ["--table"]:
        print(table(), end="")
        return 0
    if words == ["--table", "--write"]:
        text = text_with_table(read(root / "ARCHITECTURE.md"))
        if text is None:
            print(f"ARCHITECTURE.md has no place for the table: put the lines {BEGIN} and {END} there", file=sys.stderr)
            return 1
        (root / "ARCHITECTURE.md").write_text(text, encoding="utf-8")
        return 0
    if words:
        print(__doc__.split("\n\n")[1], file=sys.stderr)
        return 0 if words in (["-h"], ["--help"]) else 2
    faults = faults_in(root)
    for fault in faults:
        print(fault)
    print(f"architecture: {len(faults)} faults")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main())
