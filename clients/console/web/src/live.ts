// The gateway's WebSocket: subscribes to topics by name and connects again when the connection is lost.
import { decoderOf, type Channel, type Decoder } from "./decode";
import type { InstanceGone } from "./messages";

const SUBPROTOCOLS = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
const FIRST_RETRY = 0.5; // s
const LONGEST_RETRY = 8; // s

export type LiveState = { kind: "connecting" } | { kind: "open" } | { kind: "reconnecting"; seconds: number };
/** `isGone`: of the instance, of which the message has the key. */
type Handler = (topic: string, message: unknown, isGone: boolean) => void;

export const INSTANCE_STATE = "__instance_state";

export class LiveSource {
  private socket?: WebSocket;
  private readers = new Map<number, { topic: string; decode: Decoder }>();
  private retry = FIRST_RETRY;

  constructor(private url: string, private topics: readonly string[], private handler: Handler, private onState: (state: LiveState) => void) {
    onState({ kind: "connecting" });
    this.connect();
  }

  private connect(): void {
    const socket = (this.socket = new WebSocket(this.url, SUBPROTOCOLS));
    socket.binaryType = "arraybuffer";
    this.readers.clear();
    socket.onopen = () => {
      this.retry = FIRST_RETRY;
      this.onState({ kind: "open" });
    };
    socket.onclose = () => {
      this.onState({ kind: "reconnecting", seconds: this.retry });
      setTimeout(() => this.connect(), this.retry * 1000);
      this.retry = Math.min(LONGEST_RETRY, 2 * this.retry);
    };
    socket.onmessage = ({ data }) => {
      if (typeof data === "string") this.receiveText(data);
      else this.receiveBytes(new DataView(data as ArrayBuffer));
    };
  }

  private receiveText(data: string): void {
    const message = JSON.parse(data) as { op: string; channels?: Channel[]; level?: number; message?: string };
    if (message.op === "status") console.warn("gateway:", message.message);
    if (message.op !== "advertise") return;
    const subscriptions: { id: number; channelId: number }[] = [];
    for (const channel of message.channels ?? []) {
      if (!this.topics.includes(channel.topic)) continue;
      this.readers.set(channel.id, { topic: channel.topic, decode: decoderOf(channel) });
      subscriptions.push({ id: channel.id, channelId: channel.id });
    }
    this.socket?.send(JSON.stringify({ op: "subscribe", subscriptions }));
  }

  private receiveBytes(view: DataView): void {
    if (view.byteLength < 13 || view.getUint8(0) !== 1) return;
    const reader = this.readers.get(view.getUint32(1, true));
    if (reader === undefined) return;
    const message = reader.decode(new Uint8Array(view.buffer, 13));
    if (reader.topic !== INSTANCE_STATE) return this.handler(reader.topic, message, false);
    const { topic, key_sample } = message as InstanceGone;
    const ended = [...this.readers.values()].find((known) => known.topic === topic);
    if (ended !== undefined) this.handler(topic, ended.decode(Uint8Array.from(key_sample)), true);
  }
}
