#!/usr/bin/env python3
"""Draws the haptic structures of a part: a slice of its distance field, and its pointshell by level.

    ./tenon parts engine_bay PARTS
    ./tenon bake PARTS/drill.stl -o drill.tenon --voxel 3mm --points 4000
    server/structures/pictures/structures.py drill.tenon --across y --out .

Writes field.svg and shell.svg. Uses only the Python standard library and Tenon."""
import argparse
import csv
import math
import re
import subprocess
import sys
import tempfile
from pathlib import Path

TENON = Path(__file__).resolve().parents[3] / "tenon"
INK, FAINT, PAPER, SHADOW = "#1d2733", "#6f7b87", "#ffffff", "#eef1f4"
# one colour per voxel of distance: from inside to the surface (the first for everything deeper), then outwards
INSIDE = ["#8f1d23", "#c1392b", "#e2703a", "#f3a64e", "#fbe09a"]
OUTSIDE = ["#1f93a6", "#5fb7c4", "#9fd5dc", "#d8eef1"]
COARSER, NEW = "#d98e04", "#2f6f9f"  # points of coarser levels, and those that the level adds
FONT = "font-family='Helvetica,Arial,sans-serif'"


def tenon(*words, text=None):
    done = subprocess.run([TENON, *map(str, words)], input=text, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        sys.exit(done.stderr)
    return done.stdout


def length(text):
    number, unit = text.split()
    return float(number) * {"m": 1.0, "mm": 1e-3, "um": 1e-6}[unit]


class Baked:
    """A structure file as printed by `tenon bake --info`."""

    def __init__(self, file):
        self.file = file
        with tempfile.TemporaryDirectory() as folder:
            table = Path(folder) / "shell.csv"
            self.info = tenon("bake", "--info", file, "--shell", table)
            with table.open(encoding="utf-8") as rows:
                self.points = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(rows)]
        self.voxel = length(re.search(r"field +(\S+ \S+) voxels", self.info)[1])
        corners = re.search(r"from \((.*?)\) to \((.*?)\)", self.info)
        self.low, self.high = ([length(c) for c in corner.split(", ")] for corner in corners.groups())

    def distances(self, points):
        """Signed distance for each point, None beyond the band."""
        lines = tenon("probe", self.file, text="".join(f"{x:.7g} {y:.7g} {z:.7g}\n" for x, y, z in points))
        return [None if line == "far" else float(line.split()[0]) for line in lines.splitlines()]


def path(pieces, style):
    drawn = "".join(pieces)
    return f"<path d='{drawn}' {style}/>\n" if drawn else ""


class Slice:
    """A field in a plane, on a grid of half voxels. Distances are in voxels."""

    def __init__(self, baked, axis, at):
        self.axis, self.voxel = axis, baked.voxel
        self.u, self.v = [a for a in range(3) if a != axis]
        step, margin = baked.voxel / 2, 4.5 * baked.voxel
        self.u0, self.v0 = baked.low[self.u] - margin, baked.low[self.v] - margin
        self.columns = math.ceil((baked.high[self.u] + margin - self.u0) / step) + 1
        self.rows = math.ceil((baked.high[self.v] + margin - self.v0) / step) + 1
        places = []
        for row in range(self.rows):
            for column in range(self.columns):
                p = [0.0, 0.0, 0.0]
                p[axis], p[self.u], p[self.v] = at, self.u0 + column * step, self.v0 + row * step
                places.append(p)
        found = baked.distances(places)
        self.grid = [[None if d is None else d / baked.voxel for d in found[r * self.columns:(r + 1) * self.columns]]
                     for r in range(self.rows)]
        self.extend()

    def extend(self):
        """Fills samples beyond the band: one next to the band from its neighbours, the others by sign only."""
        known = [row[:] for row in self.grid]
        for row in range(self.rows):
            for column in range(self.columns):
                if known[row][column] is not None:
                    continue
                around = [(known[r][c], math.hypot(r - row, c - column) / 2)
                          for r in range(max(row - 1, 0), min(row + 2, self.rows))
                          for c in range(max(column - 1, 0), min(column + 2, self.columns)) if known[r][c] is not None]
                if around:
                    nearest = min(abs(d) + away for d, away in around)
                    self.grid[row][column] = math.copysign(max(nearest, 4.0), around[0][0])
        for row in self.grid:
            inside = False
            for column, d in enumerate(row):
                inside = d < 0.0 if d is not None else inside
                if d is None:
                    row[column] = -9.0 if inside else 9.0

    def cells(self):
        for row in range(self.rows - 1):
            for column in range(self.columns - 1):
                yield column, row, [self.grid[row][column], self.grid[row][column + 1],
                                    self.grid[row + 1][column + 1], self.grid[row + 1][column]]

    def line(self, level):
        """The contour of distance `level` (marching squares)."""
        ends = {}
        for column, row, corner in self.cells():
            around = [(column, row), (column + 1, row), (column + 1, row + 1), (column, row + 1)]
            crossings = []
            for i in range(4):
                a, b = corner[i] - level, corner[(i + 1) % 4] - level
                if (a < 0.0) != (b < 0.0):
                    fraction = a / (a - b)
                    (x, y), (s, t) = around[i], around[(i + 1) % 4]
                    crossings.append((number(x + fraction * (s - x)), number(y + fraction * (t - y))))
            for a, b in zip(crossings[::2], crossings[1::2]):
                ends.setdefault(a, []).append(b)
                ends.setdefault(b, []).append(a)
        return chained(ends)


