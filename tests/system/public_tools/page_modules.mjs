// Tests of the page's own modules: what it says of the stop and of a silent connection, what it lists, and what it gives back to the graphics hardware.
// Usage: node page_modules.mjs CONSOLE_SOURCES FOLDER_WITH_NODE_MODULES
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";

import { loadPage, runTests } from "./page_loader.mjs";

/** As much of a document as elements that are only made need. */
class Node {
  constructor(text = "") {
    this.own = text;
    this.children = [];
  }
  get textContent() {
    return this.own + this.children.map(({ textContent }) => textContent).join("");
  }
}
class Element extends Node {
  constructor(tag) {
    super();
    Object.assign(this, { tag, className: "", title: "", dataset: {}, style: { setProperty() {} }, attributes: {}, classList: { add() {} } });
  }
  append(...children) {
    this.children.push(...children.map((child) => (typeof child === "string" ? new Node(child) : child)));
  }
  setAttribute(name, value) {
    this.attributes[name] = value;
  }
  removeAttribute(name) {
    delete this.attributes[name];
  }
  addEventListener() {}
  /** All below it of this tag. */
  all(tag) {
    return this.children.flatMap((child) => [...(child.tag === tag ? [child] : []), ...(child.all?.(tag) ?? [])]);
  }
}
globalThis.document = { documentElement: {}, createElement: (tag) => new Element(tag), createElementNS: (_, tag) => new Element(tag), createTextNode: (text) => new Node(text) };

const { Presses, coverOf, isSilent, Session, panels, textOf, reasonOfLoss, reasonOf, whyNot, forbid, setLanguage, isTooEarly, Parts, Markers, Scene, setAssetSource } = await loadPage(...process.argv.slice(2), [
  'export { Presses } from "./presses";', 'export { coverOf, isSilent } from "./cover";', 'export { Session } from "./session";', 'export * as panels from "./panels";',
  'export { textOf } from "./eventtext";', 'export { reasonOfLoss, reasonOf } from "./desk";', 'export { whyNot } from "./permits";', 'export { forbid } from "./dom";', 'export { isTooEarly } from "./pace";', 'export { setLanguage } from "./strings";', 'export { Parts } from "./parts";', 'export { Markers } from "./markers";',
  'export { Scene } from "three";', 'export { setAssetSource } from "./assets";',
]);

/** Time that passes when it is told to. */
class Clock {
  constructor() {
    this.now = 0;
    this.timers = new Map();
    this.real = [globalThis.setTimeout, globalThis.clearTimeout, Date.now];
    Date.now = () => this.now;
    globalThis.setTimeout = (act, milliseconds) => (this.timers.set(act, this.now + milliseconds), act);
    globalThis.clearTimeout = (act) => this.timers.delete(act);
  }
  pass(milliseconds) {
    this.now += milliseconds;
    for (const [act, due] of this.timers) if (due <= this.now) this.timers.delete(act), act();
  }
  end() {
    [globalThis.setTimeout, globalThis.clearTimeout, Date.now] = this.real;
  }
}

async function withPresses(test) {
  const clock = new Clock();
  const answers = [];
  const seen = [];
  try {
    const presses = new Presses(() => new Promise((answer) => answers.push(answer)), () => seen.push(presses.isMissed ? "missed" : presses.isUnconfirmed));
    /** A press that is answered at once. */
    const press = async (session, answer) => {
      const pressed = presses.press(session);
      answers.at(-1)(answer);
      await pressed;
    };
    await test({ presses, press, clock, answers, seen });
  } finally {
    clock.end();
  }
}
const ACCEPTED = { accepted: true };
const UNHEARD = { accepted: false, text: "neither a server nor a station has answered", code: "stop_unheard" };

