// A hand without hardware: where the person at this page wants it, by mouse, touch and keys, and what it feels. The gateway keeps it near its proxy.
import { Quaternion, Vector3 } from "three";

import { motionOfPad } from "./gamepad";
import { NONE, StepPhase, type Pose } from "./messages";
import { quaternionOf, vectorOf } from "./pose";
import { Button, encodeTargets, type HandView, type Place } from "./remote";
import type { SceneView } from "./scene";
import type { Session } from "./session";

const PERIOD = 16; // [ms] between targets
const PRESS = 300; // [ms] that a press of the arming button lasts
const SHIFT = 0.005; // [m] of a workspace between two views: it is not the slow return of an offset
const NEAR = 0.02; // [m] of the proxy: nothing pushes back, so a target that is let go stays near
const NOTCH = 16; // [pixels] of depth, as large as pixels are where the hand is: a notch of the wheel
const TURN_NOTCH = 0.1; // [rad] likewise
const TURN_PIXEL = 0.008; // [rad]
const KEY_SPEED = 160; // [pixels/s] likewise
const KEY_TURN = 0.8; // [rad/s]
const ALIGN_TURN = 1.2; // [rad/s]
const ALIGNED = 0.002; // [rad]
const DEPTH_SPEED = 0.5; // [m/s]
const DEEP_ENOUGH = 0.0005; // [m]
const ADVANCE = 0.001; // [m] of depth at least that a held part gains
const TURN_ADVANCE = 0.005; // [rad] of its turn to the ghost likewise
const BLOCKED = 1000; // [ms] within these, else something stands in its way
const CLOSE = 0.05; // [m] to its place a part slides along what guides it
const FINE = 0.1;
const GATE = 0.006; // [m] beside the line of the approach from which on the way leads along it
const LEAVE = 0.02; // [m] beside it from which on the way leads to its begin again

const copy = ({ p, q }: Place): Place => ({ p: p.clone(), q: q.clone() });

/** Where the step wants what the hand moves; `farther`: [m] away from the viewer. */
export interface Guide { from: Vector3; to: Vector3; distance: number; farther: number; angle?: number }
/** Keys that move: along right, up and away of the view. */
const KEYS: Record<string, [number, number, number]> = {
  ArrowLeft: [-1, 0, 0], ArrowRight: [1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0], PageUp: [0, 0, 1], PageDown: [0, 0, -1],
};

/** What is left of a way that is to shrink, by `least` within BLOCKED at least. */
class Progress {
  private left = Infinity; // when it was last less by `least`
  private gainedAt = 0; // [ms]
  constructor(private least: number) {}

  begin(): void {
    this.left = Infinity;
  }
  /** Whether something stands in the way, with so much of it left. */
  isBlocked(left: number): boolean {
    const now = performance.now();
    if (left < this.left - this.least) [this.left, this.gainedAt] = [left, now];
    return now - this.gainedAt > BLOCKED;
  }
}

export class Hand {
  views: HandView[] = [];
  /** The one that mouse and keys move. */
  current = 0;
  /** A tenth of each motion; and drags turn instead of moving. */
  isFine = false;
  isTurning = false;
  guide?: Guide;
  /** Called when a hand has come to touch something. */
  onContact?: (force: number, index: number) => void;
  /** Whether somebody sees what the hand does; by default while the page is shown. */
  isWatched?: () => boolean;
  private targets: Place[] = [];
  private seq = 0;
  private armUntil = 0;
  private aligning = false;
  private depthGoal?: Vector3; // whose depth the hand is brought to
  private depthOf = -1; // revision of the step that it is of
  private depth = new Progress(ADVANCE);
  private alignment = new Progress(TURN_ADVANCE);
  private wayOf = -1; // revision of the step on whose approach the part is
  private pressed = new Set<string>();
  private isShift = false;
  private drag?: { pointer: number; x: number; y: number };
  private grasped = new Set<number>();
  private touched: boolean[] = [];
  private timer: number;
  private moved = 0;
  private wasPadPressed = false;

