#!/usr/bin/env python3
"""Draws a section through the control box that a hand presses at the fender of the engine bay, a sheet of 1 mm in voxels of 5 mm.

    server/collision/pictures/thin_wall.py [--before PROGRAMS] --out server/collision/pictures

Writes thin_wall.svg from `tenon rehearse --input` (docs/bake.md). --before: folder of the programs of a tree without the dilation of
thin walls (before D-051), with its scenario two folders above, drawn beside it. Needs nothing but Python and Tenon."""
import argparse
import json
import math
import struct
import subprocess
import tempfile
from collections import defaultdict
from pathlib import Path

SOURCE = Path(__file__).resolve().parents[3]
INK, FAINT, PAPER = "#1d2733", "#6f7b87", "#ffffff"
SHEET, BOX, BAD, GOOD = "#1d2733", "#d98e04", "#c1392b", "#1f6f9f"
FONT = "font-family='Helvetica,Arial,sans-serif'"
SECONDS, BEHIND = 2.5, 0.1  # [s] of the push; [m] behind the fender where the hand ends
PUSH = ((0.0, 1.146), (2.0, 0.946 - BEHIND))  # [s], [m] x of the hand in the world, against the fender at 0.946 m
Y, Z = 0.75, 0.80  # [m] of the hand
DETAIL = "0.12"
CELL = 0.004  # [m]
WIDTH, HEIGHT, TOP, GAP = 440, 430, 74, 20  # [pixels] of a panel
SCALE = 3400.0  # [pixels/m]
SPAN = 0.06  # [m] that a section shows on either side of its middle


def triangles(file):
    """Triangles [m] of a binary STL in mm."""
    data = file.read_bytes()
    for i in range(struct.unpack_from("<I", data, 80)[0]):
        v = struct.unpack_from("<9f", data, 84 + 50 * i + 12)
        yield tuple(tuple(1e-3 * c for c in v[k:k + 3]) for k in (0, 3, 6))


def placed(X, p):
    """X p, of a pose [x, y, z, qw, qx, qy, qz]."""
    w, u = X[3], X[4:]
    t = [2 * c for c in cross(u, p)]
    return tuple(X[i] + p[i] + w * t[i] + c for i, c in enumerate(cross(u, t)))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def push(programs, scenarios, folder):
    """Pose of the box and force [N] at the end."""
    rows = folder / "push.csv"
    rows.write_text("t,x,y,z,qw,qx,qy,qz\n" + "".join(f"{t},{x},{Y},{Z},1,0,0,0\n" for t, x in PUSH))
    log = folder / "push.jsonl"
    log.unlink(missing_ok=True)
    # it ends with 1, as nothing is mounted
    subprocess.run([programs / "tenon-rehearse", scenarios / "engine_bay", "--detail", DETAIL, "--input", f"right={rows}",
                    "--take", "right=control_box", "--seconds", str(SECONDS), "--every", "100", "--log", log, "--quiet"], check=False,
                   stdout=subprocess.DEVNULL)
    last = json.loads(log.read_text().splitlines()[-1])
    return last["objects"]["control_box"]["X_WO"], math.hypot(*last["hands"]["right"]["F_Ho_W"][:3])


class Fender:
    """The outer surface of the bay towards +x, where the box is pushed."""

    def __init__(self, bay):
        self.cells = defaultdict(list)
        for one in bay:
            low, high = [min(p[k] for p in one) for k in range(3)], [max(p[k] for p in one) for k in range(3)]
            for i in range(math.floor(low[1] / CELL), math.floor(high[1] / CELL) + 1):
                for j in range(math.floor(low[2] / CELL), math.floor(high[2] / CELL) + 1):
                    self.cells[i, j].append(one)

    def x(self, y, z):
        """[m] of the outermost sheet on the line along x; none: there is no surface."""
        found = None
        for a, b, c in self.cells.get((math.floor(y / CELL), math.floor(z / CELL)), ()):
            area = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
            if abs(area) < 1e-14:
                continue
            s = ((y - a[1]) * (c[2] - a[2]) - (z - a[2]) * (c[1] - a[1])) / area
            t = ((b[1] - a[1]) * (z - a[2]) - (b[2] - a[2]) * (y - a[1])) / area
            if s >= 0 and t >= 0 and s + t <= 1:
                x = a[0] + s * (b[0] - a[0]) + t * (c[0] - a[0])
                found = x if found is None else max(found, x)
        return found


def nearest(fender, box):
    """The box's vertex that is furthest behind the fender's outer surface, or nearest to it: [m] in front of it, and the point."""
    points = {p for one in box for p in one}
    gaps = ((p[0] - x, p) for p in points if (x := fender.x(p[1], p[2])) is not None)
    return min(gaps)


def section(shape, y):
    """Segments ((x, z), (x, z)) of triangles in the plane of this y."""
    for one in shape:
        ends = []
        for p, q in zip(one, one[1:] + one[:1]):
            if (p[1] < y) != (q[1] < y):
                s = (y - p[1]) / (q[1] - p[1])
                ends.append((p[0] + s * (q[0] - p[0]), p[2] + s * (q[2] - p[2])))
        if len(ends) == 2:
            yield tuple(ends)


