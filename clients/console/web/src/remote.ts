// The messages of a remote hand, as docs/devices.md has them: targets from this page, views to it.
import { Quaternion, Vector3 } from "three";

const MAGIC = 0x444e4854;
const VERSION = 1;
const TARGET_SIZE = 80;
const VIEW_SIZE = 272;
export const Button = { Arm: 2, Held: 4 } as const;
/** As the gateway numbers what a viewer's own hands are shown. */
export const HAND_SUBSCRIPTION = 0xffffffff;

export interface Place { p: Vector3; q: Quaternion }
/** A hand as its station has it: in the world, N and Nm. */
export interface HandView { isOn: boolean; isActive: boolean; inContact: boolean; isFaulty: boolean; hand: Place; proxy: Place; object: Place; centre: Vector3; force: number; objectId: number }

export function decodeViews(bytes: DataView): HandView[] {
  const views: HandView[] = [];
  for (let at = 0; at + VIEW_SIZE <= bytes.byteLength; at += VIEW_SIZE) {
    const number = (offset: number): number => bytes.getFloat64(at + offset, true);
    const vector = (offset: number): Vector3 => new Vector3(number(offset), number(offset + 8), number(offset + 16));
    const centre = vector(192);
    const place = (offset: number): Place => ({
      p: vector(offset).add(centre), q: new Quaternion(number(offset + 32), number(offset + 40), number(offset + 48), number(offset + 24)),
    });
    const flags = bytes.getUint32(at + 12, true);
    views.push({
      isOn: (flags & 1) !== 0, isActive: (flags & 2) !== 0, inContact: (flags & 4) !== 0, isFaulty: (flags & 8) !== 0,
      hand: place(24), proxy: place(80), object: place(136), centre, force: vector(216).length(), objectId: bytes.getUint32(at + 264, true),
    });
  }
  return views;
}

/** Targets in the world, of hands whose devices have these centres. */
export function encodeTargets(seq: number, buttons: number, targets: Place[], centres: Vector3[]): Uint8Array<ArrayBuffer> {
  const buffer = new ArrayBuffer(TARGET_SIZE * targets.length);
  const bytes = new DataView(buffer);
  targets.forEach(({ p, q }, i) => {
    const at = TARGET_SIZE * i;
    bytes.setUint32(at, MAGIC, true);
    bytes.setUint16(at + 4, VERSION, true);
    bytes.setUint16(at + 6, 1, true);
    bytes.setUint32(at + 8, seq, true);
    bytes.setUint32(at + 12, buttons, true);
    const off = p.clone().sub(centres[i]);
    [off.x, off.y, off.z, q.w, q.x, q.y, q.z, 0].forEach((number, k) => bytes.setFloat64(at + 16 + 8 * k, number, true));
  });
  return new Uint8Array(buffer);
}