  constructor(private session: Session, private view: SceneView, private ids: number[], private send: (bytes: Uint8Array<ArrayBuffer>) => void) {
    this.timer = window.setInterval(() => this.tick(), PERIOD);
    const { canvas } = view;
    canvas.addEventListener("pointerdown", this.onDown);
    canvas.addEventListener("pointermove", this.onMove);
    for (const name of ["pointerup", "pointercancel"] as const) canvas.addEventListener(name, this.onUp);
    canvas.addEventListener("wheel", this.onWheel, { passive: false });
    addEventListener("keyup", this.onKeyUp);
    addEventListener("blur", this.letGo);
    view.setHandMode(true);
  }

  end(): void {
    clearInterval(this.timer);
    const { canvas } = this.view;
    canvas.removeEventListener("pointerdown", this.onDown);
    canvas.removeEventListener("pointermove", this.onMove);
    for (const name of ["pointerup", "pointercancel"] as const) canvas.removeEventListener(name, this.onUp);
    canvas.removeEventListener("wheel", this.onWheel);
    removeEventListener("keyup", this.onKeyUp);
    removeEventListener("blur", this.letGo);
    this.view.setHandMode(false);
    this.view.setGuide(undefined);
  }

  receive(views: HandView[]): void {
    const before = this.views;
    this.views = views;
    views.forEach((view, i) => {
      // Without a proxy the hand stays where its device is, and also when its workspace was shifted to the proxy.
      const last = before[i];
      const isShifted = last?.isActive !== true || last.centre.distanceTo(view.centre) > SHIFT;
      if (!view.isActive || isShifted || this.targets[i] === undefined) this.targets[i] = copy(view.hand);
      if (view.isActive && view.inContact && this.touched[i] === false) this.onContact?.(view.force, i);
      this.touched[i] = view.inContact;
    });
    this.guide = this.findGuide();
    this.view.setGuide(this.guide);
  }

  get now(): HandView | undefined {
    return this.views[this.current];
  }
  get isOn(): boolean {
    return this.views.length > 0 && this.views.every((view) => view.isOn);
  }
  get isAligning(): boolean {
    return this.aligning;
  }
  get canAlign(): boolean {
    return this.goal() !== undefined;
  }
  get isDeepening(): boolean {
    return this.depthGoal !== undefined;
  }

  /** The person at this page arms the station, or agrees that a stop ends. */
  press(): void {
    this.armUntil = performance.now() + PRESS;
  }
  /** Turns what the hand holds as the ghost is turned, until it is, or until something stands in its way. */
  align(): void {
    this.alignment.begin();
    this.aligning = !this.aligning && this.canAlign;
  }
  /** Brings what the hand moves as far away from the viewer as where it is to go, or until something stands in its way: a held part pushes nothing before it is close to its place. */
  deepen(): void {
    this.depth.begin();
    this.depthOf = this.session.step?.revision ?? -1;
    this.depthGoal = this.depthGoal === undefined ? this.guide?.to.clone() : undefined;
  }
  /** No push any more. */
  relax(): void {
    if (this.now !== undefined) this.targets[this.current] = copy(this.now.proxy);
    this.aligning = false;
    this.depthGoal = undefined;
    this.drag = undefined;
    this.pressed.clear();
  }
  choose(index: number): void {
    if (index === this.current || index >= this.ids.length) return;
    this.relax();
    this.current = index;
  }
  /** Chooses the hand that the step is about. */
  follow(): void {
    const { step } = this.session;
    if (step === undefined) return;
    const wanted = [step.hand_id, this.session.holderOf(step.object_id)].map((id) => this.ids.indexOf(id)).find((index) => index >= 0);
    this.choose(wanted ?? 0);
  }

