// The scene in 3D. World frame: z up, metres. Redrawn when something has changed.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "three/examples/jsm/libs/meshopt_decoder.module.js";

import { NONE, Status, StepPhase, type Pose, type SceneModels, type SceneObject } from "./messages";
import type { Session } from "./session";

const COLORS = { target: 0x0072b2, within: 0x009e73, device: 0xe69f00, force: 0xcc79a7, shallow: 0xf0e442, deep: 0xd55e00, guide: 0x56b4e9 };
const DEEP = 0.002; // [m] depth at which a contact has the colour `deep`
const METRES_PER_NEWTON = 0.006;
const LONGEST_ARROW = 0.35; // [m]
const CONTACTS = 64;
const SIMPLE_PERIOD = 66; // [ms] between pictures without graphics hardware
const CREASE = 35; // [deg]
const LOOK = 0.15; // [m] shown around a hand and where it is to go

interface Part { group: THREE.Group; object: SceneObject; material: THREE.MeshStandardMaterial | THREE.MeshLambertMaterial; model?: THREE.Object3D }

/** Whether pictures are computed by the processor. */
function isSoftware(): boolean {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (gl === null) throw new Error("no WebGL 2");
  const info = gl.getExtension("WEBGL_debug_renderer_info");
  const name = String(gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER));
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software/i.test(name);
}

function place(target: THREE.Object3D, pose: Pose): void {
  target.position.set(pose.p[0], pose.p[1], pose.p[2]);
  target.quaternion.set(pose.q[0], pose.q[1], pose.q[2], pose.q[3]);
}

