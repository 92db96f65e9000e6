"""The console in a headset, an emulated one (iwer) in Chromium, over https: its controllers and hands move the hands of a session."""
import json
import shutil
import unittest

from console_test import Browser, SCENARIO, TOOLS, start_console, without_timeouts
from console_tls_test import certificates, trusting_home
from stage import Stage

# Controllers as somebody moves them: `go` by so many metres along x, y (up), z (towards the person) of the room in steps of 1 cm;
# `pictures`: waits for so many; `asked`: how far the hands were moved by them, in the world, and turned
MOVE = """window.asked = [];
for (const index of [0, 1]) asked.push({ way: [0, 0, 0], turn: 0 });
const { hand } = tenon.part;
hand.moveBy = (index, way, turn) => {
  way.toArray().forEach((x, i) => (asked[index].way[i] += x));
  asked[index].turn += 2 * Math.atan2(turn.z, turn.w);
  Object.getPrototypeOf(hand).moveBy.call(hand, index, way, turn);
};
window.pictures = async (count) => {
  for (let i = 0; i < count; ++i) await new Promise((done) => tenon.part.headset.session.requestAnimationFrame(done));
}
window.go = async (input, x, y, z) => {
  const steps = Math.ceil(Math.hypot(x, y, z) / 0.01);
  for (let i = 0; i < steps; ++i) {
    const { position } = input;
    position.set(position.x + x / steps, position.y + y / steps, position.z + z / steps);
    await new Promise((done) => setTimeout(done, 30));
  }
}"""
RIGHT = "[...tenon.session.hands.values()].find(h => tenon.session.sceneHands.get(h.hand_id).name === 'right')"
LEFT = RIGHT.replace("'right'", "'left'")


# A standalone headset, whose browser gives the window no frames while it presents; those of the emulated one are let through.
# `resume`: as after its session
STANDALONE = """(() => {
  const { session } = tenon.part.headset;
  const own = Object.getOwnPropertySymbols(session).map((symbol) => session[symbol]?.onDeviceFrame).find((callback) => callback !== undefined);
  const { requestAnimationFrame } = window;
  const waiting = [];
  window.requestAnimationFrame = (callback) => (callback === own ? requestAnimationFrame(callback) : waiting.push(callback));
  window.resume = () => {
    window.requestAnimationFrame = requestAnimationFrame;
    waiting.splice(0).forEach((callback) => requestAnimationFrame(callback));
  };
})()"""


def until(browser, act, is_so):
    """Does something again and again until it has come to this."""
    for _ in range(60):
        browser("value", expression=act)
        if browser("value", expression=is_so):
            return
    raise AssertionError(f"it did not come to {is_so}")


THERE = unittest.skipUnless(shutil.which("chromium") and shutil.which("certutil") and (TOOLS / "node_modules").exists(),
                            "no chromium, no certutil or no playwright-core: deploy/setup test, and npm ci in tests/system/public_tools")


class Worn:
    """What somebody does with a headset."""

    def begin(self, stage, browser, scenario, pair, wait):
        server = stage.serve(scenario, "--wait-for", wait)
        console, port = start_console(stage, 0, "--tls", pair)
        console.wait_for("joined session 'test'")
        # small: each eye is drawn by the processor
        browser("open", url=f"https://localhost:{port}/", width=320, height=240, theme="light", headset=True)
        browser("await", expression="tenon.view.models >= 3 && !document.querySelector('.take').hidden")
        browser("sit down")
        browser("await", expression="tenon.part.hand.isOn && tenon.part.hand.now.isActive")
        browser("value", expression=MOVE)
        browser("value", expression="headset.controllers.right.position.set(0.2, 1.2, -0.3), headset.controllers.left.position.set(-0.2, 1.2, -0.3)")
        browser("value", expression="document.querySelector('.handbar button[aria-label=Headset]').click()")
        browser("await", expression="tenon.part.headset !== undefined && tenon.part.hand.isWatched()")
        return server


