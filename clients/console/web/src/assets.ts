// Where the models of parts come from: the gateway, or what a page has inside it.

/** The content of an asset by its name, the hash of that content. Fails with a sentence. */
export type AssetSource = (name: string) => Promise<ArrayBuffer>;

async function fromGateway(name: string): Promise<ArrayBuffer> {
  const answer = await fetch(`/assets/${name}`);
  if (!answer.ok) throw new Error(`asset ${name}: the gateway answers ${answer.status}`);
  return answer.arrayBuffer();
}

let source: AssetSource = fromGateway;

/** From now on assets come from there. */
export function setAssetSource(next: AssetSource): void {
  source = next;
}

export function asset(name: string): Promise<ArrayBuffer> {
  return source(name);
}
