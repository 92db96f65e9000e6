// What the viewer does with the picture: choose the view, cut it open, measure, hide parts. Nothing of it reaches the session.
import * as THREE from "three";

import { h, icon, type Icon } from "./dom";
import { cornersOf } from "./framing";
import { NONE, StepPhase, type Pose } from "./messages";
import type { Label } from "./labels";
import type { SceneView } from "./scene";
import type { Session } from "./session";
import { keep, kept, n, t, type Key } from "./strings";

const STILL = 4; // [pixels] that a click moves at most
const AXES = { x: new THREE.Vector3(1, 0, 0), y: new THREE.Vector3(0, 1, 0), z: new THREE.Vector3(0, 0, 1) } as const;
type Axis = keyof typeof AXES;
type Look = "free" | "follow" | "trainee";
const KEYS: Record<string, string> = { "1": "free", "2": "follow", "3": "trainee", s: "section", b: "measure", w: "workspace", o: "hide", i: "isolate", a: "showall" };

export class ViewTools {
  readonly element = h("div", "tools");
  look: Look = "free";
  private bar = h("div", "toolbar");
  private sectionRow = h("div", "toolrow");
  private measureRow = h("div", "toolrow");
  private pickRow = h("div", "toolrow");
  private slider = Object.assign(h("input"), { type: "range", min: "0", max: "1", step: "0.002", value: "0.5" });
  private buttons = new Map<string, HTMLButtonElement>();
  private axis: Axis = "y";
  private isFlipped = false;
  private isCut = false;
  private isMeasuring = false;
  private hasWorkspaces = false;
  private ends: THREE.Vector3[] = [];
  private picked?: number;
  private followed?: THREE.Vector3;
  private pressed?: { x: number; y: number };
  private line = new THREE.Line(new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3()]), new THREE.LineBasicMaterial({ color: 0xd55e00, depthTest: false, transparent: true }));
  private dots = [0, 1].map(() => new THREE.Mesh(new THREE.SphereGeometry(1, 12, 8), new THREE.MeshBasicMaterial({ color: 0xd55e00, depthTest: false, transparent: true })));

  constructor(private view: SceneView, private session: Session) {
    const tool = (name: string, shape: Icon, action: () => void, isSwitch = true): void => {
      const button = h("button", "tool", icon(shape));
      if (isSwitch) button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", action);
      this.buttons.set(name, button);
      this.bar.append(button);
    };
    tool("reset", "whole", () => this.reset(), false);
    tool("follow", "follow", () => this.choose(this.look === "follow" ? "free" : "follow"));
    tool("trainee", "eye", () => this.choose(this.look === "trainee" ? "free" : "trainee"));
    tool("section", "section", () => this.section(!this.isCut));
    tool("measure", "measure", () => this.measure(!this.isMeasuring));
    tool("workspace", "sphere", () => this.showWorkspaces(!this.hasWorkspaces));
    this.showWorkspaces(kept("workspace") === "on");
    for (const axis of ["x", "y", "z"] as const) this.word(this.sectionRow, axis, () => this.place(axis, this.isFlipped));
    this.sectionRow.append(this.slider);
    this.word(this.sectionRow, "flip", () => this.place(this.axis, !this.isFlipped));
    this.slider.addEventListener("input", () => this.place(this.axis, this.isFlipped));
    this.line.visible = false;
    this.line.frustumCulled = false;
    this.line.renderOrder = 4;
    for (const dot of this.dots) Object.assign(dot, { visible: false, renderOrder: 4 });
    view.add(this.line, ...this.dots);
    this.element.append(this.bar, this.sectionRow, this.measureRow, this.pickRow);
    view.canvas.addEventListener("pointerdown", ({ clientX: x, clientY: y, button }) => (this.pressed = button === 0 ? { x, y } : undefined));
    view.canvas.addEventListener("pointerup", (event) => this.onUp(event));
    this.setWords();
  }

  private word(row: HTMLElement, name: string, action: () => void): void {
    const button = h("button", "word");
    button.addEventListener("click", action);
    this.buttons.set(name, button);
    row.append(button);
  }

  setWords(): void {
    for (const [name, button] of this.buttons) {
      const text = t(`tool.${name}` as Key);
      if (button.classList.contains("tool")) {
        const key = Object.entries(KEYS).find(([, known]) => known === name)?.[0] ?? "r";
        button.setAttribute("aria-label", text);
        button.title = `${text} (${key.toUpperCase()})`;
      } else button.textContent = text;
    }
    this.slider.setAttribute("aria-label", t("tool.section.place"));
    this.show();
  }

  onKeyDown({ key }: KeyboardEvent): boolean {
    const name = KEYS[key];
    if (name === undefined) return false;
    if (name === "free" || name === "follow" || name === "trainee") this.choose(name);
    if (name === "section") this.section(!this.isCut);
    if (name === "measure") this.measure(!this.isMeasuring);
    if (name === "workspace") this.showWorkspaces(!this.hasWorkspaces);
    if (name === "hide" && this.picked !== undefined) this.hide([...this.view.parts.hidden, this.picked]);
    if (name === "isolate" && this.picked !== undefined) this.isolate(this.picked);
    if (name === "showall") this.hide([]);
    return true;
  }

  private reset(): void {
    this.choose("free");
    this.view.frame();
  }

  private choose(look: Look): void {
    this.look = look;
    this.followed = undefined;
    this.show();
  }

  /** Where the work is: the object of the step when somebody holds it, else what else somebody holds, else the object of the step, else the first hand. */
  private focus(): { object: number; pose: Pose } | undefined {
    const { session } = this;
    const { step } = session;
    const all = [...session.grabs.values()].filter(({ object_id, hand_id }) => hand_id !== NONE && !session.isOwn(object_id) && !session.isTracked(hand_id));
    const held = all.find(({ object_id }) => object_id === step?.object_id) ?? all[0];
    const object = held?.object_id ?? (step !== undefined && step.phase <= StepPhase.Active ? step.object_id : NONE);
    const pose = session.states.get(object)?.X_WO ?? [...session.hands].find(([id]) => !session.isTracked(id))?.[1].X_WH;
    return pose && { object, pose };
  }

  /** The corners of an object's box; of none the place itself. */
  private around({ object, pose }: { object: number; pose: Pose }): THREE.Vector3[] {
    const known = this.session.objects.get(object);
    const [centre, size] = [known?.centre ?? [0, 0, 0], known?.size ?? [0, 0, 0]].map((v) => new THREE.Vector3().fromArray(v));
    const box = new THREE.Box3().setFromCenterAndSize(centre, size);
    const [turn, at] = [new THREE.Quaternion().fromArray(pose.q), new THREE.Vector3().fromArray(pose.p)];
    return [...cornersOf(box)].map((corner) => corner.applyQuaternion(turn).add(at));
  }

  /** Called for each frame of the display. */
  update(): void {
    if (this.look === "free") return;
    const work = this.focus();
    if (work === undefined) return;
    const focus = new THREE.Vector3().fromArray(work.pose.p);
    if (this.look === "trainee") {
      const head = [...this.session.objects.values()].find(({ kind }) => kind === "head");
      const pose = head === undefined ? undefined : this.session.states.get(head.object_id)?.X_WO;
      const eye = pose === undefined ? new THREE.Vector3(focus.x, focus.y - 0.7, focus.z + 0.5) : new THREE.Vector3(pose.p[0], pose.p[1], pose.p[2]);
      if (this.followed === undefined || this.followed.distanceTo(focus) > 1e-4) this.view.lookFrom(eye, focus);
    } else if (this.followed === undefined) this.view.frame(this.around(work));
    else if (this.followed.distanceTo(focus) > 1e-4) this.view.carry(focus.clone().sub(this.followed));
    this.followed = focus;
  }

  /** The view of the step's object and where it goes. */
  showWork(): void {
    const { step } = this.session;
    const work = this.focus();
    const goal = step?.has_target === true ? this.around({ object: step.object_id, pose: step.X_WG }) : [];
    if (work !== undefined) this.view.frame([...this.around(work), ...goal]);
  }

  private section(isOn: boolean): void {
    this.isCut = isOn;
    if (isOn) this.place(this.axis, this.isFlipped);
    else this.view.parts.cut(undefined);
    this.show();
  }

  private place(axis: Axis, isFlipped: boolean): void {
    [this.axis, this.isFlipped] = [axis, isFlipped];
    const box = this.view.parts.box();
    const normal = AXES[axis].clone().multiplyScalar(isFlipped ? -1 : 1);
    const at = box.min.clone().lerp(box.max, Number(this.slider.value));
    this.view.parts.cut(new THREE.Plane().setFromNormalAndCoplanarPoint(normal, at));
    this.show();
  }

  /** Is kept, as other choices of the viewer's are. */
  private showWorkspaces(isOn: boolean): void {
    this.hasWorkspaces = isOn;
    keep("workspace", isOn ? "on" : "off");
    this.buttons.get("workspace")?.setAttribute("aria-pressed", String(isOn));
    this.view.showWorkspaces(isOn);
  }

  private measure(isOn: boolean): void {
    this.isMeasuring = isOn;
    this.ends = [];
    this.drawMeasure();
    this.show();
  }

  private drawMeasure(): void {
    this.dots.forEach((dot, i) => {
      dot.visible = this.ends[i] !== undefined;
      if (this.ends[i] !== undefined) dot.position.copy(this.ends[i]);
      dot.scale.setScalar(4 * this.view.metresPerPixel(dot.position));
    });
    this.line.visible = this.ends.length === 2;
    const places = this.line.geometry.getAttribute("position") as THREE.BufferAttribute;
    this.ends.forEach((end, i) => places.setXYZ(i, end.x, end.y, end.z));
    places.needsUpdate = true;
    this.view.redraw();
  }

  private onUp({ clientX: x, clientY: y }: PointerEvent): void {
    const { pressed } = this;
    this.pressed = undefined;
    if (pressed === undefined || Math.hypot(x - pressed.x, y - pressed.y) > STILL || (this.view.isHandMode && !this.isMeasuring)) return;
    const pick = this.view.pick(x, y);
    if (this.isMeasuring) {
      if (pick === undefined) return;
      this.ends = this.ends.length === 2 ? [pick.point] : [...this.ends, pick.point];
      this.drawMeasure();
    } else {
      this.picked = pick?.object;
      this.view.parts.mark(this.picked);
    }
    this.show();
  }

  private hide(ids: number[]): void {
    this.view.parts.hide(ids);
    this.show();
  }

  private isolate(id: number): void {
    this.hide([...this.view.parts.all.keys()].filter((other) => other !== id));
  }

  /** Of the measured distance. */
  labels(): Label[] {
    if (this.ends.length < 2) return [];
    return [{ place: this.ends[0].clone().lerp(this.ends[1], 0.5), text: `${n(1000 * this.ends[0].distanceTo(this.ends[1]), 1)} mm`, tone: "measured" }];
  }

  show(): void {
    const press = (name: string, isOn: boolean): void => this.buttons.get(name)?.setAttribute("aria-pressed", String(isOn));
    press("follow", this.look === "follow");
    press("trainee", this.look === "trainee");
    press("section", this.isCut);
    press("measure", this.isMeasuring);
    for (const axis of ["x", "y", "z"]) press(axis, this.axis === axis);
    this.sectionRow.hidden = !this.isCut;
    this.measureRow.hidden = !this.isMeasuring;
    const [a, b] = this.ends;
    const mm = (metres: number): string => n(1000 * metres, 1);
    this.measureRow.textContent =
      b === undefined ? t(a === undefined ? "tool.measure.first" : "tool.measure.second") : t("tool.measured", { distance: mm(a.distanceTo(b)), x: mm(b.x - a.x), y: mm(b.y - a.y), z: mm(b.z - a.z) });
    const { hidden } = this.view.parts;
    const { picked } = this;
    const word = (key: Key, action: () => void): HTMLElement => {
      const button = h("button", "word", t(key));
      button.addEventListener("click", action);
      return button;
    };
    this.pickRow.hidden = picked === undefined && hidden.size === 0;
    this.pickRow.replaceChildren(
      ...(picked === undefined ? [] : [h("b", "", this.session.titleOf(picked)), word("tool.hide", () => this.hide([...hidden, picked])), word("tool.isolate", () => this.isolate(picked))]),
      ...(hidden.size === 0 ? [] : [word("tool.showall", () => this.hide([]))]),
    );
  }
}