  /** Moved directly until its release, as by a controller. */
  grasp(index: number): void {
    this.grasped.add(index);
    if (index !== this.current) return;
    this.aligning = false;
    this.depthGoal = undefined;
  }
  release(index: number): void {
    this.grasped.delete(index);
  }
  /** In the world: by a way [m], and by a turn about the hand's own centre. */
  moveBy(index: number, way: Vector3, turn: Quaternion): void {
    const target = this.targets[index];
    if (target === undefined) return;
    target.p.addScaledVector(way, this.isFine ? FINE : 1);
    target.q.premultiply(this.isFine ? new Quaternion().slerp(turn, FINE) : turn).normalize();
  }

  /** Along right, up and away of the view [m]. */
  private shift(right: number, up: number, away: number): void {
    const target = this.targets[this.current];
    if (target === undefined) return;
    const axes = this.view.axes();
    target.p.addScaledVector(axes.right, right).addScaledVector(axes.up, up).addScaledVector(axes.away, away);
  }
  /** Likewise, as far as a key that is held for so long [s]. */
  go(right: number, up: number, away: number): void {
    const target = this.targets[this.current];
    const step = target === undefined ? 0 : KEY_SPEED * this.view.metresPerPixel(target.p);
    this.shift(right * step, up * step, away * step);
  }
  /** About right, up and away of the view [rad], and the centre of what it holds. */
  turn(right: number, up: number, away: number): void {
    const axes = this.view.axes();
    for (const [axis, angle] of [[axes.right, right], [axes.up, up], [axes.away, away]] as const) this.turnBy(new Quaternion().setFromAxisAngle(axis, angle));
  }

  private turnBy(turn: Quaternion): void {
    const target = this.targets[this.current];
    const centre = this.centreAt(target);
    if (target === undefined || centre === undefined) return;
    target.p.sub(centre).applyQuaternion(turn).add(centre);
    target.q.premultiply(turn).normalize();
  }
  /** Of what the hand holds, with the hand at `place`. */
  private centreAt(place: Place | undefined): Vector3 | undefined {
    const { now } = this;
    if (now === undefined || place === undefined) return undefined;
    const centre = vectorOf(this.session.objects.get(now.objectId)?.centre ?? [0, 0, 0]).applyQuaternion(now.object.q).add(now.object.p);
    return centre.sub(now.proxy.p).applyQuaternion(now.proxy.q.clone().invert()).applyQuaternion(place.q).add(place.p);
  }
  /** Of the step, if it is about what this hand holds. */
  private goal(): Pose | undefined {
    const { step } = this.session;
    const is = step !== undefined && step.has_target && step.phase <= StepPhase.Active && step.object_id === this.now?.objectId;
    return is ? step.X_WG : undefined;
  }

  private findGuide(): Guide | undefined {
    const { session, now } = this;
    const { step } = session;
    const from = now?.isActive === true ? this.centreAt(now.proxy) : undefined;
    if (step === undefined || now === undefined || from === undefined || session.isOver) return undefined;
    const goal = this.goal();
    const guide = (to: Vector3, angle?: number): Guide => {
      const off = to.clone().sub(from);
      return { from, to, distance: off.length(), farther: off.dot(this.view.axes().away), angle };
    };
    if (goal !== undefined) {
      const q_WG = quaternionOf(goal.q);
      const to = vectorOf(session.objects.get(step.object_id)?.centre ?? [0, 0, 0]).applyQuaternion(q_WG).add(vectorOf(goal.p));
      const way = vectorOf(step.approach_W);
      const off = from.clone().sub(to);
      const beside = off.clone().addScaledVector(way, -off.dot(way)).length();
      const isOnWay = step.approach_distance === 0 || beside < (this.wayOf === step.revision ? LEAVE : GATE) || off.length() < GATE;
      this.wayOf = isOnWay ? step.revision : -1;
      return guide(isOnWay ? to : to.addScaledVector(way, -step.approach_distance), now.object.q.angleTo(q_WG));
    }
    const touch = session.states.get(step.touch_id);
    if (step.touch_id === NONE || touch === undefined || session.isOwn(step.touch_id)) return undefined;
    return guide(vectorOf(session.objects.get(step.touch_id)?.centre ?? [0, 0, 0]).applyQuaternion(quaternionOf(touch.X_WO.q)).add(vectorOf(touch.X_WO.p)));
  }

