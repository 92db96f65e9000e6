// A headset (WebXR): its controllers, or the person's own hands, move the hands in the scene with six degrees of freedom. Another source of motion of Hand.
import * as THREE from "three";

import type { Hand } from "./hand";
import { release } from "./release";
import type { SceneView } from "./scene";

const STILL = 500; // [ms] without a picture: nobody wears it, and the dead man's switch is released
const LONGEST_PULSE = 40; // [ms]
/** Buttons of the standard layout of controllers: the upper and lower face button. */
const PAD = { lower: 4, upper: 5 } as const;
const CARD = { width: 0.6, height: 0.3, pixels: 1024, distance: 0.9, below: 0.12, turn: 0.6 } as const; // [m], [rad] that the head turns until it follows
const STOP = { width: 0.16, height: 0.08 } as const; // [m]

/** What the card in view says. */
export interface CardText { head: string; title: string; text: string; state: string; stop: string }

interface Grasp { source: XRInputSource; index: number; last?: { p: THREE.Vector3; q: THREE.Quaternion } }

export async function hasHeadset(): Promise<boolean> {
  return (await navigator.xr?.isSessionSupported("immersive-vr").catch(() => false)) === true;
}

export class Headset {
  private grasps = new Map<XRInputSource, Grasp>();
  private pressed = new Map<XRInputSource, { lower: boolean; upper: boolean }>();
  private pointers = new Map<XRInputSource, THREE.Object3D>();
  private card = new Card();
  private pictureAt = -Infinity;

  /** Begins a session in the headset; fails when the browser or the person refuses it. */
  static async enter(hand: Hand, view: SceneView, handOf: (side: XRHandedness) => number, text: () => CardText, raise: () => void, ended: () => void): Promise<Headset> {
    if (navigator.xr === undefined) throw new Error("WebXR");
    const session = await navigator.xr.requestSession("immersive-vr", { optionalFeatures: ["local-floor", "hand-tracking"] });
    const headset = new Headset(session, hand, view, handOf, text, raise);
    session.addEventListener("end", () => {
      headset.leave();
      ended();
    });
    try {
      await view.headset.enter(session, (frame, space) => headset.follow(frame, space));
    } catch (problem) {
      await session.end().catch(() => undefined);
      throw problem;
    }
    return headset;
  }

  private constructor(readonly session: XRSession, private hand: Hand, private view: SceneView, private handOf: (side: XRHandedness) => number, private text: () => CardText, private raise: () => void) {
    hand.isWatched = () => session.visibilityState === "visible" && performance.now() - this.pictureAt < STILL;
    for (const name of ["selectstart", "squeezestart"] as const) session.addEventListener(name, this.onGrasp);
    for (const name of ["selectend", "squeezeend"] as const) session.addEventListener(name, this.onRelease);
    session.addEventListener("inputsourceschange", ({ removed }) => removed.forEach((source) => this.forget(source)));
    view.headset.rig.add(this.card.group);
  }

  end(): void {
    void this.session.end().catch(() => undefined);
  }

  /** A short vibration of the controller that moves this hand. */
  feel(index: number, strength: number): void {
    for (const source of this.session.inputSources)
      if (this.handOf(source.handedness) === index) void source.gamepad?.hapticActuators?.[0]?.pulse(strength, LONGEST_PULSE * strength);
  }

  private leave(): void {
    for (const { index } of this.grasps.values()) this.hand.release(index);
    for (const source of this.pointers.keys()) this.forget(source);
    this.hand.isWatched = undefined;
    this.view.headset.rig.remove(this.card.group);
    release(this.card.group);
    this.card.dispose();
    this.view.headset.leave();
  }

  private forget(source: XRInputSource): void {
    const grasp = this.grasps.get(source);
    if (grasp !== undefined) this.hand.release(grasp.index);
    this.grasps.delete(source);
    this.pressed.delete(source);
    const pointer = this.pointers.get(source);
    if (pointer !== undefined) {
      this.view.headset.rig.remove(pointer);
      release(pointer);
    }
    this.pointers.delete(source);
  }

