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
  insertBefore(child, next) {
    this.children = this.children.filter((one) => one !== child);
    this.children.splice(next === null ? this.children.length : this.children.indexOf(next), 0, child);
    (this.moved ??= []).push(child);
  }
  remove() {}
  /** All below it of this tag. */
  all(tag) {
    return this.children.flatMap((child) => [...(child.tag === tag ? [child] : []), ...(child.all?.(tag) ?? [])]);
  }
}
globalThis.document = { documentElement: {}, createElement: (tag) => new Element(tag), createElementNS: (_, tag) => new Element(tag), createTextNode: (text) => new Node(text) };

const { Presses, coverOf, isSilent, stopOf, whyCut, LiveSource, setOptions, keep, kept, moment, Lobby, Session, panels, textOf, reasonOfLoss, isRemoval, reasonOf, whyNot, forbid, setLanguage, isTooEarly, Parts, Markers, Hand, Scene, Vector3, Quaternion, Matrix4, Mesh, BoxGeometry, BufferGeometry, Float32BufferAttribute, setAssetSource, hintAt, Together, arrange, nearestOf, Surface, problemOfRecorder, linkBadge } = await loadPage(...process.argv.slice(2), [
  'export { Presses } from "./presses";', 'export { coverOf, isSilent, linkBadge, stopOf, whyCut } from "./cover";', 'export { LiveSource } from "./live";', 'export { Lobby } from "./lobby";', 'export { Session } from "./session";', 'export * as panels from "./panels";',
  'export { textOf } from "./eventtext";', 'export { isRemoval, reasonOfLoss, reasonOf } from "./eventtext";', 'export { whyNot } from "./permits";', 'export { forbid, setOptions } from "./dom";', 'export { isTooEarly } from "./pace";', 'export { keep, kept, moment, setLanguage } from "./strings";', 'export { Parts } from "./parts";', 'export { Markers } from "./markers";', 'export { Hand } from "./hand";',
  'export { hintAt } from "./player";', 'export { arrange } from "./labels";', 'export { Together } from "./beside";',
  'export { Scene, Vector3, Quaternion, Matrix4, Mesh, BoxGeometry, BufferGeometry, Float32BufferAttribute } from "three";', 'export { nearestOf, Surface } from "./nearest";', 'export { problemOfRecorder } from "./eventtext";', 'export { setAssetSource } from "./assets";',
]);

/** A list of options, one of which is chosen, or none. */
class Select extends Element {
  constructor() {
    super("select");
    this.chosen = -1;
  }
  get options() {
    return this.children;
  }
  get value() {
    return this.children[this.chosen]?.value ?? "";
  }
  set value(value) {
    this.chosen = this.children.findIndex((option) => option.value === value);
  }
  replaceChildren(...children) {
    this.children = children;
    this.chosen = children.length > 0 ? 0 : -1;
  }
  addEventListener(name, act) {
    if (name === "change") this.onChange = act;
  }
  /** As a person does. */
  choose(value) {
    this.value = value;
    this.onChange();
  }
}

/** A gateway of which the page's connections hear what a test says. */
class Socket {
  static OPEN = 1;
  static made = [];
  constructor() {
    Object.assign(this, { readyState: 0, sent: [] });
    Socket.made.push(this);
  }
  hear(message) {
    this.readyState = 1;
    this.onmessage({ data: JSON.stringify(message) });
  }
  send(text) {
    this.sent.push(text);
  }
  /** A broken connection does not hear of its end. */
  close() {
    this.readyState = 2;
  }
}

/** A connection of the page; `pass` lets seconds pass. */
function withConnection(test) {
  const real = [globalThis.WebSocket, globalThis.window, globalThis.clearTimeout];
  let look, retry;
  Socket.made = [];
  globalThis.WebSocket = Socket;
  globalThis.window = { setInterval: (act) => (look = act), setTimeout: (act) => (retry = act) };
  globalThis.clearTimeout = () => {};
  try {
    const states = [];
    const source = new LiveSource("ws://gateway/live", [], () => {}, (state) => states.push(state.kind));
    test({ source, states, pass: (seconds) => Array.from({ length: seconds }, () => look()), again: () => retry(), newest: () => Socket.made.at(-1) });
  } finally {
    [globalThis.WebSocket, globalThis.window, globalThis.clearTimeout] = real;
  }
}

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
const [DONE, RUNNING, PAUSED, STOPPED] = [2, 1, 2, 5];

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

