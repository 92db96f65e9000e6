// A recording, read where it is needed: by its index, in ranges of a file or of what the gateway serves. What it says goes the same way as what
// a live session says.
import { McapIndexedReader } from "@mcap/core";
import { decompress } from "fzstd";

import { decoderOf, type Decoder } from "./decode";
import { History, type Message } from "./history";
import { INSTANCE_STATE, type Handler } from "./live";
import type { ConsoleState, ContactPairs, EventLog, HandState, InstanceGone, SceneUpdate, SessionAnnounce, Telemetry, TickStats } from "./messages";
import { t, type Key } from "./strings";
import { Tracks } from "./tracks";

// states, events and what is seldom told: read once, and then known for every moment
const KEPT = [
  "SessionAnnounce", "SceneObject", "SceneHand", "SceneStep", "SceneTitle", "ObjectSnapshot", "StepState", "RunState", "GrabState", "Presence", "EmergencyStop", "EmergencyClear", "EventLog", "ClientEvent",
  "Telemetry", INSTANCE_STATE,
];
// streams: the newest of each instance is read before a moment
const STREAMS = ["WorldFrame_100", "HandState_100", "ContactPairs_100", "TickStats_100", "StepProgress"];
const ALL_OBJECTS = "WorldFrame_30"; // has those that rest, too; a seek alone reads it
const BEFORE = [150_000_000n, 1_000_000_000n, 8_000_000_000n]; // [ns] in which a frame of all objects is looked for: in real time some are lost
const PLOTTED = ["HandState_100", "ContactPairs_100", "TickStats_100", "Telemetry"]; // each sample has the maxima since the one before
const ENDING = "Presence"; // of whose instances the end counts
const INPUTS = "TickInput"; // of a journal
const YIELD = 500; // messages that are read at a time, of many
const CHUNKS = 24; // decompressed ones that are kept, of about 1 MB: seeking and playing read the same again
const BLOCK = 1 << 19; // bytes that are read at a time
const BLOCKS = 48; // that are kept
const LARGEST = 1 << 26; // bytes of a chunk
const LARGEST_WHOLE = 1 << 28; // bytes of a file that is read as a whole, where a server has no ranges

/** Why a recording cannot be played. */
export class Unreadable extends Error {
  constructor(private key: Key, private values: Record<string, string | number> = {}) {
    super(t(key, { name: "FILE", ...values }));
  }

  /** In the language of the page, of the file of this name. */
  of(name: string): string {
    return t(this.key, { name, ...this.values });
  }
}

/** Likewise of whatever went wrong: what the library and the browser say of a file, nobody who plays it understands. */
export function whyUnreadable(problem: unknown, name: string): string {
  const known = problem instanceof Unreadable ? problem : new Unreadable(problem instanceof DOMException ? "file.moved" : "file.damaged");
  return known.of(name);
}

const MAGIC = [0x89, 0x4d, 0x43, 0x41, 0x50, 0x30, 0x0d, 0x0a]; // with which an MCAP file begins and ends

interface Readable { size(): Promise<bigint>; read(offset: bigint, size: bigint): Promise<Uint8Array> }

/** Reads in blocks and keeps the last ones. */
class Blocks implements Readable {
  private blocks = new Map<number, Promise<Uint8Array>>();

  constructor(private bytes: number, private load: (begin: number, end: number) => Promise<Uint8Array>) {}

  size(): Promise<bigint> {
    return Promise.resolve(BigInt(this.bytes));
  }

  async read(offset: bigint, size: bigint): Promise<Uint8Array> {
    const begin = Number(offset);
    const end = begin + Number(size);
    if (end > this.bytes || Number(size) > LARGEST) throw new Unreadable("file.index");
    const result = new Uint8Array(end - begin);
    for (let block = Math.floor(begin / BLOCK); block * BLOCK < end; ++block) {
      const from = Math.max(begin, block * BLOCK);
      const part = (await this.block(block)).subarray(from - block * BLOCK, Math.min(end, (block + 1) * BLOCK) - block * BLOCK);
      result.set(part, from - begin);
    }
    return result;
  }

