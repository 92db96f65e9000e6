// States and events of a recording, indexed: of each instance the newest message up to a time, of events those that a session keeps.
import { deviceOf } from "./eventtext";
import type { EmergencyStop, EventLog } from "./messages";
import { EVENTS } from "./session";

/** `message`: decoded already. `isGone`: of the instance, of which the message has the key. */
export interface Message { time: bigint; channel: number; data?: Uint8Array; message?: unknown; isGone?: boolean }

/** Raises of the emergency stop by a client, and their clears, each with a larger number than the one before (StopTruth). */
interface Stop { raises: Message[]; clears: Message[] }

const KEYS: Record<string, string> = { SceneObject: "object_id", SceneHand: "hand_id", SceneStep: "step", GrabState: "object_id", Presence: "client_id", Telemetry: "client_id" };
const SCENE = ["SessionAnnounce", "SceneTitle", "SceneObject", "SceneHand", "SceneStep"]; // the announcement comes first

/** How many messages, of those in order, are up to a time. */
function countUntil(messages: Message[], time: bigint): number {
  let [first, end] = [0, messages.length];
  while (first < end) {
    const middle = (first + end) >> 1;
    if (messages[middle].time <= time) first = middle + 1;
    else end = middle;
  }
  return first;
}

function put(known: Map<string, Message[]>, name: string, message: Message): void {
  const earlier = known.get(name);
  if (earlier === undefined) known.set(name, [message]);
  else earlier.push(message);
}

/** Of a raise or a clear; without one, below all. */
function counterOf(entry: Message | undefined): number {
  return (entry?.message as EmergencyStop | undefined)?.counter ?? -1;
}

/** Without instances that are gone then. */
function* newestUntil(known: Map<string, Message[]>, time: bigint): Iterable<Message> {
  for (const messages of known.values()) {
    const count = countUntil(messages, time);
    if (count > 0 && messages[count - 1].isGone !== true) yield messages[count - 1];
  }
}

export class History {
  private scene = new Map(SCENE.map((topic) => [topic, new Map<string, Message[]>()]));
  private states = new Map<string, Message[]>(); // of each instance, in order
  private links = new Map<string, Message[]>(); // of each client
  private stops = new Map<string, Stop>();
  private runs: Message[] = [];
  private steps: Message[] = []; // events of them
  private server: Message[] = []; // its events
  private stations: Message[] = []; // theirs

  /** Of a state that is not decoded, `name` tells instances apart. In the order of times. */
  add(topic: string, entry: Message, name = ""): void {
    const key = `${topic} ${name} ${(entry.message as Record<string, number> | undefined)?.[KEYS[topic]] ?? ""}`;
    switch (topic) {
      case "SessionAnnounce": case "SceneTitle": case "SceneObject": case "SceneHand": case "SceneStep":
        return put(this.scene.get(topic)!, key, entry);
      case "Telemetry":
        return put(this.links, key, entry);
      case "RunState":
        return void this.runs.push(entry);
      case "EmergencyStop": case "EmergencyClear":
        return this.addStop(topic === "EmergencyClear", entry);
      case "EventLog":
        if ((entry.message as EventLog).kind.startsWith("step")) this.steps.push(entry);
        return void this.server.push(entry);
      case "ClientEvent":
        return this.addTold(entry, entry.message as EventLog);
      default:
        return put(this.states, key, entry);
    }
  }

  private addStop(isClear: boolean, entry: Message): void {
    const { client_guid } = entry.message as EmergencyStop;
    let stop = this.stops.get(client_guid);
    if (stop === undefined) this.stops.set(client_guid, (stop = { raises: [], clears: [] }));
    const known = isClear ? stop.clears : stop.raises;
    if (counterOf(entry) > counterOf(known[known.length - 1])) known.push(entry);
  }

  /** Of a station's events, which are many, two kinds are shown. */
  private addTold(entry: Message, { kind, text }: EventLog): void {
    if (kind === "device") put(this.states, `device ${deviceOf(text)?.hand}`, entry);
    if (kind === "safety") this.stations.push(entry);
  }

  /** How it stood at a time, and of the scene, which does not change, all. */
  *until(time: bigint): Iterable<Message> {
    for (const instances of this.scene.values()) for (const messages of instances.values()) yield messages[Math.max(0, countUntil(messages, time) - 1)];
    yield* newestUntil(this.states, time);
    yield* this.runs.slice(0, countUntil(this.runs, time));
    yield* this.stopsUntil(time);
    // a session has the newest events; of steps also when they were
    const events = this.newestOf(this.server, time);
    if (events.length > 0) yield* this.steps.slice(0, countUntil(this.steps, events[0].time));
    yield* events;
    yield* this.newestOf(this.stations, time);
  }

  private newestOf(events: Message[], time: bigint): Message[] {
    const count = countUntil(events, time);
    return events.slice(Math.max(0, count - EVENTS), count);
  }

  /** Raises that stand, and clears, since a raise may be told again later. */
  private *stopsUntil(time: bigint): Iterable<Message> {
    for (const { raises, clears } of this.stops.values()) {
      const raise = raises[countUntil(raises, time) - 1] as Message | undefined;
      const clear = clears[countUntil(clears, time) - 1] as Message | undefined;
      if (clear !== undefined) yield clear;
      if (raise !== undefined && counterOf(raise) > counterOf(clear)) yield raise;
    }
  }

  /** What stations said last of their links. */
  linksUntil(time: bigint): Iterable<Message> {
    return newestUntil(this.links, time);
  }
}
