// The nearest points of two surfaces of triangles: exact for what is drawn, which is a level of the part's model.
import { BoxGeometry, Matrix4, Mesh, Triangle, Vector3, type BufferGeometry, type Object3D } from "three";

const LEAF = 8; // triangles
const EDGES = [[0, 1], [1, 2], [2, 0]] as const;

/** A triangle, with a sphere about it. */
interface Facet { triangle: Triangle; middle: Vector3; radius: number }
/** A sphere about some facets, which are its children's. */
interface Node { centre: Vector3; radius: number; facets: Facet[]; children: Node[] }

export interface Nearest { distance: number; a: Vector3; b: Vector3 }

function* trianglesOf(geometry: BufferGeometry, matrix: Matrix4): Generator<Triangle> {
  const places = geometry.getAttribute("position");
  const { index } = geometry;
  const corner = (i: number): Vector3 => new Vector3().fromBufferAttribute(places, index?.getX(i) ?? i).applyMatrix4(matrix);
  for (let i = 0; i + 2 < (index?.count ?? places.count); i += 3) yield new Triangle(corner(i), corner(i + 1), corner(i + 2));
}

const cornersOf = ({ a, b, c }: Triangle): [Vector3, Vector3, Vector3] => [a, b, c];

function facetOf(triangle: Triangle): Facet {
  const corners = cornersOf(triangle);
  const middle = new Vector3().add(triangle.a).add(triangle.b).add(triangle.c).divideScalar(3);
  return { triangle, middle, radius: Math.max(...corners.map((corner) => corner.distanceTo(middle))) };
}

/** Halves at the median of the longest side of the box about the middles. */
function nodeOf(all: Facet[]): Node {
  const [low, high] = [new Vector3(Infinity, Infinity, Infinity), new Vector3(-Infinity, -Infinity, -Infinity)];
  for (const { triangle } of all)
    for (const corner of cornersOf(triangle)) {
      low.min(corner);
      high.max(corner);
    }
  const centre = low.clone().add(high).multiplyScalar(0.5);
  const radius = Math.sqrt(all.reduce((most, { triangle }) => Math.max(most, ...cornersOf(triangle).map((corner) => corner.distanceToSquared(centre))), 0));
  if (all.length <= LEAF) return { centre, radius, facets: all, children: [] };
  const size = high.sub(low);
  const axis = size.x >= size.y && size.x >= size.z ? "x" : size.y >= size.z ? "y" : "z";
  const sorted = [...all].sort((one, other) => one.middle[axis] - other.middle[axis]);
  const half = sorted.length >> 1;
  return { centre, radius, facets: [], children: [nodeOf(sorted.slice(0, half)), nodeOf(sorted.slice(half))] };
}

/** The triangles of an object in its own frame, in a tree of spheres. */
export class Surface {
  readonly root?: Node;

  private constructor(triangles: Triangle[]) {
    if (triangles.length > 0) this.root = nodeOf(triangles.map(facetOf));
  }

  /** Of all meshes below `group`. */
  static of(group: Object3D): Surface {
    group.updateWorldMatrix(true, true);
    const back = group.matrixWorld.clone().invert();
    const triangles: Triangle[] = [];
    group.traverse((child) => {
      if (child instanceof Mesh) triangles.push(...trianglesOf(child.geometry as BufferGeometry, back.clone().multiply(child.matrixWorld)));
    });
    return new Surface(triangles);
  }

  static ofBox(size: ArrayLike<number>, centre: ArrayLike<number>): Surface {
    return new Surface([...trianglesOf(new BoxGeometry(size[0], size[1], size[2]), new Matrix4().makeTranslation(centre[0], centre[1], centre[2]))]);
  }

  static ofPoint(point: Vector3): Surface {
    return new Surface([new Triangle(point, point, point)]);
  }
}

