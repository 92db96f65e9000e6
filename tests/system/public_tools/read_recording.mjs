// Opens a recording with public libraries alone, decodes every message by the schema that the file carries, and
// prints how many there were of each topic. Usage: node read_recording.mjs FILE
import { open } from "node:fs/promises";

import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";
import { McapIndexedReader } from "@mcap/core";
import { decompress } from "fzstd";

class FileReadable {
  constructor(handle) {
    this.handle = handle;
  }
  async size() {
    return BigInt((await this.handle.stat()).size);
  }
  async read(offset, size) {
    const bytes = new Uint8Array(Number(size));
    const { bytesRead } = await this.handle.read(bytes, 0, bytes.length, Number(offset));
    if (bytesRead !== bytes.length) throw new Error(`the file ends at ${Number(offset) + bytesRead}`);
    return bytes;
  }
}

// the size comes from the chunk: the one in the frame header is not trusted for an allocation
const decompressHandlers = { zstd: (bytes, size) => decompress(bytes, new Uint8Array(Number(size))) };

function decoderOf(schema) {
  if (schema?.encoding !== "omgidl") throw new Error(`schema encoding '${schema?.encoding}' instead of omgidl`);
  const reader = new MessageReader(schema.name, parseIDL(new TextDecoder().decode(schema.data)));
  return (bytes) => reader.readMessage(bytes);
}

async function main(file) {
  const handle = await open(file, "r");
  try {
    const recording = await McapIndexedReader.Initialize({ readable: new FileReadable(handle), decompressHandlers });
    const decoders = new Map();
    const counts = new Map();
    for await (const message of recording.readMessages()) {
      const channel = recording.channelsById.get(message.channelId);
      if (channel.messageEncoding !== "cdr") throw new Error(`${channel.topic}: encoding '${channel.messageEncoding}'`);
      if (!decoders.has(channel.id)) {
        decoders.set(channel.id, decoderOf(recording.schemasById.get(channel.schemaId)));
      }
      const number = counts.get(channel.topic) ?? 0;
      try {
        decoders.get(channel.id)(message.data);
      } catch (problem) {
        throw new Error(`${channel.topic}, message ${number}: ${problem.message}`);
      }
      counts.set(channel.topic, number + 1);
    }
    let total = 0;
    for (const [topic, count] of [...counts].sort()) {
      console.log(`${topic.padEnd(20)} ${count}`);
      total += count;
    }
    const counted = Number(recording.statistics.messageCount);
    if (total !== counted) throw new Error(`${total} messages were read, the file counts ${counted}`);
    console.log(`${"all".padEnd(20)} ${total}`);
  } finally {
    await handle.close();
  }
}

if (process.argv.length !== 3) {
  console.error("usage: node read_recording.mjs FILE");
  process.exit(2);
}
main(process.argv[2]).catch((problem) => {
  console.error(`${process.argv[2]}: ${problem.message}`);
  process.exit(1);
});
