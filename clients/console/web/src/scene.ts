// The scene in 3D. World frame: z up, metres. Redrawn when something has changed.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

import { zoomOf } from "./dom";
import { cornersOf, framing } from "./framing";
import { Ghost } from "./ghost";
import { Ground } from "./ground";
import { HeadsetView } from "./headsetview";
import { Markers } from "./markers";
import { NONE } from "./messages";
import { isTooEarly, openDrawing, Pace, type Quality } from "./pace";
import { Parts, type Pick } from "./parts";
import type { Session } from "./session";

const DIRECTION = new THREE.Vector3(0.35, -0.8, 0.62).normalize(); // to the viewer, from the trainee's side
const FILLED = 0.88; // of the picture's width or height, by what is to be seen
const MOST_BESIDE = 0.6; // of the picture's width that may be covered for something to be seen beside
const LOOK = 0.1; // [m] shown around what is looked at

export class SceneView {
  readonly simple: boolean;
  readonly canvas: HTMLCanvasElement;
  /** Pictures drawn, and when the first one of all that there is was done [ms of the page's clock]: for tests and the curious. */
  pictures = 0;
  wholeAt?: number;
  readonly parts: Parts;
  /** Called after each picture. */
  onPicture?: () => void;
  private renderer: THREE.WebGLRenderer;
  private scene = new THREE.Scene();
  private camera = new THREE.PerspectiveCamera(42, 1, 0.02, 60);
  readonly headset: HeadsetView;
  private controls: OrbitControls;
  private ground: Ground;
  private ghost = new Ghost(this.scene);
  private markers = new Markers(this.scene);
  private pace: Pace;
  private resizes = new ResizeObserver(() => this.resize());
  private life = -1;
  private moved = -1;
  private changed = -1;
  private dirty = true;
  private isFramed = false;
  private hasBegun = false; // and everything is where the session has it
  private isFramedWaiting = false;
  private isFramedWhole = false; // with all models
  private isWhole = false; // the last picture
  private hasObjects = false; // likewise
  private awaited?: number; // [ms] of the page's clock: since when models are
  private isTurned = false; // by the viewer, or to the work: not to be framed anew by itself
  isHandMode = false;
  private covered = { left: 0, top: 0 }; // of the picture [pixels]
  private size?: { width: number; height: number; ratio: number }; // of the next picture, where it is another one: [pixels of the page], pixels of the picture in one

  constructor(private host: HTMLElement, label: string, drawing: string | null) {
    const { context } = openDrawing(drawing);
    this.simple = context !== undefined;
    this.renderer = new THREE.WebGLRenderer(context === undefined ? { antialias: true, powerPreference: "high-performance" } : { canvas: context.canvas, context });
    this.pace = new Pace(this.renderer.getContext() as WebGL2RenderingContext, this.simple, drawing === "full", (quality) => this.setQuality(quality));
    this.canvas = this.renderer.domElement;
    this.canvas.tabIndex = 0;
    this.canvas.setAttribute("role", "img");
    this.setLabel(label);
    host.append(this.canvas);
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(1.6, -2.2, 2.1);
    this.controls = new OrbitControls(this.camera, this.canvas);
    this.controls.enableDamping = !matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.controls.dampingFactor = 0.15;
    this.controls.maxDistance = 20;
    this.controls.minDistance = 0.1;
    this.controls.listenToKeyEvents(this.canvas);
    this.controls.addEventListener("change", () => (this.dirty = true));
    this.controls.addEventListener("start", () => (this.isTurned = true));

    this.headset = new HeadsetView(this.renderer, this.scene, this.camera, () => this.parts.box(), { onPicture: () => void ++this.pictures, onEnd: () => this.resize() });
    this.renderer.localClippingEnabled = true;
    this.ground = new Ground(this.scene, this.renderer, this.simple);
    this.parts = new Parts(this.scene, this.simple, () => {
      this.moved = -1;
      this.dirty = true;
    });
    // before the controls hear of it
    this.canvas.addEventListener("wheel", ({ ctrlKey }) => (this.controls.enableZoom = !this.isHandMode || ctrlKey), { capture: true });
    this.resizes.observe(host);
    this.resize();
    this.setTheme();
  }