def text(x, y, content, colour=INK, size=15, anchor="start", weight="normal"):
    return (f"<text x='{x:.0f}' y='{y:.0f}' {FONT} font-size='{size}' fill='{colour}' text-anchor='{anchor}' "
            f"font-weight='{weight}'>{content}</text>")


def panel(left, title, bay, box, gap, at, force):
    middle = (at[0] - min(gap, 0.0), at[2])

    def pixel(p):
        return left + WIDTH / 2 + (p[0] - middle[0]) * SCALE, TOP + HEIGHT / 2 - (p[1] - middle[1]) * SCALE

    def lines(shape, style):
        near = (s for s in section(shape, at[1]) if any(abs(p[0] - middle[0]) < SPAN and abs(p[1] - middle[1]) < SPAN for p in s))
        path = "".join("M{:.1f} {:.1f}L{:.1f} {:.1f}".format(*pixel(a), *pixel(b)) for a, b in near)
        return f"<path d='{path}' {style}/>"

    colour = BAD if gap < 0 else GOOD
    said = f"{abs(1e3 * gap):.1f} mm {'behind' if gap < 0 else 'in front of'} the sheet"
    surface, tip = pixel((at[0] - gap, at[2])), pixel((at[0], at[2]))
    return [
        f"<svg x='{left}' y='{TOP}' width='{WIDTH}' height='{HEIGHT}' viewBox='{left} {TOP} {WIDTH} {HEIGHT}'>",
        f"<rect x='{left}' y='{TOP}' width='{WIDTH}' height='{HEIGHT}' fill='#f4f5f6'/>",
        lines(box, f"fill='none' stroke='{BOX}' stroke-width='2'"),
        lines(bay, f"fill='none' stroke='{SHEET}' stroke-width='2'"),
        f"<path d='M{surface[0]:.1f} {surface[1]:.1f}L{tip[0]:.1f} {tip[1]:.1f}' stroke='{colour}' stroke-width='4'/>",
        f"<circle cx='{tip[0]:.1f}' cy='{tip[1]:.1f}' r='5' fill='{colour}'/>", "</svg>",
        text(left, 40, title, size=18, weight="bold"),
        text(left, 62, f"{said}, {force:.0f} N on the hand", colour, 15),
    ]


def draw(panels):
    width = len(panels) * (WIDTH + GAP) + GAP
    height = TOP + HEIGHT + 34
    scale = f"M{GAP} {height - 16}h{10e-3 * SCALE:.0f}"
    return "\n".join([
        f"<svg xmlns='http://www.w3.org/2000/svg' width='{width}' height='{height}' viewBox='0 0 {width} {height}'>",
        "<title>The control box pressed at the fender of the engine bay, in section</title>",
        f"<rect width='{width}' height='{height}' fill='{PAPER}'/>",
        *(line for i, one in enumerate(panels) for line in panel(GAP + i * (WIDTH + GAP), *one)),
        f"<path d='{scale}' stroke='{INK}' stroke-width='2'/>", text(GAP + 10e-3 * SCALE + 8, height - 11, "10 mm", size=13),
        text(width - GAP, height - 11, "dark: the bay's sheets as modelled, yellow: the box; seen along the fender", FAINT, 13, "end"), "</svg>"]) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, required=True, help="folder of the picture")
    parser.add_argument("--programs", type=Path, default=SOURCE / "build" / "release" / "bin")
    parser.add_argument("--before", type=Path, help="programs of a tree without the dilation of thin walls")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run([options.programs / "tenon-parts", "engine_bay", folder, "--detail", DETAIL, "--overwrite"], check=True,
                       stdout=subprocess.DEVNULL)
        (low, high), (y, z) = (0.85, 1.05), (Y, Z)
        bay = [one for one in triangles(folder / "engine_bay.stl")
               if all(min(p[k] for p in one) < b and max(p[k] for p in one) > a
                      for k, (a, b) in enumerate(((low, high), (y - 0.25, y + 0.25), (z - 0.25, z + 0.25))))]
        model, fender = list(triangles(folder / "control_box.stl")), Fender(bay)
        panels = []
        for title, programs, scenarios in (("Offset of the mesh alone", options.before, None), ("Thin walls dilated", options.programs, SOURCE / "scenarios")):
            if programs is None:
                continue
            X_WO, force = push(programs, scenarios or programs.resolve().parents[2] / "scenarios", folder)
            box = [tuple(placed(X_WO, p) for p in one) for one in model]
            gap, at = nearest(fender, box)
            print(f"{title}: {1e3 * gap:.2f} mm in front of the sheet at ({at[0]:.3f}, {at[1]:.3f}, {at[2]:.3f}) m, {force:.1f} N")
            panels.append((title, bay, box, gap, at, force))
    (options.out / "thin_wall.svg").write_text(draw(panels), encoding="utf-8")


if __name__ == "__main__":
    main()
