// The gateway's WebSocket: subscribes to topics by name, connects again when the connection is lost, and carries requests to the desk.
import { decoderOf, type Channel, type Decoder } from "./decode";
import type { InstanceGone } from "./messages";
import type { Permitted } from "./permits";
import { decodeViews, HAND_SUBSCRIPTION, type HandView } from "./remote";

const SUBPROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
const FIRST_RETRY = 0.5; // s
const LONGEST_RETRY = 8; // s
/** Reasons of the gateway after which it is asked again seldom: pages would put each other out all the time, and a session that is not there may begin. */
const SELDOM = [/^a newer viewer came/, /^there is no such session/];
const HANGS = 2500; // [ms] without a message: a gateway sends one every 2 s at least
const PERIOD = 1000; // [ms] of updates of what was heard
/** Looks without a message, counted so that a page that was busy or asleep hears first what has come meanwhile. */
const GIVEN_UP = 10;

/** `reason`: of the gateway, in its English; empty: it gave none. */
export type LiveState = { kind: "connecting" } | { kind: "open" } | { kind: "reconnecting"; seconds: number; reason: string };
/** `isGone`: of the instance, of which the message has the key. */
export type Handler = (topic: string, message: unknown, isGone: boolean) => void;
/** What the gateway answers to a request to the desk; of id 0: what nobody asked for, as the loss of a seat. */
/** `code`: the kind of a refusal, as refusalName() of idl/types/names.h has it; `commands`: of a seat that was granted. */
export interface DeskAnswer { id: number; accepted: boolean; text: string; role: string; code?: string; commands?: Permitted; client?: number }

export const INSTANCE_STATE = "__instance_state";

export function addressOf(room: string): string {
  return `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}${room}`;
}

export class LiveSource {
  /** Called with an answer of id 0. */
  onNotice?: (answer: DeskAnswer) => void;
  /** Likewise, of what the gateway says of this page's hands; and what they are shown. */
  onHandNotice?: (answer: DeskAnswer) => void;
  onHands?: (views: HandView[]) => void;
  private socket?: WebSocket;
  private readers = new Map<number, { topic: string; decode: Decoder }>();
  private retry = FIRST_RETRY;
  private timer = 0;
  private asked = new Map<number, (answer: DeskAnswer | undefined) => void>();
  private lastId = 0;
  private isClosed = false;
  /** The gateway sends a heartbeat to its own pages; a connection without one may be silent for long. Until the first message all are watched. */
  private isWatched = true;
  private heardAt = 0; // [ms]
  private quiet = 0; // periods
  private watch = window.setInterval(() => this.check(), PERIOD);

  constructor(private url: string, private topics: readonly string[], private handler: Handler, private onState: (state: LiveState) => void) {
    onState({ kind: "connecting" });
    this.connect();
  }

  close(): void {
    this.isClosed = true;
    clearTimeout(this.timer);
    clearInterval(this.watch);
    this.socket?.close();
  }

  get isOpen(): boolean {
    return this.socket?.readyState === WebSocket.OPEN;
  }

  /** [s] without a message of a connection on which there is one every few seconds. */
  get silence(): number {
    return this.isOpen && this.isWatched && this.heardAt > 0 ? (performance.now() - this.heardAt) / 1000 : 0;
  }

  /** Connects again now, and not after the pause of a retry. */
  hurry(): void {
    if (this.socket !== undefined || this.isClosed) return;
    clearTimeout(this.timer);
    this.retry = FIRST_RETRY;
    this.connect();
  }

  /** Asks the desk; undefined when it cannot be asked, or the connection was lost before it answered. */
  ask(op: string, values: object = {}): Promise<DeskAnswer | undefined> {
    if (!this.isOpen || this.socket === undefined) return Promise.resolve(undefined);
    const id = ++this.lastId;
    this.socket.send(JSON.stringify({ op, id, ...values }));
    return new Promise((answer) => this.asked.set(id, answer));
  }