  private tick(): void {
    const now = performance.now();
    const seconds = Math.min(0.1, (now - this.moved) / 1000);
    this.moved = now;
    this.applyKeys(seconds);
    this.applyGamepad(seconds);
    this.applyAlignment(seconds);
    this.applyDepth(seconds);
    this.targets.forEach((target, i) => {
      const view = this.views[i];
      if (view === undefined || (this.drag !== undefined && i === this.current) || this.grasped.has(i)) return;
      const off = target.p.clone().sub(view.proxy.p);
      if (view.isActive && off.length() > NEAR && view.inContact) target.p.copy(view.proxy.p).add(off.setLength(NEAR));
    });
    if (this.views.length === 0) return;
    const isWatched = this.isWatched?.() ?? document.visibilityState === "visible";
    const buttons = (isWatched ? Button.Held : 0) | (now < this.armUntil ? Button.Arm : 0);
    this.send(encodeTargets(++this.seq, buttons, this.targets, this.views.map((view) => view.centre)));
  }

  private applyKeys(seconds: number): void {
    const sum = [0, 0, 0];
    for (const key of this.pressed) KEYS[key].forEach((direction, i) => (sum[i] += direction));
    const scale = seconds * (this.isFine ? FINE : 1);
    const [right, up, away] = sum.map((direction) => direction * scale);
    if (right === 0 && up === 0 && away === 0) return;
    if (this.isShift) this.turn(-up * KEY_TURN, right * KEY_TURN, away * KEY_TURN);
    else this.go(right, up, away);
  }

  /** The sticks of the first gamepad: left right and up, away; with the left shoulder they turn. */
  private applyGamepad(seconds: number): void {
    const pad = motionOfPad();
    if (pad === undefined) return;
    if (pad.isPressed && !this.wasPadPressed) {
      if (this.isOn) this.align();
      else this.press();
    }
    this.wasPadPressed = pad.isPressed;
    const scale = seconds * (this.isFine || pad.isFine ? FINE : 1);
    const [right, up, away] = [pad.right, pad.up, pad.away].map((part) => part * scale);
    if (right === 0 && up === 0 && away === 0) return;
    if (pad.isTurning || this.isTurning) this.turn(-up * KEY_TURN, right * KEY_TURN, away * KEY_TURN);
    else this.go(right, up, away);
  }

  /** Eases the orientation of the part to the ghost's. */
  private applyAlignment(seconds: number): void {
    const goal = this.aligning ? this.goal() : undefined;
    const target = this.targets[this.current];
    if (goal === undefined || target === undefined || this.now === undefined) {
      this.aligning = false;
      return;
    }
    const q_HO = this.now.proxy.q.clone().invert().multiply(this.now.object.q);
    const off = quaternionOf(goal.q).multiply(target.q.clone().multiply(q_HO).invert());
    const angle = 2 * Math.acos(Math.min(1, Math.abs(off.w)));
    if (angle > ALIGNED) this.turnBy(new Quaternion().slerp(off, Math.min(1, (ALIGN_TURN * seconds) / angle)));
    const left = this.now.object.q.angleTo(quaternionOf(goal.q));
    if ((angle <= ALIGNED && left < 2 * ALIGNED) || this.alignment.isBlocked(left)) this.aligning = false;
  }

  /** What the hand holds has gained no depth for a while. */
  private isDepthBlocked(): boolean {
    const from = this.depthGoal === undefined ? undefined : this.centreAt(this.now?.proxy);
    if (from === undefined || this.depthGoal === undefined) return false;
    return this.depth.isBlocked(Math.abs(this.depthGoal.clone().sub(from).dot(this.view.axes().away)));
  }

