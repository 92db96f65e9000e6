#!/usr/bin/env python3
"""Draws the path of a held box that slides in a corner while its hand is behind floor and wall.

    server/collision/pictures/god_object.py --out server/collision/pictures

Writes god_object.svg from the output of `tenon bench corner`. Needs nothing but Python and Tenon."""
import argparse
import csv
import subprocess
import sys
from pathlib import Path

TENON = Path(__file__).resolve().parents[3] / "tenon"
INK, FAINT, PAPER, WALL = "#1d2733", "#6f7b87", "#ffffff", "#d5dade"
GOD, BLOCKING, FORCE = "#1f6f9f", "#c1392b", "#d98e04"
FONT = "font-family='Helvetica,Arial,sans-serif'"
HALF_X, HALF_Z = 0.04, 0.02  # [m] of the box
DILATION = 0.00261  # [m] of the corner's surface
SCALE = 5000.0  # [pixels/m]
LEFT, RIGHT, BELOW, ABOVE = -0.03, 0.235, -0.03, 0.105
FLOOR = 0.17  # [m] its end in the picture
CLOSE_SCALE, CLOSE = 45000.0, 0.006  # [pixels/m] scale and [m] size of the close-up


class View:
    """Transforms metres in the x-z plane to pixels."""

    def __init__(self, x, y, scale):
        self.x, self.y, self.scale = x, y, scale

    def at(self, x, z):
        return f"{self.x + x * self.scale:.1f},{self.y - z * self.scale:.1f}"

    def line(self, points, style):
        return f"<polyline fill='none' points='{' '.join(self.at(*p) for p in points)}' {style}/>"

    def area(self, points, style):
        return f"<polygon points='{' '.join(self.at(*p) for p in points)}' {style}/>"


def text(x, y, content, colour=INK, size=14, anchor="start"):
    return f"<text x='{x}' y='{y}' {FONT} font-size='{size}' fill='{colour}' text-anchor='{anchor}'>{content}</text>"


def outline(row):
    x, z = row["box_x"], row["box_z"]
    return [(x - HALF_X, z - HALF_Z), (x + HALF_X, z - HALF_Z), (x + HALF_X, z + HALF_Z), (x - HALF_X, z + HALF_Z)]


def arrow(view, row, colour):
    """Force on the hand as an arrow from the box's centre, 1 mm per newton."""
    x, z = row["box_x"], row["box_z"]
    tip = (x + 1e-3 * row["force_x"], z + 1e-3 * row["force_z"])
    return view.line([(x, z), tip], f"stroke='{colour}' stroke-width='2.5' marker-end='url(#tip)'")


def overview(rows):
    """The corner, the path of the hand, and the god object with the force on the hand at four poses."""
    view = View(-LEFT * SCALE, 70 + ABOVE * SCALE, SCALE)
    god = [row for row in rows if row["method"] == "god object"]
    wall = [(LEFT, ABOVE), (LEFT, BELOW), (FLOOR, BELOW), (FLOOR, 0.0), (0.0, 0.0), (0.0, ABOVE)]
    dilated = [(DILATION, ABOVE), (DILATION, DILATION), (FLOOR, DILATION)]
    drawn = [view.area(wall, f"fill='{WALL}'"),
             view.line(dilated, f"stroke='{FAINT}' stroke-width='1' stroke-dasharray='5 4'")]
    for fraction in (0.0, 0.3, 0.62, 0.99):
        row = god[int(fraction * (len(god) - 1))]
        drawn.append(view.area(outline(row), f"fill='{GOD}' fill-opacity='0.10' stroke='{GOD}' stroke-width='1'"))
        hand = (row["hand_x"], row["hand_z"])
        drawn.append(view.line([(row["box_x"], row["box_z"]), hand], f"stroke='{FAINT}' stroke-dasharray='2 3'"))
        drawn.append(f"<circle cx='{view.at(*hand).split(',')[0]}' cy='{view.at(*hand).split(',')[1]}' r='5' fill='{INK}'/>")
        if abs(row["force_x"]) + abs(row["force_z"]) > 0.5:
            drawn.append(arrow(view, row, FORCE))
    drawn.append(view.line([(row["hand_x"], row["hand_z"]) for row in god],
                           f"stroke='{INK}' stroke-width='1.5' stroke-dasharray='7 5'"))
    drawn.append(view.line([(row["box_x"], row["box_z"]) for row in god], f"stroke='{GOD}' stroke-width='3'"))
    return drawn


