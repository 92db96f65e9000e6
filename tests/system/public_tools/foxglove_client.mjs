// Connects to a gateway with Foxglove's own client, subscribes to all channels, and decodes what comes with public libraries, by the
// schemas that the gateway advertises. Usage: node foxglove_client.mjs URL SUBPROTOCOL TOPIC...
// Ends with exit code 0 when each TOPIC has been decoded, with 1 for what cannot be decoded.
import { parseIDL } from "@foxglove/omgidl-parser";
import { MessageReader } from "@foxglove/omgidl-serialization";
import foxglove from "@foxglove/ws-protocol";
import WebSocket from "ws";

const [url, subprotocol, ...awaited] = process.argv.slice(2);
const client = new foxglove.FoxgloveClient({ ws: new WebSocket(url, [subprotocol]) });
const readers = new Map();
const counts = new Map();

function finish(problem) {
  console.log([...counts].sort().map(([topic, count]) => `${topic} ${count}`).join("\n"));
  if (problem) console.error(problem);
  process.exit(problem ? 1 : 0);
}

client.on("error", (error) => finish(error));
client.on("close", () => finish("the connection was closed"));
client.on("status", ({ message }) => finish(`status: ${message}`));
client.on("advertise", (channels) => {
  for (const channel of channels) {
    const decode = channel.encoding === "json"
      ? (bytes) => JSON.parse(new TextDecoder().decode(bytes))
      : ((reader) => (bytes) => reader.readMessage(bytes))(new MessageReader(channel.schemaName, parseIDL(channel.schema)));
    readers.set(client.subscribe(channel.id), { topic: channel.topic, decode });
  }
});
client.on("message", ({ subscriptionId, data }) => {
  const { topic, decode } = readers.get(subscriptionId);
  try {
    decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
  } catch (problem) {
    finish(`${topic}: ${problem.message}`);
  }
  counts.set(topic, (counts.get(topic) ?? 0) + 1);
  if (awaited.every((name) => counts.has(name))) finish();
});
setTimeout(() => finish(`not seen in time: ${awaited.filter((name) => !counts.has(name))}`), 120000);