  /** Trigger, grip or pinch: takes the hand, presses what it points at, or arms a station that is off. */
  private onGrasp = ({ inputSource: source, frame }: XRInputSourceEvent): void => {
    const ray = this.view.headset.poseIn(frame, source.targetRaySpace);
    if (ray !== undefined && this.card.isStopAt(ray)) return this.raise();
    if (!this.hand.isOn) return this.hand.press();
    const index = this.handOf(source.handedness);
    const isTaken = [...this.grasps.values()].some((grasp) => grasp.index === index);
    if (isTaken || this.hand.views[index] === undefined) return;
    this.grasps.set(source, { source, index });
    this.hand.grasp(index);
  };
  private onRelease = ({ inputSource: source }: XRInputSourceEvent): void => {
    const grasp = this.grasps.get(source);
    if (grasp === undefined) return;
    this.grasps.delete(source);
    this.hand.release(grasp.index);
  };

  /** Called for each picture of the headset. */
  private follow(frame: XRFrame, space: XRReferenceSpace): void {
    const now = performance.now();
    if (now - this.pictureAt > STILL) this.forgetPlaces();
    this.pictureAt = now;
    for (const source of this.session.inputSources) {
      const own = frame.getPose(source.gripSpace ?? source.targetRaySpace, space);
      this.show(source, own);
      const place = this.view.headset.poseIn(frame, source.gripSpace ?? source.targetRaySpace);
      const grasp = this.grasps.get(source);
      if (grasp !== undefined) this.carry(grasp, place);
      this.pressButtons(source);
    }
    const head = frame.getViewerPose(space);
    if (head !== undefined) this.card.follow(head.transform);
    this.card.write(this.text());
  }

  /** After a pause: the way since then is nobody's motion. */
  private forgetPlaces(): void {
    for (const grasp of this.grasps.values()) delete grasp.last;
  }

  /** The hand goes as the controller went since the picture before, turned about its own centre; one that is lost for a while moves nothing. */
  private carry(grasp: Grasp, place: { p: THREE.Vector3; q: THREE.Quaternion } | undefined): void {
    const { last } = grasp;
    grasp.last = place;
    if (last === undefined || place === undefined) return;
    this.hand.moveBy(grasp.index, place.p.clone().sub(last.p), place.q.clone().multiply(last.q.clone().invert()));
  }

  private pressButtons(source: XRInputSource): void {
    const isDown = (button: number): boolean => source.gamepad?.buttons[button]?.pressed === true;
    const now = { lower: isDown(PAD.lower), upper: isDown(PAD.upper) };
    const before = this.pressed.get(source) ?? now;
    this.pressed.set(source, now);
    if (now.upper && !before.upper) this.raise();
    if (now.lower && !before.lower) {
      if (!this.hand.isOn) return this.hand.press();
      this.hand.choose(this.handOf(source.handedness));
      this.hand.align();
    }
  }

  /** Where the person's hands are. */
  private show(source: XRInputSource, pose: XRPose | undefined): void {
    let pointer = this.pointers.get(source);
    if (pointer === undefined) {
      pointer = new THREE.Mesh(new THREE.ConeGeometry(0.012, 0.06, 12).rotateX(-Math.PI / 2), new THREE.MeshBasicMaterial({ color: 0x8fa3b5, transparent: true, opacity: 0.7 }));
      this.pointers.set(source, pointer);
      this.view.headset.rig.add(pointer);
    }
    pointer.visible = pose !== undefined;
    if (pose === undefined) return;
    pointer.position.copy(pose.transform.position as unknown as THREE.Vector3);
    pointer.quaternion.copy(pose.transform.orientation as unknown as THREE.Quaternion);
  }
}

