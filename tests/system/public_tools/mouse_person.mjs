// A person at the console's page with a mouse: takes part and mounts a part. It knows what the page shows: where the line of the way begins and
// ends on the screen, the numbers beside the hand, and which step it is. It sees with a delay, and its aim is off.
const REACTION = 250; // [ms] from what it sees to what it does
const REST = 100; // [ms] between two looks at a hand that is moving: it aims again where it has come to
const LONGEST_WAY = 1500; // [ms] it watches one motion
const STILL = 2; // [pixels] between two looks
const AIM = 0.008; // [m] of aiming at the hand, root mean square; a tenth of it when the hand moves finely
const PUSH = 0.05; // [m] from which on it pushes straight where it does not get nearer otherwise
const NEAR = 0.03; // [m] it changes to fine motion
const DEPTH_HELP = 0.004; // [m] of depth that it leaves to the help with it
const ABOVE = 0.03; // [m] beside the line of sight to where it is to go; farther off it drags first: over what stands before it
const LIFT = 0.006; // [m] off the rim of a hole
const HIGHEST_LIFT = 0.05; // [m] over what stands in the way
const HALF_SWEEP = 220; // [pixels] of the mouse in one drag, to either side

const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

/** Uniform in 0 to 1 (mulberry32). */
function generator(seed) {
  let state = (seed * 2654435761) >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let x = Math.imul(state ^ (state >>> 15), state | 1);
    x ^= x + Math.imul(x ^ (x >>> 7), x | 61);
    return ((x ^ (x >>> 14)) >>> 0) / 4294967296;
  };
}

function see() {
  const { part, session, view } = window.tenon;
  const { hand } = part;
  const box = view.canvas.getBoundingClientRect();
  const guide = hand?.guide;
  // the arrow in the scene and the line of the way point straight down
  const isDown = ({ from, to }) => session.step.has_target && session.step.approach_W[2] < -0.9 && Math.hypot(from.x - to.x, from.y - to.y) < Math.max(0.1 * (from.z - to.z), from.z - to.z > 0.01 ? 0.006 : 0);
  return {
    step: session.step?.name ?? "", isOver: session.isOver, isOn: hand?.isOn === true, isFine: hand?.isFine === true, isAligning: hand?.isAligning === true, isDeepening: hand?.isDeepening === true,
    text: document.querySelector(".hand-state")?.textContent ?? "",
    height: box.height,
    middle: { x: box.left + 0.55 * box.width, y: box.top + 0.5 * box.height },
    guide: guide && { from: view.project(guide.from), to: view.project(guide.to), distance: guide.distance, farther: guide.farther, angle: guide.angle ?? 0, isDown: isDown(guide), above: view.project(guide.to.clone().setZ(guide.from.z)), pixel: view.metresPerPixel(guide.from) },
  };
}

export async function sitDown(page) {
  await page.locator(".take").click();
  await page.locator("dialog[open] .primary").click();
  await page.locator(".arm").waitFor({ timeout: 60000 });
  await page.locator(".lesson").waitFor({ timeout: 5000 }).catch(() => {}); // the first time
  const understood = page.locator(".lesson .primary");
  if (await understood.isVisible()) await understood.click();
  await page.locator(".arm").click();
}

/** What it sees once the hand has come to where the mouse brought it: a slow machine shows it later. */
async function seeAtRest(page) {
  let seen = await page.evaluate(see);
  for (const begun = Date.now(); Date.now() - begun < LONGEST_WAY; ) {
    await sleep(REST);
    const before = seen;
    seen = await page.evaluate(see);
    const [a, b] = [before.guide?.from, seen.guide?.from];
    if (a === undefined || b === undefined || seen.isDeepening || seen.isAligning || Math.hypot(a.x - b.x, a.y - b.y) < STILL) break;
  }
  return seen;
}

