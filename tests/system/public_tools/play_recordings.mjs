// Plays small recordings with the page's own modules: what they tell a session at a place, and when a tick was.
// Usage: node play_recordings.mjs CONSOLE_SOURCES FOLDER_WITH_NODE_MODULES
import assert from "node:assert/strict";

import { loadPage, runTests } from "./page_loader.mjs";

globalThis.document = { documentElement: {} };
const [sources, libraries] = process.argv.slice(2);
const { fromFile, Recording, whyUnreadable, Session, McapWriter, setLanguage } = await loadPage(sources, libraries, [
  'export { fromFile, Recording, whyUnreadable } from "./recording";', 'export { Session } from "./session";', 'export { McapWriter } from "@mcap/core";', 'export { setLanguage } from "./strings";',
]);
const ZERO = { p: [0, 0, 0], q: [1, 0, 0, 0] };
const at = (id, x) => ({ object_id: id, epoch: 1, X_WO: { ...ZERO, p: [x, 0, 0] } });

/** A file that is written, and what reads it. */
async function started(options) {
  const parts = [];
  let size = 0n;
  const writable = { position: () => size, write: async (bytes) => void (parts.push(bytes.slice()), (size += BigInt(bytes.length))) };
  const writer = new McapWriter({ writable, ...options });
  await writer.start({ profile: "", library: "" });
  const whole = async () => {
    await writer.end();
    const file = Buffer.concat(parts);
    return { size: async () => BigInt(file.length), read: async (offset, length) => new Uint8Array(file.subarray(Number(offset), Number(offset + length))) };
  };
  return { writer, whole };
}

/** A recording of [time in s, topic, message]; without such a topic no session is announced. */
async function recorded(messages, metadata, options) {
  const { writer, whole } = await started(options);
  const channels = new Map();
  for (const [seconds, topic, message] of messages) {
    if (!channels.has(topic)) {
      const schemaId = await writer.registerSchema({ name: topic, encoding: "jsonschema", data: new Uint8Array() });
      channels.set(topic, await writer.registerChannel({ topic, schemaId, messageEncoding: "json", metadata: new Map() }));
    }
    const time = BigInt(Math.round(seconds * 1e9));
    await writer.addMessage({ channelId: channels.get(topic), sequence: 0, logTime: time, publishTime: time, data: new TextEncoder().encode(JSON.stringify(message)) });
  }
  if (metadata !== undefined) await writer.addMetadata({ name: "tenon recording", metadata: new Map(Object.entries(metadata)) });
  return whole();
}

/** A file of one other program's messages. */
async function foreign(topic, messageEncoding, schema, encoding) {
  const { writer, whole } = await started();
  const schemaId = await writer.registerSchema({ name: schema, encoding, data: new Uint8Array([1, 2, 3]) });
  const channelId = await writer.registerChannel({ topic, schemaId, messageEncoding, metadata: new Map() });
  for (let i = 0n; i < 100n; ++i) await writer.addMessage({ channelId, sequence: 0, logTime: i, publishTime: i, data: new Uint8Array(8) });
  return whole();
}

const ANNOUNCED = { session: "test", title: "", lockstep: false, scene_hash: "", protocol_version: 1 };

/** `told`: how many messages the recording has told. */
async function opened(messages, metadata) {
  const session = new Session();
  const told = { count: 0 };
  const isAnnounced = messages.some(([, topic]) => topic === "SessionAnnounce");
  const readable = await recorded(isAnnounced ? messages : [[messages[0][0], "SessionAnnounce", ANNOUNCED], ...messages], metadata);
  const recording = await Recording.open(readable, (topic, message, isGone) => (++told.count, session.receive(topic, message, isGone)), () => undefined);
  return { session, recording, told };
}

