// The scene in 3D. World frame: z up, metres. Redrawn when something has changed.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "three/examples/jsm/libs/meshopt_decoder.module.js";

import { asset } from "./assets";
import { COLORS, Markers, place } from "./markers";
import { NONE, Status, StepPhase, type SceneModels, type SceneObject } from "./messages";
import { isSoftware, Pace, type Quality } from "./pace";
import type { Session } from "./session";

const CREASE = 35; // [deg]
const LOOK = 0.15; // [m] shown around a hand and where it is to go

interface Part { group: THREE.Group; object: SceneObject; material: THREE.MeshStandardMaterial | THREE.MeshLambertMaterial; model?: THREE.Object3D }

export class SceneView {
  readonly simple: boolean;
  readonly canvas: HTMLCanvasElement;
  /** Pictures drawn, and objects with their model: for tests and the curious. */
  pictures = 0;
  models = 0;
  private renderer: THREE.WebGLRenderer;
  private scene = new THREE.Scene();
  private camera = new THREE.PerspectiveCamera(42, 1, 0.02, 60);
  /** Of the viewer in the world: as the world but in a headset, whose y is up. */
  readonly rig = new THREE.Group();
  private before?: THREE.PerspectiveCamera;
  private controls: OrbitControls;
  private sun = new THREE.DirectionalLight(0xffffff, 2.2);
  private parts = new Map<number, Part>();
  private ghost?: { object: number; group: THREE.Group; material: THREE.MeshBasicMaterial };
  private markers = new Markers(this.scene);
  private pace: Pace;
  private loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  private loaded = new Map<string, Promise<THREE.Object3D>>();
  private list?: string;
  private sceneModels?: SceneModels;
  private life = -1;
  private moved = -1;
  private changed = -1;
  private dirty = true;
  private isFramed = false;
  private isHandMode = false;

