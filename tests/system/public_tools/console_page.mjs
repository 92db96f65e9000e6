// Drives the console's page in Chromium. Reads commands from standard input, a line of JSON each, and answers each with a line:
//   {"do": "open", "url": U, "width": W, "height": H, "theme": "dark" | "light"}
//   {"do": "await", "expression": JS}   until it is true in the page
//   {"do": "value", "expression": JS}
//   {"do": "type", "selector": CSS, "text": T}
//   {"do": "key", "key": K}   as Playwright names it
//   {"do": "key down", "key": K}, {"do": "key up", "key": K}
//   {"do": "sit down"}   takes part, as a person at the page would
//   {"do": "mount", "seed": S, "seconds": T, "steps": [..]}   with the mouse, until the step is none of these
//   {"do": "picture", "file": F}
// Usage: node console_page.mjs PATH_OF_CHROMIUM
import { createInterface } from "node:readline";

import { chromium } from "playwright-core";

import { mount, sitDown } from "./mouse_person.mjs";

const browser = await chromium.launch({ executablePath: process.argv[2], args: ["--no-sandbox", "--disable-dev-shm-usage"] });
const problems = [];
let page;

const commands = {
  async open({ url, width, height, theme }) {
    await page?.context().close();
    const context = await browser.newContext({ viewport: { width, height }, colorScheme: theme, locale: "en-GB" });
    page = await context.newPage();
    page.on("pageerror", (error) => problems.push(String(error)));
    page.on("console", (line) => line.type() === "error" && problems.push(line.text()));
    page.on("request", (request) => new URL(request.url()).origin !== new URL(url).origin && !request.url().startsWith("blob:") && problems.push(`asked elsewhere: ${request.url()}`));
    await page.goto(url);
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
  async "sit down"() {
    await sitDown(page);
  },
  async mount(task) {
    return mount(page, task);
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