const tests = {
  // their encodings and schemas are not the page's, and it does not come so far as to read them
  async "a file of other messages, and a journal, are refused with the reason, in each language"() {
    const inputs = Array.from({ length: 100 }, (_, tick) => [tick / 1000, "TickInput", { tick }]);
    const files = [
      [await foreign("imu", "ros1", "sensor_msgs/Imu", "ros1msg"), /written by something else/, /hat etwas anderes geschrieben/],
      [await foreign("Telemetry", "protobuf", "car.Telemetry", "protobuf"), /written by something else/, /hat etwas anderes geschrieben/],
      [await recorded([...inputs, [0.1, "Checkpoint", {}]]), /journal of a server.*`tenon resimulate FILE`/, /Journal eines Servers.*`tenon resimulate FILE`/],
      [await recorded([[0, "WorldFrame_100", { part: 0, parts: 1, tick: 0, states: [] }]]), /written by something else/, /hat etwas anderes geschrieben/],
    ];
    for (const [file, ...reasons] of files)
      for (const [i, language] of ["en", "de"].entries()) {
        setLanguage(language);
        await assert.rejects(Recording.open(file, () => assert.fail("nothing is told"), () => undefined), reasons[i]);
      }
    setLanguage("en");
  },

  // each is too short for an index, or for where it says that its index is
  async "a file that is no recording, and one that was cut off, are refused with what they are"() {
    const whole = await recorded([[0, "SessionAnnounce", ANNOUNCED], [0, "WorldFrame_100", { part: 0, parts: 1, tick: 0, states: [] }]]);
    const bytes = await whole.read(0n, await whole.size());
    const open = (...parts) => Recording.open(fromFile(new Blob(parts)), () => undefined, () => undefined);
    const rows = [
      ["hello", /written by something else/], ["a longer text ".repeat(30), /written by something else/], [new Uint8Array(300_000), /written by something else/], ["", /is empty: no message/],
      ...[8, 12, 20, 40, bytes.length - 100, bytes.length - 1].map((length) => [bytes.subarray(0, length), /was cut off before its end/]),
    ];
    for (const [file, reason] of rows) await assert.rejects(open(file), reason, `${file.length} bytes`);
    assert.equal((await open(bytes)).seconds, 0);
  },

  async "what is wrong with a file is said with its name and what reads it, and without the words of a library"() {
    const whole = await recorded([[0, "SessionAnnounce", ANNOUNCED], [0, "WorldFrame_100", { part: 0, parts: 1, tick: 0, states: [] }]]);
    const bytes = Buffer.from(await whole.read(0n, await whole.size()));
    const empty = async (options) => {
      const { writer, whole } = await started(options);
      await writer.registerSchema({ name: "a", encoding: "jsonschema", data: new Uint8Array() });
      return whole();
    };
    const unindexed = { useSummaryOffsets: false, useChunks: false, useStatistics: false, repeatSchemas: false, repeatChannels: false, useAttachmentIndex: false, useMetadataIndex: false };
    const changed = (at) => {
      const copy = Buffer.from(bytes);
      copy[at] ^= 0xff;
      return fromFile(new Blob([copy]));
    };
    const footer = bytes.length - 8 - 20;
    const messages = bytes.indexOf("SessionAnnounce");
    const moved = { size: async () => 1000n, read: () => Promise.reject(new DOMException("gone", "NotFoundError")) };
    const rows = [
      [await empty(), "is empty: no message was recorded"], [await empty(unindexed), "is empty: no message was recorded"],
      [await recorded([[0, "SessionAnnounce", ANNOUNCED]], undefined, unindexed), "was written without an index.*`tenon report a b.mcap`"],
      [changed(messages), "part of it is damaged.*`tenon report a b.mcap`"], [changed(footer + 2), "damaged.*`tenon report a b.mcap`"], [changed(footer - 12), "part of it is damaged.*`tenon report a b.mcap`"],
      [moved, "no longer where it was"],
    ];
    for (const [file, reason] of rows) {
      const problem = await Recording.open(file, () => undefined, () => undefined).then(() => assert.fail(reason), (problem) => problem);
      assert.match(whyUnreadable(problem, "a b.mcap"), new RegExp(reason));
    }
  },

  async "a seek tells what stations said last of their links"() {
    const link = (seconds, age) => [seconds, "Telemetry", { client_id: 1, samples: 5, age, jitter: 0, answers_lost: 0, inputs_lost: 0 }];
    const { session, recording } = await opened([
      [0, "WorldFrame_30", { part: 0, parts: 1, tick: 0, states: [at(1, 0)] }], link(0.5, 0.01), link(1.5, 0.02), [2.4, "WorldFrame_30", { part: 0, parts: 1, tick: 2400, states: [at(1, 1)] }], link(2.5, 0.03),
    ]);
    await recording.seek(2.4);
    assert.equal(session.telemetry.get(1).age, 0.02);
    assert.equal(session.tracks.of("age 1").times.at(-1), 2.4);
  },

  async "a seek tells of each state the newest message, however many there are"() {
    const messages = [[0, "WorldFrame_30", { part: 0, parts: 1, tick: 0, states: [at(1, 0)] }], [0, "SceneStep", { step: 0, steps: 1, name: "take", title: [], part: "" }]];
    const add = (seconds, topic, message) => messages.push([seconds, topic, message]);
    const raise = (counter) => ({ client_guid: "a", counter, who: "", reason: "" });
    const person = (client_id, more) => ({ client_id, name: `${client_id}`, role: 3, hands: [], alive: true, ...more });
    add(0, "EventLog", { seq: 0, tick: 0, severity: 0, kind: "step", text: "take" });
    add(0.01, "EventLog", { seq: 1, tick: 10, severity: 0, kind: "step done", text: "take (0.01 s)" });
    for (let i = 1; i <= 2000; ++i) {
      const seconds = i / 1000;
      add(seconds, "EmergencyStop", raise(i));
      if (i % 500 !== 0) add(seconds, "EmergencyClear", raise(i));
      add(seconds, "Presence", person(i));
      if (i % 1000 !== 0) add(seconds, "__instance_state", { topic: "Presence", key_sample: [...new TextEncoder().encode(JSON.stringify(person(i)))] });
      add(seconds, "GrabState", { object_id: 1, hand_id: i });
      add(seconds, "EventLog", { seq: 1 + i, tick: i, severity: 0, kind: "note", text: "" });
      add(seconds, "ClientEvent", { client_id: 1, seq: i, tick: i, kind: "safety", text: "" });
    }
    add(3, "EmergencyStop", raise(1)); // told again, after its clear
    const { session, recording, told } = await opened(messages);
    for (const [seconds, standing, people, hand] of [[2, [2000], [1000, 2000], 2000], [1.2, [], [1000], 1200], [0.9, [], [], 900]]) {
      told.count = 0;
      session.reset();
      await recording.seek(seconds);
      assert.ok(told.count < 450, `${told.count} messages`);
      assert.deepEqual(session.standing.map(({ counter }) => counter), standing);
      assert.deepEqual([...session.people.keys()], people);
      assert.equal(session.grabs.get(1).hand_id, hand);
      assert.deepEqual(["note", "safety"].map((kind) => session.events.filter((event) => event.kind === kind).at(-1).tick), [1000 * seconds, 1000 * seconds]);
      assert.equal(session.steps[0].phase, 2, "of steps all events are told");
    }
    await recording.advance(3);
    assert.deepEqual(session.standing.map(({ counter }) => counter), [2000], "a raise that was cleared does not stand when it is told again");
  },

  // what a station tells once holds for every place after it
  async "the device of a hand is known with its reach"() {
    const { session, recording } = await opened([
      [0, "SceneHand", { hand_id: 3, name: "right", role: 2, object_id: 9 }],
      [0, "ClientEvent", { client_id: 1, seq: 1, tick: 0, kind: "device", text: "hand right: sigma.7 (simulated), workspace radius 0.060 m" }],
      [0.1, "WorldFrame_100", { part: 0, parts: 1, tick: 100, states: [at(1, 0)] }],
      [1, "WorldFrame_100", { part: 0, parts: 1, tick: 1000, states: [at(1, 1)] }],
    ]);
    await recording.seek(0.9);
    assert.deepEqual(session.deviceOf(3), { model: "sigma.7 (simulated)", radius: 0.06 });
    assert.equal(session.deviceOf(4), undefined);
    assert.equal(session.events.length, 0, "it is no event for people");
  },

  // object 1 moves until 1.5 s and rests then, object 2 always moves: frames of 100 Hz have what moves, those of 30 Hz all
  async "a seek shows a part that has come to rest where it rests"() {
    const messages = [];
    for (let tick = 0; tick < 3000; tick += 10) {
      const place = (id) => at(id, Math.min(tick, id === 1 ? 1500 : 3000) / 1000);
      const states = tick <= 1500 ? [place(1), place(2)] : [place(2)];
      if (tick % 1000 === 0) for (const id of [1, 2]) messages.push([tick / 1000, "ObjectSnapshot", { object_id: id, tick, state: place(id) }]);
      messages.push([tick / 1000, "WorldFrame_100", { part: 0, parts: 1, tick, states }]);
      if (tick % 30 === 0) messages.push([tick / 1000, "WorldFrame_30", { part: 0, parts: 1, tick, states: [place(1), place(2)] }]);
    }
    const { session, recording } = await opened(messages);
    await recording.seek(1.995);
    assert.equal(session.states.get(1).X_WO.p[0], 1.5);
    assert.equal(session.states.get(2).X_WO.p[0], 1.99);
    // and nothing moves back while it is played
    let last = 0;
    for (let time = 2; time < 2.9; time += 0.005) {
      await recording.advance(time);
      const x = session.states.get(2).X_WO.p[0];
      assert.ok(x >= last, `${x} m after ${last} m`);
      last = x;
      assert.equal(session.states.get(1).X_WO.p[0], 1.5);
    }
    assert.ok(last > 2.88);
  },

  // in lockstep who joins before the first tick does so by the recorder's clock
  async "a tick before that of the first mark is where its event was recorded, too"() {
    const event = (seconds, tick) => [seconds, "EventLog", { seq: tick, tick, severity: 0, kind: "join", text: "" }];
    const { recording } = await opened([event(1, 1), event(1.02, 0)]);
    assert.equal(recording.secondsOf(0), 0.02);
  },

  // lockstep: the first 1,000 ticks take 4 s. Then the server is killed, and resumed after 3 s at tick 900
  async "a tick is where its event was recorded, in lockstep and after a resume"() {
    const event = (seconds, tick, text) => [seconds, "EventLog", { seq: Math.round(seconds), tick, severity: 0, kind: "step", text }];
    const { recording } = await opened([event(0, 0, "a"), event(4, 1000, "b"), event(7, 900, "resumed"), event(8, 1900, "c"), [9, "TickStats_100", { tick: 2900 }]]);
    for (const mark of recording.marks) assert.equal(recording.secondsOf(mark.tick), mark.seconds, mark.text);
    assert.equal(recording.secondsOf(1950), 8.05);
    assert.equal(recording.secondsOf(500), 0.5);
  },

  // people are waited for during 30 s: what happens then has tick 0
  async "the player's clock is that of the session, and what comes before the first tick is less than 0"() {
    const event = (seconds, tick, kind) => [seconds, "EventLog", { seq: Math.round(100 * seconds), tick, severity: 0, kind, text: "" }];
    const frame = (seconds, tick) => [seconds, "WorldFrame_100", { part: 0, parts: 1, tick, states: [at(1, 1)] }];
    const { recording } = await opened([[0, "SessionAnnounce", ANNOUNCED], event(0.5, 0, "join"), event(29.99, 0, "run"), event(30.001, 1, "step"), frame(30.01, 10), event(40, 10000, "mounted"), frame(50, 20000)]);
    const near = (a, b) => assert.ok(Math.abs(a - b) < 1e-6, `${a} s, expected ${b} s`);
    near(recording.sessionTimeOf(0), -30);
    near(recording.sessionTimeOf(30), 0);
    near(recording.sessionTimeOf(45), 15);
    // a row of a table leads to a place of its time
    for (const tick of [10, 5000, 10000, 15000]) near(recording.sessionTimeOf(recording.secondsOf(tick)), tick / 1000);
    near(recording.secondsOf(-10000), 20);
  },

  // begun 60 s after the server: what that keeps for late joiners has its old times
  async "a recording that was begun late begins where its streams do"() {
    for (const announced of [60, 62]) { // the recorder's clock is right, or ahead of the server's
      const { session, recording } = await opened([
        [5, "SceneObject", { object_id: 1, name: "peg" }],
        [10, "EventLog", { seq: 1, tick: 5000, severity: 0, kind: "step", text: "a" }],
        [announced, "SessionAnnounce", ANNOUNCED],
        [60.1, "WorldFrame_100", { part: 0, parts: 1, tick: 55100, states: [at(1, 1)] }],
        [70, "WorldFrame_100", { part: 0, parts: 1, tick: 65000, states: [at(1, 2)] }],
      ]);
      const begin = Math.min(announced, 60.1);
      assert.ok(Math.abs(recording.seconds - (70 - begin)) < 1e-6, `${recording.seconds} s`);
      await recording.seek(0.2);
      assert.equal(session.objects.size, 1);
      assert.equal(session.events.length, 1, "what was before is known");
      assert.equal(session.states.get(1).X_WO.p[0], 1);
      assert.ok(Math.abs(recording.secondsOf(65000) - (70 - begin)) < 1e-6, "a tick is counted from the event before the beginning");
    }
  },

  // times are those of ticks since the recorder began: 60 s of them are not in it
  async "a recording in lockstep that was begun late begins where its streams do"() {
    const announce = [100, "SessionAnnounce", { ...ANNOUNCED, lockstep: true }];
    const frames = [60, 65].map((seconds) => [100 + seconds, "WorldFrame_100", { part: 0, parts: 1, tick: 1000 * seconds, states: [at(1, 1)] }]);
    const { recording } = await opened([announce, ...frames], { lockstep: "yes" });
    assert.equal(recording.seconds, 5);
    // in real time that is a session that waited for people
    assert.equal((await opened([announce, ...frames], { lockstep: "no" })).recording.seconds, 65);
  },

  async "what is plotted before a place have the session's times"() {
    const messages = [[0, "EventLog", { seq: 1, tick: 0, severity: 0, kind: "step", text: "a" }]];
    for (let i = 1; i <= 100; ++i) {
      messages.push([i / 25, "TickStats_100", { tick: 10 * i }]);
      messages.push([i / 25, "HandState_100", { hand_id: 0, F_Ho_W: { force: [i, 0, 0], torque: [0, 0, 0] } }]);
    }
    const { recording } = await opened(messages);
    const { times, values } = (await recording.tracksBefore(2, 1)).of("force 0");
    assert.deepEqual([times.at(-1), values.at(-1)], [0.5, 50]);
  },
};

await runTests(tests);