  private applyDepth(seconds: number): void {
    if (this.depthOf !== this.session.step?.revision) this.depthGoal = undefined;
    if (this.depthGoal !== undefined && this.now?.inContact === true && this.goal() !== undefined && (this.guide?.distance ?? 0) > CLOSE) return this.relax();
    const centre = this.depthGoal === undefined ? undefined : this.centreAt(this.targets[this.current]);
    const off = centre === undefined ? 0 : (this.depthGoal?.clone().sub(centre).dot(this.view.axes().away) ?? 0);
    if (Math.abs(off) < DEEP_ENOUGH || this.isDepthBlocked()) this.depthGoal = undefined;
    if (centre === undefined || this.depthGoal === undefined) return;
    // along the line of sight: in the picture it stays where it is
    const ray = this.view.sightOf(centre);
    const most = DEPTH_SPEED * seconds;
    this.targets[this.current].p.addScaledVector(ray, Math.max(-most, Math.min(most, off)) / ray.dot(this.view.axes().away));
  }

  /** True when it was one of the hand's keys. */
  onKeyDown(event: KeyboardEvent): boolean {
    this.isShift = event.shiftKey;
    if (event.key in KEYS) {
      this.pressed.add(event.key);
      event.preventDefault();
      return true;
    }
    if (event.repeat) return false;
    const action = { g: () => this.align(), d: () => this.deepen(), f: () => (this.isFine = !this.isFine), t: () => (this.isTurning = !this.isTurning), x: () => this.choose((this.current + 1) % this.ids.length), Escape: () => this.relax() }[event.key];
    action?.();
    return action !== undefined;
  }
  private onKeyUp = (event: KeyboardEvent): void => {
    this.isShift = event.shiftKey;
    this.pressed.delete(event.key);
  };
  /** What was held when the window lost the focus: its release is not heard of. */
  private letGo = (): void => {
    this.pressed.clear();
    this.drag = undefined;
  };

  private onDown = (event: PointerEvent): void => {
    // a second finger turns the view: the hand stays, also when one of them is lifted
    const isSecond = !event.isPrimary || (this.drag !== undefined && this.drag.pointer !== event.pointerId);
    if (isSecond) this.drag = undefined;
    if (isSecond || event.button !== 0) return;
    this.drag = { pointer: event.pointerId, x: event.clientX, y: event.clientY };
    this.aligning = false;
  };
  private onMove = (event: PointerEvent): void => {
    const { drag } = this;
    const target = this.targets[this.current];
    if (drag === undefined || drag.pointer !== event.pointerId || target === undefined) return;
    const fine = this.isFine ? FINE : 1;
    const dx = (event.clientX - drag.x) * fine;
    const dy = (event.clientY - drag.y) * fine;
    this.drag = { ...drag, x: event.clientX, y: event.clientY };
    const metres = this.view.metresPerPixel(target.p);
    if (event.shiftKey || this.isTurning) this.turn(dy * TURN_PIXEL, dx * TURN_PIXEL, 0);
    else if (event.ctrlKey) target.p.z -= dy * metres;
    else this.shift(dx * metres, -dy * metres, 0);
  };
  private onUp = (event: PointerEvent): void => {
    if (this.drag?.pointer === event.pointerId) this.drag = undefined;
  };
  private onWheel = (event: WheelEvent): void => {
    if (event.ctrlKey) return; // zooms
    event.preventDefault();
    const notches = -Math.sign(event.deltaY || event.deltaX) * (this.isFine ? FINE : 1);
    this.depthGoal = undefined;
    if (event.shiftKey) this.turn(0, 0, notches * TURN_NOTCH);
    else this.go(0, 0, (notches * NOTCH) / KEY_SPEED);
  };
}