  /** Left drags and the wheel are the hand's; the right button turns the view, the middle one moves it, Ctrl and the wheel zoom. */
  setHandMode(isOn: boolean): void {
    this.isHandMode = isOn;
    const { MOUSE, TOUCH } = THREE;
    this.controls.mouseButtons = isOn ? { LEFT: null, MIDDLE: MOUSE.PAN, RIGHT: MOUSE.ROTATE } : { LEFT: MOUSE.ROTATE, MIDDLE: MOUSE.DOLLY, RIGHT: MOUSE.PAN };
    this.controls.touches = isOn ? { ONE: null, TWO: TOUCH.DOLLY_ROTATE } : { ONE: TOUCH.ROTATE, TWO: TOUCH.DOLLY_PAN };
    this.controls.enableZoom = !isOn;
    if (isOn) this.controls.stopListenToKeyEvents();
    else this.controls.listenToKeyEvents(this.canvas);
  }

  /** Directions of the view in the world. */
  axes(): { right: THREE.Vector3; up: THREE.Vector3; away: THREE.Vector3 } {
    const [right, up, back] = [new THREE.Vector3(), new THREE.Vector3(), new THREE.Vector3()];
    this.camera.updateMatrixWorld();
    this.camera.matrixWorld.extractBasis(right, up, back);
    return { right, up, away: back.negate() };
  }

  /** Unit vector from the viewer to a place. */
  sightOf(place: THREE.Vector3): THREE.Vector3 {
    return place.clone().sub(this.camera.position).normalize();
  }

  /** Size of a pixel of the page at the depth of a place [m]. */
  metresPerPixel(place: THREE.Vector3): number {
    const depth = place.clone().sub(this.camera.position).dot(this.axes().away);
    return (2 * Math.max(0.05, depth) * Math.tan((this.camera.fov * Math.PI) / 360)) / Math.max(1, this.host.clientHeight * zoomOf(this.host));
  }

  /** Where a place is drawn, in pixels of the page. */
  project(place: THREE.Vector3): { x: number; y: number; isAhead: boolean } {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    this.camera.updateMatrixWorld();
    const { x, y, z } = place.clone().project(this.camera);
    return { x: left + ((1 + x) * width) / 2, y: top + ((1 - y) * height) / 2, isAhead: z < 1 };
  }

  /** Whether a place is in the picture, not at its border, and not behind the instruction. */
  isInSight(place: THREE.Vector3): boolean {
    const { x, y } = this.project(place);
    const box = this.canvas.getBoundingClientRect();
    const isInside = x > box.left + 0.08 * box.width && x < box.right - 0.08 * box.width && y > box.top + 0.08 * box.height && y < box.bottom - 0.22 * box.height;
    return isInside && document.elementFromPoint(x, y) === this.canvas;
  }

  /** The line that leads what the hand moves to where the step wants it. */
  setGuide(guide: { from: THREE.Vector3; to: THREE.Vector3 } | undefined): void {
    this.markers.setGuide(guide);
    this.dirty = true;
  }

  /** Whether the workspaces of all devices are shown, or only near their limits. */
  showWorkspaces(isOn: boolean): void {
    this.markers.showsWorkspaces = isOn;
    this.moved = -1;
    this.dirty = true;
  }

  /** The limit of a device's workspace is in the picture. */
  get hasWorkspace(): boolean {
    return this.markers.hasWorkspace;
  }

  setLabel(label: string): void {
    this.canvas.setAttribute("aria-label", label);
  }

  setTheme(): void {
    const style = getComputedStyle(document.documentElement);
    this.scene.background = new THREE.Color(style.getPropertyValue("--scene").trim());
    this.ground.setColor(style.getPropertyValue("--floor").trim());
    this.dirty = true;
  }

