"""The report: one HTML file with the session inside, which opens from a folder in a browser without a network."""
import json
import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

from console_test import Browser, TOOLS
from stage import PROGRAMS, Stage, tenon

MOST_BYTES = 8_000_000
HAS_PAGE = (PROGRAMS.parent / "report_page" / "report.html").exists()
# titles, legends and plots of all figures, pairwise
OVERLAPS = """[...document.querySelectorAll('figure')].flatMap((figure) => {
  const boxes = [...figure.querySelectorAll('h3, .curve, .plot-host')].map((element) => element.getBoundingClientRect());
  return boxes.flatMap((a, i) => boxes.slice(i + 1).filter((b) => a.left < b.right - 1 && b.left < a.right - 1 && a.top < b.bottom - 1 && b.top < a.bottom - 1));
}).length"""


@unittest.skipUnless(HAS_PAGE, "the report's page is not built: deploy/setup console")
class Report(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        """A recorded session of one process after the other, and its report."""
        cls.folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(cls.folder.cleanup)
        cls.out = Path(cls.folder.name)
        with Stage() as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right,recorder")
            recorder = stage.start("record", "-o", cls.out / "session.mcap")
            stage.start("trainee", "--seed", 1)
            assert server.wait() == 0 and recorder.wait(30) == 0, server.text() + recorder.text()
        done = tenon("report", cls.out / "session.mcap", "-o", cls.out)
        assert done.returncode == 0, done.stdout + done.stderr
        cls.summary = json.loads((cls.out / "summary.json").read_text(encoding="utf-8"))

    def test_it_is_one_small_file_that_asks_for_nothing(self):
        page = (self.out / "report.html").read_text(encoding="utf-8")
        self.assertLess(len(page.encode()), MOST_BYTES)
        self.assertIn("default-src 'none'", page)
        self.assertEqual(sorted(file.name for file in self.out.iterdir()), ["report.html", "session.mcap", "summary.json"])

    def test_without_its_page_it_says_how_that_is_built_and_the_summary_is_there(self):
        with tempfile.TemporaryDirectory() as folder:
            alone = Path(folder) / "bin" / "tenon-report"
            alone.parent.mkdir()
            shutil.copy(PROGRAMS / "tenon-report", alone)
            done = subprocess.run([alone, self.out / "session.mcap", "-o", folder], capture_output=True, text=True, timeout=300, check=False)
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertRegex(done.stderr, r"report_page/report\.html: the report's page is not built.*`deploy/setup console`")
            self.assertFalse((Path(folder) / "report.html").exists())
            self.assertEqual(json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8")), self.summary)
            table = subprocess.run([alone, self.out / "session.mcap", "--json"], capture_output=True, text=True, timeout=300, check=False)
            self.assertEqual((table.returncode, json.loads(table.stdout)), (0, self.summary))

    @unittest.skipUnless(shutil.which("chromium") and (TOOLS / "node_modules").exists(), "no chromium or no playwright-core: deploy/setup test, and npm ci in tests/system/public_tools")
    def test_it_opens_from_its_folder_and_each_row_leads_to_its_moment(self):
        pictures = os.environ.get("TENON_PICTURES")
        address = (self.out / "report.html").as_uri()
        step = self.summary["steps"][-1]
        for theme, width in (("light", 1280), ("dark", 420)):
            with self.subTest(theme=theme, width=width), Browser() as browser:
                browser("open", url=address, width=width, height=800, theme=theme)
                browser("await", expression="globalThis.tenon?.isReady && tenon.view.models >= 3 && tenon.session.states.size >= 3")
                self.assertEqual(browser("value", expression="document.documentElement.dataset.theme"), theme)
                self.assertEqual(browser("value", expression=OVERLAPS), 0)
                self.assertEqual(browser("value", expression="document.querySelectorAll('figure canvas').length"), 4)
                # from a row to its moment, and from there to the cursor of the plots
                browser("value", expression=f"document.querySelector('.steps-table tr[data-time=\"{step['begin']:g}\"]').click()")
                browser("await", expression=f"Math.abs(tenon.session.tick / 1000 - {step['begin']}) < 0.1")
                browser("await", expression="!document.querySelector('.plot-host .now').hidden")
                # the player's clock is that of the tables
                browser("await", expression=f"Math.abs(tenon.player.sessionTime - {step['begin']}) < 0.1")
                # of the tables for engineers, too, and of the sums, which are of the whole session
                self.assertEqual(browser("value", expression="document.querySelectorAll('tbody tr:not([data-time])').length"), 0)
                first = self.summary["steps"][0]["begin"]
                browser("value", expression="document.querySelector('table:not(.steps-table, .events-table) tbody tr:first-child .jump').click()")
                browser("await", expression=f"Math.abs(tenon.session.tick / 1000 - {first}) < 0.1")
                browser("value", expression=f"document.querySelector('.steps-table tr[data-time=\"{step['begin']:g}\"]').click()")
                browser("await", expression=f"Math.abs(tenon.session.tick / 1000 - {step['begin']}) < 0.1")
                # all of the poses that one sees are there
                self.assertGreater(browser("value", expression="tenon.report.player.rate"), 29)
                before = browser("value", expression="tenon.session.moved")
                browser("value", expression="tenon.player.toggle()")
                # the step's state was recorded when it came, which may be after the frame of its first tick
                browser("await", expression=f"tenon.session.moved > {before} + 20 && tenon.session.step?.name === '{step['name']}'")
                browser("value", expression="tenon.player.isPlaying && tenon.player.toggle()")
                browser("value", expression="(s => { s.value = 'de'; s.dispatchEvent(new Event('change')); })(document.querySelector('select'))")
                browser("await", expression="document.querySelector('.plots-section h2').textContent === 'Im Verlauf'")
                self.assertEqual(browser("value", expression=OVERLAPS), 0, "in German")
                told = browser("value", expression="[...document.querySelectorAll('tr[data-time] td:last-child')].map(cell => cell.textContent)")
                for text in ("Trainee ist da", "Zapfen einstecken", "Zapfen", "alles ist eingebaut"):
                    self.assertIn(text, told, "in German")
                if pictures:
                    browser("picture", file=f"{pictures}/report_{theme}_{width}.png")
                self.assertEqual(browser.problems, [])


if __name__ == "__main__":
    unittest.main()
