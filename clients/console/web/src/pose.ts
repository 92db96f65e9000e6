// Poses of the messages as three.js has them. World frame, metres; quaternions are x, y, z, w.
import { Quaternion, Vector3, type Object3D } from "three";

import type { Pose, Vector } from "./messages";

export const vectorOf = (v: Vector): Vector3 => new Vector3(v[0], v[1], v[2]);
export const quaternionOf = (q: Vector): Quaternion => new Quaternion(q[0], q[1], q[2], q[3]);

/** Puts what is drawn where a pose is. */
export function place(target: Object3D, { p, q }: Pose): void {
  target.position.set(p[0], p[1], p[2]);
  target.quaternion.set(q[0], q[1], q[2], q[3]);
}
