// Plays small recordings with the page's own modules: what they tell a session at a place, and when a tick was.
// Usage: node play_recordings.mjs CONSOLE_SOURCES FOLDER_WITH_NODE_MODULES
import assert from "node:assert/strict";

import { loadPage, runTests } from "./page_loader.mjs";

const [sources, libraries] = process.argv.slice(2);
const { Recording, Session, McapWriter } = await loadPage(sources, libraries, [
  'export { Recording } from "./recording";', 'export { Session } from "./session";', 'export { McapWriter } from "@mcap/core";',
]);
const ZERO = { p: [0, 0, 0], q: [1, 0, 0, 0] };
const at = (id, x) => ({ object_id: id, epoch: 1, X_WO: { ...ZERO, p: [x, 0, 0] } });

/** A recording of [time in s, topic, message]. */
async function recorded(messages, metadata) {
  const parts = [];
  let size = 0n;
  const writable = { position: () => size, write: async (bytes) => void (parts.push(bytes.slice()), (size += BigInt(bytes.length))) };
  const writer = new McapWriter({ writable });
  await writer.start({ profile: "", library: "" });
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
  await writer.end();
  const file = Buffer.concat(parts);
  return { size: async () => BigInt(file.length), read: async (offset, length) => new Uint8Array(file.subarray(Number(offset), Number(offset + length))) };
}

async function opened(messages, metadata) {
  const session = new Session();
  const recording = await Recording.open(await recorded(messages, metadata), (topic, message, isGone) => session.receive(topic, message, isGone), () => undefined);
  return { session, recording };
}

const tests = {
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

  // lockstep: the first 1,000 ticks take 4 s. Then the server is killed, and resumed after 3 s at tick 900
  async "a tick is where its event was recorded, in lockstep and after a resume"() {
    const event = (seconds, tick, text) => [seconds, "EventLog", { seq: Math.round(seconds), tick, severity: 0, kind: "step", text }];
    const { recording } = await opened([event(0, 0, "a"), event(4, 1000, "b"), event(7, 900, "resumed"), event(8, 1900, "c"), [9, "TickStats_100", { tick: 2900 }]]);
    for (const mark of recording.marks) assert.equal(recording.secondsOf(mark.tick), mark.seconds, mark.text);
    assert.equal(recording.secondsOf(1950), 8.05);
    assert.equal(recording.secondsOf(500), 0.5);
  },

  // begun 60 s after the server: what that keeps for late joiners has its old times
  async "a recording that was begun late begins where its streams do"() {
    for (const announced of [60, 62]) { // the recorder's clock is right, or ahead of the server's
      const { session, recording } = await opened([
        [5, "SceneObject", { object_id: 1, name: "peg" }],
        [10, "EventLog", { seq: 1, tick: 5000, severity: 0, kind: "step", text: "a" }],
        [announced, "SessionAnnounce", { session: "late", title: "", lockstep: false, scene_hash: "", protocol_version: 1 }],
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
    const announce = [100, "SessionAnnounce", { session: "late", title: "", lockstep: true, scene_hash: "", protocol_version: 1 }];
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