  /** Targets of this page's hands. Not while others wait to be sent, here or for a gateway that hangs: old ones are of no use. */
  sendTargets(bytes: Uint8Array<ArrayBuffer>): void {
    if (performance.now() - this.heardAt > HANGS) return;
    if (this.socket?.readyState === WebSocket.OPEN && this.socket.bufferedAmount < 4096) this.socket.send(bytes);
  }

  private connect(): void {
    const socket = (this.socket = new WebSocket(this.url, SUBPROTOCOLS));
    socket.binaryType = "arraybuffer";
    this.readers.clear();
    this.isWatched = true;
    this.heardAt = this.quiet = 0;
    socket.onclose = ({ reason }) => this.lose(socket, reason);
    socket.onmessage = ({ data }) => {
      if (socket !== this.socket || this.isClosed) return; // given up
      if (this.heardAt === 0) this.begin();
      this.heardAt = performance.now();
      this.quiet = 0;
      if (typeof data === "string") this.receiveText(data);
      else this.receiveBytes(new DataView(data as ArrayBuffer));
    };
  }

  /** With the first message: the gateway may open a connection only to say why it closes it. */
  private begin(): void {
    this.isWatched = false;
    this.retry = FIRST_RETRY;
    this.onState({ kind: "open" });
  }

  /** Gives a connection up of which nothing is heard: its loss may never be told. */
  private check(): void {
    const { socket } = this;
    if (socket === undefined || !this.isWatched || ++this.quiet < GIVEN_UP) return;
    socket.close();
    this.lose(socket, "");
  }

  private lose(socket: WebSocket, reason: string): void {
    if (socket !== this.socket) return;
    this.socket = undefined;
    for (const answer of this.asked.values()) answer(undefined);
    this.asked.clear();
    if (this.isClosed) return;
    if (SELDOM.some((one) => one.test(reason))) this.retry = LONGEST_RETRY;
    this.onState({ kind: "reconnecting", seconds: this.retry, reason });
    this.timer = window.setTimeout(() => this.connect(), this.retry * 1000);
    this.retry = Math.min(LONGEST_RETRY, 2 * this.retry);
  }

  private receiveText(data: string): void {
    const message = JSON.parse(data) as { op: string; channels?: Channel[]; level?: number; message?: string };
    if (message.op === "heartbeat") this.isWatched = true;
    if (message.op === "status") console.warn("gateway:", message.message);
    if (message.op === "deskAnswer" || message.op === "handAnswer") this.receiveAnswer(message as unknown as DeskAnswer, message.op === "handAnswer");
    if (message.op !== "advertise") return;
    const channels = (message.channels ?? []).filter(({ topic }) => this.topics.includes(topic));
    // first: to read the schemas takes longer than the way to the gateway and back
    this.socket?.send(JSON.stringify({ op: "subscribe", subscriptions: channels.map(({ id }) => ({ id, channelId: id })) }));
    for (const channel of channels) this.readers.set(channel.id, { topic: channel.topic, decode: decoderOf(channel) });
  }

  private receiveAnswer(answer: DeskAnswer, isOfHands: boolean): void {
    if (answer.id === 0) return isOfHands ? this.onHandNotice?.(answer) : this.onNotice?.(answer);
    this.asked.get(answer.id)?.(answer);
    this.asked.delete(answer.id);
  }

  private receiveBytes(view: DataView): void {
    if (view.byteLength < 13 || view.getUint8(0) !== 1) return;
    if (view.getUint32(1, true) === HAND_SUBSCRIPTION) return this.onHands?.(decodeViews(new DataView(view.buffer, 13)));
    const reader = this.readers.get(view.getUint32(1, true));
    if (reader === undefined) return;
    const message = reader.decode(new Uint8Array(view.buffer, 13));
    if (reader.topic !== INSTANCE_STATE) return this.handler(reader.topic, message, false);
    const { topic, key_sample } = message as InstanceGone;
    const ended = [...this.readers.values()].find((known) => known.topic === topic);
    if (ended !== undefined) this.handler(topic, ended.decode(Uint8Array.from(key_sample)), true);
  }
}
