"""Queries of baked parts, compared with the loop over all points and with the mesh."""
import math
import random
import struct
import tempfile
import unittest
from pathlib import Path

from stage import tenon


def baked(folder, part, voxel, points):
    """Bakes a part that `tenon parts` has written to the folder."""
    mesh, file = Path(folder) / f"{part}.stl", Path(folder) / f"{part}.tenon"
    done = tenon("bake", mesh, "-o", file, "--voxel", voxel, "--points", points, "--quiet")
    assert done.returncode == 0, done.stderr
    return file


def any_rotation(random_source):
    q = [random_source.gauss(0, 1) for _ in range(4)]
    length = math.sqrt(sum(x * x for x in q))
    return [x / length for x in q]


def any_direction(random_source):
    v = [random_source.gauss(0, 1) for _ in range(3)]
    length = math.sqrt(sum(x * x for x in v))
    return [x / length for x in v]


def sub(a, b):
    return [a[0] - b[0], a[1] - b[1], a[2] - b[2]]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def triangles_of(stl):
    """Corners of the triangles of a binary STL file in millimetres, in metres."""
    data = Path(stl).read_bytes()
    count = struct.unpack_from("<I", data, 80)[0]
    found = []
    for i in range(count):
        n = [0.001 * x for x in struct.unpack_from("<9f", data, 84 + 50 * i + 12)]
        found.append((n[0:3], n[3:6], n[6:9]))
    return found


def distance_to(p, triangle):
    a, b, c = triangle
    normal = cross(sub(b, a), sub(c, a))
    squared = dot(normal, normal)
    if squared > 0 and all(dot(normal, cross(sub(v, u), sub(p, u))) >= 0 for u, v in ((a, b), (b, c), (c, a))):
        return abs(dot(normal, sub(p, a))) / math.sqrt(squared)
    best = math.inf
    for u, v in ((a, b), (b, c), (c, a)):
        along, to_p = sub(v, u), sub(p, u)
        length = dot(along, along)
        fraction = min(max(dot(along, to_p) / length, 0.0), 1.0) if length > 0 else 0.0
        best = min(best, math.dist(to_p, [fraction * x for x in along]))
    return best


def inside(p, triangles):
    """By the solid angle of the surface seen from p (van Oosterom and Strackee 1983)."""
    half_angles = 0.0
    for triangle in triangles:
        a, b, c = (sub(corner, p) for corner in triangle)
        la, lb, lc = (math.sqrt(dot(v, v)) for v in (a, b, c))
        half_angles += math.atan2(dot(a, cross(b, c)), la * lb * lc + dot(a, b) * lc + dot(b, c) * la + dot(c, a) * lb)
    return half_angles > math.pi


def on_surface(triangles, random_source):
    """A uniformly distributed point of the surface, and its outward normal."""
    areas = [math.sqrt(dot(n, n)) for n in (cross(sub(b, a), sub(c, a)) for a, b, c in triangles)]
    a, b, c = random_source.choices(triangles, areas)[0]
    u, v = random_source.random(), random_source.random()
    if u + v > 1:
        u, v = 1 - u, 1 - v
    normal = cross(sub(b, a), sub(c, a))
    length = math.sqrt(dot(normal, normal))
    return [a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]) for i in range(3)], [x / length for x in normal]


class Queries(unittest.TestCase):
    def assert_pruned_equals_flat(self, folder, field, shell, reach):
        """At random poses around the SDF's body all columns are equal, to the last digit written."""
        random_source, poses, tables = random.Random(7), Path(folder) / "poses", []
        lines = []
        for _ in range(1500):
            distance = reach * random_source.uniform(0.3, 1.0)
            position = [distance * x for x in any_direction(random_source)]
            lines.append(" ".join(f"{x:.9f}" for x in position + any_rotation(random_source)))
        poses.write_text("\n".join(lines) + "\n", encoding="utf-8")
        for arguments in ((), ("--no-prune",)):
            table = Path(folder) / "table.csv"
            done = tenon("contact", field, shell, "--poses", poses, "--csv", table, "--overwrite", *arguments)
            self.assertEqual(done.returncode, 0, done.stderr)
            rows = [line.split(",") for line in table.read_text(encoding="utf-8").splitlines()[1:]]
            # all columns but time and load
            tables.append([row[:1] + row[2:10] for row in rows])
        pruned, flat = tables
        self.assertEqual(len(pruned), 1500)
        for a, b in zip(pruned, flat):
            self.assertEqual(a, b)
        self.assertGreater(sum(int(row[1]) for row in flat), 10000)
        self.assertGreater(sum(1 for row in flat if row[1] == "0"), 20)

    def test_pruned_queries_equal_the_loop_over_all_points(self):
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(tenon("parts", "engine_bay", folder, "--detail", 0.05).returncode, 0)
            bracket = baked(folder, "bracket", "3mm", 3000)
            pointer = baked(folder, "haptic_pointer", "2mm", 1000)
            drill = baked(folder, "drill", "3mm", 3000)
            self.assert_pruned_equals_flat(folder, bracket, drill, 0.3)
            self.assert_pruned_equals_flat(folder, drill, pointer, 0.2)

    def test_distances_near_a_part_agree_with_its_mesh(self):
        with tempfile.TemporaryDirectory() as folder:
            self.assertEqual(tenon("parts", "peg_and_box", folder).returncode, 0)
            # voxel size as in its scenario; the largest errors lie along edges and are proportional to the voxel
            field, triangles = baked(folder, "peg", "2mm", 1000), triangles_of(Path(folder) / "peg.stl")
            random_source, points = random.Random(8), []
            for _ in range(3000):
                p, out = on_surface(triangles, random_source)
                depth = random_source.uniform(-0.006, 0.006)
                points.append([p[i] - depth * out[i] for i in range(3)])
            done = tenon("probe", field, input="".join(" ".join(f"{x:.9f}" for x in p) + "\n" for p in points))
            self.assertEqual(done.returncode, 0, done.stderr)
            errors, within, missed = [], 0, 0
            for p, line in zip(points, done.stdout.splitlines()):
                measured = float(line.split()[0])
                truth = min(distance_to(p, triangle) for triangle in triangles)
                if inside(p, triangles):
                    truth, within, missed = -truth, within + 1, missed + (measured >= 0)
                errors.append(abs(measured - truth))
            errors.sort()
            self.assertEqual(len(errors), 3000)
            self.assertLess(errors[1500], 0.01e-3)
            self.assertLess(errors[2970], 0.5e-3)
            self.assertGreater(within, 1000)
            self.assertLessEqual(missed, 0.01 * within)


if __name__ == "__main__":
    unittest.main()