/** The nearest points of two segments (Ericson, Real-Time Collision Detection, 5.1.9). */
function ofSegments(p1: Vector3, q1: Vector3, p2: Vector3, q2: Vector3): [Vector3, Vector3] {
  const [d1, d2, r] = [q1.clone().sub(p1), q2.clone().sub(p2), p1.clone().sub(p2)];
  const [a, e, f, c, b] = [d1.dot(d1), d2.dot(d2), d2.dot(r), d1.dot(r), d1.dot(d2)];
  const clamp = (value: number): number => Math.min(1, Math.max(0, value));
  let [s, t] = [0, 0];
  if (a <= Number.EPSILON * e || a === 0) t = e === 0 ? 0 : clamp(f / e);
  else if (e === 0) s = clamp(-c / a);
  else {
    const parallel = a * e - b * b;
    s = parallel > 1e-12 * a * e ? clamp((b * f - c * e) / parallel) : 0;
    t = (b * s + f) / e;
    if (t < 0 || t > 1) [t, s] = [clamp(t), clamp((b * clamp(t) - c) / a)];
  }
  return [p1.clone().addScaledVector(d1, s), p2.clone().addScaledVector(d2, t)];
}

/** Where a segment passes through a triangle. */
function crossing(p: Vector3, q: Vector3, triangle: Triangle): Vector3 | undefined {
  const normal = triangle.getNormal(new Vector3());
  const [from, to] = [p.clone().sub(triangle.a).dot(normal), q.clone().sub(triangle.a).dot(normal)];
  if (from * to > 0 || from === to) return undefined;
  const place = p.clone().lerp(q, from / (from - to));
  return triangle.containsPoint(place) ? place : undefined;
}

function ofTriangles(one: Triangle, other: Triangle, best: Nearest): void {
  const take = (a: Vector3, b: Vector3): void => {
    const distance = a.distanceTo(b);
    if (distance < best.distance) Object.assign(best, { distance, a: a.clone(), b: b.clone() });
  };
  const [corners, others] = [cornersOf(one), cornersOf(other)];
  for (const [i, j] of EDGES) {
    const [through, back] = [crossing(corners[i], corners[j], other), crossing(others[i], others[j], one)];
    if (through !== undefined) take(through, through);
    if (back !== undefined) take(back, back);
    for (const [k, l] of EDGES) take(...ofSegments(corners[i], corners[j], others[k], others[l]));
  }
  for (const corner of corners) take(corner, other.closestPointToPoint(corner, new Vector3()));
  for (const corner of others) take(one.closestPointToPoint(corner, new Vector3()), corner);
}

/** Of surfaces at `X_WA` and `X_WB`, in the world; distance 0 where they touch or meet each other. Undefined where one has no triangles. */
export function nearestOf(a: Surface, X_WA: Matrix4, b: Surface, X_WB: Matrix4): Nearest | undefined {
  if (a.root === undefined || b.root === undefined) return undefined;
  const X_AB = X_WA.clone().invert().multiply(X_WB);
  const best: Nearest = { distance: Infinity, a: new Vector3(), b: new Vector3() };
  const moved = new Map<Node, { centre: Vector3; facets?: Facet[] }>(); // of B, in A
  const inA = (node: Node): { centre: Vector3; facets?: Facet[] } => {
    let known = moved.get(node);
    if (known === undefined) moved.set(node, (known = { centre: node.centre.clone().applyMatrix4(X_AB) }));
    return known;
  };
  const moveFacet = ({ triangle, middle, radius }: Facet): Facet => {
    const [p, q, r] = cornersOf(triangle).map((corner) => corner.clone().applyMatrix4(X_AB));
    return { triangle: new Triangle(p, q, r), middle: middle.clone().applyMatrix4(X_AB), radius };
  };
  const least = (one: Node, other: Node): number => one.centre.distanceTo(inA(other).centre) - one.radius - other.radius;
  const visit = (one: Node, other: Node): void => {
    if (best.distance === 0 || least(one, other) >= best.distance) return;
    if (one.children.length === 0 && other.children.length === 0) {
      const facets = (inA(other).facets ??= other.facets.map(moveFacet));
      for (const first of one.facets)
        for (const second of facets)
          if (first.middle.distanceTo(second.middle) - first.radius - second.radius < best.distance) ofTriangles(first.triangle, second.triangle, best);
      return;
    }
    const splitsFirst = other.children.length === 0 || (one.children.length > 0 && one.radius >= other.radius);
    const pairs = splitsFirst ? one.children.map((child) => [child, other] as const) : other.children.map((child) => [one, child] as const);
    for (const [first, second] of pairs.sort((x, y) => least(...x) - least(...y))) visit(first, second);
  };
  visit(a.root, b.root);
  return { distance: best.distance, a: best.a.applyMatrix4(X_WA), b: best.b.applyMatrix4(X_WA) };
}