export class SceneView {
  readonly simple: boolean;
  readonly canvas: HTMLCanvasElement;
  /** Pictures drawn, and objects with their model: for tests and the curious. */
  pictures = 0;
  models = 0;
  private renderer: THREE.WebGLRenderer;
  private scene = new THREE.Scene();
  private camera = new THREE.PerspectiveCamera(42, 1, 0.02, 60);
  private controls: OrbitControls;
  private sun = new THREE.DirectionalLight(0xffffff, 2.2);
  private parts = new Map<number, Part>();
  private ghost?: { object: number; group: THREE.Group; material: THREE.MeshBasicMaterial };
  private hands = new Map<number, { device: THREE.Mesh; link: THREE.Line }>();
  private contacts: THREE.InstancedMesh;
  private arrows: THREE.ArrowHelper[] = [];
  private loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  private loaded = new Map<string, Promise<THREE.Object3D>>();
  private list?: string;
  private sceneModels?: SceneModels;
  private life = -1;
  private moved = -1;
  private changed = -1;
  private dirty = true;
  private drawn = 0;
  private isFramed = false;
  private isHandMode = false;
  private guide = new THREE.Line(
    new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3()]),
    new THREE.LineDashedMaterial({ color: COLORS.guide, dashSize: 0.015, gapSize: 0.01, depthTest: false, transparent: true }),
  );
  private markers = 1; // size of what is drawn beside the parts, by the size of the scene

  constructor(private host: HTMLElement, label: string, drawing: string | null) {
    const isSlow = isSoftware();
    this.simple = drawing === "simple" || (drawing !== "full" && isSlow);
    this.renderer = new THREE.WebGLRenderer({ antialias: !this.simple, powerPreference: "high-performance" });
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

    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a929c, 1.5), this.sun, this.sun.target);
    if (!this.simple) {
      this.renderer.shadowMap.enabled = true;
      this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
      this.sun.castShadow = true;
      this.sun.shadow.mapSize.set(2048, 2048);
      this.sun.shadow.bias = -0.0004;
      this.sun.shadow.normalBias = 0.004;
    }
    this.contacts = new THREE.InstancedMesh(new THREE.SphereGeometry(0.008, 12, 8), new THREE.MeshBasicMaterial({ depthTest: false, transparent: true, opacity: 0.9 }), CONTACTS);
    this.contacts.count = 0;
    this.contacts.renderOrder = 2;
    this.contacts.frustumCulled = false;
    this.scene.add(this.contacts);
    this.guide.visible = this.guide.frustumCulled = false;
    this.guide.renderOrder = 3;
    this.scene.add(this.guide);
    // before the controls hear of it
    this.canvas.addEventListener("wheel", ({ ctrlKey }) => (this.controls.enableZoom = !this.isHandMode || ctrlKey), { capture: true });
    new ResizeObserver(() => this.resize()).observe(host);
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

  /** Size of a pixel of the page at the depth of a place [m]. */
  metresPerPixel(place: THREE.Vector3): number {
    const depth = place.clone().sub(this.camera.position).dot(this.axes().away);
    return (2 * Math.max(0.05, depth) * Math.tan((this.camera.fov * Math.PI) / 360)) / Math.max(1, this.host.clientHeight);
  }

  /** Where a place is drawn, in pixels of the page. */
  project(place: THREE.Vector3): { x: number; y: number } {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    this.camera.updateMatrixWorld();
    const { x, y } = place.clone().project(this.camera);
    return { x: left + ((1 + x) * width) / 2, y: top + ((1 - y) * height) / 2 };
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
    this.guide.visible = guide !== undefined;
    this.dirty = true;
    if (guide === undefined) return;
    const ends = this.guide.geometry.getAttribute("position") as THREE.BufferAttribute;
    guide.from.toArray(ends.array, 0);
    guide.to.toArray(ends.array, 3);
    ends.needsUpdate = true;
    this.guide.computeLineDistances();
  }

  setLabel(label: string): void {
    this.canvas.setAttribute("aria-label", label);
  }

  setTheme(): void {
    const style = getComputedStyle(document.documentElement);
    this.scene.background = new THREE.Color(style.getPropertyValue("--scene").trim());
    this.dirty = true;
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.host;
    if (width === 0 || height === 0) return;
    this.renderer.setPixelRatio(this.simple ? 0.75 : Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }

  /** Shows all of the scene, or these places and what is around them, from the trainee's side. */
  frame(places: THREE.Vector3[] = []): void {
    const box = new THREE.Box3();
    for (const { group, object } of this.parts.values())
      if (group.visible && object.kind !== "head" && object.kind !== "forearm") box.expandByObject(group);
    if (box.isEmpty()) return;
    const scene = box.getBoundingSphere(new THREE.Sphere());
    const radius = Math.max(0.05, scene.radius);
    const sphere = places.length === 0 ? scene : new THREE.Box3().setFromPoints(places).getBoundingSphere(new THREE.Sphere());
    const shown = places.length === 0 ? radius : Math.min(1.2 * radius, sphere.radius + LOOK);
    const half = Math.min(this.camera.fov, this.camera.fov * this.camera.aspect) * (Math.PI / 360);
    const direction = new THREE.Vector3(0.35, -0.8, 0.62).normalize();
    this.controls.target.copy(sphere.center);
    this.camera.position.copy(sphere.center).addScaledVector(direction, ((places.length > 0 ? 1 : 0.7) * shown) / Math.sin(half));
    this.controls.update();
    const reach = 1.3 * radius;
    this.sun.position.copy(scene.center).add(new THREE.Vector3(-0.5, -0.7, 1.4).multiplyScalar(2 * radius));
    this.sun.target.position.copy(scene.center);
    const light = this.sun.shadow.camera;
    Object.assign(light, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.1, far: 8 * radius });
    light.updateProjectionMatrix();
    this.markers = Math.min(1.3, Math.max(0.35, radius / 0.9));
    this.isFramed = true;
    this.moved = -1;
    this.dirty = true;
  }

  /** Takes over what the session says; draws when that, or the view, has changed. Called for each frame of the display. */
  update(session: Session, now: number): void {
    if (session.link !== undefined && session.link.life !== this.life) this.clear(session.link.life);
    if (session.changed !== this.changed) {
      this.changed = session.changed;
      this.takeObjects(session);
      void this.takeModels(session.link?.scene ?? "");
      this.moved = -1;
    }
    if (session.moved !== this.moved) {
      this.moved = session.moved;
      this.takePoses(session);
      this.takeGhost(session);
      this.takeHands(session);
      this.takeContacts(session);
      this.dirty = true;
      if (!this.isFramed && this.parts.size > 0 && session.states.size > 0) this.frame();
    }
    this.controls.update();
    if (!this.dirty || (this.simple && now - this.drawn < SIMPLE_PERIOD)) return;
    this.dirty = false;
    this.drawn = now;
    this.renderer.render(this.scene, this.camera);
    ++this.pictures;
  }

  private clear(life: number): void {
    this.life = life;
    for (const { group } of this.parts.values()) this.scene.remove(group);
    this.parts.clear();
    for (const { device, link } of this.hands.values()) this.scene.remove(device, link);
    this.hands.clear();
    if (this.ghost !== undefined) this.scene.remove(this.ghost.group);
    this.ghost = undefined;
    this.sceneModels = undefined;
    this.list = undefined;
    this.models = 0;
    this.isFramed = false;
    this.dirty = true;
  }

  private takeObjects(session: Session): void {
    for (const [id, object] of session.objects) {
      if (this.parts.has(id)) continue;
      const color = new THREE.Color(object.color.slice(0, 7) || "#9aa4ad");
      const opacity = object.color.length === 9 ? parseInt(object.color.slice(7), 16) / 255 : 1;
      const options = { color, opacity, transparent: opacity < 1, side: THREE.DoubleSide };
      const material = this.simple ? new THREE.MeshLambertMaterial(options) : new THREE.MeshStandardMaterial({ ...options, roughness: 0.62, metalness: 0.06 });
      const group = new THREE.Group();
      place(group, object.X_WO);
      this.parts.set(id, { group, object, material });
      this.scene.add(group);
    }
  }

  /** The models of all objects; of one without, or before it is there, a box. */
  private async takeModels(list: string): Promise<void> {
    if (list === this.list && this.sceneModels === undefined) return;
    if (list !== this.list) {
      this.list = list;
      this.sceneModels = undefined;
      const life = this.life;
      const answer = list === "" ? undefined : await fetch(`/assets/${list}`).catch(() => undefined);
      const models = answer?.ok ? ((await answer.json()) as SceneModels) : { version: 1, objects: [] };
      if (list !== this.list || life !== this.life) return;
      this.sceneModels = models;
    }
    for (const [id, part] of this.parts) {
      if (part.model !== undefined) continue;
      const levels = this.sceneModels?.objects[id] ?? [];
      const level = this.simple ? levels[levels.length - 1] : levels[0];
      part.model = this.boxOf(part);
      part.group.add(part.model);
      if (level !== undefined) void this.load(part, level.model);
    }
    this.dirty = true;
  }

  private boxOf(part: Part): THREE.Object3D {
    const { size, centre } = part.object;
    const box = new THREE.LineSegments(new THREE.EdgesGeometry(new THREE.BoxGeometry(size[0], size[1], size[2])), new THREE.LineBasicMaterial({ color: part.material.color }));
    box.position.set(centre[0], centre[1], centre[2]);
    return box;
  }

  private async load(part: Part, asset: string): Promise<void> {
    let loading = this.loaded.get(asset);
    if (loading === undefined) this.loaded.set(asset, (loading = this.loader.loadAsync(`/assets/${asset}`).then((file) => file.scene)));
    let model: THREE.Object3D;
    try {
      model = (await loading).clone(true);
    } catch (problem) {
      this.loaded.delete(asset);
      console.warn("a model is missing:", problem);
      return;
    }
    if (this.parts.get(part.object.object_id) !== part) return;
    model.rotation.x = Math.PI / 2; // glTF has y up
    const line = new THREE.LineBasicMaterial({ color: part.material.color.clone().multiplyScalar(0.35), transparent: true, opacity: 0.55 });
    const meshes: THREE.Mesh[] = [];
    model.traverse((child) => child instanceof THREE.Mesh && meshes.push(child));
    for (const mesh of meshes) {
      mesh.material = part.material;
      mesh.castShadow = mesh.receiveShadow = !this.simple;
      if (!this.simple) mesh.add(new THREE.LineSegments(new THREE.EdgesGeometry(mesh.geometry as THREE.BufferGeometry, CREASE), line));
    }
    if (part.model !== undefined) part.group.remove(part.model);
    part.model = model;
    part.group.add(model);
    ++this.models;
    this.moved = -1;
    this.dirty = true;
  }

  private takePoses(session: Session): void {
    for (const [id, part] of this.parts) {
      const state = session.states.get(id);
      part.group.visible = state !== undefined && state.status !== Status.Hidden;
      if (state !== undefined) place(part.group, state.X_WO);
    }
  }

  private takeGhost(session: Session): void {
    const step = session.step;
    const part = step === undefined ? undefined : this.parts.get(step.object_id);
    const shows = step !== undefined && part?.model !== undefined && step.has_target && step.phase <= StepPhase.Active;
    if (this.ghost !== undefined && (!shows || this.ghost.object !== step.object_id || this.ghost.group.userData["model"] !== part.model)) {
      this.scene.remove(this.ghost.group);
      this.ghost = undefined;
    }
    if (!shows || part?.model === undefined) return;
    if (this.ghost === undefined) {
      const material = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.32, depthWrite: false, side: THREE.DoubleSide });
      const group = new THREE.Group();
      const model = part.model.clone(true);
      model.traverse((child) => {
        if (!(child instanceof THREE.Mesh)) return;
        child.material = material;
        child.castShadow = child.receiveShadow = false;
      });
      group.add(model);
      group.userData["model"] = part.model;
      group.renderOrder = 1;
      this.scene.add(group);
      this.ghost = { object: step.object_id, group, material };
    }
    place(this.ghost.group, step.X_WG);
    this.ghost.material.color.setHex(session.isWithinTolerance ? COLORS.within : COLORS.target);
  }

  /** The device beside the object it holds: a ring of its own colour, and a line to its place at the object. */
  private takeHands(session: Session): void {
    for (const [id, hand] of session.hands) {
      if (session.isTracked(id)) continue;
      let shown = this.hands.get(id);
      if (shown === undefined) {
        const device = new THREE.Mesh(new THREE.TorusGeometry(0.024, 0.004, 8, 24), new THREE.MeshBasicMaterial({ color: COLORS.device, depthTest: false, transparent: true }));
        const link = new THREE.Line(new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3()]), new THREE.LineBasicMaterial({ color: COLORS.device, depthTest: false, transparent: true }));
        device.renderOrder = link.renderOrder = 2;
        link.frustumCulled = false;
        shown = { device, link };
        this.hands.set(id, shown);
        this.scene.add(device, link);
      }
      place(shown.device, hand.X_WH);
      shown.device.scale.setScalar(this.markers);
      const grab = [...session.grabs.values()].find((known) => known.hand_id === id && session.holderOf(known.object_id) === id);
      const state = grab === undefined ? undefined : session.states.get(grab.object_id);
      shown.link.visible = state !== undefined;
      if (grab === undefined || state === undefined) continue;
      // X_WH' = X_WO X_HO^-1: where the hand is at the object
      const q_WO = new THREE.Quaternion(state.X_WO.q[0], state.X_WO.q[1], state.X_WO.q[2], state.X_WO.q[3]);
      const q_OH = new THREE.Quaternion(grab.X_HO.q[0], grab.X_HO.q[1], grab.X_HO.q[2], grab.X_HO.q[3]).invert();
      const proxy = new THREE.Vector3(grab.X_HO.p[0], grab.X_HO.p[1], grab.X_HO.p[2]).applyQuaternion(q_OH).negate().applyQuaternion(q_WO);
      proxy.add(new THREE.Vector3(state.X_WO.p[0], state.X_WO.p[1], state.X_WO.p[2]));
      const ends = shown.link.geometry.getAttribute("position") as THREE.BufferAttribute;
      ends.setXYZ(0, proxy.x, proxy.y, proxy.z);
      ends.setXYZ(1, hand.X_WH.p[0], hand.X_WH.p[1], hand.X_WH.p[2]);
      ends.needsUpdate = true;
    }
  }

  private takeContacts(session: Session): void {
    const matrix = new THREE.Matrix4();
    const color = new THREE.Color();
    const deep = new THREE.Color(COLORS.deep);
    let count = 0;
    let arrows = 0;
    for (const pair of session.pairs.values()) {
      if (session.isOver || !pair.colliding || session.tick - pair.tick > 300 || count >= CONTACTS) continue;
      matrix.makeScale(this.markers, this.markers, this.markers).setPosition(pair.p_WP[0], pair.p_WP[1], pair.p_WP[2]);
      this.contacts.setMatrixAt(count, matrix);
      this.contacts.setColorAt(count, color.setHex(COLORS.shallow).lerp(deep, Math.min(1, pair.peak_depth / DEEP)));
      ++count;
      const force = new THREE.Vector3(pair.F_Ao_W.force[0], pair.F_Ao_W.force[1], pair.F_Ao_W.force[2]);
      const newtons = force.length();
      if (newtons < 0.1) continue;
      if (this.arrows[arrows] === undefined) {
        const arrow = new THREE.ArrowHelper(new THREE.Vector3(0, 0, 1), new THREE.Vector3(), 0.1, COLORS.force, 0.03, 0.018);
        arrow.traverse((child) => {
          child.renderOrder = 3;
          const material = (child as THREE.Mesh).material as THREE.Material | undefined;
          if (material !== undefined) Object.assign(material, { depthTest: false, transparent: true });
        });
        this.arrows.push(arrow);
        this.scene.add(arrow);
      }
      const arrow = this.arrows[arrows++];
      arrow.position.set(pair.p_WP[0], pair.p_WP[1], pair.p_WP[2]);
      arrow.setDirection(force.divideScalar(newtons));
      arrow.setLength(this.markers * Math.min(LONGEST_ARROW, 0.04 + METRES_PER_NEWTON * newtons), this.markers * 0.03, this.markers * 0.018);
    }
    this.contacts.count = count;
    this.contacts.instanceMatrix.needsUpdate = true;
    if (this.contacts.instanceColor !== null) this.contacts.instanceColor.needsUpdate = true;
    this.arrows.forEach((arrow, i) => (arrow.visible = i < arrows));
  }

  /** Where an object's frame is drawn [m]; for tests. */
  positionOf(name: string): number[] | undefined {
    const part = [...this.parts.values()].find((known) => known.object.name === name);
    return part === undefined || part.object.object_id === NONE ? undefined : part.group.position.toArray();
  }
}
