// Bytes to messages, by the schema that came with them: the one way for a live session, and for whatever carries the same channels.
import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";

export interface Channel {
  id: number; topic: string; encoding: string; schemaName: string; schema: string; schemaEncoding: string;
}

export type Decoder = (bytes: Uint8Array) => unknown;

const parsed = new Map<string, ReturnType<typeof parseIDL>>();
const text = new TextDecoder();

/** Fails when the page cannot read this channel. */
export function decoderOf(channel: Channel): Decoder {
  if (channel.encoding === "json") return (bytes) => JSON.parse(text.decode(bytes)) as unknown;
  if (channel.encoding !== "cdr" || channel.schemaEncoding !== "omgidl") throw new Error(`${channel.topic}: ${channel.encoding} is not read here`);
  let definitions = parsed.get(channel.schema);
  if (definitions === undefined) parsed.set(channel.schema, (definitions = parseIDL(channel.schema)));
  const reader = new MessageReader(channel.schemaName, definitions);
  return (bytes) => reader.readMessage(bytes);
}