/** A hand that is on, of a page on which nothing is drawn: `point(name, event)` is a pointer on the canvas, `tick()` a period; `sent`: targets. */
function handOf() {
  const heard = new Map();
  const canvas = { addEventListener: (name, act) => heard.set(name, act), removeEventListener() {} };
  const view = { canvas, setHandMode() {}, setGuide() {}, metresPerPixel: () => 0.001, axes: () => ({ right: new Vector3(1, 0, 0), up: new Vector3(0, 0, 1), away: new Vector3(0, 1, 0) }) };
  const sent = [];
  let tick;
  globalThis.window = { setInterval: (act) => (tick = act) };
  globalThis.addEventListener = () => {};
  const hand = new Hand(sessionOf(), view, [0], (bytes) => sent.push(bytes));
  hand.isWatched = () => true;
  const place = () => ({ p: new Vector3(), q: new Quaternion() });
  hand.receive([{ isOn: true, isActive: true, inContact: false, isFaulty: false, hand: place(), proxy: place(), object: place(), centre: new Vector3(), force: 0, objectId: 0 }]);
  const point = (name, pointerId, clientX, clientY) => heard.get(name)({ pointerId, clientX, clientY, isPrimary: pointerId === 1, button: 0 });
  return { hand, sent, point, tick: () => tick(), where: () => hand.targets[0].p.toArray().map((x) => Math.round(1000 * x)) };
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

  "the page is silent as well when the gateway is, with or without a session"() {
    const session = { link: { state: "joined", lockstep: true }, isOver: false };
    for (const [standing, expected] of [[{ silence: 5.1 }, true], [{ silence: 5 }, false], [{ silence: 5.1, lobby: {} }, true], [{ silence: 5.1, player: {} }, false]])
      assert.equal(isSilent({ live: { kind: "open" }, session, age: 0, ...standing }), expected, JSON.stringify(standing));
  },

  "a session that was joined and of which nothing was ever heard is silent"() {
    const real = performance.now;
    performance.now = () => 1000;
    const session = sessionOf();
    performance.now = real;
    assert.equal(session.heard, 1000);
    session.receive("/console", { state: "joined", life: 2, lockstep: false }, false);
    assert.ok(session.heard > 0, "the next life of the server, too");
  },

  "of a stop it is said whether it stands only while that is heard"() {
    const session = sessionOf();
    const unknown = "Not known whether forces are stopped: the console hears nothing. Use the emergency stop switch at the device";
    const said = (other = {}) => {
      const { state, text } = stopOf({ live: { kind: "open" }, session, age: 0, silence: 0, ...other });
      return [state, text];
    };
    const deaf = [{ live: { kind: "reconnecting", seconds: 1, reason: "" } }, { live: { kind: "connecting" } }, { age: 3.1 }, { silence: 5.1 }];
    assert.deepEqual(said(), ["unknown", unknown], "no pose has come yet");
    const waits = new Session(); // in lockstep for a station that is gone
    waits.receive("/console", { state: "joined", life: 1, lockstep: true }, false);
    waits.receive("SceneObject", { object_id: 1, name: "peg", titles: [] }, false);
    waits.receive("NewestRaise", { number: 5, standing: 1, who: "Ada", reason: "hot" }, false);
    assert.deepEqual([said({ session: waits }), waits.isStopKnown], [["raised", "Emergency stop by Ada: hot"], true]);
    session.receive("WorldFrame_100", { tick: 1n, states: [] }, false);
    assert.deepEqual(said(), ["none", "No emergency stop active"]);
    for (const other of deaf) assert.deepEqual(said(other), ["unknown", unknown], JSON.stringify(other));
    session.receive("EmergencyStop", { client_guid: "a", counter: 1, who: "Ada", reason: "hot" }, false);
    assert.deepEqual(said(), ["raised", "Emergency stop by Ada: hot"]);
    for (const other of deaf) assert.deepEqual(said(other), ["unknown", `${unknown}. Last known: Emergency stop by Ada: hot`], "others may have cleared it");
    session.receive("/console", { ...session.link, state: "lost" }, false);
    assert.equal(said()[0], "unknown");
    session.receive("/console", { ...session.link, state: "ended" }, false);
    assert.equal(said()[0], "raised");
    assert.equal(stopOf({ live: { kind: "open" }, session: new Session(), age: 0, silence: 0, lobby: {} }), undefined);
    assert.equal(stopOf({ live: { kind: "reconnecting", reason: "" }, session: new Session(), age: 0, silence: 0, lobby: {} }).state, "unknown", "nor does the stop of all sessions go anywhere");
  },

  "a server that continues and says that no raise stands is believed, also where clears are not told any more"() {
    const session = sessionOf();
    const raise = (counter) => session.receive("EmergencyStop", { client_guid: "a", counter, who: "Ada", reason: "" }, false);
    const newest = (standing) => session.receive("NewestRaise", { number: 3000, standing, who: "Bob", reason: "again" }, false);
    const pose = (tick) => session.receive("WorldFrame_100", { tick: BigInt(tick), states: [] }, false);
    const shown = () => [session.isRaised, panels.strip(session).isRaised, panels.phase(session).textContent === "Stop raised"];
    session.receive("RunState", { phase: RUNNING, tick: 1n, reason: "running" }, false);
    raise(1);
    raise(2);
    newest(0);
    assert.deepEqual(shown(), [true, true, true], "a server that hangs may not have heard them");
    pose(1);
    assert.deepEqual(shown(), [false, false, false]);
    raise(3);
    assert.deepEqual(shown(), [true, true, true], "one that is heard after it stands at once");
    pose(2);
    assert.equal(session.isRaised, true);
    newest(0);
    pose(3);
    assert.equal(session.isRaised, false);
    newest(1); // the server knows of a raise that this page has not heard
    assert.deepEqual(shown(), [true, true, true]);
    assert.equal(panels.strip(session).text, "Emergency stop by Bob: again");
    newest(0);
    raise(4);
    session.receive("/console", { ...session.link, state: "lost" }, false);
    newest(0);
    pose(4);
    assert.equal(session.isRaised, true, "nothing is to be had of a server that is gone");
  },

  "a connection of which nothing is heard for 10 s is given up, once it had a heartbeat"() {
    withConnection(({ states, pass, again, newest, source }) => {
      const first = newest();
      first.hear({ op: "serverInfo" });
      pass(30);
      assert.deepEqual(states, ["connecting", "open"], "a gateway without heartbeats may be silent");
      first.hear({ op: "heartbeat" });
      pass(9);
      first.hear({ op: "serverInfo" });
      pass(9);
      first.hear({ op: "heartbeat" });
      pass(9);
      assert.equal(states.length, 2);
      const asked = source.ask("deskLeave");
      pass(1);
      assert.deepEqual(states, ["connecting", "open", "reconnecting"]);
      assert.equal(first.readyState, 2);
      first.hear({ op: "heartbeat" });
      first.onclose({ reason: "" });
      assert.equal(states.length, 3, "of one that was given up nothing is heard any more");
      again();
      pass(10); // nor does the next one come about
      again();
      newest().hear({ op: "serverInfo" });
      assert.deepEqual(states, ["connecting", "open", "reconnecting", "reconnecting", "open"]);
      return asked;
    });
  },

  "a connection that is opened only to be closed is no connection"() {
    withConnection(({ states, newest }) => {
      newest().readyState = 1;
      newest().onopen?.();
      newest().onclose({ reason: "there is no such session: it has ended or not begun, or this gateway shows too many" });
      assert.deepEqual(states, ["connecting", "reconnecting"]);
    });
  },

  "of a session that is not running the page says so, and leads to the others"() {
    for (const reason of ["there is no such session: it has ended or not begun, or this gateway shows too many", "the session is over"]) {
      const over = coverOf({ live: { kind: "reconnecting", seconds: 8, reason }, session: new Session(), chosen: "monday", only: "", age: 0, silence: 0 });
      assert.deepEqual([over.state, over.head, over.leads], ["absent", "Session monday is not running", "All sessions"]);
    }
  },

  "a list keeps what was chosen, and chooses nothing instead of what is not there any more"() {
    const select = new Select();
    const options = (...names) => names.map((name) => ({ name, title: name.toUpperCase() }));
    setOptions(select, options("a", "b", "c"));
    assert.equal(select.value, "a");
    select.choose("b");
    const [first] = select.children;
    setOptions(select, options("a", "b", "c"));
    assert.equal(select.children[0], first, "the same ones stay");
    setOptions(select, options("c", "b"));
    assert.equal(select.value, "b");
    setOptions(select, options("a", "c"));
    assert.deepEqual([select.value, select.children.map(({ value }) => value)], ["", ["a", "c"]]);
  },

  "a list of which nobody has chosen shows its first entry, also when another one was the first before"() {
    const select = new Select();
    const options = (...names) => names.map((name) => ({ name, title: name }));
    for (const [names, expected] of [[[], ""], [["fixed", "a"], "fixed"], [["a", "b"], "a"], [["b"], "b"], [["a", "b"], "a"]]) {
      setOptions(select, options(...names));
      assert.equal(select.value, expected);
    }
  },

  "a card of the list of sessions stays where it is when another session begins, and says that its connection is lost"() {
    const lobby = new Lobby();
    const receive = (...names) => lobby.receive({ sessions: names.map((session) => ({ session, title: session, host: "here", served: false, lockstep: false, protocol: 1 })) });
    const list = lobby.element.all("div").find(({ className }) => className === "cards");
    receive("b", "d");
    const [b, d] = list.children;
    list.moved = [];
    receive("a", "b", "b", "c", "d");
    assert.deepEqual([list.children.indexOf(b), list.children.indexOf(d), list.children.length], [1, 3, 4]);
    assert.ok(!list.moved.includes(b) && !list.moved.includes(d), "it would lose the focus");
    const card = { ...lobby.cards.get("b"), live: "reconnecting" };
    card.info.served = true;
    assert.match(lobby.contentOf(card).map(({ textContent }) => textContent).join(), /Connection lost/);
  },

  "what a browser does not keep lasts as long as the page"() {
    const blocked = { get() { throw new Error("SecurityError"); }, configurable: true };
    Object.defineProperties(globalThis, { localStorage: blocked, sessionStorage: blocked });
    keep("name", "Ada");
    keep("pass", "p", "tab");
    assert.deepEqual([kept("name"), kept("name", "tab"), kept("pass", "tab")], ["Ada", null, "p"]);
    keep("pass", null, "tab");
    assert.equal(kept("pass", "tab"), null);
    delete globalThis.localStorage;
    delete globalThis.sessionStorage;
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
    const session = sessionOf({ hands: ["right", "left"] });
    assert.equal(textOf(session, { kind: "taken", text: "Right hand (right hand)" }), "Right hand");
    assert.equal(textOf(session, { kind: "taken", text: "Grid (right hand)" }), "Grid (Right hand)");
    assert.equal(textOf(session, { kind: "guidance", text: "hand 'right' is guided no more: its instructor is gone." }), "Right hand is guided no more: its instructor is gone");
    assert.equal(textOf(session, { kind: "seats", text: "all seats are taken." }), "all seats are taken");
    assert.equal(textOf(session, { kind: "note", text: "Mind the edge." }), "Mind the edge.", "what a person wrote stays");
  },

  // a scenario calls the hand "Your hand", for who has it
  "a hand is called by its title for who has it, and by its role for others"() {
    const session = sessionOf();
    Object.assign(session.objects.get(0), { title: "Your hand", titles: [{ language: "en", text: "Your hand" }, { language: "de", text: "Deine Hand" }] });
    session.receive("SceneObject", { object_id: 5, name: "peg", title: "Peg", titles: [], kind: "part" }, false);
    const told = () => [session.nameOfHand(0), textOf(session, { kind: "hand frozen", text: "hand 'right' is held still (last input 60 ms ago)" }), textOf(session, { kind: "taken", text: "Peg (right hand)" })];
    const condition = () => {
      Object.assign(session, { step: { revision: 1, has_target: false, title: [], instruction: [], name: "take", part: "", step: 0, steps: 1 }, progress: { revision: 1, nodes: 1, conditions: [{ text: "contact right_hand-peg", value: 0.2, limit: 1, group: 0, met: false, depth: 0 }] } });
      return panels.instruction(session).map(({ textContent }) => textContent).join(" ");
    };
    assert.deepEqual(told(), ["Trainee", "Trainee is frozen (last input 60 ms ago)", "Peg (Trainee)"]);
    assert.match(condition(), /Trainee touches Peg/);
    session.ownHands = new Set([0]);
    assert.deepEqual(told(), ["Your hand", "Your hand is frozen (last input 60 ms ago)", "Peg (Your hand)"]);
    assert.match(condition(), /Your hand touches Peg/);
    setLanguage("de");
    assert.equal(session.nameOfHand(0), "Deine Hand");
    setLanguage("en");
  },

  "a run with steps that were skipped or late is said to have ended, and not to have succeeded"() {
    const session = sessionOf();
    const end = (reason, more) => {
      session.receive("RunState", { phase: 3, tick: 9n, reason, ...more }, false);
      const [head, text] = panels.instruction(session);
      return [head.children[0].className, head.textContent, text.textContent];
    };
    assert.deepEqual(end("everything is mounted", { steps_skipped: 0, steps_timed_out: 0 }), ["badge good", "Succeeded", "everything is mounted"]);
    assert.deepEqual(end("ended, 2 steps skipped", { steps_skipped: 2, steps_timed_out: 0 }), ["badge warn", "Ended, not every step was done", "ended, steps skipped: 2"]);
    assert.deepEqual(end("ended, 1 step skipped, 1 step not done in time", { steps_skipped: 1, steps_timed_out: 1 })[2], "ended, steps skipped: 1, not done in time: 1");
    assert.deepEqual(end("ended, 1 step not done in time", { steps_skipped: 0, steps_timed_out: 1 }), ["badge warn", "Ended, not every step was done", "ended, steps not done in time: 1"]);
    setLanguage("de");
    assert.equal(end("ended, 2 steps skipped", { steps_skipped: 2, steps_timed_out: 0 })[2], "zu Ende, übersprungene Schritte: 2");
    setLanguage("en");
  },

  "what the journal lacks is told in the page's language"() {
    setLanguage("de");
    const text = (what) => textOf(sessionOf(), { kind: "journal", text: what });
    assert.equal(text("379 more ticks are missing in the journal, 380 in all: the disk or the machine is too slow"), "weitere Takte, die im Journal fehlen: 379, zusammen 380; der Datenträger oder der Rechner ist zu langsam");
    assert.equal(text("1 tick is missing in the journal: the disk or the machine is too slow"), "Takte, die im Journal fehlen: 1; der Datenträger oder der Rechner ist zu langsam");
    setLanguage("en");
  },

  "a session that waits says for whom"() {
    const session = sessionOf({ hands: ["right", "left"] });
    session.receive("SceneHand", { ...HAND, hand_id: 7, name: "instructor", role: 1, object_id: 0xffffffff }, false);
    const waits = (reason) => {
      session.receive("RunState", { phase: 0, tick: 0n, reason }, false);
      return panels.instruction(session).at(-1).textContent;
    };
    assert.equal(waits("waiting for people: right, instructor, recorder"), "It begins when these are here, too: Trainee (Right hand), Instructor, Recorder");
    assert.equal(waits("waiting for people"), "It begins when all whom it waits for are here.");
    assert.equal(textOf(session, { kind: "run", text: "waiting for people: recorder" }), "waiting for people: Recorder");
  },

  "a gateway of one session names it while that is being prepared"() {
    const session = new Session();
    session.receive("/console", { state: "searching", life: 1, session: "", title: "", lockstep: false, scene: "", protocol: 1 }, false);
    const standing = { isDropping: false, live: { kind: "open" }, session, chosen: "", age: 0, silence: 0 };
    const named = coverOf({ ...standing, only: "demo" });
    assert.deepEqual([named.head, named.command], ["Waiting for the session demo", undefined]);
    assert.equal(coverOf({ ...standing, only: "" }).command, "./tenon demo");
  },

  "a condition that was not evaluated yet shows no limit of zero"() {
    const session = sessionOf();
    const shown = (condition) => {
      Object.assign(session, { step: { revision: 1, has_target: false, title: [], instruction: [], name: "take", part: "", step: 0, steps: 1 }, progress: { revision: 1, nodes: 1, conditions: [{ text: "contact right_hand-peg", group: 0, met: false, depth: 0, ...condition }] } });
      return panels.instruction(session).at(-1).all("output").map(({ textContent }) => textContent);
    };
    assert.deepEqual(shown({ value: 0, limit: 0 }), [""]);
    assert.deepEqual(shown({ value: 0.4, limit: 1 }), ["0.4 / 1.0 s"]);
  },

  "nobody is offered to remove himself"() {
    const session = sessionOf();
    for (const [client_id, name, role] of [[1, "Ada", 1], [2, "Ben", 2]]) session.receive("Presence", { client_id, name, role, hands: [], alive: true }, false);
    const removed = (self) => panels.people(session, { leads: true, self })[0].all("button").map(({ dataset }) => dataset.kick);
    assert.deepEqual(removed(1), ["2"]);
    assert.deepEqual(removed(undefined), ["1", "2"]);
  },

  // a server that hangs: its announcement ends, and nothing says that the session has
  "the card of a session that does not answer stays and names it, until it is known to have ended"() {
    const lobby = new Lobby();
    const card = (name, phase) => {
      const session = sessionOf();
      session.receive("RunState", { phase, tick: 5n, reason: "" }, false);
      return { element: new Element("a"), session, source: { close() {} }, live: "open", info: { session: name, title: "Test", host: "", served: true }, shown: "", isSilent: false };
    };
    const cards = { hung: card("hung", RUNNING), over: card("over", DONE + 1), heard: card("heard", RUNNING) };
    for (const [name, one] of Object.entries(cards)) lobby.cards.set(name, one);
    cards.heard.session.receive("NewestRaise", { number: 1, standing: 1, who: "", reason: "" }, false);
    lobby.receive({ sessions: [cards.heard.info] });
    assert.deepEqual([...lobby.cards.keys()], ["hung", "heard"]);
    assert.deepEqual(lobby.unstopped, ["hung"]);
    assert.match(lobby.contentOf(cards.hung).map(({ textContent }) => textContent).join(" "), /Does not answer.*stop its devices by their switch/);
    lobby.receive({ sessions: [cards.heard.info, cards.hung.info] });
    assert.doesNotMatch(lobby.contentOf(cards.hung).map(({ textContent }) => textContent).join(" "), /Does not answer/);
  },

  "numbers, switches and those who have no name are in the page's language"() {
    const session = sessionOf();
    setLanguage("de");
    assert.equal(textOf(session, { kind: "step done", text: "take (3.25 s)" }), "take (3,25 s)");
    assert.equal(textOf(session, { kind: "command", text: "command line: freeze on" }), "Befehlszeile: Kräfte einfrieren an");
    assert.equal(textOf(session, { kind: "join", text: "trainee (trainee) has joined" }), "Trainee ist da");
    assert.equal(textOf(session, { kind: "join", text: "Ada (trainee) has joined" }), "Ada (Trainee) ist da");
    session.receive("EmergencyStop", { client_guid: "a", counter: 1, who: "console", reason: "pressed in the browser" }, false);
    assert.equal(panels.strip(session).text, "Not-Halt von Konsole: im Browser gedrückt");
    setLanguage("en");
  },

  "a time of the session has its sign, and is that of the place that was sought"() {
    assert.deepEqual([-32.7, -5, -0.3, 0, 8.99, 9.5, 61].map(moment), ["−0:32", "−0:05", "0:00", "0:00", "0:09", "0:09", "1:01"]);
  },

  "a place on the time line of a recording is told in the page's language"() {
    const session = sessionOf({ steps: ["take"] });
    session.sceneSteps.get(0).title = [{ language: "en", text: "Take it" }, { language: "de", text: "Nimm es" }];
    const mark = (seconds, kind, text, severity = 0) => ({ seconds, tick: 1000 * seconds, kind, text, severity });
    const marks = [mark(1, "step", "take"), mark(2, "run", "emergency stop", 2), mark(3, "note", "Mind the edge.")];
    setLanguage("de");
    assert.equal(hintAt(session, marks, 2, 0.1), "0:02 · Nimm es · Lauf: Not-Halt");
    assert.equal(hintAt(session, marks, 3.05, 0.1), "0:03 · Nimm es · Notiz: Mind the edge.", "what a person wrote stays");
    assert.equal(hintAt(session, marks, 0.5, 0.1), "0:00");
    setLanguage("en");
  },

  "a link without losses is quiet in each language of the page"() {
    const session = sessionOf({ hands: ["right", "left"] });
    session.receive("Presence", { client_id: 1, name: "Ada", role: 2, hands: [0], alive: true }, false);
    const link = { client_id: 1, samples: 100n, age: 0.005, jitter: 0, answers_lost: 0, inputs_lost: 0.0004, clock_known: false };
    const lines = () => panels.people(session, { leads: false })[0].all("small").map(({ textContent }) => textContent);
    for (const language of ["en", "de"]) {
      setLanguage(language);
      session.receive("Telemetry", link, false);
      assert.deepEqual(lines(), ["Right hand"], language);
      session.receive("Telemetry", { ...link, inputs_lost: 0.02 }, false);
      assert.match(lines()[1], language === "en" ? /2\.0 % lost$/ : /2,0 % verloren$/);
    }
    setLanguage("en");
  },

  // the server's events come first, then those of the stations
  "a page that is opened late lists events by their ticks, and many of stations put out none of the server's"() {
    const session = sessionOf();
    for (let tick = 0; tick < 50; ++tick) tell(session, 100 * tick, "note", `note ${tick}`);
    for (let i = 0; i < 1000; ++i) session.receive("ClientEvent", { client_id: 1, seq: BigInt(i), tick: BigInt(5 * i + 1), kind: "safety", text: "" }, false);
    const ticks = session.events.map(({ tick }) => Number(tick));
    assert.deepEqual(ticks, [...ticks].sort((a, b) => a - b));
    const [notes, safety] = ["note", "safety"].map((kind) => session.events.filter((event) => event.kind === kind));
    assert.deepEqual([notes.length, safety.length, Number(safety[0].seq)], [50, 200, 800], "the newest are kept");
  },

  "a step with a time limit says what is left of it, more plainly in its last fifth, and one without a limit says nothing"() {
    const session = sessionOf({ steps: ["a"] });
    const cardAt = (tick, timeout) => {
      session.tick = tick;
      session.step = { step: 0, steps: 1, name: "a", title: [], instruction: [], part: "", phase: 1, started: 1000n, timeout, has_target: false };
      const card = new Element("div");
      card.append(...panels.instruction(session));
      return card.all("p").filter(({ className }) => className.startsWith("limit")).map(({ className, textContent }) => [className, textContent]);
    };
    session.receive("RunState", { phase: RUNNING, tick: 0n, reason: "" }, false);
    assert.deepEqual(cardAt(1000, 90), [["limit", "Time left: 1:30 of 1:30"]]);
    assert.deepEqual(cardAt(31_400, 90), [["limit", "Time left: 1:00 of 1:30"]]);
    assert.deepEqual(cardAt(73_000, 90), [["limit soon", "Time left: 0:18 of 1:30"]]);
    assert.deepEqual(cardAt(99_000, 90), [["limit soon", "Time left: 0:00 of 1:30"]]);
    assert.deepEqual(cardAt(31_400, 0), []);
    // the time of a step stands still in a pause
    session.receive("RunState", { phase: PAUSED, tick: 11_000n, reason: "" }, false);
    setLanguage("de");
    assert.deepEqual(cardAt(99_000, 90), [["limit", "Zeit: noch 1:20 von 1:30"]]);
    setLanguage("en");
  },

  "the time of a step that runs is its own in a page that is opened late, too"() {
    const session = sessionOf({ steps: ["take"] });
    session.receive("StepState", { name: "take", revision: 1, step: 0, steps: 1, phase: 1, started: 1000n, title: [] }, false);
    session.receive("RunState", { phase: RUNNING, tick: 9000n, reason: "running" }, false); // the newest one
    for (const [tick, text] of [[1000, "running"], [3000, "paused"], [5000, "emergency stop"], [6000, "paused"], [7000, "forces frozen"], [9000, "running"]]) tell(session, tick, "run", text);
    session.receive("WorldFrame_100", { part: 0, parts: 1, tick: 11000n, states: [] }, false);
    assert.equal(session.steps[0].seconds, 6);
  },

  // the other one reads at half the speed
  "of two players beside each other the one that is ahead waits"() {
    const [fast, slow] = [new Together(), new Together()];
    for (let frame = 1; frame <= 600; ++frame) {
      fast.played += fast.pass(1 / 60);
      if (frame % 2 === 0) slow.played += slow.pass(1 / 60);
      if (frame % 15 === 0) [fast, slow].forEach((one, i) => one.hear([slow, fast][i].played, 1));
      assert.ok(fast.played - slow.played < 0.4, `${frame}: ${fast.played} s, ${slow.played} s`);
    }
    assert.ok(Math.abs(slow.played - 5) < 0.02, "the slow one never waits");
  },

  "why a seat is lost is said in words of the page"() {
    assert.equal(reasonOfLoss("the server of session 'a' removed this client: was removed by Ada"), "Ada has removed you");
    assert.equal(reasonOfLoss("the server of session 'a' is gone"), "the server is gone");
    assert.equal(reasonOfLoss("refused: join first"), "the server has heard nothing of it for a while");
    assert.equal(reasonOfLoss("the cable is broken."), "the cable is broken");
    for (const [text, removed] of [["the server of session 'a' removed this client: was removed by Ada", true], ["you were removed from this session; ask", true], ["the server of session 'a' is gone", false], ["the cable is broken.", false]])
      assert.equal(isRemoval(text), removed, text);
  },

  "while gateway or server are lost nothing is asked of them, and why is said"() {
    const why = (kind, silence, state) => whyCut({ live: { kind }, session: { link: { state } }, silence });
    assert.deepEqual([why("open", 2, "joined"), why("open", 2, "ended")], [undefined, undefined]);
    assert.deepEqual([why("reconnecting", 0, "joined"), why("connecting", 0, undefined)], ["cut.gateway", "cut.gateway"]);
    assert.deepEqual([why("open", 5.1, "joined"), why("open", 0, "lost")], ["cut.silent", "lost.gone"]);
  },

  "what a server says of a stop of before, of who was removed and of a hand that is taken is in the page's language"() {
    const session = sessionOf();
    session.receive("EmergencyStop", { client_guid: "server", counter: 1, who: "server", reason: "it stood when this server started" }, false);
    const removed = "you were removed from this session; ask the instructor to admit you to a new one";
    setLanguage("de");
    assert.equal(panels.strip(session).text, "Not-Halt von Server: er stand, als dieser Server begann");
    const stood = "engaged by server: it stood when the former server was killed";
    assert.match(textOf(session, { kind: "emergency stop", text: stood }), /er stand, als der vorige Server beendet wurde/);
    assert.equal(textOf(session, { kind: "refused", text: `Ada may not join: ${removed}` }), "Ada wurde aus dieser Sitzung entfernt und darf nicht wieder mitmachen");
    assert.equal(reasonOfLoss(removed), "du wurdest aus dieser Sitzung entfernt");
    assert.equal(reasonOfLoss("the server of session 'a' is gone; no server announced session 'a' within 10 s: start one"), "der Server ist weg");
    assert.equal(reasonOf({ accepted: false, text: "hand 'right' is already moved by somebody else" }), "die Hand right bewegt schon jemand anders");
    assert.equal(reasonOf({ accepted: false, text: removed }), "du wurdest aus dieser Sitzung entfernt");
    const refused = coverOf({ live: { kind: "open" }, session: Object.assign(session, { link: { state: "refused", reason: removed, protocol: 1 } }), view: {}, chosen: "", only: "", age: 0 });
    assert.equal(refused.more, "du wurdest aus dieser Sitzung entfernt");
    // a person's own words stay
    session.receive("EmergencyStop", { client_guid: "server", counter: 2, who: "Ada", reason: "the cat is gone" }, false);
    assert.equal(panels.strip(session).text, "Not-Halt von Ada: the cat is gone");
    setLanguage("en");
  },

  "why the gateway has closed the connection is said in words of the page"() {
    const session = sessionOf();
    session.link = { state: "joined" };
    const moreOf = (reason) => coverOf({ live: { kind: "reconnecting", seconds: 8, reason }, session, view: {}, chosen: "", only: "", age: 0 }).more;
    assert.match(moreOf(""), /start `tenon console` again/);
    assert.match(moreOf("a newer viewer came: 192 look on here at most, without a seat or hands"), /a newer page came, and no more than 192 .* in 8 s/);
    assert.match(moreOf("a message longer than 64 kB"), /this page sent a message longer than 64 kB.* in 8 s/);
    assert.match(moreOf("the moon is full"), /the moon is full/);
    setLanguage("de");
    for (const reason of ["a newer viewer came: 192 look on here at most, without a seat or hands", "more than 200 messages a second", "a message longer than 64 kB", "more was asked for than was read", "the session is over"])
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
    const needed = said(undefined, "the role instructor needs the key of the session: 64 digits, in the file /home/ada/key of the server's user; or the address that `tenon console --role instructor` prints");
    assert.equal(needed, "die Rolle Ausbilder:in braucht den Schlüssel der Sitzung oder die Adresse, die `tenon console --role instructor` ausgibt");
    assert.equal(said(undefined, "this gateway was not started with --role instructor"), "diese Konsole wurde nicht mit `--role instructor` gestartet");
    assert.equal(said(undefined, "there is no session yet"), "es gibt noch keine Sitzung");
    assert.equal(reasonOf({ accepted: true, text: "there is no session yet" }), "there is no session yet");
    setLanguage("en");
    assert.equal(said("record_failed", "session 'a' is full"), "session 'a' is full");
    // who sits at a browser has no path of the server
    const english = said(undefined, "the role instructor needs the key of the session: 64 digits, in the file /home/ada/key of the server's user; or the address that `tenon console --role instructor` prints");
    assert.equal(english, "the role Instructor needs the key of the session, or the address that `tenon console --role instructor` prints");
  },

  "the problem of a recorder is in the page's language, and one without a rule as it is"() {
    const full = "/data/session.mcap: cannot write (No space left on device)";
    assert.equal(problemOfRecorder(full), "recording ended, /data/session.mcap cannot be written: the disk is full");
    setLanguage("de");
    assert.equal(problemOfRecorder(full), "Aufzeichnung beendet, /data/session.mcap ist nicht zu schreiben: der Datenträger ist voll");
    assert.equal(problemOfRecorder("a.mcap: cannot be closed (Stale file handle)"), "a.mcap war nicht zu schließen: Stale file handle");
    assert.equal(problemOfRecorder("the server is gone"), "the server is gone");
    setLanguage("en");
  },

  "a session by its name, of a gateway that shows another one alone, is said to be elsewhere"() {
    const standing = (chosen, only) => ({ live: { kind: "connecting" }, session: new Session(), chosen, only, age: 0, silence: 0 });
    const over = coverOf(standing("monday", "tuesday"));
    assert.deepEqual([over.state, over.head, over.leads], ["elsewhere", "Session monday is not shown here", "Show tuesday"]);
    assert.match(over.more, /^This console shows tuesday, and nothing else/);
    assert.equal(linkBadge(standing("monday", "tuesday"))[0], "link.elsewhere");
    for (const [chosen, only] of [["", "tuesday"], ["monday", "monday"], ["monday", ""]]) assert.equal(coverOf(standing(chosen, only)).state, "connecting", `${chosen} of ${only}`);
  },

  "the title of a scenario is in the page's language where the server tells it in several"() {
    const session = sessionOf();
    assert.equal(session.title, "Test", "of the announcement");
    session.receive("SceneTitle", { titles: [{ language: "en", text: "Engine bay" }, { language: "de", text: "Motorraum" }] }, false);
    assert.equal(session.title, "Engine bay");
    setLanguage("de");
    assert.equal(session.title, "Motorraum");
    setLanguage("en");
  },

  "the distance of two surfaces is that of their nearest points, wherever those are"() {
    const at = (x, y, z, turn = new Quaternion()) => new Matrix4().compose(new Vector3(x, y, z), turn, new Vector3(1, 1, 1));
    const box = Surface.ofBox([1, 1, 1], [0, 0, 0]);
    const turned = new Quaternion().setFromAxisAngle(new Vector3(0, 0, 1), Math.PI / 4);
    const near = (value, expected, what) => assert.ok(Math.abs(value - expected) < 1e-9, `${what}: ${value}, ${expected}`);
    const distance = (...of) => nearestOf(...of).distance;
    near(distance(box, at(0, 0, 0), box, at(3, 0.2, 0.1)), 2, "two faces");
    near(distance(box, at(0, 0, 0), box, at(3, 0, 0, turned)), 2.5 - Math.SQRT1_2, "a face and an edge");
    near(distance(box, at(5, 5, 5), box, at(7, 7, 7)), Math.sqrt(3), "two corners, away from the origin");
    near(distance(box, at(0, 0, 0), Surface.ofPoint(new Vector3()), at(0.2, -0.3, 2)), 1.5, "a face and a point");
    near(distance(box, at(0, 0, 0), box, at(0.5, 0.25, 0.1, turned)), 0, "they meet");
    // two edges that cross, neither of whose ends is near
    const triangle = (...corners) => {
      const mesh = new Mesh(new BufferGeometry().setAttribute("position", new Float32BufferAttribute(corners.flat(), 3)));
      return Surface.of(new Scene().add(mesh));
    };
    const along = triangle([-1, 0, 0], [1, 0, 0], [0, 0, -1]);
    const across = triangle([0, -1, 0.25], [0, 1, 0.25], [0, 0, 1]);
    near(distance(along, at(0, 0, 0), across, at(0, 0, 0)), 0.25, "two edges");
    const { a, b } = nearestOf(along, at(1, 2, 3), across, at(1, 2, 3));
    assert.deepEqual([a.toArray(), b.toArray()].map((place) => place.map((x) => Math.round(1e6 * x) / 1e6)), [[1, 2, 3], [1, 2, 3.25]], "in the world");
    assert.equal(nearestOf(box, at(0, 0, 0), Surface.of(new Scene()), at(0, 0, 0)), undefined);
  },

  "the tree of a surface finds what comparing all with all finds"() {
    let state = 7;
    const random = () => (state = (state * 16807) % 2147483647) / 2147483647;
    const soup = (count) => {
      const places = Array.from({ length: count }, () => {
        const middle = [random(), random(), random()];
        return Array.from({ length: 3 }, () => middle.map((x) => x + 0.1 * random())).flat();
      });
      const of = (all) => Surface.of(new Scene().add(new Mesh(new BufferGeometry().setAttribute("position", new Float32BufferAttribute(all.flat(), 3)))));
      return { whole: of(places), each: places.map((one) => of([one])) };
    };
    const [first, second] = [soup(60), soup(60)];
    for (let i = 0; i < 4; ++i) {
      const turn = new Quaternion(random(), random(), random(), random()).normalize();
      const X_WB = new Matrix4().compose(new Vector3(1.5 + random(), random(), random()), turn, new Vector3(1, 1, 1));
      const X_WA = new Matrix4().makeTranslation(0.1, 0.2, 0.3);
      const all = first.each.flatMap((one) => second.each.map((other) => nearestOf(one, X_WA, other, X_WB).distance));
      assert.ok(Math.abs(nearestOf(first.whole, X_WA, second.whole, X_WB).distance - Math.min(...all)) < 1e-12);
    }
  },

  "labels stay inside of the scene, and beside the tools and each other"() {
    const scene = { width: 580, height: 300 };
    const column = { x: 538, y: 10, width: 34, height: 192 };
    const label = (x, y) => ({ x, y, width: 130, height: 18 });
    const meets = (a, b) => a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
    for (const wishes of [[label(20, 50)], [label(394, 185), label(500, 185)], [label(570, 100), label(575, 104), label(560, 98)], [label(560, 295), label(562, 295)]]) {
      const placed = arrange(wishes, [column], scene);
      assert.equal(placed.length, wishes.length);
      placed.forEach((box, i) => {
        assert.ok(box.x >= 0 && box.y >= 0 && box.x + box.width <= scene.width && box.y + box.height <= scene.height, JSON.stringify(box));
        assert.ok(![column, ...placed.slice(0, i)].some((other) => meets(box, other)), JSON.stringify(placed));
        assert.ok(Math.abs(box.y - wishes[i].y) <= 80, "it is still seen of what it is");
      });
    }
    assert.deepEqual(arrange([label(20, 50)], [column], scene), [label(20, 50)], "what is free stays where it is");
    assert.deepEqual(arrange([label(20, 50)], [{ x: 0, y: 0, ...scene }], scene), [undefined], "what lies under something and has no free place near by is not shown");
    assert.deepEqual(arrange([label(0, 0), label(0, 0)], [], { width: 130, height: 18 })[1], label(0, 0), "labels alone hide none of them");
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

  "a second finger ends the drag of the first one, and the hand stays until a finger lands anew"() {
    const { point, where } = handOf();
    point("pointerdown", 1, 100, 100);
    point("pointermove", 1, 110, 100);
    assert.deepEqual(where(), [10, 0, 0]);
    point("pointerdown", 2, 200, 100);
    point("pointermove", 1, 150, 100);
    point("pointermove", 2, 250, 100);
    point("pointerup", 2, 250, 100);
    point("pointermove", 1, 160, 100);
    assert.deepEqual(where(), [10, 0, 0]);
    point("pointerup", 1, 160, 100);
    point("pointerdown", 1, 100, 100);
    point("pointermove", 1, 100, 80);
    assert.deepEqual(where(), [10, 0, 20]);
  },

  "targets are sent where the page may not ask for gamepads"() {
    const before = Object.getOwnPropertyDescriptor(globalThis, "navigator");
    try {
      for (const gamepads of [{}, { getGamepads: () => { throw new Error("SecurityError"); } }, { getGamepads: () => [null] }]) {
        Object.defineProperty(globalThis, "navigator", { value: gamepads, configurable: true });
        const { sent, tick } = handOf();
        tick();
        assert.equal(sent.length, 1);
      }
    } finally {
      delete globalThis.navigator;
      if (before !== undefined) Object.defineProperty(globalThis, "navigator", before);
    }
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
