// The lines along which a model is creased.
import { BufferAttribute, BufferGeometry, Vector3 } from "three";

const FLAT = Math.cos((35 * Math.PI) / 180); // between the normals beside a crease at most

/**
 * The creases and borders of `geometry` as segments of lines. By the normals of its corners, which are those of the part's own surface: where a curved surface has
 * few triangles some are slivers, whose own normals mean nothing.
 */
export function creases(geometry: BufferGeometry): BufferGeometry {
  const places = geometry.getAttribute("position");
  const normals = geometry.getAttribute("normal");
  const { index } = geometry;
  const cornerAt = (i: number): number => index?.getX(i) ?? i;

  // corners at one place are one node
  const known = new Map<string, number>();
  const nodes = Array.from({ length: places.count }, (_, i) => {
    const key = `${places.getX(i)} ${places.getY(i)} ${places.getZ(i)}`;
    const node = known.get(key) ?? i;
    known.set(key, node);
    return node;
  });

  const edges = new Map<number, { from: number; to: number; normal: Vector3; isCrease: boolean }>();
  const normalOf = (a: number, b: number): Vector3 => new Vector3().fromBufferAttribute(normals, a).add(new Vector3().fromBufferAttribute(normals, b)).normalize();
  const count = index?.count ?? places.count;
  for (let first = 0; first < count; first += 3) {
    const corners = [cornerAt(first), cornerAt(first + 1), cornerAt(first + 2)];
    for (let i = 0; i < 3; ++i) {
      const [a, b] = [corners[i], corners[(i + 1) % 3]];
      const [low, high] = nodes[a] < nodes[b] ? [nodes[a], nodes[b]] : [nodes[b], nodes[a]];
      if (low === high) continue;
      const key = low * places.count + high;
      const edge = edges.get(key);
      if (edge === undefined) edges.set(key, { from: a, to: b, normal: normalOf(a, b), isCrease: true });
      else edge.isCrease = edge.normal.dot(normalOf(a, b)) < FLAT;
    }
  }
  const segments: number[] = [];
  for (const { from, to, isCrease } of edges.values())
    if (isCrease) for (const corner of [from, to]) segments.push(places.getX(corner), places.getY(corner), places.getZ(corner));
  return new BufferGeometry().setAttribute("position", new BufferAttribute(new Float32Array(segments), 3));
}
