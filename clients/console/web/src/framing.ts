// Where a viewer has to be to see all of something, in a direction that is given.
import { Vector3 } from "three";

export interface Framing { target: Vector3; distance: number }

/**
 * The smallest distance [m] at which all `points` (world, not empty) are in the picture, and what is in its middle. `direction`: from the target to the viewer,
 * of length 1, not along `up`. `across`, `high`: tangents of half the angles that the points may fill. Each side of the picture is a plane through the viewer, so
 * the two of a dimension, each touching its farthest point, say place and distance.
 */
export function framing(points: Iterable<Vector3>, direction: Vector3, up: Vector3, across: number, high: number): Framing {
  const right = new Vector3().crossVectors(up, direction).normalize();
  const above = new Vector3().crossVectors(direction, right);
  const sides = { right: -Infinity, left: -Infinity, top: -Infinity, bottom: -Infinity };
  let [nearest, farthest] = [-Infinity, Infinity];
  for (const point of points) {
    const [x, y, z] = [point.dot(right), point.dot(above), point.dot(direction)];
    sides.right = Math.max(sides.right, x + z * across);
    sides.left = Math.max(sides.left, -x + z * across);
    sides.top = Math.max(sides.top, y + z * high);
    sides.bottom = Math.max(sides.bottom, -y + z * high);
    nearest = Math.max(nearest, z);
    farthest = Math.min(farthest, z);
  }
  const viewer = Math.max((sides.right + sides.left) / (2 * across), (sides.top + sides.bottom) / (2 * high));
  const middle = (nearest + farthest) / 2; // the depth about which the view turns
  const target = right.multiplyScalar((sides.right - sides.left) / 2).addScaledVector(above, (sides.top - sides.bottom) / 2).addScaledVector(direction, middle);
  return { target, distance: viewer - middle };
}

/** Of a box. */
export function* cornersOf({ min, max }: { min: Vector3; max: Vector3 }): Generator<Vector3> {
  for (let i = 0; i < 8; ++i) yield new Vector3(i & 1 ? min.x : max.x, i & 2 ? min.y : max.y, i & 4 ? min.z : max.z);
}