const HAND = { role: 2, freeze_ticks: 0, park_ticks: 0 };
function sessionOf({ hands = ["right"], steps = [] } = {}) {
  const session = new Session();
  session.receive("/console", { state: "joined", life: 1, session: "test", title: "Test", lockstep: false, scene: "", protocol: 1 }, false);
  hands.forEach((name, id) => {
    const title = `${name[0].toUpperCase()}${name.slice(1)} hand`;
    session.receive("SceneObject", { object_id: id, name: `${name}_hand`, title, titles: [{ language: "en", text: title }], kind: "pointer", color: "#ff8000", size: [0.1, 0.1, 0.1], centre: [0, 0, 0], X_WO: { p: [0, 0, 0], q: [0, 0, 0, 1] } }, false);
    session.receive("SceneHand", { hand_id: id, name, object_id: id, ...HAND }, false);
  });
  steps.forEach((name, step) => session.receive("SceneStep", { step, steps: steps.length, name, title: [], part: "" }, false));
  return session;
}
let seq = 0;
const tell = (session, tick, kind, text) => session.receive("EventLog", { seq: BigInt(++seq), tick: BigInt(tick), severity: 0, kind, text }, false);
const stateOf = (session) => Object.fromEntries(session.steps.map(({ name, phase }) => [name, phase]));
const [DONE, RUNNING, STOPPED] = [2, 1, 5];

/** What the graphics hardware would hold of a scene. */
function heldBy(scene) {
  const held = new Set();
  scene.traverse(({ geometry, material }) => [geometry, material].flat().forEach((one) => one !== undefined && held.add(one)));
  return [...held];
}
function watched(resources) {
  const left = new Set(resources);
  for (const one of resources) one.addEventListener("dispose", () => left.delete(one));
  return left;
}

/** A triangle as binary glTF. */
function triangle() {
  const places = Buffer.from(new Float32Array([0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1]).buffer);
  const view = (byteOffset) => ({ buffer: 0, byteOffset, byteLength: 36 });
  const accessor = (bufferView) => ({ bufferView, componentType: 5126, count: 3, type: "VEC3", min: [0, 0, 0], max: [1, 1, 1] });
  let json = JSON.stringify({
    asset: { version: "2.0" }, scene: 0, scenes: [{ nodes: [0] }], nodes: [{ mesh: 0 }], meshes: [{ primitives: [{ attributes: { POSITION: 0, NORMAL: 1 } }] }],
    accessors: [accessor(0), accessor(1)], bufferViews: [view(0), view(36)], buffers: [{ byteLength: 72 }],
  });
  json = json.padEnd(4 * Math.ceil(json.length / 4));
  const chunk = (type, bytes) => Buffer.concat([Buffer.from(new Uint32Array([bytes.length, type]).buffer), bytes]);
  const chunks = Buffer.concat([chunk(0x4e4f534a, Buffer.from(json)), chunk(0x004e4942, places)]);
  const file = Buffer.concat([Buffer.from(new Uint32Array([0x46546c67, 2, 12 + chunks.length]).buffer), chunks]);
  return file.buffer.slice(file.byteOffset, file.byteOffset + file.length);
}