/** Mounts until the step is another one than `steps`; the time that it took [s], or what stood in the way. */
export async function mount(page, { seed, seconds, steps }) {
  const random = generator(seed);
  const gauss = () => Math.sqrt(-2 * Math.log(1 - random())) * Math.cos(2 * Math.PI * random());
  const begun = Date.now();
  const log = [];
  let best = Infinity;
  let stuck = 0;
  let turns = 0;
  let unhelped = 0; // times in a row that the help with the depth was asked for
  let last = "";

  const fine = async (seen, wanted) => {
    if (seen.isFine !== wanted) await page.keyboard.press("f");
  };
  // a drag by pixels of the mouse, as often as the hand has to reach around for it
  const drag = async (seen, dx, dy, key) => {
    const parts = Math.max(1, Math.ceil(Math.max(Math.abs(dx), Math.abs(dy)) / (2 * HALF_SWEEP)));
    for (let i = 0; i < parts; ++i) {
      const [x, y] = [dx / parts, dy / parts];
      await page.mouse.move(seen.middle.x - x / 2, seen.middle.y - y / 2);
      if (key !== undefined) await page.keyboard.down(key);
      await page.mouse.down();
      await page.mouse.move(seen.middle.x + x / 2, seen.middle.y + y / 2, { steps: 3 });
      await page.mouse.up();
      if (key !== undefined) await page.keyboard.up(key);
    }
  };

  while (Date.now() - begun < 1000 * seconds) {
    const seen = await seeAtRest(page);
    if (seen.isOver || (seen.step !== "" && !steps.includes(seen.step))) return { seconds: (Date.now() - begun) / 1000, log };
    await sleep(REACTION);
    if (seen.step !== last) [last, best, stuck] = [seen.step, Infinity, 0];
    const { guide } = seen;
    // a hand that the station has switched off is switched on again, as the page asks for
    if (!seen.isOn && (await page.locator(".arm").isVisible())) await page.keyboard.press("Enter");
    if (!seen.isOn || guide === undefined) continue;
    log.push(`${((Date.now() - begun) / 1000).toFixed(1)} ${seen.step} ${(1000 * guide.distance).toFixed(1)} mm, ${(1000 * guide.farther).toFixed(1)} farther, ${guide.angle.toFixed(3)} rad: ${seen.text}`);
    if (seen.isAligning || guide.angle > 0.02) {
      // a part that jams cannot be turned: it pushes no more, and lifts it, each time higher
      if (++turns % 8 === 0) {
        await page.keyboard.press("Escape");
        await drag(seen, 0, ((seen.isFine ? 10 : 1) * -Math.min(HIGHEST_LIFT, (0.01 * turns) / 8)) / guide.pixel, "Control");
      } else if (!seen.isAligning) await page.keyboard.press("g");
      continue;
    }
    turns = 0;
    // the help with the depth, until it has done its work
    if (seen.isDeepening) continue;
    const pixels = Math.hypot(guide.to.x - guide.from.x, guide.to.y - guide.from.y);
    if (!guide.isDown && Math.abs(guide.farther) > DEPTH_HELP && (pixels * guide.pixel < ABOVE || stuck > 3)) {
      // help that did not help: it pushes no more, and lifts the part over what stands in the way, each time higher
      if (++unhelped % 3 === 0) {
        await page.keyboard.press("Escape");
        await drag(seen, 0, ((seen.isFine ? 10 : 1) * -Math.min(HIGHEST_LIFT, (0.01 * unhelped) / 3)) / guide.pixel, "Control");
      } else await page.keyboard.press("d");
      continue;
    }
    unhelped = 0;
    // a closer look where the way is small in the picture
    if (guide.pixel * seen.height > 5 * (guide.distance + 0.15)) {
      await page.keyboard.press("c");
      continue;
    }
    // pixels of the mouse for those of the hand, which is `scale` times slower
    const aimAt = (scale) => (pixels) => scale * pixels + (AIM / Math.SQRT2 / guide.pixel) * gauss();
    if (guide.distance < 0.9 * best) [best, stuck] = [guide.distance, 0];
    else ++stuck;
    if (guide.isDown && stuck > 3 && stuck % 4 === 0) {
      // it stands on the rim: it lifts it a little, and brings it over the hole
      await page.keyboard.press("Escape");
      await fine(seen, true);
      const aim = aimAt(10);
      await drag(seen, 0, (10 * -LIFT) / guide.pixel, "Control");
      await drag(seen, aim(guide.above.x - guide.from.x), aim(guide.above.y - guide.from.y));
      continue;
    }
    const isNear = guide.distance < NEAR;
    await fine(seen, isNear);
    const scale = isNear ? 10 : 1; // of the mouse to the hand
    const aim = aimAt(scale);
    const [dx, dy] = [guide.to.x - guide.from.x, guide.to.y - guide.from.y];
    // a straight push when it does not get nearer otherwise, as the instruction says; then it lifts a little
    if (guide.distance < PUSH && stuck > 3 && stuck % 6 === 5) await drag(seen, 0, aim(-0.004 / guide.pixel), "Control");
    else if (guide.distance < PUSH && stuck > 3 && stuck % 2 === 0) await drag(seen, 0, aim((guide.distance + 0.005) / guide.pixel), "Control");
    else if (guide.isDown) await drag(seen, 0, aim(dy), "Control");
    else await drag(seen, aim(dx), aim(dy));
    if (guide.isDown || Math.abs(guide.farther) > ABOVE) continue; // left to the straight push, and to the help
    const notches = Math.round((guide.farther + (AIM / Math.SQRT2 / scale) * gauss()) / ((16 / scale) * guide.pixel)); // of 16 pixels each
    for (let i = 0; i < Math.min(6, Math.abs(notches)); ++i) await page.mouse.wheel(0, -100 * Math.sign(notches));
  }
  return { log };
}
