// What the viewer does with the picture: choose the view, cut it open, measure, hide parts. Nothing of it reaches the session.
import * as THREE from "three";

import { h, icon, renew, type Icon } from "./dom";
import { cornersOf } from "./framing";
import type { Label } from "./labels";
import { Measure } from "./measure";
import { NONE, StepPhase, type Pose } from "./messages";
import { PartList } from "./partlist";
import { quaternionOf, vectorOf } from "./pose";
import type { SceneView } from "./scene";
import type { Session } from "./session";
import { keep, kept, t, type Key } from "./strings";

const STILL = 4; // [pixels] that a click moves at most
const AXES = { x: new THREE.Vector3(1, 0, 0), y: new THREE.Vector3(0, 1, 0), z: new THREE.Vector3(0, 0, 1) } as const;
type Axis = keyof typeof AXES;
type Look = "free" | "follow" | "trainee";
const KEYS: Record<string, string> = { "1": "free", "2": "follow", "3": "trainee", s: "section", b: "measure", w: "workspace", p: "parts", o: "hide", i: "isolate", a: "showall", v: "chase", "+": "nearer", "=": "nearer", "-": "farther", q: "left", e: "right" };
const ZOOM = 0.9; // of the distance, by a key
const TURN = 0.1; // [rad] likewise

export class ViewTools {
  readonly element = h("div", "tools");
  look: Look = "free";
  private bar = h("div", "toolbar");
  private sectionRow = h("div", "toolrow");
  private pickRow = h("div", "toolrow");
  private said = h("p", "unseen"); // for those who do not see the scene
  private slider = Object.assign(h("input"), { type: "range", min: "0", max: "1", step: "0.002", value: "0.5" });
  private buttons = new Map<string, HTMLButtonElement>();
  private axis: Axis = "y";
  private isFlipped = false;
  private isCut = false;
  private hasWorkspaces = false;
  private measure: Measure;
  private list: PartList;
  private picked?: number;
  private chased?: number; // what is followed in place of the work
  private followed?: THREE.Vector3;
  private pressed?: { x: number; y: number };
  private life?: number; // of the session that it is about

  constructor(private view: SceneView, private session: Session) {
    this.measure = new Measure(view, session);
    this.list = new PartList(view, session, { pick: (id) => this.pick(id), use: (id) => this.use(id), close: () => this.openList(false) });
    this.said.setAttribute("role", "status");
    const tool = (name: string, shape: Icon, action: () => void, isSwitch = true): void => {
      const button = h("button", "tool", icon(shape));
      if (isSwitch) button.setAttribute("aria-pressed", "false");
      button.addEventListener("click", action);
      this.buttons.set(name, button);
      this.bar.append(button);
    };
    tool("reset", "whole", () => this.reset(), false);
    tool("follow", "follow", () => this.choose(this.look === "follow" && this.chased === undefined ? "free" : "follow"));
    tool("trainee", "eye", () => this.choose(this.look === "trainee" ? "free" : "trainee"));
    tool("section", "section", () => this.section(!this.isCut));
    tool("measure", "measure", () => this.setMeasuring(!this.measure.isOn));
    tool("parts", "list", () => this.openList(!this.list.isOpen));
    tool("workspace", "sphere", () => this.showWorkspaces(!this.hasWorkspaces));
    this.showWorkspaces(kept("workspace") === "on");
    for (const axis of ["x", "y", "z"] as const) this.word(this.sectionRow, axis, () => this.place(axis, this.isFlipped));
    this.sectionRow.append(this.slider);
    this.word(this.sectionRow, "flip", () => this.place(this.axis, !this.isFlipped));
    this.slider.addEventListener("input", () => this.place(this.axis, this.isFlipped));
    this.element.append(this.bar, this.sectionRow, this.measure.row, this.pickRow, this.list.element, this.said);
    this.pickRow.addEventListener("click", ({ target }) => this.act((target as HTMLElement).closest<HTMLElement>("[data-key]")?.dataset["key"]));
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
    this.list.setWords();
    this.measure.tell();
    this.show();
  }