  private block(index: number): Promise<Uint8Array> {
    let block = this.blocks.get(index);
    if (block === undefined) block = this.load(index * BLOCK, Math.min(this.bytes, (index + 1) * BLOCK));
    this.blocks.delete(index); // the newest at the end
    this.blocks.set(index, block);
    block.catch(() => this.blocks.delete(index));
    if (this.blocks.size > BLOCKS) this.blocks.delete(this.blocks.keys().next().value as number);
    return block;
  }
}

export function fromFile(file: File): Readable {
  return new Blocks(file.size, async (begin, end) => new Uint8Array(await file.slice(begin, end).arrayBuffer()));
}

/** Of a recording that is inside the page. */
export function fromBytes(bytes: Uint8Array): Readable {
  return new Blocks(bytes.length, (begin, end) => Promise.resolve(bytes.subarray(begin, end)));
}

/** `address`: relative to the page. Of another server than the page's it is there when both permit it. */
export async function fromAddress(address: string): Promise<Readable> {
  const url = URL.canParse(address, location.href) ? new URL(address, location.href) : undefined;
  if (url === undefined || !["http:", "https:"].includes(url.protocol)) throw new Unreadable("file.address", { url: address });
  const { origin, href } = url;
  const ask = async (options: RequestInit): Promise<Response> => {
    const answer = await fetch(href, options).catch(() => undefined);
    if (answer === undefined) throw origin === location.origin ? new Unreadable("file.unreachable", { url: href }) : new Unreadable("file.elsewhere", { url: href, origin });
    if (!answer.ok) throw new Unreadable("file.status", { url: href, status: answer.status });
    return answer;
  };
  const load = (begin: number, end: number): Promise<Response> => ask({ headers: { Range: `bytes=${begin}-${end - 1}` } });
  const first = await load(0, 1);
  const lengthOf = ({ headers }: Response): number => Number(headers.get("Content-Length") ?? NaN);
  if (first.status !== 206) {
    if (!(lengthOf(first) <= LARGEST_WHOLE)) throw new Unreadable("file.ranges", { url: href });
    return fromBytes(new Uint8Array(await first.arrayBuffer()));
  }
  // a server elsewhere may keep this header from the page
  const size = Number(first.headers.get("Content-Range")?.split("/")[1] ?? lengthOf(await ask({ method: "HEAD" })));
  if (!Number.isFinite(size)) throw new Unreadable("file.ranges", { url: href });
  return new Blocks(size, async (begin, end) => new Uint8Array(await (await load(begin, end)).arrayBuffer()));
}

/**
 * For a chunk. fzstd compares it with a number, for which JavaScript writes all of its bytes as a text first: without this method that takes ten times as long as
 * decompressing.
 */
function bufferOf(size: number): Uint8Array {
  return Object.defineProperty(new Uint8Array(size), Symbol.toPrimitive, { value: () => NaN });
}

/** Decompresses chunks and keeps the last ones. */
class Chunks {
  private kept = new Map<string, Uint8Array>();

  readonly zstd = (bytes: Uint8Array, size: bigint): Uint8Array => {
    if (size > BigInt(LARGEST)) throw new Unreadable("file.index");
    // as FNV-1a, of words; the reader checks the sum of what it gets
    const words = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    let hash = 0x811c9dc5;
    for (let i = 0; i + 4 <= bytes.length; i += 4) {
      hash = Math.imul(hash ^ words.getUint32(i, true), 0x01000193);
      hash ^= hash >>> 15;
    }
    const name = `${bytes.length} ${size} ${hash}`;
    const chunk = this.kept.get(name) ?? decompress(bytes, bufferOf(Number(size)));
    this.kept.delete(name); // the newest at the end
    this.kept.set(name, chunk);
    if (this.kept.size > CHUNKS) this.kept.delete(this.kept.keys().next().value as string);
    return chunk;
  };
}