  constructor(private host: HTMLElement, label: string, drawing: string | null) {
    const isSlow = isSoftware();
    this.simple = drawing === "simple" || (drawing !== "full" && isSlow);
    this.renderer = new THREE.WebGLRenderer({ antialias: !this.simple, powerPreference: "high-performance" });
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

    this.rig.add(this.camera);
    this.scene.add(this.rig);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x8a929c, 1.5), this.sun, this.sun.target);
    if (!this.simple) {
      this.renderer.shadowMap.enabled = true;
      this.renderer.shadowMap.type = THREE.PCFSoftShadowMap;
      this.sun.castShadow = true;
      this.sun.shadow.mapSize.set(2048, 2048);
      this.sun.shadow.bias = -0.0004;
      this.sun.shadow.normalBias = 0.004;
    }
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

  /** Unit vector from the viewer to a place. */
  sightOf(place: THREE.Vector3): THREE.Vector3 {
    return place.clone().sub(this.camera.position).normalize();
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
    this.markers.setGuide(guide);
    this.dirty = true;
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
    if (width === 0 || height === 0 || this.before !== undefined) return;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, this.pace.quality.ratio));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.dirty = true;
  }

  private setQuality({ hasShadows }: Quality): void {
    this.sun.castShadow = hasShadows;
    this.resize();
  }

  /** About all that is shown, but what people carry on themselves; empty when nothing is. */
  private sphere(): THREE.Sphere {
    const box = new THREE.Box3();
    for (const { group, object } of this.parts.values())
      if (group.visible && object.kind !== "head" && object.kind !== "forearm") box.expandByObject(group);
    return box.getBoundingSphere(new THREE.Sphere());
  }

  /** Shows all of the scene, or these places and what is around them, from the trainee's side. */
  frame(places: THREE.Vector3[] = []): void {
    const scene = this.sphere();
    if (scene.isEmpty()) return;
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
    this.markers.size = Math.min(1.3, Math.max(0.35, radius / 0.9));
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
      this.markers.take(session);
      this.dirty = true;
      if (!this.isFramed && this.parts.size > 0 && session.states.size > 0) this.frame();
    }
    if (this.before !== undefined) return; // the headset asks for its pictures
    this.controls.update();
    if (!this.pace.isReady(now) || !this.dirty) return;
    this.dirty = false;
    this.renderer.render(this.scene, this.camera);
    this.pace.hasDrawn(now);
    ++this.pictures;
  }

  /** The scene is shown in a headset at its size, from the trainee's side; `follow` is called before each picture. Fails when it cannot draw there. */
  async enterHeadset(session: XRSession, follow: (frame: XRFrame, space: XRReferenceSpace) => void): Promise<void> {
    const { xr } = this.renderer;
    xr.enabled = true;
    this.before = this.camera.clone();
    try {
      await xr.setSession(session);
    } catch (problem) {
      this.leaveHeadset();
      throw problem;
    }
    let isPlaced = false;
    this.renderer.setAnimationLoop((_, frame?: XRFrame) => {
      const space = xr.getReferenceSpace();
      if (frame === undefined || space === null) return;
      const head = frame.getViewerPose(space);
      if (!isPlaced && head !== undefined) this.placeRig(head.transform);
      isPlaced ||= head !== undefined;
      follow(frame, space);
      this.renderer.render(this.scene, this.camera);
      ++this.pictures;
    });
  }

  leaveHeadset(): void {
    const { xr } = this.renderer;
    this.renderer.setAnimationLoop(null);
    xr.enabled = false;
    this.rig.position.set(0, 0, 0);
    this.rig.quaternion.identity();
    this.rig.updateMatrixWorld(true);
    if (this.before !== undefined) this.camera.copy(this.before, false);
    this.before = undefined;
    this.resize();
  }

  /** The viewer's head, wherever it is in the room, comes before the scene and looks at it. */
  private placeRig({ position, orientation }: XRRigidTransform): void {
    const scene = this.sphere();
    const eye = scene.center.clone().add(new THREE.Vector3(0, -Math.min(1.5, 0.5 + 0.4 * scene.radius), 0.45));
    const ahead = new THREE.Vector3(0, 0, -1).applyQuaternion(orientation as unknown as THREE.Quaternion);
    const turn = new THREE.Quaternion().setFromAxisAngle(new THREE.Vector3(0, 1, 0), Math.atan2(ahead.x, -ahead.z));
    // y of the room is z of the world, and ahead is along y of the world
    this.rig.quaternion.setFromAxisAngle(new THREE.Vector3(1, 0, 0), Math.PI / 2).multiply(turn);
    this.rig.position.copy(eye).sub(new THREE.Vector3(position.x, position.y, position.z).applyQuaternion(this.rig.quaternion));
    this.rig.updateMatrixWorld(true);
  }

  /** Where something of the headset is in the world; none while it is lost. */
  poseIn(frame: XRFrame, of: XRSpace): { p: THREE.Vector3; q: THREE.Quaternion } | undefined {
    const space = this.renderer.xr.getReferenceSpace();
    const pose = space === null ? undefined : frame.getPose(of, space);
    if (pose === undefined) return undefined;
    const { position, orientation } = pose.transform;
    return {
      p: new THREE.Vector3(position.x, position.y, position.z).applyQuaternion(this.rig.quaternion).add(this.rig.position),
      q: this.rig.quaternion.clone().multiply(new THREE.Quaternion(orientation.x, orientation.y, orientation.z, orientation.w)),
    };
  }

  /** Draws now, and puts the picture into another canvas, which paper takes. */
  copyTo(target: HTMLCanvasElement): void {
    this.renderer.render(this.scene, this.camera);
    Object.assign(target, { width: this.canvas.width, height: this.canvas.height });
    target.getContext("2d")?.drawImage(this.canvas, 0, 0);
  }

  private clear(life: number): void {
    this.life = life;
    for (const { group } of this.parts.values()) this.scene.remove(group);
    this.parts.clear();
    this.markers.clear();
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
      const bytes = list === "" ? undefined : await asset(list).catch(() => undefined);
      const models = bytes === undefined ? { version: 1, objects: [] } : (JSON.parse(new TextDecoder().decode(bytes)) as SceneModels);
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

  private async load(part: Part, name: string): Promise<void> {
    let loading = this.loaded.get(name);
    if (loading === undefined) this.loaded.set(name, (loading = asset(name).then((bytes) => this.loader.parseAsync(bytes, "")).then((file) => file.scene)));
    let model: THREE.Object3D;
    try {
      model = (await loading).clone(true);
    } catch (problem) {
      this.loaded.delete(name);
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

  /** Where an object's frame is drawn [m]; for tests. */
  positionOf(name: string): number[] | undefined {
    const part = [...this.parts.values()].find((known) => known.object.name === name);
    return part === undefined || part.object.object_id === NONE ? undefined : part.group.position.toArray();
  }
}