  onKeyDown({ key }: KeyboardEvent): boolean {
    const name = KEYS[key];
    this.act(name);
    return name !== undefined;
  }

  private act(name: string | undefined): void {
    if (name === "free" || name === "follow" || name === "trainee") this.choose(name);
    if (name === "section") this.section(!this.isCut);
    if (name === "measure") this.setMeasuring(!this.measure.isOn);
    if (name === "workspace") this.showWorkspaces(!this.hasWorkspaces);
    if (name === "parts") this.openList(!this.list.isOpen);
    if (name === "hide") this.hidePicked();
    if (name === "isolate") this.isolate();
    if (name === "showall") this.showAll();
    if (name === "chase") this.chase();
    if (name === "nearer" || name === "farther") this.view.zoom(name === "nearer" ? ZOOM : 1 / ZOOM);
    if (name === "left" || name === "right") this.view.turn(name === "left" ? -TURN : TURN);
  }

  private reset(): void {
    this.choose("free");
    this.view.frame();
  }

  /** `chased`: an object that is followed in place of the work. */
  private choose(look: Look, chased?: number): void {
    this.look = look;
    this.chased = chased;
    this.followed = undefined;
    this.show();
  }

  private openList(isOpen: boolean): void {
    const hadFocus = this.list.element.contains(document.activeElement);
    this.list.open(isOpen);
    if (!isOpen && hadFocus) this.view.canvas.focus();
    this.show();
  }

  private pick(object: number | undefined): void {
    this.picked = object;
    this.view.parts.mark(object);
    this.list.follow(object);
    this.show();
  }

  /** Enter on a part of the list: the next end of what is measured, else a closer look at it. */
  private use(object: number): void {
    if (this.measure.isOn) return this.measure.take(object);
    const pose = this.session.states.get(object)?.X_WO ?? this.session.objects.get(object)?.X_WO;
    if (pose === undefined) return;
    this.choose("free");
    this.view.frame(this.around({ object, pose }));
  }

  private chase(): void {
    if (this.picked === undefined) return;
    const isChased = this.look === "follow" && this.chased === this.picked;
    this.choose(isChased ? "free" : "follow", isChased ? undefined : this.picked);
    if (!isChased) this.say(t("parts.said.followed", { what: this.session.titleOf(this.picked) }));
  }

  private say(text: string): void {
    this.said.textContent = text;
  }

  /** Where the work is: the object of the step when somebody holds it, else what else somebody holds, else the object of the step, else the first hand. */
  private focus(): { object: number; pose: Pose } | undefined {
    const { session, chased } = this;
    const { step } = session;
    const own = chased === undefined ? undefined : session.states.get(chased)?.X_WO;
    if (chased !== undefined && own !== undefined) return { object: chased, pose: own };
    const all = [...session.grabs.values()].filter(({ object_id, hand_id }) => hand_id !== NONE && !session.isOwn(object_id) && !session.isTracked(hand_id));
    const held = all.find(({ object_id }) => object_id === step?.object_id) ?? all[0];
    const object = held?.object_id ?? (step !== undefined && step.phase <= StepPhase.Active ? step.object_id : NONE);
    const pose = session.states.get(object)?.X_WO ?? [...session.hands].find(([id]) => !session.isTracked(id))?.[1].X_WH;
    return pose && { object, pose };
  }

  /** The corners of an object's box; of none the place itself. */
  private around({ object, pose }: { object: number; pose: Pose }): THREE.Vector3[] {
    const known = this.session.objects.get(object);
    const box = new THREE.Box3().setFromCenterAndSize(vectorOf(known?.centre ?? [0, 0, 0]), vectorOf(known?.size ?? [0, 0, 0]));
    const [turn, at] = [quaternionOf(pose.q), vectorOf(pose.p)];
    return [...cornersOf(box)].map((corner) => corner.applyQuaternion(turn).add(at));
  }