const tests = {
  // a gateway that hangs for 5 s
  async "a stop without an answer is said to be unconfirmed within a second, until the answer comes"() {
    await withPresses(async ({ presses, clock, answers, seen }) => {
      const pressed = presses.press("a");
      clock.pass(900);
      assert.deepEqual(seen, []);
      clock.pass(100);
      assert.deepEqual(seen, [true]);
      clock.pass(4000);
      answers[0](ACCEPTED);
      assert.equal(await pressed, ACCEPTED);
      assert.deepEqual(seen, [true, false]);
    });
  },

  async "a stop that is answered at once is no alarm"() {
    await withPresses(async ({ press, clock, seen }) => {
      await press("a", ACCEPTED);
      clock.pass(5000);
      assert.deepEqual(seen, []);
    });
  },

  async "a stop that could not be sent, that was refused or whose connection broke is unconfirmed"() {
    for (const answer of [undefined, UNHEARD])
      await withPresses(async ({ presses, press, clock, seen }) => {
        await press("a", answer);
        assert.deepEqual(seen, [true]);
        clock.pass(60000);
        assert.deepEqual(seen, [true], "it does not become true by itself");
        presses.forget(); // understood
        assert.deepEqual(seen, [true, false]);
        assert.equal(presses.rejoin("a"), undefined);
      });
  },

  async "a stop that is not confirmed is sent again when its session is there again, within 10 s of the press"() {
    await withPresses(async ({ presses, press, clock, answers, seen }) => {
      await press("a", undefined);
      clock.pass(9999);
      const again = presses.rejoin("a");
      assert.equal(answers.length, 2);
      assert.deepEqual(seen, [true], "until it is answered");
      answers[1](ACCEPTED);
      assert.equal(await again, ACCEPTED);
      assert.deepEqual(seen, [true, false]);
      assert.equal(presses.rejoin("a"), undefined, "once confirmed it is not sent again");
      assert.equal(answers.length, 2);
    });
  },

  async "a stop of which the gateway alone has heard is sent again when the gateway is in the session again"() {
    await withPresses(async ({ presses, clock, answers, seen }) => {
      const pressed = presses.press("a");
      clock.pass(500);
      const again = presses.rejoin("a");
      answers[0](UNHEARD);
      await pressed;
      assert.deepEqual(seen, [true]);
      answers[1](ACCEPTED);
      await again;
      assert.deepEqual(seen, [true, false]);
    });
  },

  async "later, and in another session, it is said that the stop did not arrive: it is not sent again"() {
    for (const [passed, session] of [[10000, "a"], [-1, "a"], [100, "b"], [100, ""]])
      await withPresses(async ({ presses, press, clock, answers, seen }) => {
        await press("a", undefined);
        clock.pass(passed);
        assert.equal(presses.rejoin(session), undefined);
        assert.equal(answers.length, 1);
        assert.deepEqual(seen, [true, "missed"]);
        // the person presses again
        await press(session, ACCEPTED);
        assert.deepEqual(seen, [true, "missed", false]);
      });
  },

  async "a stop of anybody that stands answers for one that is not confirmed"() {
    for (const [standing, expected] of [[true, [true, false]], [false, [true]]])
      await withPresses(async ({ presses, press, clock, seen }) => {
        let stands = true; // a raise comes, and its clear after it
        presses.hear(() => stands); // before the press
        await press("a", undefined);
        clock.pass(5000);
        assert.deepEqual(seen, [true], "what was heard before the press is of no account");
        presses.hear(() => stands);
        clock.pass(900);
        stands = standing;
        clock.pass(100);
        assert.deepEqual(seen, expected);
      });
  },

  async "this page's own stop that comes back from the gateway is no answer"() {
    await withPresses(async ({ presses, clock, answers, seen }) => {
      const pressed = presses.press("a");
      presses.hear(() => true);
      clock.pass(1000);
      answers[0](UNHEARD);
      await pressed;
      clock.pass(1000);
      assert.deepEqual(seen, [true]);
    });
  },

  async "a later press that is confirmed answers for those before it"() {
    await withPresses(async ({ presses, clock, answers, seen }) => {
      const [first, second] = [presses.press("a"), presses.press("a")];
      clock.pass(1000);
      answers[1](ACCEPTED);
      await second;
      answers[0](undefined);
      await first;
      assert.deepEqual(seen, [true, false]);
    });
  },

  async "of a stop that reached the devices alone it is said that they were reached, until it is confirmed"() {
    await withPresses(async ({ presses, press }) => {
      await press("a", { accepted: false, text: "1 station has stopped", code: "stop_devices" });
      assert.deepEqual([presses.isUnconfirmed, presses.reached], [true, "devices"]);
      await press("a", ACCEPTED);
      assert.deepEqual([presses.isUnconfirmed, presses.reached], [false, "nobody"]);
    });
  },

  "a raise that others have heard is no stopped session: its server says of the run that it is stopped"() {
    const session = sessionOf();
    session.receive("RunState", { phase: RUNNING, tick: 1n, reason: "running" }, false);
    session.receive("EmergencyStop", { client_guid: "a", counter: 1, who: "Ada", reason: "" }, false);
    assert.deepEqual([session.standing.length, session.isStopped], [1, false]);
    session.receive("RunState", { phase: RUNNING, tick: 2n, reason: "emergency stop", emergency_stop: true }, false);
    assert.equal(session.isStopped, true);
    session.receive("EmergencyClear", { client_guid: "a", counter: 1, who: "Ada", reason: "" }, false);
    assert.equal(session.isStopped, false);
  },

  "what the server says to be closed, or not permitted to the seat, is forbidden with its reason, and nothing else"() {
    const run = (open_commands, more = {}) => ({ run: { open_commands, ...more }, isOver: false, isWaiting: false, ...more });
    const seat = { pause: 2, skip: 5, kick: 18, record: null };
    const reasons = (session, permitted = seat) => ["pause", "skip", "kick", "record", "clear"].map((word) => whyNot(word, permitted, session)?.replace("refusal.", "") ?? "");
    const [PAUSE, SKIP, KICK] = [1 << 2, 1 << 5, 1 << 18];
    assert.deepEqual(reasons(run(PAUSE | SKIP | KICK)), ["", "", "", "", "not_permitted"]);
    assert.deepEqual(reasons(run(PAUSE | KICK, { emergency_stop: true })), ["", "stopped", "", "", "not_permitted"]);
    assert.deepEqual(reasons(run(KICK, { isWaiting: true })), ["waiting", "waiting", "", "", "not_permitted"]);
    assert.deepEqual(reasons(run(KICK, { isOver: true, emergency_stop: true })), ["over", "over", "", "", "not_permitted"]);
    assert.deepEqual(reasons(run(SKIP | KICK)), ["already", "", "", "", "not_permitted"]);
    assert.deepEqual(reasons({ isOver: false, isWaiting: false }), ["", "", "", "", "not_permitted"], "nothing is known of the run");
    assert.equal(whyNot("skip", undefined, run(0)), undefined, "without a seat the gateway says what is missing");
    const button = new Element("button");
    forbid(button, "because");
    assert.deepEqual([button.title, button.attributes], ["because", { "aria-disabled": "true" }]);
    forbid(button, "");
    assert.deepEqual([button.title, button.attributes], ["", {}]);
  },

  "in a stop only what is in somebody's hands cannot be taken"() {
    const session = sessionOf({ hands: ["right", "left"] });
    session.receive("SceneObject", { object_id: 2, name: "peg", title: "Peg", titles: [], kind: "part", color: "#ff8000", size: [0.1, 0.1, 0.1], centre: [0, 0, 0], X_WO: { p: [0, 0, 0], q: [0, 0, 0, 1] } }, false);
    session.receive("Presence", { client_id: 1, name: "Ada", role: 2, hands: [0], alive: true }, false);
    session.receive("GrabState", { object_id: 2, hand_id: 0 }, false);
    const [list] = panels.people(session, { leads: true, hand: "left", whyNoTaking: "a stop stands" });
    const forbidden = list.all("button").filter(({ attributes }) => attributes["aria-disabled"] === "true");
    assert.deepEqual(forbidden.map(({ textContent, title }) => [textContent, title]), [["Take over", "a stop stands"]]);
  },

  // kNone is no refusal
  "each refusal of the server has a text in each language of the page"() {
    const names = readFileSync(join(process.argv[2], "../../../../idl/types/names.h"), "utf8");
    const [, list] = /refusalName[^{]*\{[^{]*\{([^}]*)\}/.exec(names);
    const refusals = [...list.matchAll(/"(\w*)"/g)].map(([, name]) => name);
    const idl = readFileSync(join(process.argv[2], "../../../../idl/tenon.idl"), "utf8");
    assert.equal(refusals.length, [.../enum Refusal \{([^}]*)\}/.exec(idl)[1].matchAll(/REFUSAL_/g)].length, "each has its name");
    assert.deepEqual([refusals[0], refusals.includes("stopped")], ["", true]);
    const texts = new Map();
    for (const language of ["en", "de"]) {
      setLanguage(language);
      const said = refusals.slice(1).map((code) => reasonOf({ accepted: false, text: "", code }));
      for (const [i, text] of said.entries()) assert.notEqual(text, "", `${language}: ${refusals[i + 1]}`);
      texts.set(language, said);
    }
    setLanguage("en");
    assert.equal(new Set(texts.get("de")).size, refusals.length - 1);
    for (const [i, text] of texts.get("de").entries()) assert.notEqual(text, texts.get("en")[i], refusals[i + 1]);
  },

  "a session that goes on and of which nothing is heard for 3 s is silent"() {
    const session = { link: { state: "joined", lockstep: false }, isOver: false };
    const standing = { live: { kind: "open" }, session, age: 3.1 };
    assert.equal(isSilent(standing), true);
    const others = [
      { age: 3 }, { live: { kind: "reconnecting", seconds: 1 } }, { player: {} }, { lobby: {} }, { session: { ...session, isOver: true } },
      { session: { ...session, link: { state: "joined", lockstep: true } } }, { session: { ...session, link: { state: "lost", lockstep: false } } }, { session: { isOver: false } },
    ];
    for (const other of others) assert.equal(isSilent({ ...standing, ...other }), false, JSON.stringify(other));
  },

  "the state of a run under an emergency stop is the stop"() {
    const session = sessionOf();
    session.receive("RunState", { phase: RUNNING, tick: 1n, reason: "running" }, false);
    assert.equal(panels.phase(session).textContent, "Running");
    session.receive("EmergencyStop", { client_guid: "a", counter: 1, who: "Ada", reason: "" }, false);
    assert.deepEqual([panels.phase(session).textContent, panels.phase(session).className], ["Stop raised", "badge bad"], "the server has not said that it has heard it");
    session.receive("RunState", { phase: RUNNING, tick: 2n, reason: "emergency stop", emergency_stop: true }, false);
    assert.deepEqual([panels.phase(session).textContent, panels.phase(session).className], ["Forces stopped", "badge bad"]);
    session.receive("EmergencyClear", { client_guid: "a", counter: 1, who: "Ada", reason: "" }, false);
    assert.equal(panels.phase(session).textContent, "Running");
    session.receive("EmergencyStop", { client_guid: "a", counter: 2, who: "Ada", reason: "" }, false);
    session.receive("RunState", { phase: STOPPED, tick: 3n, reason: "stopped" }, false);
    assert.equal(panels.phase(session).textContent, "Stopped", "it is over");
  },

  "steps of a former attempt are to come again after a new start, and after a step back"() {
    const session = sessionOf({ steps: ["take", "mount", "check"] });
    for (const [tick, kind, text] of [[0, "step", "take"], [1000, "step done", "take (1.0 s)"], [1000, "step", "mount"], [2000, "step done", "mount (1.0 s)"], [2000, "step", "check"]]) tell(session, tick, kind, text);
    assert.deepEqual(stateOf(session), { take: DONE, mount: DONE, check: undefined });
    tell(session, 3000, "step", "mount"); // back
    assert.deepEqual(stateOf(session), { take: DONE, mount: undefined, check: undefined });
    assert.equal(session.steps[2].started, undefined);
    tell(session, 4000, "step", "take"); // start again
    assert.deepEqual(session.steps.map(({ started, phase }) => [started, phase]), [[4, undefined], [undefined, undefined], [undefined, undefined]]);
  },

  "a button to guide a hand names it where there are several"() {
    for (const [hands, labels] of [[["right"], ["Show", "Together", "Hands off", "Remove"]], [["right", "left"], ["Show: Right hand", "Together: Right hand", "Hands off: Right hand", "Show: Left hand", "Together: Left hand", "Hands off: Left hand", "Remove"]]]) {
      const session = sessionOf({ hands });
      session.receive("Presence", { client_id: 1, name: "Ada", role: 2, hands: hands.map((_, id) => id), alive: true }, false);
      const [list] = panels.people(session, { leads: true });
      const buttons = list.all("button");
      assert.deepEqual(buttons.map(({ textContent }) => textContent), labels);
      const described = buttons.map(({ attributes }) => attributes["aria-label"]);
      assert.equal(new Set(described).size, described.length);
      labels.forEach((label, i) => assert.ok(described[i].startsWith(label), `${described[i]}: what is seen is what is called`));
    }
  },

  "hands whose objects have one title are told apart by their names"() {
    const session = sessionOf({ hands: ["right", "left"] });
    for (const object of session.objects.values()) Object.assign(object, { title: "Glove", titles: [] });
    assert.deepEqual([0, 1].map((id) => session.nameOfHand(id)), ["Glove (right)", "Glove (left)"]);
  },

  "an event names a hand once and ends without a point"() {
    const session = sessionOf();
    assert.equal(textOf(session, { kind: "taken", text: "Right hand (right hand)" }), "Right hand");
    assert.equal(textOf(session, { kind: "taken", text: "Grid (right hand)" }), "Grid (Right hand)");
    assert.equal(textOf(session, { kind: "guidance", text: "hand 'right' is guided no more: its instructor is gone." }), "Right hand is guided no more: its instructor is gone");
    assert.equal(textOf(session, { kind: "seats", text: "all seats are taken." }), "all seats are taken");
    assert.equal(textOf(session, { kind: "note", text: "Mind the edge." }), "Mind the edge.", "what a person wrote stays");
  },

  "numbers, switches and those who have no name are in the page's language"() {
    const session = sessionOf();
    setLanguage("de");
    assert.equal(textOf(session, { kind: "step done", text: "take (3.25 s)" }), "take (3,25 s)");
    assert.equal(textOf(session, { kind: "command", text: "command line: freeze on" }), "Befehlszeile: Kräfte einfrieren an");
    assert.equal(textOf(session, { kind: "join", text: "trainee (trainee) has joined" }), "Auszubildende ist da");
    assert.equal(textOf(session, { kind: "join", text: "Ada (trainee) has joined" }), "Ada (Auszubildende) ist da");
    session.receive("EmergencyStop", { client_guid: "a", counter: 1, who: "console", reason: "pressed in the browser" }, false);
    assert.equal(panels.strip(session).text, "Not-Halt von Konsole: im Browser gedrückt");
    setLanguage("en");
  },

  "why a seat is lost is said in words of the page"() {
    assert.equal(reasonOfLoss("the server of session 'a' removed this client: was removed by Ada"), "Ada has removed you");
    assert.equal(reasonOfLoss("the server of session 'a' is gone"), "the server is gone");
    assert.equal(reasonOfLoss("refused: join first"), "the server has heard nothing of it for a while");
    assert.equal(reasonOfLoss("the cable is broken."), "the cable is broken");
  },

  "why the gateway has closed the connection is said in words of the page"() {
    const session = sessionOf();
    session.link = { state: "joined" };
    const moreOf = (reason) => coverOf({ live: { kind: "reconnecting", seconds: 8, reason }, session, view: {}, age: 0 }).more;
    assert.match(moreOf(""), /start `tenon console` again/);
    assert.match(moreOf("a newer viewer came: 192 look on here at most, without a seat or hands"), /a newer page came, and no more than 192 .* in 8 s/);
    assert.match(moreOf("the moon is full"), /the moon is full/);
    setLanguage("de");
    for (const reason of ["a newer viewer came: 192 look on here at most, without a seat or hands", "more than 200 messages a second", "more was asked for than was read", "the session is over"])
      assert.ok(!moreOf(reason).includes(reason), reason);
    setLanguage("en");
  },

  // the gateway's own, and those of the server without words of their own
  "a refusal without words of its own has the reason, and no more than that"() {
    const said = (code, text) => reasonOf({ accepted: false, text, code });
    setLanguage("de");
    assert.equal(said("record_failed", "session 'a' is full"), "die Aufzeichnung ist misslungen: session 'a' is full");
    assert.match(said("record_no_folder", "this console has no folder"), /^diese Konsole hat keinen Ordner/);
    assert.equal(said("record_none", "there is no session yet"), "es gibt noch keine Sitzung");
    assert.equal(said("other", ""), "das geht so nicht");
    setLanguage("en");
    assert.equal(said("record_failed", "session 'a' is full"), "session 'a' is full");
  },

  async "parts give back all that they have drawn when another session begins"() {
    const list = new TextEncoder().encode(JSON.stringify({ version: 1, objects: [[{ model: "m", triangles: 1, error: 0 }], []] })).buffer;
    setAssetSource(async (name) => (name === "list" ? list : triangle()));
    for (const simple of [true, false]) {
      const scene = new Scene();
      const parts = new Parts(scene, simple, () => {});
      parts.takeObjects(sessionOf({ hands: ["right", "left"] }));
      const taking = parts.takeModels("list");
      await taking;
      const boxes = watched(heldBy(scene));
      while (parts.reading > 0) await new Promise((done) => setTimeout(done));
      assert.equal(parts.models, 1);
      assert.equal(boxes.size, 2, "the box of the part that has a model is given back, the other one's is not");
      const models = watched(heldBy(scene));
      assert.ok(models.size >= 3);
      parts.clear();
      await new Promise((done) => setTimeout(done));
      assert.equal(models.size, 0);
      assert.equal(heldBy(scene).length, 0);
    }
  },

  "where the processor draws, the first picture waits for the models, for 1.5 s, and nowhere is one of nothing"() {
    const prospect = { objects: 3, showsObjects: false, isSimple: true, isComplete: false, awaited: 0 };
    const rows = [
      [{}, true], [{ awaited: 1499 }, true], [{ awaited: 1500 }, false], [{ isComplete: true }, false], [{ isSimple: false }, false],
      [{ objects: 0 }, true], [{ objects: 0, isSimple: false }, true], [{ objects: 0, showsObjects: true }, false],
    ];
    for (const [other, expected] of rows) assert.equal(isTooEarly({ ...prospect, ...other }), expected, JSON.stringify(other));
  },

  "markers give back all that they have drawn when another session begins"() {
    const session = sessionOf();
    session.devices.set("right", { model: "falcon", radius: 0.05 });
    session.hands.set(0, { hand_id: 0, X_WH: { p: [0.05, 0, 0], q: [0, 0, 0, 1] }, p_WC: [0, 0, 0], tactors: [], F_Ho_W: { force: [0, 0, 0], torque: [0, 0, 0] } });
    session.pairs.set("0 1", { a: 0, b: 1, colliding: true, p_WP: [0, 0, 0], peak_depth: 0, F_Ao_W: { force: [0, 0, 5] }, tick: 0 });
    const scene = new Scene();
    const markers = new Markers(scene);
    const always = new Set(heldBy(scene));
    markers.take(session);
    const shown = watched(heldBy(scene).filter((one) => !always.has(one)));
    assert.ok(shown.size >= 6, "device, link, workspace, and an arrow of two pieces");
    markers.clear();
    // the sphere is that of all workspaces
    assert.deepEqual([...shown].map(({ type }) => type), ["SphereGeometry"]);
    assert.equal(heldBy(scene).length, always.size);
  },
};

await runTests(tests);
