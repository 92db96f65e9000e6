// What is around the objects: light, the ground with their shadow, and its grid.
import * as THREE from "three";
import { RoomEnvironment } from "three/examples/jsm/environments/RoomEnvironment.js";

import { release } from "./release";

export class Ground {
  readonly sun: THREE.DirectionalLight;
  private floor = new THREE.Mesh(new THREE.PlaneGeometry(1, 1), new THREE.ShadowMaterial({ opacity: 0.28, depthWrite: false }));
  private grid?: THREE.LineSegments;
  private color = new THREE.Color();

  /** `simple`: without shadows, and without light that is reflected by a room. */
  constructor(private scene: THREE.Scene, renderer: THREE.WebGLRenderer, simple: boolean) {
    this.sun = new THREE.DirectionalLight(0xffffff, simple ? 2.2 : 2.0);
    scene.add(new THREE.HemisphereLight(0xffffff, 0x8a929c, simple ? 1.5 : 0.7), this.sun, this.sun.target);
    if (simple) return;
    const room = new THREE.PMREMGenerator(renderer);
    scene.environment = room.fromScene(new RoomEnvironment(), 0.04).texture;
    scene.environmentIntensity = 0.55;
    room.dispose();
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = THREE.PCFSoftShadowMap;
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.set(2048, 2048);
    this.sun.shadow.bias = -0.0004;
    this.sun.shadow.normalBias = 0.004;
    this.sun.shadow.radius = 3;
    this.floor.receiveShadow = true;
    this.floor.renderOrder = -1;
    scene.add(this.floor);
  }

  /** It is not drawn any more. */
  end(): void {
    for (const shown of [this.floor, this.grid]) if (shown !== undefined) release(shown);
    this.sun.shadow.map?.dispose();
    this.scene.environment?.dispose();
  }

  setColor(color: string): void {
    this.color.set(color);
    const material = this.grid?.material as THREE.LineBasicMaterial | undefined;
    material?.color.copy(this.color);
  }

  /** Lights a scene, and lays the ground below it. */
  fit(box: THREE.Box3): void {
    const { center, radius } = box.getBoundingSphere(new THREE.Sphere());
    this.sun.position.copy(center).add(new THREE.Vector3(-0.5, -0.7, 1.4).multiplyScalar(2 * radius));
    this.sun.target.position.copy(center);
    const reach = 1.3 * radius;
    Object.assign(this.sun.shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0.1 * radius, far: 6 * radius });
    this.sun.shadow.camera.updateProjectionMatrix();
    const z = box.min.z - 0.001 * radius; // not in the plane of what stands on it
    this.floor.scale.setScalar(8 * radius);
    this.floor.position.set(center.x, center.y, z);
    // cells of 1, 10, 100 mm ... of which about five are as wide as the scene
    const cell = 10 ** Math.round(Math.log10(radius / 4));
    if (this.grid !== undefined) {
      this.scene.remove(this.grid);
      release(this.grid);
    }
    this.grid = new THREE.LineSegments(gridOf(Math.ceil((2.5 * radius) / cell), cell), new THREE.LineBasicMaterial({ color: this.color, vertexColors: true, transparent: true, depthWrite: false }));
    this.grid.position.set(Math.round(center.x / cell) * cell, Math.round(center.y / cell) * cell, z);
    this.grid.renderOrder = -2;
    this.scene.add(this.grid);
  }
}

/** Lines of `cells` to each side, in pieces of a cell, that fade away from the middle. */
function gridOf(cells: number, cell: number): THREE.BufferGeometry {
  const [places, colors]: [number[], number[]] = [[], []];
  const point = (x: number, y: number): void => {
    places.push(x * cell, y * cell, 0);
    colors.push(1, 1, 1, Math.max(0, 1 - Math.hypot(x, y) / cells));
  };
  for (let a = -cells; a <= cells; ++a)
    for (let b = -cells; b < cells; ++b) {
      point(a, b), point(a, b + 1);
      point(b, a), point(b + 1, a);
    }
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(places, 3));
  geometry.setAttribute("color", new THREE.Float32BufferAttribute(colors, 4));
  return geometry;
}