def close_up(rows, x, y):
    """Path of the box's corner near the walls, for both methods."""
    edge = CLOSE * CLOSE_SCALE
    view = View(x, y + edge, CLOSE_SCALE)
    drawn = [f"<clipPath id='close'><rect x='{x}' y='{y}' width='{edge}' height='{edge}'/></clipPath>",
             f"<rect x='{x}' y='{y}' width='{edge}' height='{edge}' fill='{PAPER}'/><g clip-path='url(#close)'>",
             view.area([(0.0, 0.0), (CLOSE, 0.0), (CLOSE, DILATION), (DILATION, DILATION), (DILATION, CLOSE), (0.0, CLOSE)],
                       f"fill='{WALL}' fill-opacity='0.55' stroke='{FAINT}' stroke-dasharray='5 4'")]
    for method, colour in (("blocking", BLOCKING), ("god object", GOD)):
        path = [(row["box_x"] - HALF_X, row["box_z"] - HALF_Z) for row in rows if row["method"] == method]
        drawn.append(view.line(path, f"stroke='{colour}' stroke-width='3'"))
    drawn += ["</g>", f"<rect x='{x}' y='{y}' width='{edge}' height='{edge}' fill='none' stroke='{INK}'/>",
              text(x, y - 10, "the corner of the box, enlarged nine times", size=13),
              text(x + 6, y + edge - 8, "inside the dilated walls", FAINT, 12)]
    return drawn


def picture(rows):
    width, height = (RIGHT - LEFT) * SCALE, 70 + (ABOVE - BELOW) * SCALE
    out = [f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {width:.0f} {height:.0f}'>",
           f"<rect width='100%' height='100%' fill='{PAPER}'/>",
           f"<defs><marker id='tip' viewBox='0 0 8 8' refX='6' refY='4' markerWidth='5' markerHeight='5' orient='auto'>"
           f"<path d='M0,0 L8,4 L0,8 z' fill='{FORCE}'/></marker></defs>",
           text(20, 30, "A held box whose hand moves behind a floor and a wall", size=18),
           text(20, 54, "hand: dashed; box: the god object, blue; force on the hand: 1 mm per newton; "
                        "dashed surface: dilated contact surface of a field with 3 mm voxels", FAINT)]
    out += overview(rows)
    x = width - CLOSE * CLOSE_SCALE - 24
    out += close_up(rows, x, 100)
    out += [text(x, 100 + CLOSE * CLOSE_SCALE + 22, "one QP per island: slides, no penetration", GOD, 13),
            text(x, 100 + CLOSE * CLOSE_SCALE + 42, "blocking on the summed wrench: penetrates", BLOCKING, 13), "</svg>"]
    return "\n".join(out) + "\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--csv", type=Path, help="output of `tenon bench corner` (default: run it)")
    parser.add_argument("--out", type=Path, default=Path("."), help="folder of the picture")
    options = parser.parse_args()
    if options.csv:
        table = options.csv.read_text(encoding="utf-8")
    else:
        completed = subprocess.run([TENON, "bench", "corner"], capture_output=True, text=True, check=False)
        if completed.returncode != 0:
            sys.exit(completed.stderr)
        table = completed.stdout
    rows = [{key: value if key == "method" else float(value) for key, value in row.items()}
            for row in csv.DictReader(table.splitlines())]
    (options.out / "god_object.svg").write_text(picture(rows), encoding="utf-8")


if __name__ == "__main__":
    main()
