"""The force model scene copy through the programs: a station computes its contacts from the compiled scene, out of the cache it shares with the server or fetched from a console."""
import re
import unittest

from stage import Process, Stage

COPY = "forces from this station's copy of the scene"
MANIFOLD = "forces from the contacts that the server lists"


class SceneCopy(unittest.TestCase):
    def mount(self, stage, server, *options):
        """What a trainee with the copy says who mounts the part."""
        trainee = stage.start("trainee", "--seed", 1, "--force-model", "scene-copy", *options)
        self.assertEqual(server.wait(300), 0, server.text())
        self.assertEqual(trainee.wait(60), 0, trainee.text())
        self.assertIn("everything is mounted", server.text())
        self.assertIn(COPY, trainee.text())
        if stage.lockstep:  # else a busy machine may be too slow for it, for a while
            self.assertNotIn(MANIFOLD, trainee.text(), "it went back")
        return trainee.text()

    def test_a_part_is_mounted_by_a_station_on_the_servers_machine(self):
        with Stage(lockstep=False) as stage:
            self.mount(stage, stage.serve("peg_and_box", "--wait-for", "right"))

    def test_a_session_in_lockstep_is_mounted_and_repeats(self):
        states = []
        for _ in range(2):
            with Stage() as stage:
                server = stage.serve("peg_and_box", "--wait-for", "right")
                self.mount(stage, server)
                states.append(re.search(r"final state hash: (\w+)", server.text())[1])
        self.assertEqual(states[0], states[1])

    def test_a_station_without_the_scene_fetches_it_from_a_console(self):
        with Stage(lockstep=False) as stage:
            server = stage.serve("peg_and_box", "--wait-for", "right")
            console = Process("console", [stage.session, "--domain", stage.domain, "--port", 0], stage.out)
            stage.processes.append(console)
            port = re.search(r":(\d+)/$", console.wait_for(r"^console: http://\S+:\d+/$"))[1]
            console.wait_for("joined session")
            cache = stage.out / "cache"
            self.mount(stage, server, "--cache", cache, "--assets", f"http://localhost:{port}")
            self.assertTrue(list((cache / "assets").iterdir()), "kept for the next time")

    def test_what_cannot_be_fetched_is_said_and_the_station_does_not_start(self):
        with Stage(lockstep=False) as stage:
            stage.serve("peg_and_box", "--wait-for", "right")
            for options, reason in ((("--cache", stage.out / "none"), "--assets"),
                                    (("--cache", stage.out / "none", "--assets", "http://localhost:9"), "localhost:9"),
                                    (("--cache", stage.out / "none", "--assets", "ftp://somewhere"), "http://")):
                with self.subTest(options=options):
                    trainee = stage.start("trainee", "--seed", 1, "--force-model", "scene-copy", *options)
                    self.assertEqual(trainee.wait(60), 1, trainee.text())
                    self.assertIn("--force-model scene-copy", trainee.text())
                    self.assertIn(reason, trainee.text())


if __name__ == "__main__":
    unittest.main()