def number(value):
    return f"{value:.2f}".rstrip("0").rstrip(".")


def chained(ends):
    pieces = []
    while ends:
        start = min(ends, key=lambda p: len(ends[p]))
        line, here = [start], start
        while ends.get(here):
            there = ends[here].pop()
            ends[there].remove(here)
            if not ends[here]:
                del ends[here]
            line.append(there)
            here = there
        ends.pop(here, None)
        if len(line) > 2:
            pieces.append("M" + "L".join(f"{x} {y}" for x, y in line[:-1]) + "z")
    return pieces


def page(width, height, body):
    return (f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width:.0f} {height:.0f}' {FONT}>\n"
            f"<rect width='{width:.0f}' height='{height:.0f}' fill='{PAPER}'/>\n{body}</svg>\n")


def scale_bar(x, y, per_metre):
    size = 0.02
    return (f"<path d='M{x} {y - 4}v4h{size * per_metre:.1f}v-4' fill='none' stroke='{INK}' stroke-width='1.2'/>\n"
            f"<text x='{x + size * per_metre / 2:.1f}' y='{y - 6}' font-size='12' text-anchor='middle' fill='{INK}'>20 mm</text>\n")


def field_picture(baked, axis, at):
    cut = Slice(baked, axis, at)
    unit = 900.0 / cut.columns
    height = cut.rows * unit
    body = f"<g transform='translate(36 {height + 12:.1f}) scale({unit:.4f} {-unit:.4f})' stroke-linejoin='round'>\n"
    steps = [(k - len(INSIDE), colour) for k, colour in enumerate(INSIDE)] + list(enumerate(OUTSIDE))
    # areas below each limit, each painted over those of the next higher limit
    for low, colour in reversed(steps):
        body += path(cut.line(low + 1), f"fill='{colour}' fill-rule='evenodd' stroke='{PAPER}' stroke-width='0.18'")
    body += path(cut.line(0.0), f"fill='none' stroke='{INK}' stroke-width='0.7'")
    body += "</g>\n"
    foot = height + 40
    body += scale_bar(36, foot + 6, unit * 2 / baked.voxel)
    box, left = 44, 936 - 44 * len(steps)
    for k, (low, colour) in enumerate(steps):
        body += f"<rect x='{left + box * k}' y='{foot - 12}' width='{box}' height='16' fill='{colour}'/>\n"
        if k > 0:
            millimetres = f"{low * baked.voxel * 1e3:+.0f}".replace("-", "\u2212") if low else "0"
            body += f"<text x='{left + box * k}' y='{foot + 22}' font-size='13' text-anchor='middle' fill='{INK}'>{millimetres}</text>\n"
    body += path([f"M{left + box * len(INSIDE)} {foot - 14}v20"], f"stroke='{INK}' stroke-width='2.5'")
    body += f"<text x='{left - 12}' y='{foot + 1}' font-size='13' text-anchor='end' fill='{INK}'>signed distance [mm]</text>\n"
    return page(972, foot + 36, body)


