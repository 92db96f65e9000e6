"""Output and files of the verbs that need no running session."""
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest
from pathlib import Path
from xml.etree import ElementTree

from stage import COARSE, PROGRAMS, SOURCE, Stage, free_domain, tenon


def cube(folder, half=10, unit="mm"):
    """A cube of 20 mm about the origin, baked at 1 mm."""
    mesh, baked = Path(folder) / "cube.off", Path(folder) / "cube.tenon"
    corners = [f"{x} {y} {z}" for z in (-half, half) for y in (-half, half) for x in (-half, half)]
    sides = ("0 2 3 1", "4 5 7 6", "0 1 5 4", "2 6 7 3", "0 4 6 2", "1 3 7 5")
    mesh.write_text("\n".join(["OFF", "8 6 0", *corners, *(f"4 {side}" for side in sides)]) + "\n", encoding="utf-8")
    done = tenon("bake", mesh, "-o", baked, "--unit", unit, "--voxel", "1mm", "--points", "2000", "--quiet")
    assert done.returncode == 0, done.stderr
    return baked


class Verbs(unittest.TestCase):
    def test_version_names_a_version(self):
        self.assertRegex(tenon("version").stdout, r"^tenon \d+\.\d+\.\d+$")

    def test_doctor_checks_every_item(self):
        done = tenon("doctor")
        self.assertEqual(done.returncode, 0, done.stdout)
        programs = [file for file in PROGRAMS.glob("tenon-*") if not file.name.startswith("tenon-bench")]
        self.assertIn(f" {len(programs)} programs are there", done.stdout)
        for point in ("system", "processor", "programs", "real time", "memory", "bus", "disk"):
            self.assertRegex(done.stdout, rf"(?m)^(good|note) +{point}")

    def test_parts_are_made_baked_and_described(self):
        with tempfile.TemporaryDirectory() as folder:
            parts = tenon("parts", "peg_and_box", folder)
            self.assertEqual(parts.returncode, 0, parts.stderr)
            mesh, baked = Path(folder) / "peg.stl", Path(folder) / "peg.tenon"
            self.assertTrue(mesh.exists())
            bake = tenon("bake", mesh, "-o", baked, "--voxel", "2mm", "--unit", "mm", "--points", "2000")
            self.assertEqual(bake.returncode, 0, bake.stderr)
            info = tenon("bake", "--info", baked)
            self.assertEqual(info.returncode, 0, info.stderr)
            for word in ("voxel", "points", "triangles", "bytes per brick"):
                self.assertIn(word, info.stdout.lower())
            self.assertRegex(bake.stdout, r"used +\S+ s processor time, \d+ MB peak memory")

    def test_pointshell_points_are_listed_by_level(self):
        with tempfile.TemporaryDirectory() as folder:
            table = Path(folder) / "shell.csv"
            done = tenon("bake", "--info", cube(folder), "--shell", table)
            self.assertEqual(done.returncode, 0, done.stderr)
            head, *rows = [line.split(",") for line in table.read_text(encoding="utf-8").splitlines()]
            self.assertEqual(head, "level,x,y,z,nx,ny,nz,area".split(","))
            self.assertEqual(len(rows), int(re.search(r"shell +(\d+) points", done.stdout)[1]))
            self.assertAlmostEqual(sum(float(row[7]) for row in rows), 6 * 0.02 * 0.02, places=6)
            for row in rows:
                p, n = [float(c) for c in row[1:4]], [float(c) for c in row[4:7]]
                self.assertAlmostEqual(max(abs(c) for c in p), 0.01, places=5)
                self.assertGreater(sum(a * b for a, b in zip(p, n)), 0.0)

    def test_structures_are_drawn(self):
        drawing = Path(__file__).parents[2] / "server" / "structures" / "pictures" / "structures.py"
        with tempfile.TemporaryDirectory() as folder:
            arguments = [sys.executable, drawing, cube(folder), "--across", "z", "--out", folder]
            done = subprocess.run(arguments, capture_output=True, text=True, timeout=300, check=False)
            self.assertEqual(done.returncode, 0, done.stderr)
            field, shell = (ElementTree.parse(Path(folder) / name).getroot() for name in ("field.svg", "shell.svg"))
            labels = [[text.text for text in root.iter("{http://www.w3.org/2000/svg}text")] for root in (field, shell)]
            self.assertEqual(labels[0], ["20 mm", *(f"\u2212{k}" for k in (4, 3, 2, 1)), "0", "+1", "+2", "+3",
                                        "signed distance [mm]"])
            self.assertEqual(labels[1][:4:2], ["level 0", "level 1"])

    def test_an_interrupted_bake_reports_it_and_leaves_no_file(self):
        with tempfile.TemporaryDirectory() as folder:
            tenon("parts", "peg_and_box", folder)
            baked = Path(folder) / "baked"
            baked.mkdir()
            for number, arguments in ((signal.SIGINT, ("-o", baked / "peg.tenon")), (signal.SIGTERM, ("--cache", baked))):
                bake = subprocess.Popen([PROGRAMS / "tenon-bake", Path(folder) / "peg.stl", "--voxel", "0.25mm", *arguments],
                                        stderr=subprocess.PIPE, text=True)
                for line in bake.stderr:
                    if "measuring distances" in line:
                        bake.send_signal(number)
                rest = line
                self.assertEqual(bake.wait(60), 130)
                bake.stderr.close()
                self.assertEqual(rest.splitlines()[-1], "tenon-bake: peg.stl: cancelled")
                self.assertEqual(list(baked.iterdir()), [])

    def test_serve_and_rehearse_that_are_interrupted_while_a_scene_is_prepared_say_so_and_leave_nothing_half_written(self):
        scenario = SOURCE / "scenarios" / "engine_bay"
        for verb, said in (("serve", "tenon serve: stopped while the scene was prepared"), ("rehearse", "tenon rehearse: stopped")):
            with tempfile.TemporaryDirectory() as cache:
                # while parts are generated, then while they are baked
                for begun, number in (("parts", signal.SIGINT), ("structures", signal.SIGTERM)):
                    program = subprocess.Popen([PROGRAMS / f"tenon-{verb}", scenario, "--cache", cache, "--detail", "1" if begun == "parts" else "0.12"],
                                               stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
                    while not (Path(cache) / begun).exists() and program.poll() is None:
                        time.sleep(0.01)
                    program.send_signal(number)
                    errors = program.communicate(timeout=120)[1]
                    self.assertEqual((program.returncode, errors.strip()), (1, said), begun)
                    self.assertEqual([str(file) for file in Path(cache).rglob("*") if re.search(r"\.(part)?\d{3,}$", file.name)], [])

    def test_a_rehearsal_that_is_interrupted_ends_with_1(self):
        rehearsal = subprocess.Popen(["stdbuf", "-oL", PROGRAMS / "tenon-rehearse", SOURCE / "scenarios" / "peg_and_box", *COARSE, "--follow"], stdout=subprocess.PIPE,
                                     stderr=subprocess.PIPE, text=True)
        while "depth" not in (line := rehearsal.stdout.readline()) and line:
            pass
        rehearsal.send_signal(signal.SIGINT)
        errors = rehearsal.communicate(timeout=120)[1]
        self.assertEqual((rehearsal.returncode, errors.strip()), (1, "tenon rehearse: stopped"))

    # A module of the standard library that interrupts who imports it.
    def test_scripts_that_are_interrupted_in_their_imports_end_with_130_and_without_a_traceback(self):
        with tempfile.TemporaryDirectory() as folder:
            (Path(folder) / "argparse.py").write_text("import os, signal, time\nos.kill(os.getpid(), signal.SIGINT)\ntime.sleep(60)\n", encoding="utf-8")
            for verb in ("demo", "doctor", "picture"):
                with self.subTest(verb=verb):
                    done = tenon(verb, env={"PYTHONPATH": folder})
                    self.assertEqual((done.returncode, done.stdout, done.stderr), (130, "", ""))

    def test_a_check_of_a_link_that_is_interrupted_ends_with_130_and_without_a_traceback(self):
        domain = str(free_domain())
        environment = {**os.environ, "TENON_PROGRAMS": str(PROGRAMS), "PYTHONUNBUFFERED": "1"}

        def start(*words):
            doctor = subprocess.Popen([SOURCE / "tenon", "doctor", *words, "--domain", domain], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)
            self.addCleanup(doctor.kill)
            doctor.stdout.readline()
            return doctor

        listener = start("--listen")
        asker = start("--peer", "127.0.0.1", "--seconds", "60")
        asker.send_signal(signal.SIGINT)
        self.assertEqual((asker.communicate(timeout=60)[1], asker.returncode), ("", 130))
        listener.send_signal(signal.SIGINT)
        self.assertEqual((listener.communicate(timeout=60)[1], listener.returncode), ("", 0))

    def test_a_damaged_structure_file_is_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            tenon("parts", "peg_and_box", folder)
            baked = Path(folder) / "peg.tenon"
            tenon("bake", Path(folder) / "peg.stl", "-o", baked, "--voxel", "4mm", "--unit", "mm")
            data = bytearray(baked.read_bytes())
            data[len(data) // 2] ^= 0x10
            baked.write_bytes(data)
            info = tenon("bake", "--info", baked)
            self.assertNotEqual(info.returncode, 0)
            self.assertIn("peg.tenon", info.stderr)

    def test_probe_prints_distance_and_normal_or_far(self):
        with tempfile.TemporaryDirectory() as folder:
            baked = cube(folder)
            done = tenon("probe", baked, input="# beside, inside, away\n0.011 0 0\n0.0 0.001 0.0085\n\n0.5 0 0\n")
            self.assertEqual(done.returncode, 0, done.stderr)
            beside, inside, away = [line.split() for line in done.stdout.splitlines()]
            self.assertAlmostEqual(float(beside[0]), 0.001, places=5)
            self.assertAlmostEqual(float(beside[1]), 1.0, places=4)
            self.assertAlmostEqual(float(inside[0]), -0.0015, places=5)
            self.assertAlmostEqual(float(inside[3]), 1.0, places=4)
            self.assertEqual(away, ["far"])

    def test_contact_wrench_is_the_penalty_force_on_every_code_path(self):
        with tempfile.TemporaryDirectory() as folder:
            baked, poses = cube(folder), Path(folder) / "poses"
            # a cube 0.5 mm deep in the side of another one, and a cube apart from it
            poses.write_text("0.0195 0 0 1 0 0 0\n0.1 0 0 1 0 0 0\n", encoding="utf-8")
            tables = {}
            for arguments in ((), ("--isa", "scalar"), ("--no-prune",)):
                table = Path(folder) / "table.csv"
                done = tenon("contact", baked, baked, "--poses", poses, "--csv", table, "--overwrite", "--stiffness", "500",
                             *arguments)
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertIn("2, 1 in contact", done.stdout)
                rows = [line.split(",") for line in table.read_text(encoding="utf-8").splitlines()]
                self.assertEqual(rows[0], "index,microseconds,contacts,penetration_m,fx,fy,fz,tx,ty,tz,load_percent".split(","))
                tables[arguments] = [row[:1] + row[2:10] for row in rows[1:]]
            touching, away = tables[()]
            self.assertAlmostEqual(float(touching[2]), 0.0005, places=5)
            # 500 N/m for each cm^2 of the 4 cm^2 that are inside, rim points stand for some of the sides
            self.assertAlmostEqual(float(touching[3]), 500 * 0.0005 * 4, delta=0.3)
            self.assertEqual([float(number) for number in away[1:]], [0.0] * 8)
            for arguments, table in tables.items():
                self.assertEqual(table, tables[()], arguments)

    def test_refined_contacts_agree_with_the_mesh_at_edges(self):
        with tempfile.TemporaryDirectory() as folder:
            baked, poses, table = cube(folder), Path(folder) / "poses", Path(folder) / "table.csv"
            # an edge 0.5 mm below two sides of the other cube
            poses.write_text("0.0195 0.0195 0.003 1 0 0 0\n", encoding="utf-8")
            depths = []
            for arguments in (("--interpolated",), (), ("--refine",), ("--refine", "--mesh", Path(folder) / "cube.off")):
                done = tenon("contact", baked, baked, "--poses", poses, "--csv", table, "--overwrite", *arguments)
                self.assertEqual(done.returncode, 0, done.stderr)
                depths.append(float(table.read_text(encoding="utf-8").splitlines()[1].split(",")[3]))
            self.assertLess(depths[0], 0.0004)
            self.assertAlmostEqual(depths[1], 0.0005, delta=0.00005)
            for depth in depths[2:]:
                self.assertAlmostEqual(depth, 0.0005, places=5)
            other = Path(folder) / "other.off"
            other.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", encoding="utf-8")
            done = tenon("contact", baked, baked, "--poses", poses, "--refine", "--mesh", other)
            self.assertEqual(done.returncode, 1)
            self.assertIn("is not the mesh of cube.off", done.stderr)
            (Path(folder) / "cube.off").unlink()
            done = tenon("contact", baked, baked, "--poses", poses, "--refine")
            self.assertEqual(done.returncode, 1)
            self.assertIn("cube.off", done.stderr)

    def test_a_mesh_is_read_again_in_the_unit_it_was_baked_in(self):
        with tempfile.TemporaryDirectory() as folder:
            baked, poses = cube(folder, half=1, unit="cm"), Path(folder) / "poses"
            self.assertIn("one unit of its files is 10 mm", tenon("bake", "--info", baked).stdout)
            poses.write_text("0.0195 0.0195 0.003 1 0 0 0\n", encoding="utf-8")
            done = tenon("contact", baked, baked, "--poses", poses, "--refine")
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertRegex(done.stdout, r"penetration +at most 0\.5 mm")
            with tempfile.TemporaryDirectory() as elsewhere:
                cube(elsewhere)
                done = tenon("contact", baked, baked, "--poses", poses, "--mesh", Path(elsewhere) / "cube.off")
            self.assertEqual(done.returncode, 1)
            self.assertIn("is of another size", done.stderr)

    def test_bad_points_and_poses_are_refused_by_line(self):
        with tempfile.TemporaryDirectory() as folder:
            baked, poses = cube(folder), Path(folder) / "poses"
            for text, complaint in (("0 0 0\n0 nan 0\n", "points:2: 'nan' is not finite"),
                                    ("\n0 0\n", "points:2: 2 numbers where 3 are expected"),
                                    ("0 0 zero\n", "points:1: 'zero' is not a number")):
                done = tenon("probe", baked, input=text)
                self.assertEqual(done.returncode, 1)
                self.assertIn(complaint, done.stderr)
            for text, complaint in (("0 0 0 1 0 0 0\n0 0 inf 1 0 0 0\n", "poses:2: 'inf' is not finite"),
                                    ("0 0 0 0 0 0 0\n", "poses:1: qw qx qy qz is not a unit quaternion"),
                                    ("# nothing\n", "has no poses")):
                poses.write_text(text, encoding="utf-8")
                done = tenon("contact", baked, baked, "--poses", poses)
                self.assertEqual(done.returncode, 1)
                self.assertIn(complaint, done.stderr)
            poses.write_text("0 0 0 1 0 0 0\n", encoding="utf-8")
            abacus = tenon("contact", baked, baked, "--poses", poses, "--isa", "abacus")
            self.assertEqual(abacus.returncode, 2)
            self.assertIn("--isa abacus: this processor has scalar", abacus.stderr)
            self.assertEqual(tenon("contact", baked, "missing.tenon", "--poses", poses).returncode, 1)

    def test_voxels_of_a_path_are_measured_written_and_baked_again(self):
        with tempfile.TemporaryDirectory() as folder:
            baked, poses, tree, scan = cube(folder), Path(folder) / "poses", Path(folder) / "way.bt", Path(folder) / "way.tenon"
            poses.write_text("0 0 0.0178 1 0 0 0\n0.1 0 0.0178 1 0 0 0\n", encoding="utf-8")
            done = tenon("voxels", baked, "--poses", poses, "--cell", "1mm", "--scene", baked, "-o", tree)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertEqual(done.stderr, "")
            volume = float(re.search(r"volume +(\S+) m\^3", done.stdout)[1])
            self.assertAlmostEqual(volume, 0.12 * 0.02 * 0.02, delta=0.03 * 0.12 * 0.02 * 0.02)
            # at its first pose it is 2.2 mm deep in the cube of the scene
            self.assertAlmostEqual(float(re.search(r"clearance +(\S+) m", done.stdout)[1]), -0.0022, places=4)
            again = tenon("bake", tree, "-o", scan, "--voxel", "1mm", "--points", "2000")
            self.assertEqual(again.returncode, 0, again.stderr)
            self.assertIn("120 mm x 20 mm x 20 mm", again.stdout)

    def test_voxels_with_wrong_arguments_are_refused(self):
        with tempfile.TemporaryDirectory() as folder:
            baked = cube(folder)
            for code, arguments, complaint in ((2, ("-o", Path(folder) / "cube.stl"), "must end in .bt or .ot"),
                                               (2, ("--cell", "0mm"), "--cell 0mm: must be greater than 0"),
                                               (2, ("--grow", "-1mm"), "--grow -1mm: must be 0 or more"),
                                               (1, ("--cell", "0.1um"), "choose larger ones"),
                                               (1, ("--cell", "50mm"), "no cell's middle is inside"),
                                               (1, ("--poses", "missing"), "missing: cannot be read"),
                                               (1, ("--scene", "missing"), "missing")):
                done = tenon("voxels", baked, *arguments)
                self.assertEqual(done.returncode, code, arguments)
                self.assertIn(complaint, done.stderr)
                self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)

    def test_an_observer_prints_json(self):
        with Stage(lockstep=False) as stage:
            stage.serve("peg_and_box", "--wait-for", "right,observer")
            stage.lockstep = False
            observer = stage.start("observer", "--json")
            stage.start("trainee", "--seed", 1)
            line = observer.wait_for("take_peg", 60)
            self.assertIsInstance(json.loads(line), dict)

    def test_the_demo_leaves_report_recording_and_journal(self):
        with tempfile.TemporaryDirectory() as folder:
            report = Path(folder) / "report.html"
            report.write_text("of an earlier demo", encoding="utf-8")
            done = tenon("demo", *COARSE, "--scenario", "peg_and_box", "--no-instructor", "--lockstep", "--headless", "--domain", free_domain(),
                         "--out", folder, "--overwrite", timeout=800)
            self.assertEqual(done.returncode, 0, done.stdout[-3000:] + done.stderr[-1000:])
            self.assertTrue(re.fullmatch(r"final state hash: [0-9a-f]{16}", done.stdout.strip().splitlines()[-1]))
            for file in ("report.html", "session.mcap", "journal.mcap", *(["scene.png"] if shutil.which("chromium") else [])):
                self.assertTrue((Path(folder) / file).exists(), file)
            self.assertIn("<html", report.read_text(encoding="utf-8"))


class Overwriting(unittest.TestCase):
    """A file that exists is replaced with `--overwrite` only, an input never."""

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.baked = cube(self.folder)
        (self.folder / "poses").write_text("0.0195 0 0 1 0 0 0\n", encoding="utf-8")

    def file(self, name):
        file = self.folder / name
        file.write_text("mine", encoding="utf-8")
        return file

    def assert_refused(self, code, file, why, *words):
        before = file.read_bytes()
        done = tenon(*words)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        self.assertEqual(len(done.stderr.splitlines()), 1, done.stderr)
        self.assertIn(f"{file}: {why}", done.stderr)
        self.assertEqual(file.read_bytes(), before)

    def test_what_exists_is_kept_and_replaced_with_overwrite(self):
        mesh, poses = self.folder / "cube.off", self.folder / "poses"
        for name, words in (("a.tenon", ["bake", mesh, "--voxel", "2mm", "--points", 100, "--quiet", "-o"]),
                            ("shell.csv", ["bake", "--info", self.baked, "--shell"]),
                            ("a.bt", ["voxels", self.baked, "-o"]),
                            ("a.csv", ["contact", self.baked, self.baked, "--poses", poses, "--csv"])):
            with self.subTest(command=" ".join(map(str, words))):
                file = self.file(name)
                self.assert_refused(1, file, "exists; --overwrite replaces it", *words, file)
                done = tenon(*words, file, "--overwrite")
                self.assertEqual(done.returncode, 0, done.stderr)
                self.assertNotEqual(file.read_bytes(), b"mine")

    def test_one_file_of_a_folder_that_exists_is_enough(self):
        self.file("peg.stl")
        self.assert_refused(1, self.folder / "peg.stl", "exists; --overwrite", "parts", "peg_and_box", self.folder)
        self.assertFalse((self.folder / "box_with_hole.stl").exists())
        self.assertEqual(tenon("parts", "peg_and_box", self.folder, "--overwrite").returncode, 0)
        self.assertTrue((self.folder / "box_with_hole.stl").exists())
        for words in (["report", "session.mcap", "-o", self.folder], ["demo", "--headless", "--out", self.folder]):
            self.assert_refused(1, self.file("summary.json"), "exists; --overwrite", *words)

    def test_a_session_does_not_begin(self):
        journal, scenario = self.file("journal.mcap"), SOURCE / "scenarios" / "peg_and_box"
        self.assert_refused(1, journal, "exists; --overwrite", "serve", scenario, "--journal", journal)
        self.assert_refused(1, journal, "exists; --overwrite", "record", "-o", journal, "--domain", free_domain())
        self.assert_refused(1, self.folder / "cube.off", "is not the file of a seat", "join", "--role", "trainee", "--seat",
                            self.folder / "cube.off")

    def test_an_input_is_never_an_output(self):
        mesh, poses = self.folder / "cube.off", self.folder / "poses"
        link = self.folder / "link.tenon"
        link.symlink_to(mesh)
        scenario = self.folder / "scenario.yaml"
        scenario.write_text((SOURCE / "scenarios" / "peg_and_box" / "scenario.yaml").read_text(encoding="utf-8"), encoding="utf-8")
        for file, words in ((mesh, ["bake", mesh, "-o", mesh]), (link, ["bake", mesh, "-o", link]),
                            (self.baked, ["bake", "--info", self.baked, "--shell", self.baked]),
                            (poses, ["contact", self.baked, self.baked, "--poses", poses, "--csv", poses]),
                            (scenario, ["serve", self.folder, "--journal", scenario])):
            with self.subTest(command=" ".join(map(str, words))):
                self.assert_refused(2, file, "is an input of this command", *words, "--overwrite")

    def test_a_pipe_is_written_and_stays_a_pipe(self):
        pipe, copy = self.folder / "pipe", self.folder / "copy.tenon"
        os.mkfifo(pipe)
        with copy.open("wb") as out:
            reader = subprocess.Popen(["cat", pipe], stdout=out)
        self.addCleanup(reader.kill)
        done = tenon("bake", self.folder / "cube.off", "-o", pipe, "--voxel", "2mm", "--points", 100, "--quiet")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(reader.wait(60), 0)
        self.assertTrue(pipe.is_fifo())
        self.assertEqual(tenon("bake", "--info", copy).returncode, 0)


class BenchNightly(unittest.TestCase):
    """The benchmark is built only when asked for: here in a folder of its own."""

    def test_it_prints_tables_and_writes_json(self):
        with tempfile.TemporaryDirectory() as folder:
            build, written = Path(folder) / "build", Path(folder) / "bench.json"
            for words in ([SOURCE / "deploy" / "setup", "run", "build", "bench"],
                          ["cmake", "-S", SOURCE, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DBUILD_TESTING=OFF",
                           "-DTENON_BUILD_BENCH=ON"],
                          ["cmake", "--build", build, "--target", "tenon-bench"]):
                done = subprocess.run(words, capture_output=True, text=True, timeout=3600)
                self.assertEqual(done.returncode, 0, done.stdout[-3000:] + done.stderr[-3000:])
            programs = {"TENON_PROGRAMS": str(build / "bin")}
            done = tenon("bench", "engine", "--only", "many_bodies", "--json", written, timeout=600, env=programs)
            self.assertEqual(done.returncode, 0, done.stderr)
            self.assertIn("median us", done.stdout)
            tables = json.loads(written.read_text(encoding="utf-8"))["tables"]
            self.assertEqual([table["name"] for table in tables], ["many_bodies"])
            self.assertGreater(len(tables[0]["rows"]), 0)
            for row in tables[0]["rows"]:
                self.assertGreaterEqual(row["p99 us"], row["median us"])
            refused = tenon("bench", "flight", env=programs)
            self.assertNotEqual(refused.returncode, 0)
            self.assertIn("engine", refused.stderr)


if __name__ == "__main__":
    unittest.main()
