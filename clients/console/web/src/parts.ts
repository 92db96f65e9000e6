// The objects of the scene: models, colours, places; what of them is hidden, cut by the section, or picked.
import * as THREE from "three";
import { GLTFLoader } from "three/examples/jsm/loaders/GLTFLoader.js";
import { MeshoptDecoder } from "three/examples/jsm/libs/meshopt_decoder.module.js";

import { asset } from "./assets";
import { creases } from "./creases";
import { Status, type RecordedModel, type SceneModels, type SceneObject } from "./messages";
import { place } from "./pose";
import { release } from "./release";
import type { Session } from "./session";

const MOST_POINTS = 5000; // of a mesh, to see where it is
const ON_PLANE = 1e-6; // [m] a face that lies in the section's plane is cut away
const PICKED = 0x14507a; // emitted by what is picked
const EDGE = { transparent: true, opacity: 0.5 } as const;

type Material = THREE.MeshStandardMaterial | THREE.MeshLambertMaterial;
export interface Part { group: THREE.Group; object: SceneObject; material: Material; model?: THREE.Object3D; isShown: boolean }
export interface Pick { object: number; point: THREE.Vector3 }

export class Parts {
  readonly all = new Map<number, Part>();
  /** Objects with their model, and models that are being read. */
  models = 0;
  reading = 0;
  /** Not drawn, by the viewer's choice. */
  readonly hidden = new Set<number>();
  private picked?: number;
  private planes: THREE.Plane[] = [];
  private loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  private loaded = new Map<string, Promise<THREE.Object3D>>();
  private list?: string;
  private sceneModels?: SceneModels;
  private life = 0;

  constructor(private scene: THREE.Scene, private simple: boolean, private onChange: () => void) {}

  /** Of another session nothing is left. */
  clear(): void {
    ++this.life;
    for (const { group, material } of this.all.values()) {
      this.scene.remove(group);
      release(group);
      material.dispose();
    }
    this.all.clear();
    // models are shared by the parts that look the same
    for (const loading of this.loaded.values()) void loading.then((model) => release(model), () => undefined);
    this.loaded.clear();
    this.hidden.clear();
    this.picked = this.list = this.sceneModels = undefined;
    this.models = 0;
  }

  /** No object of a scene that is complete has a model. */
  get areBoxes(): boolean {
    return this.isComplete && this.models === 0;
  }

  /** All models are there that the scene has. */
  get isComplete(): boolean {
    return this.all.size > 0 && this.list !== undefined && this.sceneModels !== undefined && this.reading === 0;
  }

  takeObjects(session: Session): void {
    for (const [id, object] of session.objects) {
      if (this.all.has(id)) continue;
      const color = new THREE.Color(object.color.slice(0, 7) || "#9aa4ad");
      const opacity = object.color.length === 9 ? parseInt(object.color.slice(7), 16) / 255 : 1;
      const options = { color, opacity, transparent: opacity < 1, side: THREE.DoubleSide, clippingPlanes: this.planes };
      const material = this.simple ? new THREE.MeshLambertMaterial(options) : new THREE.MeshStandardMaterial({ ...options, roughness: 0.58, metalness: 0.05 });
      const group = new THREE.Group();
      place(group, object.X_WO);
      this.all.set(id, { group, object, material, isShown: false });
      this.scene.add(group);
    }
  }

  /** The models of all objects; of one without, or before it is there, a box. `recorded`: by an object's name, where the assets are not there. */
  async takeModels(list: string, recorded?: RecordedModel): Promise<void> {
    if (list === this.list && this.sceneModels === undefined) return;
    if (list !== this.list) {
      this.list = list;
      this.sceneModels = undefined;
      const { life } = this;
      const bytes = list === "" ? undefined : await asset(list).catch(() => undefined);
      const models = bytes === undefined ? { version: 1, objects: [] } : (JSON.parse(new TextDecoder().decode(bytes)) as SceneModels);
      if (list !== this.list || life !== this.life) return;
      this.sceneModels = models;
    }
    for (const [id, part] of this.all) {
      if (part.model !== undefined) continue;
      const levels = this.sceneModels?.objects[id] ?? [];
      const level = this.simple ? levels[levels.length - 1] : levels[0];
      part.model = this.boxOf(part);
      part.group.add(part.model);
      if (level !== undefined || recorded !== undefined) void this.load(part, level?.model, recorded);
    }
    this.onChange();
  }

  private boxOf(part: Part): THREE.Object3D {
    const { size, centre } = part.object;
    const box = new THREE.LineSegments(new THREE.EdgesGeometry(new THREE.BoxGeometry(size[0], size[1], size[2])), new THREE.LineBasicMaterial({ color: part.material.color }));
    box.position.set(centre[0], centre[1], centre[2]);
    return box;
  }