class View:
    """The points of a shell in orthographic projection: right, up, towards the viewer."""

    def __init__(self, points, turn, tilt):
        self.turn, self.tilt = math.radians(turn), math.radians(tilt)
        self.points = []
        for p in points:
            place, normal = self.projected(p["x"], p["y"], p["z"]), self.projected(p["nx"], p["ny"], p["nz"])
            # light from the upper left behind the viewer
            light = max(0.0, -0.45 * normal[0] + 0.65 * normal[1] + 0.62 * normal[2])
            self.points.append((int(p["level"]), *place, normal[2], light))
        self.low, self.high = ([edge(p[axis] for p in self.points) for axis in (1, 2)] for edge in (min, max))
        self.spacing = math.sqrt(sum(p["area"] for p in points) / len(points))
        self.front = {}
        for p in self.points:
            for cell in self.cells(p, 1):
                self.front[cell] = max(self.front.get(cell, -1e9), p[3])

    def projected(self, x, y, z):
        x, y = math.cos(self.turn) * x - math.sin(self.turn) * y, math.sin(self.turn) * x + math.cos(self.turn) * y
        return x, math.sin(self.tilt) * y + math.cos(self.tilt) * z, -math.cos(self.tilt) * y + math.sin(self.tilt) * z

    def cells(self, p, around):
        column, row = math.floor(p[1] / self.spacing), math.floor(p[2] / self.spacing)
        return [(column + i, row + j) for i in range(-around, around + 1) for j in range(-around, around + 1)]

    def visible(self, p):
        """Whether a point faces the viewer and is not occluded."""
        return p[4] > 0.0 and self.front[self.cells(p, 0)[0]] - p[3] < 4.0 * self.spacing


def mixed(colour, fraction, other):
    channels = [(int(colour[i:i + 2], 16), int(other[i:i + 2], 16)) for i in (1, 3, 5)]
    return "#" + "".join(f"{round(a + (b - a) * fraction):02x}" for a, b in channels)


def shell_picture(baked, turn=-28.0, tilt=16.0):
    """One panel per level: its own points and those of coarser levels, over all points as a background."""
    view = View(baked.points, turn, tilt)
    levels = 1 + max(p[0] for p in view.points)
    columns = 2 if levels > 3 else levels
    panel = 948.0 / columns
    unit = (panel - 36.0) / (view.high[0] - view.low[0])
    height = (view.high[1] - view.low[1]) * unit
    rows = math.ceil(levels / columns)
    seen = [p for p in view.points if view.visible(p)]
    dot = [f"M{(p[1] - view.low[0]) * unit:.1f} {(view.high[1] - p[2]) * unit:.1f}h0" for p in seen]
    shadow = path(dot, f"id='whole' stroke='{SHADOW}' stroke-width='{2.6 * view.spacing * unit:.1f}'")
    body = f"<defs>{shadow}</defs>\n<g stroke-linecap='round'>\n"
    for level in range(levels):
        left, top = 30 + level % columns * panel, 20 + level // columns * (height + 62)
        body += f"<g transform='translate({left:.1f} {top:.1f})'><use href='#whole'/>\n"
        count = sum(p[0] <= level for p in view.points)
        size = max(3.0, min(9.0, 0.42 * unit * math.sqrt(view.spacing ** 2 * len(view.points) / count)))
        for own in (True, False):
            for shade in range(5):
                dots = [d for d, p in zip(dot, seen) if min(4, int(p[5] * 5)) == shade
                        and (p[0] == level if own else p[0] < level)]
                colour = mixed(mixed(NEW if own or level == 0 else COARSER, 0.45, INK), shade / 4, NEW if own else COARSER)
                if own:
                    colour = mixed(colour, shade / 10, PAPER)
                body += path(dots, f"stroke='{colour}' stroke-width='{size:.1f}'")
        body += (f"<text y='{height + 30:.0f}' font-size='15' fill='{INK}'>level {level}</text>"
                 f"<text x='62' y='{height + 30:.0f}' font-size='13' fill='{FAINT}'>{count} points</text></g>\n")
    foot = rows * (height + 62) + 22
    for x, colour, words in ((30, NEW, "new at this level"), (190, COARSER, "from the levels before")):
        body += path([f"M{x + 5} {foot}h0"], f"stroke='{colour}' stroke-width='9'")
        body += f"<text x='{x + 18}' y='{foot + 5:.0f}' font-size='13' fill='{INK}'>{words}</text>\n"
    return page(972, foot + 24, body + "</g>\n")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("baked", metavar="STRUCTURES", help="structure file (from tenon bake)")
    parser.add_argument("--across", choices="xyz", default="z", help="axis perpendicular to the slice")
    parser.add_argument("--at", type=float, default=0.0, help="position on that axis [m]")
    parser.add_argument("--out", type=Path, default=Path("."), help="folder to write into")
    words = parser.parse_args()
    baked = Baked(words.baked)
    (words.out / "field.svg").write_text(field_picture(baked, "xyz".index(words.across), words.at), encoding="utf-8")
    (words.out / "shell.svg").write_text(shell_picture(baked), encoding="utf-8")


if __name__ == "__main__":
    main()