  /** What lies over the picture's corner at the top left: what is framed is seen beside it, below it where it is wide. */
  setCover(element: HTMLElement | undefined): void {
    const right = element === undefined ? 0 : element.offsetLeft + element.offsetWidth;
    const isWide = right > MOST_BESIDE * this.host.clientWidth;
    const left = isWide ? 0 : right;
    const top = isWide && element !== undefined ? element.offsetTop + element.offsetHeight : 0;
    if (Math.abs(left - this.covered.left) < 8 && Math.abs(top - this.covered.top) < 8) return;
    this.covered = { left, top };
    this.resize();
    if (this.isFramed && !this.isTurned) this.frame();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width === 0 || height === 0 || this.headset.isOn) return;
    const zoom = zoomOf(this.host);
    this.size = { width, height, ratio: Math.min(devicePixelRatio, this.pace.quality.ratio) * zoom };
    if (this.pictures === 0) this.fit(); // later with the next picture: until then the last one is stretched
    this.controls.rotateSpeed = this.controls.panSpeed = 1 / zoom; // they measure ways in pixels of the page, and the picture in its own
    this.camera.aspect = width / height;
    const { left, top } = this.covered;
    if (left > 0 || top > 0) this.camera.setViewOffset(width, height, -left / 2, -top / 2, width, height);
    else this.camera.clearViewOffset();
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }

  /** A new size clears the canvas. */
  private fit(): void {
    if (this.size === undefined) return;
    this.renderer.setPixelRatio(this.size.ratio);
    this.renderer.setSize(this.size.width, this.size.height, false);
    this.size = undefined;
  }

  private draw(): void {
    this.fit();
    this.renderer.render(this.scene, this.camera);
  }

  private setQuality({ hasShadows }: Quality): void {
    this.ground.sun.castShadow = hasShadows;
    this.resize();
  }

  /** Shows all of the scene, or these places and what is around them, from the trainee's side. */
  frame(places: THREE.Vector3[] = []): void {
    const box = this.parts.box();
    if (box.isEmpty()) return;
    const scene = box.getBoundingSphere(new THREE.Sphere());
    const radius = Math.max(0.05, scene.radius);
    const around = new THREE.Box3().setFromPoints(places).expandByScalar(Math.min(LOOK, 0.6 * radius));
    const half = Math.tan((this.camera.fov * Math.PI) / 360) * FILLED;
    const across = half * this.camera.aspect * Math.max(0.3, 1 - this.covered.left / Math.max(1, this.host.clientWidth));
    const high = half * Math.max(0.3, 1 - this.covered.top / Math.max(1, this.host.clientHeight));
    const { target, distance } = framing(places.length === 0 ? this.parts.points() : cornersOf(around), DIRECTION, this.camera.up, across, high);
    this.controls.target.copy(target);
    this.camera.position.copy(target).addScaledVector(DIRECTION, distance);
    this.controls.update();
    this.ground.fit(box);
    this.markers.size = Math.min(1.3, Math.max(0.35, radius / 0.9));
    this.isFramed = true;
    this.isFramedWhole = this.parts.isComplete;
    this.isTurned = places.length > 0;
    this.moved = -1;
    this.dirty = true;
  }

  /** Takes over what the session says; draws when that, or the view, has changed. Called for each frame of the display. */
  update(session: Session, now: number): void {
    if (session.link !== undefined && session.link.life !== this.life) this.clear(session.link.life);
    if (this.isWhole && this.wholeAt === undefined && this.pace.isReady(now) && this.pace.isDone) this.wholeAt = performance.now();
    if (session.changed !== this.changed) {
      this.changed = session.changed;
      this.parts.takeObjects(session);
      void this.parts.takeModels(session.link?.scene ?? "", session.link?.modelOf);
      this.moved = -1;
    }
    if (session.moved !== this.moved) {
      this.moved = session.moved;
      this.parts.takePoses(session);
      this.ghost.take(session, this.parts);
      this.markers.take(session);
      this.dirty = true;
      this.hasBegun = session.states.size > 0;
      // anew when the session begins, since more is there then than where it waited
      const isAnew = this.hasBegun && this.isFramedWaiting && !this.isTurned;
      const isWhole = this.isFramed && !this.isFramedWhole && !this.isTurned && this.parts.isComplete;
      if (this.parts.all.size > 0 && (isAnew || isWhole || (!this.isFramed && (this.hasBegun || session.isWaiting)))) this.frame();
      this.isFramedWaiting = !this.hasBegun && session.isWaiting;
    }
    if (this.headset.isOn) return; // the headset asks for its pictures
    this.controls.update();
    if (!this.pace.isReady(now) || !this.dirty || this.isTooEarly(now)) return;
    this.dirty = false;
    this.hasObjects = this.parts.all.size > 0;
    this.isWhole = this.parts.isComplete && this.isFramed;
    this.draw();
    this.pace.hasDrawn(now);
    ++this.pictures;
    this.onPicture?.();
  }

  private isTooEarly(now: number): boolean {
    const { parts, simple, hasObjects } = this;
    if (parts.all.size > 0) this.awaited ??= now;
    return isTooEarly({ objects: parts.all.size, showsObjects: hasObjects, isSimple: simple, isComplete: parts.isComplete, awaited: now - (this.awaited ?? now) });
  }

  /** It is not looked at any more. */
  end(): void {
    this.resizes.disconnect();
    this.controls.dispose();
    this.clear(this.life);
    this.markers.end();
    this.ground.end();
    this.renderer.dispose();
    this.renderer.forceContextLoss();
    this.canvas.remove();
  }

  /** Objects with their model. */
  get models(): number {
    return this.parts.models;
  }

  /** All that there is to be seen is drawn. */
  get isComplete(): boolean {
    return this.parts.isComplete && this.isFramed && this.hasBegun && !this.dirty;
  }

  /** The surface below a place of the page. */
  pick(x: number, y: number): Pick | undefined {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const ray = new THREE.Raycaster();
    ray.params.Line = { threshold: 0 };
    this.camera.updateMatrixWorld();
    ray.setFromCamera(new THREE.Vector2((2 * (x - left)) / width - 1, 1 - (2 * (y - top)) / height), this.camera);
    return this.parts.hit(ray);
  }

  /** Moves the view with what it follows. */
  carry(by: THREE.Vector3): void {
    this.camera.position.add(by);
    this.controls.target.add(by);
    this.dirty = true;
  }

  /** Nearer to what it looks at, or farther away, by a factor. */
  zoom(factor: number): void {
    this.goAround((off) => off.multiplyScalar(factor).clampLength(this.controls.minDistance, this.controls.maxDistance));
  }

  /** The viewer goes to the right about what it looks at [rad]. */
  turn(angle: number): void {
    this.goAround((off) => off.applyAxisAngle(this.camera.up, angle));
  }

  private goAround(change: (off: THREE.Vector3) => void): void {
    const off = this.camera.position.clone().sub(this.controls.target);
    change(off);
    this.lookFrom(off.add(this.controls.target), this.controls.target);
  }

  /** Looks from a place at another one. */
  lookFrom(eye: THREE.Vector3, at: THREE.Vector3): void {
    this.isTurned = true;
    this.camera.position.copy(eye);
    this.controls.target.copy(at);
    this.dirty = true;
  }

  /** Shows something beside the objects. */
  add(...objects: THREE.Object3D[]): void {
    this.scene.add(...objects);
    this.dirty = true;
  }

  redraw(): void {
    this.dirty = true;
  }

  /** Draws now, and puts the picture into another canvas, which paper takes. */
  copyTo(target: HTMLCanvasElement): void {
    this.draw();
    Object.assign(target, { width: this.canvas.width, height: this.canvas.height });
    target.getContext("2d")?.drawImage(this.canvas, 0, 0);
  }

  private clear(life: number): void {
    this.life = life;
    this.parts.clear();
    this.markers.clear();
    this.ghost.clear();
    this.isFramed = this.hasBegun = this.isFramedWaiting = this.isTurned = false;
    this.awaited = undefined;
    this.dirty = true;
  }

  /** Where an object's frame is drawn [m]; for tests. */
  positionOf(name: string): number[] | undefined {
    const part = [...this.parts.all.values()].find((known) => known.object.name === name);
    return part === undefined || part.object.object_id === NONE ? undefined : part.group.position.toArray();
  }
}