@THERE
class Headset(unittest.TestCase, Worn):
    def test_a_controller_moves_turns_and_feels_and_stops(self):
        with Stage(lockstep=False) as stage:
            authority, pair = certificates(stage.out)
            with Browser(HOME=trusting_home(stage.out, authority)) as browser:
                server = self.begin(stage, browser, without_timeouts(SCENARIO, stage.out), pair, "right")
                # a controller that is not closed moves nothing
                browser("value", expression="go(headset.controllers.right, 0, 0.1, 0)")
                self.assertEqual(browser("value", expression="asked[0].way"), [0, 0, 0])
                # up in the room is up in the scene, as far; ahead is away from the trainee's side; a turn about the vertical is one
                browser("value", expression=f"headset.controllers.right.updateButtonValue('squeeze', 1), window.first = {RIGHT}.X_WH.p")
                browser("await", expression="tenon.part.headset.grasps.size === 1 && [...tenon.part.headset.grasps.values()][0].last !== undefined")
                # (what moves during a picture that takes this machine more than half a second counts as nobody's motion, so: again)
                until(browser, """(async () => {
                  await go(headset.controllers.right, 0, -0.06, 0.04), await pictures(2), asked[0].way = [0, 0, 0];
                  await go(headset.controllers.right, 0, 0.06, -0.04), await pictures(2);
                })()""", "(w => Math.hypot(w[0], w[1] - 0.04, w[2] - 0.06) < 1e-6)(asked[0].way)")
                until(browser, """(async () => {
                  headset.controllers.right.quaternion.set(0, 0, 0, 1), await pictures(2), asked[0].turn = 0;
                  headset.controllers.right.quaternion.set(0, Math.sin(0.2), 0, Math.cos(0.2)), await pictures(2);
                })()""", "Math.abs(asked[0].turn - 0.4) < 1e-3")
                # the session's hand follows
                until(browser, "go(headset.controllers.right, 0, 0.04, 0)", f"{RIGHT}.X_WH.p[2] > first[2] + 0.02")
                browser("value", expression="headset.controllers.right.updateButtonValue('squeeze', 0)")
                browser("await", expression="tenon.part.headset.grasps.size === 0")

                # it touches what the step names, and is felt in the controller
                browser("value", expression="""(() => {
                  window.felt = [];
                  const actuator = [...tenon.part.headset.session.inputSources].find((source) => source.handedness === 'right').gamepad.hapticActuators[0];
                  Object.getPrototypeOf(actuator).pulse = (strength, time) => Promise.resolve(felt.push([strength, time]));
                })()""")
                browser("value", expression="headset.controllers.right.updateButtonValue('trigger', 1)")
                browser("await", expression="tenon.part.headset.grasps.size === 1")
                # of the room: x, z of the world, -y of the world
                until(browser, "(({from, to} = {}) => from && to && go(headset.controllers.right, to.x - from.x, to.z - from.z, from.y - to.y))(tenon.part.hand.guide)",
                      "felt.some(([strength, time]) => strength > 0 && time > 0) && tenon.session.step.name === 'insert_peg'")
                browser("value", expression="headset.controllers.right.updateButtonValue('trigger', 0)")

                # the person's own hand
                browser("value", expression="headset.primaryInputMode = 'hand', headset.hands.right.position.set(0.2, 1.2, -0.3)")
                browser("await", expression="[...tenon.part.headset.session.inputSources].some((source) => source.hand)")
                browser("value", expression="headset.hands.right.updatePinchValue(1)")
                browser("await", expression="tenon.part.headset.grasps.size === 1")
                browser("value", expression=f"window.first = {RIGHT}.X_WH.p")
                until(browser, "go(headset.hands.right, 0, 0.04, 0)", f"{RIGHT}.X_WH.p[2] > first[2] + 0.02")
                browser("value", expression="headset.hands.right.updatePinchValue(0)")

                # the dead man's switch: nobody looks
                browser("value", expression="headset.updateVisibilityState('hidden')")
                browser("await", expression="!tenon.part.hand.isWatched()")
                browser("value", expression="headset.updateVisibilityState('visible'), headset.primaryInputMode = 'controller'")
                browser("await", expression="tenon.part.hand.isWatched() && [...tenon.part.headset.session.inputSources].some((source) => source.gamepad && !source.hand)")
                browser("value", expression="headset.controllers.right.updateButtonValue('b-button', 1)")
                server.wait_for("pressed in the browser")
                browser("await", expression="!tenon.part.hand.isOn && tenon.session.standing.length > 0")
                browser("value", expression="tenon.part.headset.end()")
                browser("await", expression="tenon.part.headset === undefined && tenon.part.hand.isWatched === undefined")
                self.assertEqual(browser.problems, [])


    def test_the_scene_goes_on_in_a_headset_whose_browser_gives_the_window_no_frames(self):
        with Stage(lockstep=False) as stage:
            authority, pair = certificates(stage.out)
            with Browser(HOME=trusting_home(stage.out, authority)) as browser:
                self.begin(stage, browser, without_timeouts(SCENARIO, stage.out), pair, "right")
                browser("value", expression="""(() => {
                  window.updates = 0;
                  const { update } = tenon.view;
                  tenon.view.update = (...values) => (++updates, update.apply(tenon.view, values));
                })()""")
                # once for each picture, not for each frame of the window as well
                until(browser, """(async () => {
                  await pictures(1);
                  const before = [updates, tenon.view.pictures];
                  await pictures(10);
                  window.counted = [updates - before[0], tenon.view.pictures - before[1]];
                })()""", "counted[1] >= 9 && counted[0] === counted[1]")
                browser("value", expression=STANDALONE)
                browser("value", expression="headset.controllers.right.updateButtonValue('squeeze', 1)")
                browser("await", expression="tenon.part.headset.grasps.size === 1")
                drawn = "tenon.view.positionOf(tenon.session.objects.get(tenon.part.hand.now.objectId).name)[2]"
                browser("value", expression=f"window.first = {drawn}")
                until(browser, "go(headset.controllers.right, 0, 0.04, 0)", f"{drawn} > first + 0.03")
                browser("value", expression="headset.controllers.right.updateButtonValue('squeeze', 0)")
                # after it the window's frames are the page's again
                browser("value", expression="tenon.part.headset.end(), resume()")
                browser("await", expression="tenon.part.headset === undefined")
                browser("value", expression="window.updates = 0")
                browser("await", expression="updates > 5")
                self.assertEqual(browser.problems, [])