  private async load(part: Part, model: string | undefined, recorded?: RecordedModel): Promise<void> {
    const name = model ?? `/scene/${part.object.name}`;
    const bytesOf = async (): Promise<ArrayBuffer> => {
      const bytes = model === undefined ? undefined : await asset(model).catch((problem: unknown) => { if (recorded === undefined) throw problem; });
      return bytes ?? (recorded as RecordedModel)(part.object.name);
    };
    let loading = this.loaded.get(name);
    if (loading === undefined) this.loaded.set(name, (loading = bytesOf().then((bytes) => this.loader.parseAsync(bytes, "")).then((file) => file.scene)));
    ++this.reading;
    try {
      this.dress(part, (await loading).clone(true));
    } catch (problem) {
      this.loaded.delete(name);
      console.warn("a model is missing:", problem);
    } finally {
      --this.reading;
    }
  }

  private dress(part: Part, model: THREE.Object3D): void {
    if (this.all.get(part.object.object_id) !== part) return; // of another session: what it has is released with the model
    model.rotation.x = Math.PI / 2; // glTF has y up
    const meshes: THREE.Mesh[] = [];
    model.traverse((child) => child instanceof THREE.Mesh && meshes.push(child));
    // colours of its own come before the object's
    if (meshes.some((mesh) => (mesh.geometry as THREE.BufferGeometry).hasAttribute("color"))) {
      part.material.vertexColors = true;
      part.material.color.set(0xffffff);
    }
    const dark = part.material.vertexColors ? new THREE.Color(0x10161c) : part.material.color.clone().multiplyScalar(0.35);
    const line = new THREE.LineBasicMaterial({ ...EDGE, color: dark, clippingPlanes: this.planes });
    for (const mesh of meshes) {
      mesh.material = part.material;
      mesh.castShadow = mesh.receiveShadow = !this.simple;
      if (!this.simple) mesh.add(new THREE.LineSegments(creases(mesh.geometry as THREE.BufferGeometry), line));
    }
    if (part.model !== undefined) {
      part.group.remove(part.model);
      release(part.model);
    }
    part.model = model;
    part.group.add(model);
    ++this.models;
    this.onChange();
  }

  takePoses(session: Session): void {
    for (const [id, part] of this.all) {
      const state = session.states.get(id);
      // before the session begins what is there is where it begins; people are not there yet
      part.isShown = state === undefined ? session.isWaiting && !session.isOwn(id) : state.status !== Status.Hidden;
      part.group.visible = part.isShown && !this.hidden.has(id);
      if (state !== undefined) place(part.group, state.X_WO);
    }
  }

  /** Those of `ids` are not drawn. */
  hide(ids: Iterable<number>): void {
    this.hidden.clear();
    for (const id of ids) this.hidden.add(id);
    for (const [id, part] of this.all) part.group.visible = part.isShown && !this.hidden.has(id);
    this.onChange();
  }

  /** What is on the far side of the plane is not drawn. */
  cut(plane: THREE.Plane | undefined): void {
    this.planes.splice(0, this.planes.length, ...(plane === undefined ? [] : [plane]));
    this.onChange();
  }

  /** Makes one object shine; undefined: none. */
  mark(id: number | undefined): void {
    const shine = (object: number | undefined, color: number): unknown => this.all.get(object ?? -1)?.material.emissive.setHex(color);
    shine(this.picked, 0);
    shine((this.picked = id), PICKED);
    this.onChange();
  }

  /** The first surface on a ray that is drawn. */
  hit(ray: THREE.Raycaster): Pick | undefined {
    const groups = [...this.all.values()].filter(({ group, model }) => group.visible && model !== undefined).map(({ group }) => group);
    for (const { object, point } of ray.intersectObjects(groups, true)) {
      if (!(object instanceof THREE.Mesh) || this.planes.some((plane) => plane.distanceToPoint(point) < ON_PLANE)) continue;
      const found = [...this.all.values()].find(({ group }) => isBelow(object, group));
      if (found !== undefined) return { object: found.object.object_id, point };
    }
    return undefined;
  }

  /** About all that is drawn, but what people carry on themselves; empty when nothing is. */
  box(): THREE.Box3 {
    const box = new THREE.Box3();
    for (const { group, object } of this.all.values())
      if (group.visible && object.kind !== "head" && object.kind !== "forearm") box.expandByObject(group);
    return box;
  }

  /** Of what box() is about: points of its surfaces, in the world; each is valid until the next one. */
  *points(): Generator<THREE.Vector3> {
    const point = new THREE.Vector3();
    for (const { group, object } of this.all.values()) {
      if (!group.visible || object.kind === "head" || object.kind === "forearm") continue;
      group.updateWorldMatrix(true, true);
      for (const child of leavesOf(group)) {
        const places = (child as THREE.Mesh).geometry.getAttribute("position");
        const every = Math.max(1, Math.floor(places.count / MOST_POINTS));
        for (let i = 0; i < places.count; i += every) yield point.fromBufferAttribute(places, i).applyMatrix4(child.matrixWorld);
      }
    }
  }
}

/** Meshes and lines. */
function leavesOf(object: THREE.Object3D): THREE.Object3D[] {
  return [...("geometry" in object ? [object] : []), ...object.children.flatMap(leavesOf)];
}

function isBelow(object: THREE.Object3D, group: THREE.Object3D): boolean {
  for (let at: THREE.Object3D | null = object; at !== null; at = at.parent) if (at === group) return true;
  return false;
}
