// Drives the console's page in Chromium. Reads commands from standard input, a line of JSON each, and answers each with a line:
//   {"do": "open", "url": U, "width": W, "height": H, "theme": "dark" | "light", "touch": true, "language": "de-DE", "headset": true, "blocked": true}   with an emulated headset, `headset` in the page; with site data blocked
//   {"do": "await", "expression": JS}   until it is true in the page
//   {"do": "value", "expression": JS}
//   {"do": "type", "selector": CSS, "text": T}
//   {"do": "key", "key": K}   as Playwright names it
//   {"do": "key down", "key": K}, {"do": "key up", "key": K}
//   {"do": "click", "at": [X, Y]}
//   {"do": "press", "selector": CSS, "milliseconds": T}   the mouse is held down for so long
//   {"do": "sit down"}   takes part, as a person at the page would
//   {"do": "mount", "seed": S, "seconds": T, "steps": [..]}   with the mouse, until the step is none of these
//   {"do": "picture", "file": F}
//   {"do": "touch", "from": [X, Y], "to": [X, Y], "beside": [X, Y]}   one finger, of a page that was opened with "touch": true; a second one that lands beside it and rests there
//   {"do": "axe"}   faults of accessibility, WCAG 2.2 A and AA, that are serious or worse: [[rule, element], ..]
// Usage: node console_page.mjs PATH_OF_CHROMIUM
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { createInterface } from "node:readline";

import { chromium } from "playwright-core";

import { mount, sitDown } from "./mouse_person.mjs";

const axeSource = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const headsetSource = readFileSync(createRequire(import.meta.url).resolve("iwer/build/iwer.min.js"), "utf8");
const browser = await chromium.launch({ executablePath: process.argv[2], args: ["--no-sandbox", "--disable-dev-shm-usage"] });
const problems = [];
let page;

const commands = {
  async open({ url, width, height, theme, touch, language, headset, blocked }) {
    await page?.context().close();
    const context = await browser.newContext({ viewport: { width, height }, colorScheme: theme, locale: language ?? "en-GB", hasTouch: touch === true });
    page = await context.newPage();
    // Chromium has a WebXR of its own, without a device; its layers would draw where the emulated one has none
    if (headset) await page.addInitScript(`${headsetSource}; delete window.XRWebGLBinding; window.headset = new IWER.XRDevice(IWER.metaQuest3); headset.installRuntime({ forceInstall: true });`);
    if (blocked) await page.addInitScript(`for (const name of ["localStorage", "sessionStorage"]) Object.defineProperty(window, name, { get() { throw new DOMException("blocked", "SecurityError"); } });`);
    page.on("pageerror", (error) => problems.push(String(error)));
    page.on("console", (line) => line.type() === "error" && problems.push(line.text()));
    page.on("request", (request) => new URL(request.url()).origin !== new URL(url).origin && !request.url().startsWith("blob:") && problems.push(`asked elsewhere: ${request.url()}`));
    await page.goto(url, { timeout: 120000 });
  },
  // asked from here again and again: in the page its content security policy forbids to evaluate texts
  async await({ expression }) {
    const isTrue = () => page.evaluate(expression).catch((problem) => {
      if (!String(problem).includes("context was destroyed")) throw problem; // another page is loaded meanwhile
    });
    for (const end = Date.now() + 120000; !(await isTrue()); await new Promise((done) => setTimeout(done, 200))) {
      if (Date.now() > end) throw new Error("it did not become true in time");
    }
  },
  async value({ expression }) {
    return page.evaluate(expression);
  },
  async type({ selector, text }) {
    await page.locator(selector).first().pressSequentially(text);
  },
  async key({ key }) {
    await page.keyboard.press(key);
  },
  async "key down"({ key }) {
    await page.keyboard.down(key);
  },
  async "key up"({ key }) {
    await page.keyboard.up(key);
  },
  async click({ at }) {
    await page.mouse.click(at[0], at[1]);
  },
  async press({ selector, milliseconds }) {
    await page.locator(selector).first().scrollIntoViewIfNeeded();
    const { x, y, width, height } = await page.locator(selector).first().boundingBox();
    await page.mouse.move(x + width / 2, y + height / 2);
    await page.mouse.down();
    await new Promise((done) => setTimeout(done, milliseconds));
    await page.mouse.up();
  },
  async "sit down"() {
    await sitDown(page);
  },
  async mount(task) {
    return mount(page, task);
  },
  async touch({ from, to, beside }) {
    const touches = await page.context().newCDPSession(page);
    const send = (type, points) => touches.send("Input.dispatchTouchEvent", { type, touchPoints: points.map(([x, y]) => ({ x, y })) });
    const others = beside === undefined ? [] : [beside];
    await send("touchStart", [from]);
    if (beside !== undefined) await send("touchStart", [from, beside]);
    for (let i = 1; i <= 8; ++i) await send("touchMove", [[from[0] + ((to[0] - from[0]) * i) / 8, from[1] + ((to[1] - from[1]) * i) / 8], ...others]);
    await send("touchEnd", []);
    await touches.detach();
  },
  async axe() {
    await page.evaluate(axeSource);
    const { violations } = await page.evaluate(() => window.axe.run({ runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "wcag22aa"] }));
    return violations.filter(({ impact }) => impact === "serious" || impact === "critical").flatMap(({ id, nodes }) => nodes.map((node) => [id, node.html.slice(0, 160)]));
  },
  async picture({ file }) {
    await page.screenshot({ path: file, timeout: 120000 });
  },
};

for await (const line of createInterface({ input: process.stdin })) {
  const command = JSON.parse(line);
  try {
    console.log(JSON.stringify({ value: (await commands[command.do](command)) ?? null, problems: problems.splice(0) }));
  } catch (problem) {
    console.log(JSON.stringify({ problem: String(problem), problems: problems.splice(0) }));
  }
}
await browser.close();