const FIRST_POSES = 40_000_000n; // [ns] in which the parts of a frame come

interface Sample extends Message { data: Uint8Array }
type Reading = AsyncGenerator<{ logTime: bigint; channelId: number; data: Uint8Array }, void, void>;
export interface Mark { seconds: number; tick: number; kind: string; text: string; severity: number }

let opened = 0; // recordings, by this page

/**
 * When a recording begins. What the server keeps for those who join late has the times of before: the announcement is written at the beginning, by the clock of the
 * recorder, and the streams begin with it, by the server's.
 */
async function beginOf(reader: McapIndexedReader, first: bigint): Promise<bigint> {
  const firstOf = async (topics: string[]): Promise<bigint | undefined> => {
    for await (const { logTime } of reader.readMessages({ topics })) return logTime;
    return undefined;
  };
  const announced = await firstOf(["SessionAnnounce"]);
  if (announced === undefined) return first;
  const streamed = (await firstOf([...STREAMS, ALL_OBJECTS])) ?? announced;
  // in lockstep the times of streams are their ticks
  return streamed < announced || (await isInLockstep(reader)) ? streamed : announced;
}

/** Why a file with messages is no recording that can be played, as refusalOfKind() of idl/record/recording_kind.cpp has it. */
function refuseKind(reader: McapIndexedReader): void {
  const topics = [...reader.channelsById.values()].map(({ topic }) => topic);
  if (!topics.includes("SessionAnnounce")) throw new Unreadable(topics.includes(INPUTS) ? "file.journal" : "file.foreign");
}

/** Why a file is no MCAP file that is complete, by its first and last bytes: no index is looked for in another one. */
async function refuseOther(readable: Readable): Promise<void> {
  const size = await readable.size();
  if (size === 0n) throw new Unreadable("file.empty");
  const long = BigInt(MAGIC.length);
  const isMagic = async (offset: bigint): Promise<boolean> => {
    const bytes = await readable.read(offset, long);
    return MAGIC.every((byte, i) => bytes[i] === byte);
  };
  if (size < long || !(await isMagic(0n))) throw new Unreadable("file.foreign");
  if (size < 2n * long || !(await isMagic(size - long))) throw new Unreadable("file.cut");
  if (await hasSummary(readable, size)) return;
  throw new Unreadable((await hasMessages(readable, size)) ? "file.no_index" : "file.empty");
}

// records of MCAP: what they are, and how long
const RECORD_HEAD = 9n;
const [MESSAGE, CHUNK] = [0x05, 0x06];
const FOOTER = 20n; // bytes of the last record

async function hasSummary(readable: Readable, size: bigint): Promise<boolean> {
  const at = size - BigInt(MAGIC.length) - FOOTER;
  if (at < 0n) return false;
  const start = await readable.read(at, 8n);
  return start.some((byte) => byte !== 0);
}

/** Of a file without a summary, which would say so. */
async function hasMessages(readable: Readable, size: bigint): Promise<boolean> {
  for (let at = BigInt(MAGIC.length); at + RECORD_HEAD <= size; ) {
    const head = await readable.read(at, RECORD_HEAD);
    if (head[0] === MESSAGE || head[0] === CHUNK) return true;
    at += RECORD_HEAD + new DataView(head.buffer, head.byteOffset).getBigUint64(1, true);
  }
  return false;
}

async function isInLockstep(reader: McapIndexedReader): Promise<boolean> {
  for await (const { metadata } of reader.readMetadata({ name: "tenon recording" })) return metadata.get("lockstep") === "yes";
  return false;
}

export class Recording {
  /** What happened, by the server's log, in s since the beginning of the recording. */
  marks: Mark[] = [];
  private history = new History();
  private decoders = new Map<number, { topic: string; decode: Decoder }>();
  private reading?: Reading;
  private next?: Sample;
  private streams = STREAMS;
  private life = -1 - ++opened; // no live session's: the scene of another recording is another one