/** The instruction and the emergency stop, before the person: it follows when the head turns away. Frame of the headset: y up. */
class Card {
  readonly group = new THREE.Group();
  private canvas = Object.assign(document.createElement("canvas"), { width: CARD.pixels, height: (CARD.pixels * CARD.height) / CARD.width });
  private texture = new THREE.CanvasTexture(this.canvas);
  private sheet = new THREE.Mesh(new THREE.PlaneGeometry(CARD.width, CARD.height), new THREE.MeshBasicMaterial({ map: this.texture }));
  private stopCanvas = Object.assign(document.createElement("canvas"), { width: 256, height: 128 });
  private stopTexture = new THREE.CanvasTexture(this.stopCanvas);
  private stop = new THREE.Mesh(new THREE.PlaneGeometry(STOP.width, STOP.height), new THREE.MeshBasicMaterial({ map: this.stopTexture }));
  private written = "";
  private isPlaced = false;

  constructor() {
    this.texture.colorSpace = this.stopTexture.colorSpace = THREE.SRGBColorSpace;
    this.stop.position.set(0, -(CARD.height + STOP.height) / 2 - 0.02, 0);
    this.group.add(this.sheet, this.stop);
  }

  dispose(): void {
    for (const part of [this.texture, this.stopTexture, this.sheet.geometry, this.sheet.material, this.stop.geometry, this.stop.material]) part.dispose();
  }

  /** Stays where it is while the head looks about it. */
  follow({ position, orientation }: XRRigidTransform): void {
    const ahead = new THREE.Vector3(0, 0, -1).applyQuaternion(orientation as unknown as THREE.Quaternion);
    ahead.y = 0;
    if (ahead.lengthSq() < 1e-6) return;
    ahead.normalize();
    const eye = new THREE.Vector3(position.x, position.y, position.z);
    const to = this.group.position.clone().sub(eye).setY(0);
    if (this.isPlaced && to.angleTo(ahead) < CARD.turn && Math.abs(to.length() - CARD.distance) < 0.5 * CARD.distance) return;
    this.isPlaced = true;
    this.group.position.copy(eye).addScaledVector(ahead, CARD.distance);
    this.group.position.y += CARD.height - CARD.below;
    this.group.lookAt(this.group.parent === null ? eye : this.group.parent.localToWorld(eye.clone()));
  }

  /** Whether a ray along -z of this place in the world meets the stop. */
  isStopAt({ p, q }: { p: THREE.Vector3; q: THREE.Quaternion }): boolean {
    this.group.updateWorldMatrix(true, true);
    return new THREE.Raycaster(p, new THREE.Vector3(0, 0, -1).applyQuaternion(q)).intersectObject(this.stop).length > 0;
  }

  write(text: CardText): void {
    const key = JSON.stringify(text);
    const paper = this.canvas.getContext("2d");
    const label = this.stopCanvas.getContext("2d");
    if (key === this.written || paper === null || label === null) return;
    this.written = key;
    const { width, height } = this.canvas;
    paper.fillStyle = "#1c2229";
    paper.fillRect(0, 0, width, height);
    let y = 20;
    const line = (words: string, size: number, color: string, weight: number, most: number): void => {
      paper.font = `${weight} ${size}px sans-serif`;
      paper.fillStyle = color;
      for (const row of wrapped(words, (part) => paper.measureText(part).width < width - 64).slice(0, most)) paper.fillText(row, 32, (y += 1.25 * size));
      y += 0.3 * size;
    };
    line(text.head, 30, "#9fb0c0", 400, 1);
    line(text.title, 52, "#e6edf3", 700, 2);
    line(text.text, 38, "#e6edf3", 400, 4);
    y = Math.max(y, height - 110);
    line(text.state, 32, "#e69f00", 600, 2);
    label.fillStyle = "#c62828";
    label.fillRect(0, 0, 256, 128);
    Object.assign(label, { fillStyle: "#ffffff", font: "700 40px sans-serif", textAlign: "center", textBaseline: "middle" });
    label.fillText(text.stop, 128, 64, 240);
    this.texture.needsUpdate = this.stopTexture.needsUpdate = true;
  }
}

function wrapped(text: string, fits: (row: string) => boolean): string[] {
  const rows: string[] = [];
  for (const word of text.split(/\s+/).filter((part) => part !== "")) {
    const longer = rows.length === 0 ? word : `${rows[rows.length - 1]} ${word}`;
    if (rows.length > 0 && fits(longer)) rows[rows.length - 1] = longer;
    else rows.push(word);
  }
  return rows;
}