  /** Of another session nothing is picked, or measured. */
  private forget(): void {
    this.life = this.session.link?.life;
    this.chased = undefined;
    this.measure.set(this.measure.isOn);
    this.pick(undefined);
  }

  /** Called for each frame of the display. */
  update(now: number): void {
    if (this.session.link?.life !== this.life) this.forget();
    this.measure.update(now);
    this.list.update(now);
    if (this.look === "free") return;
    const work = this.focus();
    if (work === undefined) return;
    const focus = vectorOf(work.pose.p);
    if (this.look === "trainee") {
      const head = [...this.session.objects.values()].find(({ kind }) => kind === "head");
      const pose = head === undefined ? undefined : this.session.states.get(head.object_id)?.X_WO;
      const eye = pose === undefined ? new THREE.Vector3(focus.x, focus.y - 0.7, focus.z + 0.5) : vectorOf(pose.p);
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

  private setMeasuring(isOn: boolean): void {
    this.measure.set(isOn);
    this.show();
  }

  private onUp({ clientX: x, clientY: y }: PointerEvent): void {
    const { pressed } = this;
    this.pressed = undefined;
    if (pressed === undefined || Math.hypot(x - pressed.x, y - pressed.y) > STILL || (this.view.isHandMode && !this.measure.isOn)) return;
    const pick = this.view.pick(x, y);
    if (!this.measure.isOn) this.pick(pick?.object);
    else if (pick !== undefined) this.measure.take(pick.point);
  }

  private hide(ids: number[]): void {
    this.view.parts.hide(ids);
    this.list.follow(this.picked);
    this.show();
  }

  /** Or shows it again. */
  private hidePicked(): void {
    const { picked } = this;
    if (picked === undefined) return;
    const { hidden } = this.view.parts;
    const isHidden = hidden.has(picked);
    this.hide(isHidden ? [...hidden].filter((id) => id !== picked) : [...hidden, picked]);
    this.say(t(isHidden ? "parts.said.shown" : "parts.said.hidden", { what: this.session.titleOf(picked) }));
  }

  private isolate(): void {
    const { picked } = this;
    if (picked === undefined) return;
    this.hide([...this.view.parts.all.keys()].filter((other) => other !== picked));
    this.say(t("parts.said.alone", { what: this.session.titleOf(picked) }));
  }

  private showAll(): void {
    this.hide([]);
    this.say(t("parts.said.all"));
  }

  /** Of the measured distance. */
  labels(): Label[] {
    return this.measure.labels();
  }

  show(): void {
    const press = (name: string, isOn: boolean): void => this.buttons.get(name)?.setAttribute("aria-pressed", String(isOn));
    press("follow", this.look === "follow" && this.chased === undefined);
    press("trainee", this.look === "trainee");
    press("section", this.isCut);
    press("measure", this.measure.isOn);
    press("parts", this.list.isOpen);
    for (const axis of ["x", "y", "z"]) press(axis, this.axis === axis);
    this.sectionRow.hidden = !this.isCut;
    const { hidden } = this.view.parts;
    const { picked } = this;
    // known by their names, so that the one with the focus keeps it
    const word = (name: string, key: Key, isPressed?: boolean): HTMLElement => {
      const button = h("button", "word", t(key));
      if (isPressed !== undefined) button.setAttribute("aria-pressed", String(isPressed));
      button.dataset["key"] = name;
      return button;
    };
    const ofPicked = picked === undefined ? [] : [
      h("b", "", this.session.titleOf(picked)), word("hide", hidden.has(picked) ? "tool.show" : "tool.hide"), word("isolate", "tool.isolate"), word("chase", "tool.chase", this.chased === picked),
    ];
    this.pickRow.hidden = picked === undefined && hidden.size === 0;
    renew(this.pickRow, [...ofPicked, ...(hidden.size === 0 ? [] : [word("showall", "tool.showall")])]);
  }
}