@THERE
class HeadsetNightly(unittest.TestCase, Worn):
    def test_both_controllers_move_both_hands_and_the_card_has_a_stop(self):
        with Stage(lockstep=False) as stage:
            authority, pair = certificates(stage.out)
            with Browser(HOME=trusting_home(stage.out, authority)) as browser:
                server = self.begin(stage, browser, without_timeouts("engine_bay", stage.out), pair, "right,left")
                for side in ("right", "left"):
                    browser("value", expression=f"headset.controllers.{side}.updateButtonValue('squeeze', 1)")
                browser("await", expression="tenon.part.headset.grasps.size === 2")
                browser("value", expression=f"window.first = [{RIGHT}.X_WH.p, {LEFT}.X_WH.p]")
                until(browser, "Promise.all([go(headset.controllers.right, 0, 0.03, 0), go(headset.controllers.left, 0, 0, 0.03)])",
                      f"{RIGHT}.X_WH.p[2] > first[0][2] + 0.02 && {LEFT}.X_WH.p[1] < first[1][1] - 0.02")
                for side in ("right", "left"):
                    browser("value", expression=f"headset.controllers.{side}.updateButtonValue('squeeze', 0)")
                browser("await", expression="tenon.part.headset.grasps.size === 0")
                # the instruction is written, and its stop is pressed from where one points
                written = json.loads(browser("value", expression="tenon.part.headset.card.written"))
                self.assertTrue(written["title"], written)
                browser("value", expression="""(() => {
                  const { card } = tenon.part.headset;
                  const stop = card.stop.position.clone().applyQuaternion(card.group.quaternion).add(card.group.position);
                  headset.controllers.right.position.set(stop.x, stop.y, stop.z + 0.3);
                  headset.controllers.right.quaternion.set(0, 0, 0, 1);
                })()""")
                browser("value", expression="new Promise((done) => setTimeout(() => done(headset.controllers.right.updateButtonValue('trigger', 1)), 500))")
                server.wait_for("pressed in the browser")
                self.assertEqual(browser.problems, [])


if __name__ == "__main__":
    unittest.main()