  /** The first tick that is recorded as a stream. */
  private first?: { seconds: number; tick: number };

  private constructor(private reader: McapIndexedReader, private handler: Handler, readonly begin: bigint, readonly seconds: number) {}

  /** Fails with the reason when it is no recording, or was cut before its index. */
  static async open(readable: Readable, handler: Handler, onProgress: (fraction: number) => void): Promise<Recording> {
    await refuseOther(readable);
    const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers: { zstd: new Chunks().zstd } }).catch((problem: unknown) => {
      console.warn(problem); // what the library found instead, in its words
      throw problem instanceof Unreadable || problem instanceof DOMException ? problem : new Unreadable("file.damaged");
    });
    const { statistics } = reader;
    if (statistics === undefined) throw new Unreadable("file.no_index");
    if (statistics.messageCount === 0n) throw new Unreadable("file.empty");
    refuseKind(reader);
    const begin = await beginOf(reader, statistics.messageStartTime);
    const recording = new Recording(reader, handler, begin, Number(statistics.messageEndTime - begin) / 1e9);
    for (const channel of reader.channelsById.values()) recording.addChannel(channel.id);
    // a recording inside a report has no faster poses
    if (![...recording.decoders.values()].some(({ topic }) => topic === "WorldFrame_100")) recording.streams = [...STREAMS, ALL_OBJECTS];
    await recording.readKept(onProgress);
    await recording.readFirst();
    return recording;
  }

  private addChannel(id: number): void {
    const topic = this.reader.channelsById.get(id)?.topic ?? "";
    const decode = [...KEPT, ...STREAMS, ALL_OBJECTS].includes(topic) ? this.decoderOf(id) : undefined;
    if (decode !== undefined) this.decoders.set(id, { topic, decode });
  }

  private decoderOf(id: number): Decoder | undefined {
    const channel = this.reader.channelsById.get(id);
    const schema = this.reader.schemasById.get(channel?.schemaId ?? 0);
    if (channel === undefined || schema === undefined) return undefined;
    const text = new TextDecoder().decode(schema.data);
    return decoderOf({ id, topic: channel.topic, encoding: channel.messageEncoding, schemaName: schema.name, schema: text, schemaEncoding: schema.encoding });
  }

  private async readKept(onProgress: (fraction: number) => void): Promise<void> {
    let read = 0;
    for await (const { logTime, channelId, data } of this.reader.readMessages({ topics: KEPT })) {
      if (++read % 50 === 0) onProgress(Math.max(0, Number(logTime - this.begin)) / 1e9 / Math.max(this.seconds, 1e-9));
      const channel = this.decoders.get(channelId);
      if (channel === undefined) continue;
      const own = data.slice(); // the whole chunk is not kept
      if (channel.topic === "ObjectSnapshot") this.history.add(channel.topic, { time: logTime, channel: channelId, data: own }, this.instanceOf(channelId, own)); // few of them are told
      else this.keep(logTime, channelId, channel.topic, channel.decode(own));
    }
  }

  private keep(time: bigint, channel: number, topic: string, message: unknown): void {
    if (topic === INSTANCE_STATE) return this.keepEnd(time, message as InstanceGone);
    this.history.add(topic, { time, channel, message });
    if (topic === "EventLog") this.mark(time, message as EventLog);
  }

  private keepEnd(time: bigint, { topic, key_sample }: InstanceGone): void {
    const ended = topic === ENDING ? [...this.decoders].find(([, other]) => other.topic === topic) : undefined;
    if (ended !== undefined) this.history.add(topic, { time, channel: ended[0], message: ended[1].decode(Uint8Array.from(key_sample)), isGone: true });
  }

  private mark(time: bigint, { kind, text, severity, tick }: EventLog): void {
    this.marks.push({ seconds: Number(time - this.begin) / 1e9, tick: Number(tick), kind, text, severity });
  }

  /** When a tick was, in s since the beginning: counted from the last mark before it, since ticks are no clock in lockstep, at a pause, and while no server ran. */
  secondsOf(tick: number): number {
    if (tick < 0 && this.first !== undefined) return this.first.seconds + (tick - this.first.tick) / 1000;
    let before: Mark | undefined;
    for (const mark of this.marks) if (mark.tick <= tick && mark.tick >= (before?.tick ?? 0)) before = mark;
    const from = before ?? this.marks[0] ?? { seconds: 0, tick: 0 };
    return from.seconds + (tick - from.tick) / 1000;
  }

  private async readFirst(): Promise<void> {
    for await (const { logTime, channelId, data } of this.reader.readMessages({ topics: ["TickStats_100", "WorldFrame_100", ALL_OBJECTS] })) {
      const { tick } = this.decoders.get(channelId)?.decode(data) as TickStats;
      this.first = { seconds: Number(logTime - this.begin) / 1e9, tick: Number(tick) };
      return;
    }
  }

  /**
   * The session's own time [s], 0 at its first tick and less before it, at a place of the recording: counted from the last event or the first tick before it, and never beyond the
   * next event.
   */
  sessionTimeOf(seconds: number): number {
    const first = this.first ?? this.marks.find(({ tick }) => tick > 0) ?? { seconds: 0, tick: 0 };
    const from = this.marks.filter((mark) => mark.seconds >= first.seconds && mark.seconds <= seconds && mark.tick > 0).pop() ?? first;
    const time = from.tick / 1000 + seconds - from.seconds;
    const next = this.marks.find((mark) => mark.seconds > seconds && mark.seconds > from.seconds && mark.tick >= from.tick);
    return next === undefined ? time : Math.min(time, next.tick / 1000);
  }

  private timeOf(seconds: number): bigint {
    return this.begin + BigInt(Math.round(1e9 * Math.min(this.seconds, Math.max(0, seconds))));
  }

  private tell({ channel, data, message: decoded, isGone = false }: Message): void {
    const known = this.decoders.get(channel);
    if (known === undefined) return;
    const message = decoded ?? known.decode(data ?? new Uint8Array());
    if (known.topic === "SessionAnnounce") return this.tellLink(message as SessionAnnounce);
    if (known.topic !== INSTANCE_STATE) return this.handler(known.topic === ALL_OBJECTS ? "WorldFrame_100" : known.topic, message, isGone);
    const { topic, key_sample } = message as InstanceGone;
    const ended = [...this.decoders.values()].find((other) => other.topic === topic);
    if (ended !== undefined) this.handler(topic, ended.decode(Uint8Array.from(key_sample)), true);
  }

  private tellLink(announce: SessionAnnounce): void {
    const link: ConsoleState = {
      state: "recorded", reason: "", life: this.life, session: announce.session, title: announce.title, lockstep: announce.lockstep, scene: announce.scene_hash,
      protocol: announce.protocol_version, modelOf: (object) => this.modelOf(object),
    };
    this.handler("/console", link, false);
  }

  /** The display model of an object, which the recorder kept for public viewers. Fails where there is none. */
  private async modelOf(object: string): Promise<ArrayBuffer> {
    const topic = `/scene/${object}`;
    for await (const { channelId, data } of this.reader.readMessages({ topics: [topic] })) {
      const { entities } = this.decoderOf(channelId)?.(data) as SceneUpdate;
      const model = entities[0]?.models[0]?.data;
      if (model !== undefined) return model.slice().buffer;
    }
    throw new Error(`${topic} is not in the recording, or a box`);
  }

  /** Emits the state at a time: kept messages, snapshots, newest stream samples. What was told before is to be forgotten. */
  async seek(seconds: number): Promise<void> {
    const time = this.timeOf(seconds);
    this.reading = undefined;
    this.next = undefined;
    for (const message of this.history.until(time)) this.tell(message);
    let hasAll = false;
    for (const window of BEFORE) {
      const newest = await this.newestOf(time - window, time);
      hasAll = newest.some(({ channel }) => this.decoders.get(channel)?.topic === ALL_OBJECTS);
      if (!hasAll && window !== BEFORE[BEFORE.length - 1]) continue;
      for (const message of newest) this.tell(message);
      break;
    }
    if (!hasAll) await this.tellFirstPoses(time);
    for (const message of this.history.linksUntil(time)) this.tell(message); // its samples are plotted at the session's time
    this.reading = this.reader.readMessages({ topics: [...KEPT, ...this.streams], startTime: time + 1n }) as unknown as Reading;
  }

  /** Before the first poses of a recording its objects are where those say. */
  private async tellFirstPoses(startTime: bigint): Promise<void> {
    let endTime: bigint | undefined;
    for await (const { logTime, channelId, data } of this.reader.readMessages({ topics: [ALL_OBJECTS], startTime })) {
      endTime ??= logTime + FIRST_POSES;
      if (logTime > endTime) return;
      this.tell({ time: logTime, channel: channelId, data });
    }
  }

  /** The newest of each instance of the streams, in order. */
  private async newestOf(startTime: bigint, endTime: bigint): Promise<Message[]> {
    const newest = new Map<string, Message>();
    for await (const { logTime, channelId, data } of this.reader.readMessages({ topics: [...STREAMS, ALL_OBJECTS], startTime, endTime }))
      newest.set(this.instanceOf(channelId, data), { time: logTime, channel: channelId, data: data.slice() });
    return [...newest.values()].sort((a, b) => Number(a.time - b.time));
  }

  /** Of a stream: the channel and the key, which is the first number after the encapsulation's four bytes. */
  private instanceOf(channel: number, data: Uint8Array): string {
    const hasKey = !["TickStats_100", "StepProgress"].includes(this.decoders.get(channel)?.topic ?? "");
    return `${channel} ${hasKey && data.length >= 8 ? new DataView(data.buffer, data.byteOffset).getUint32(4, true) : 0}`;
  }

  /** What is plotted, over some seconds before a time; times are those of the session. Ends early once `isStale`. */
  async tracksBefore(seconds: number, window: number, isStale: () => boolean = () => false): Promise<Tracks> {
    const tracks = new Tracks();
    let time: number | undefined;
    let read = 0;
    for await (const { channelId, data } of this.reader.readMessages({ topics: PLOTTED, startTime: this.timeOf(seconds - window), endTime: this.timeOf(seconds) })) {
      // so that the page draws and answers meanwhile
      if (++read % YIELD === 0) await new Promise((resolve) => setTimeout(resolve));
      if (isStale()) break;
      const channel = this.decoders.get(channelId);
      const message = channel?.decode(data);
      if (channel?.topic === "TickStats_100") {
        time = Number((message as TickStats).tick) / 1000;
        tracks.count(message as TickStats);
      }
      if (channel?.topic === "ContactPairs_100") tracks.touch(message as ContactPairs);
      if (time === undefined) continue;
      if (channel?.topic === "HandState_100") tracks.feel(time, message as HandState);
      if (channel?.topic === "Telemetry") tracks.link(time, message as Telemetry);
    }
    return tracks;
  }

  /** Tells what happened since the last call, up to a time; of poses and progress the newest. */
  async advance(seconds: number): Promise<void> {
    const time = this.timeOf(seconds);
    const reading = this.reading;
    if (reading === undefined) return;
    const newest = new Map<string, Sample>();
    while (true) {
      if (this.next === undefined) {
        const { value } = await reading.next();
        if (value === undefined || reading !== this.reading) break;
        this.next = { time: value.logTime, channel: value.channelId, data: value.data.slice() };
      }
      if (this.next.time > time) break;
      const message = this.next;
      this.next = undefined;
      const topic = this.decoders.get(message.channel)?.topic ?? "";
      if (this.streams.includes(topic) && !PLOTTED.includes(topic)) newest.set(this.instanceOf(message.channel, message.data), message);
      else this.tell(message);
    }
    for (const message of newest.values()) this.tell(message);
  }
}
