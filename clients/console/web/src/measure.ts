// A distance in the scene, between two places that were clicked, or two parts that were chosen.
import * as THREE from "three";

import { h } from "./dom";
import type { Label } from "./labels";
import { nearestOf, Surface } from "./nearest";
import type { SceneView } from "./scene";
import type { Session } from "./session";
import { n, t } from "./strings";

const COLOR = 0xd55e00;
const DOT = 4; // [pixels]
const PERIOD = 200; // [ms] between two measurements of parts that move
const SHARE = 0.1; // of the time that goes into them at most

/** Of [m]; no minus before a 0. */
const mm = (metres: number): string => n(Math.round(1e4 * metres) / 10 || 0, 1);

/** A place in the world, or the object whose nearest surface counts. */
type End = THREE.Vector3 | number;

export class Measure {
  readonly row = h("div", "toolrow");
  isOn = false;
  private ends: End[] = [];
  private points: THREE.Vector3[] = [];
  private centres?: number; // [m] between those of two parts
  private surfaces = new WeakMap<THREE.Object3D, Surface>();
  private places = ""; // of the parts, when it was measured
  private next = 0; // [ms] of the page's clock
  private line = new THREE.Line(new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3()]), new THREE.LineBasicMaterial({ color: COLOR, depthTest: false, transparent: true }));
  private dots = [0, 1].map(() => new THREE.Mesh(new THREE.SphereGeometry(1, 12, 8), new THREE.MeshBasicMaterial({ color: COLOR, depthTest: false, transparent: true })));

  constructor(private view: SceneView, private session: Session) {
    this.row.setAttribute("role", "status");
    this.line.visible = false;
    this.line.frustumCulled = false;
    this.line.renderOrder = 4;
    for (const dot of this.dots) Object.assign(dot, { visible: false, renderOrder: 4 });
    view.add(this.line, ...this.dots);
  }

  /** Begins anew, or ends. */
  set(isOn: boolean): void {
    this.isOn = isOn;
    this.ends = [];
    this.find();
  }

  /** The next end; a third one begins anew. */
  take(end: End): void {
    this.ends = this.ends.length === 2 ? [end] : [...this.ends, end];
    this.find();
  }

  /** Called for each frame of the display: parts move. */
  update(now: number): void {
    if (this.points.length === 2) this.dots.forEach((dot) => dot.scale.setScalar(DOT * this.view.metresPerPixel(dot.position)));
    if (this.ends.length < 2 || now < this.next || this.placesOf() === this.places) return;
    this.find();
    this.next = now + Math.max(PERIOD, (performance.now() - now) / SHARE);
  }

  private placesOf(): string {
    return this.ends.map((end) => (typeof end === "number" ? (this.view.parts.all.get(end)?.group.matrixWorld.elements.join() ?? "") : "")).join(";");
  }

  private surfaceOf(end: End): { surface: Surface; X_WS: THREE.Matrix4; centre?: THREE.Vector3 } | undefined {
    if (typeof end !== "number") return { surface: Surface.ofPoint(new THREE.Vector3()), X_WS: new THREE.Matrix4().setPosition(end) };
    const part = this.view.parts.all.get(end);
    if (part?.model === undefined) return undefined;
    part.group.updateWorldMatrix(true, false);
    const { size, centre } = part.object;
    let surface = this.surfaces.get(part.model);
    if (surface === undefined) {
      surface = Surface.of(part.group);
      if (surface.root === undefined) surface = Surface.ofBox(size, centre); // drawn as a box of lines
      this.surfaces.set(part.model, surface);
    }
    const X_WS = part.group.matrixWorld.clone();
    return { surface, X_WS, centre: new THREE.Vector3(centre[0], centre[1], centre[2]).applyMatrix4(X_WS) };
  }

  private find(): void {
    const [a, b] = this.ends.map((end) => this.surfaceOf(end));
    const areBoth = this.ends.length === 2 && a !== undefined && b !== undefined;
    const nearest = areBoth ? nearestOf(a.surface, a.X_WS, b.surface, b.X_WS) : undefined;
    this.points = nearest !== undefined ? [nearest.a, nearest.b] : this.ends.filter((end) => typeof end !== "number");
    this.centres = areBoth && a.centre !== undefined && b.centre !== undefined ? a.centre.distanceTo(b.centre) : undefined;
    this.places = this.placesOf();
    this.draw();
    this.tell();
  }

  private draw(): void {
    this.dots.forEach((dot, i) => {
      dot.visible = this.points[i] !== undefined;
      if (this.points[i] !== undefined) dot.position.copy(this.points[i]);
      dot.scale.setScalar(DOT * this.view.metresPerPixel(dot.position));
    });
    this.line.visible = this.points.length === 2;
    const places = this.line.geometry.getAttribute("position") as THREE.BufferAttribute;
    this.points.forEach((point, i) => places.setXYZ(i, point.x, point.y, point.z));
    places.needsUpdate = true;
    this.view.redraw();
  }

  /** In the language of the page. */
  tell(): void {
    this.row.hidden = !this.isOn;
    const says = this.text();
    this.row.replaceChildren(...(typeof says === "string" ? [says] : [h("b", "measured", says.distance), says.between, h("p", "", says.more)]));
  }

  private text(): string | { distance: string; between: string; more: string } {
    const [first] = this.ends;
    const titles = this.ends.map((end) => (typeof end === "number" ? this.session.titleOf(end) : t("tool.measure.point")));
    if (first === undefined) return t("tool.measure.first");
    if (this.ends.length < 2) return typeof first === "number" ? t("tool.measure.second.of", { a: titles[0] }) : t("tool.measure.second");
    const [a, b] = this.points;
    if (b === undefined) return t("tool.measure.none");
    const off = t("tool.measured.off", { x: mm(b.x - a.x), y: mm(b.y - a.y), z: mm(b.z - a.z) });
    const distance = `${mm(a.distanceTo(b))} mm`;
    if (this.ends.every((end) => typeof end !== "number")) return { distance, between: off, more: "" };
    const between = t(a.distanceTo(b) === 0 ? "tool.measured.meet" : "tool.measured.parts", { a: titles[0], b: titles[1] });
    return { distance, between, more: [off, ...(this.centres === undefined ? [] : [t("tool.measured.centres", { centres: mm(this.centres) })])].join("; ") };
  }

  labels(): Label[] {
    if (this.points.length < 2) return [];
    return [{ place: this.points[0].clone().lerp(this.points[1], 0.5), text: `${mm(this.points[0].distanceTo(this.points[1]))} mm`, tone: "measured" }];
  }
}
