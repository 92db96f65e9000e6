// What is drawn beside the parts: devices, contacts with their forces, the way of the hand, the approach. World frame, metres.
import * as THREE from "three";

import { NONE, StepPhase } from "./messages";
import { place, quaternionOf, vectorOf } from "./pose";
import { release } from "./release";
import type { Session } from "./session";

export const COLORS = { target: 0x0072b2, within: 0x009e73, device: 0xe69f00, force: 0xcc79a7, shallow: 0xf0e442, deep: 0xd55e00, guide: 0x56b4e9 };
const DEEP = 0.002; // [m] depth at which a contact has the colour `deep`
const METRES_PER_NEWTON = 0.006;
const LONGEST_ARROW = 0.35; // [m]
const CONTACTS = 64;
const TACTORS = 6; // about a forearm, whose x goes from elbow to wrist: the first on top, the others every 60 degrees
const RED = new THREE.Color(0xd55e00);
const GREY = new THREE.Color(0x52606d);
const OPEN = { depthTest: false, transparent: true } as const; // seen through parts

const FULL = 1; // [m] of a larger workspace, as that of a mouse, there is no limit to be seen
const NEAR = 0.7; // of its radius, from which on the limit of a workspace shows

/** A sphere of which what is seen at an angle shows: its rim. */
function shell(): THREE.ShaderMaterial {
  return new THREE.ShaderMaterial({
    transparent: true, depthWrite: false, uniforms: { color: { value: new THREE.Color(COLORS.device) }, opacity: { value: 0 } },
    vertexShader: "varying vec3 n, v; void main() { vec4 p = modelViewMatrix * vec4(position, 1.0); n = normalMatrix * normal; v = -p.xyz; gl_Position = projectionMatrix * p; }",
    fragmentShader: "uniform vec3 color; uniform float opacity; varying vec3 n, v; void main() { float rim = pow(1.0 - abs(dot(normalize(n), normalize(v))), 3.0); gl_FragColor = vec4(color, opacity * (0.04 + 0.96 * rim));\n#include <colorspace_fragment>\n}",
  });
}

export class Markers {
  /** By the size of the scene. */
  size = 1;
  /** Of all devices, not only of those that are near the limit of theirs. */
  showsWorkspaces = false;
  private workspaces = new Map<number, THREE.Mesh<THREE.SphereGeometry, THREE.ShaderMaterial>>();
  private sphere = new THREE.SphereGeometry(1, 64, 32);
  private hands = new Map<number, { device: THREE.Mesh; link: THREE.Line }>();
  private contacts = new THREE.InstancedMesh(new THREE.SphereGeometry(0.008, 12, 8), new THREE.MeshBasicMaterial({ ...OPEN, opacity: 0.9 }), CONTACTS);
  private arrows: THREE.ArrowHelper[] = [];
  private tactors = new Map<number, THREE.Mesh<THREE.SphereGeometry, THREE.MeshBasicMaterial>[]>();
  private guide = new THREE.Line(
    new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3()]),
    new THREE.LineDashedMaterial({ ...OPEN, color: COLORS.guide, dashSize: 0.015, gapSize: 0.01 }),
  );
  private approach = new THREE.Group();
  private approachMaterial = new THREE.MeshBasicMaterial({ ...OPEN, color: COLORS.target, opacity: 0.75 });
  private shaft = new THREE.Mesh(new THREE.CylinderGeometry(0.0025, 0.0025, 1, 8), this.approachMaterial);
  private tip = new THREE.Mesh(new THREE.ConeGeometry(0.011, 0.03, 16), this.approachMaterial);
  private gate = new THREE.Mesh(new THREE.TorusGeometry(0.02, 0.0025, 8, 32), this.approachMaterial);

  constructor(private scene: THREE.Scene) {
    this.contacts.count = 0;
    this.contacts.renderOrder = 2;
    this.contacts.frustumCulled = false;
    this.guide.visible = this.guide.frustumCulled = false;
    this.guide.renderOrder = 3;
    this.gate.rotation.x = Math.PI / 2; // about the shaft
    this.approach.add(this.shaft, this.tip, this.gate);
    for (const child of this.approach.children) child.renderOrder = 2;
    this.approach.visible = false;
    scene.add(this.contacts, this.guide, this.approach);
  }

  /** Of another session nothing is left. */
  clear(): void {
    const hands = [...this.hands.values()].flatMap(({ device, link }) => [device, link]);
    for (const shown of [...hands, ...[...this.tactors.values()].flat(), ...this.arrows]) {
      this.scene.remove(shown);
      release(shown);
    }
    this.arrows = [];
    for (const workspace of this.workspaces.values()) {
      this.scene.remove(workspace);
      workspace.material.dispose(); // all have one sphere
    }
    this.workspaces.clear();
    this.hands.clear();
    this.tactors.clear();
    this.approach.visible = false;
  }

  /** It is not drawn any more. */
  end(): void {
    this.clear();
    for (const shown of [this.contacts, this.guide, this.approach]) release(shown);
    this.contacts.dispose();
    this.sphere.dispose();
  }

  take(session: Session): void {
    this.takeHands(session);
    this.takeWorkspaces(session);
    this.takeTactors(session);
    this.takeContacts(session);
    this.takeApproach(session);
  }

  /** The line that leads what the hand moves to where the step wants it. */
  setGuide(guide: { from: THREE.Vector3; to: THREE.Vector3 } | undefined): void {
    this.guide.visible = guide !== undefined;
    if (guide === undefined) return;
    const ends = this.guide.geometry.getAttribute("position") as THREE.BufferAttribute;
    guide.from.toArray(ends.array, 0);
    guide.to.toArray(ends.array, 3);
    ends.needsUpdate = true;
    this.guide.computeLineDistances();
  }

  /** The straight way on which the step wants its part: from a ring at its begin to the tip of an arrow at the target's centre. */
  private takeApproach(session: Session): void {
    const { step } = session;
    const object = step === undefined ? undefined : session.objects.get(step.object_id);
    this.approach.visible = step !== undefined && object !== undefined && step.has_target && step.approach_distance > 0 && step.phase <= StepPhase.Active && !session.isOver;
    if (!this.approach.visible || step === undefined || object === undefined) return;
    const end = vectorOf(object.centre).applyQuaternion(quaternionOf(step.X_WG.q)).add(vectorOf(step.X_WG.p));
    const length = step.approach_distance;
    const head = 0.03 * this.size;
    this.approach.position.copy(end);
    this.approach.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), vectorOf(step.approach_W));
    this.shaft.scale.set(this.size, Math.max(1e-3, length - head), this.size);
    this.shaft.position.y = -(length + head) / 2;
    this.tip.scale.setScalar(this.size);
    this.tip.position.y = -head / 2;
    this.gate.scale.setScalar(this.size);
    this.gate.position.y = -length;
    this.approachMaterial.color.setHex(session.isWithinTolerance ? COLORS.within : COLORS.target);
  }

  /** The device beside the object it holds: a ring of its own colour, and a line to its place at the object. */
  private takeHands(session: Session): void {
    for (const [id, hand] of session.hands) {
      if (session.isTracked(id)) continue;
      let shown = this.hands.get(id);
      if (shown === undefined) {
        const device = new THREE.Mesh(new THREE.TorusGeometry(0.024, 0.004, 8, 24), new THREE.MeshBasicMaterial({ ...OPEN, color: COLORS.device }));
        const link = new THREE.Line(new THREE.BufferGeometry().setFromPoints([new THREE.Vector3(), new THREE.Vector3()]), new THREE.LineBasicMaterial({ ...OPEN, color: COLORS.device }));
        device.renderOrder = link.renderOrder = 2;
        link.frustumCulled = false;
        shown = { device, link };
        this.hands.set(id, shown);
        this.scene.add(device, link);
      }
      place(shown.device, hand.X_WH);
      shown.device.scale.setScalar(this.size);
      const grab = [...session.grabs.values()].find((known) => known.hand_id === id && session.holderOf(known.object_id) === id);
      const state = grab === undefined ? undefined : session.states.get(grab.object_id);
      shown.link.visible = state !== undefined;
      if (grab === undefined || state === undefined) continue;
      // X_WH' = X_WO X_HO^-1: where the hand is at the object
      const q_OH = quaternionOf(grab.X_HO.q).invert();
      const proxy = vectorOf(grab.X_HO.p).applyQuaternion(q_OH).negate().applyQuaternion(quaternionOf(state.X_WO.q)).add(vectorOf(state.X_WO.p));
      const ends = shown.link.geometry.getAttribute("position") as THREE.BufferAttribute;
      ends.setXYZ(0, proxy.x, proxy.y, proxy.z);
      ends.setXYZ(1, hand.X_WH.p[0], hand.X_WH.p[1], hand.X_WH.p[2]);
      ends.needsUpdate = true;
    }
  }

  /** What a device reaches: a sphere about C_w, the nearer the hand is to its limit the clearer. */
  private takeWorkspaces(session: Session): void {
    for (const [id, { X_WH, p_WC }] of session.hands) {
      const radius = session.deviceOf(id)?.radius ?? Infinity;
      let shown = this.workspaces.get(id);
      if (radius > FULL || session.isOver) {
        if (shown !== undefined) shown.visible = false;
        continue;
      }
      if (shown === undefined) {
        shown = new THREE.Mesh(this.sphere, shell());
        shown.renderOrder = 1;
        this.workspaces.set(id, shown);
        this.scene.add(shown);
      }
      const out = Math.hypot(X_WH.p[0] - p_WC[0], X_WH.p[1] - p_WC[1], X_WH.p[2] - p_WC[2]) / radius;
      const near = THREE.MathUtils.smoothstep(out, NEAR, 1);
      const opacity = this.showsWorkspaces ? 0.45 + 0.5 * near : 0.95 * near;
      shown.visible = opacity > 0.02;
      shown.material.uniforms["opacity"].value = opacity;
      shown.position.copy(vectorOf(p_WC));
      shown.scale.setScalar(radius);
    }
  }

  get hasWorkspace(): boolean {
    return [...this.workspaces.values()].some(({ visible }) => visible);
  }

  /** The vibration motors of a forearm's bracelet: grey, and red and larger the more they vibrate. */
  private takeTactors(session: Session): void {
    for (const [id, hand] of session.hands) {
      const object = session.objects.get(session.sceneHands.get(id)?.object_id ?? NONE);
      const X = session.states.get(object?.object_id ?? NONE)?.X_WO;
      if (object?.kind !== "forearm" || X === undefined) continue;
      let bracelet = this.tactors.get(id);
      if (bracelet === undefined) {
        bracelet = Array.from({ length: TACTORS }, () => new THREE.Mesh(new THREE.SphereGeometry(0.008, 12, 8), new THREE.MeshBasicMaterial()));
        this.tactors.set(id, bracelet);
        this.scene.add(...bracelet);
      }
      const q = quaternionOf(X.q);
      const { size, centre } = object;
      bracelet.forEach((motor, i) => {
        const [angle, strength] = [(i * Math.PI) / 3, hand.tactors[i] / 255];
        motor.position.set(centre[0] + 0.3 * size[0], centre[1] + 0.5 * size[1] * Math.sin(angle), centre[2] + 0.5 * size[2] * Math.cos(angle));
        motor.position.applyQuaternion(q).add(vectorOf(X.p));
        motor.scale.setScalar(1 + strength);
        motor.material.color.copy(GREY).lerp(RED, strength);
      });
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
      matrix.makeScale(this.size, this.size, this.size).setPosition(pair.p_WP[0], pair.p_WP[1], pair.p_WP[2]);
      this.contacts.setMatrixAt(count, matrix);
      this.contacts.setColorAt(count, color.setHex(COLORS.shallow).lerp(deep, Math.min(1, pair.peak_depth / DEEP)));
      ++count;
      const force = vectorOf(pair.F_Ao_W.force);
      const newtons = force.length();
      if (newtons < 0.1) continue;
      if (this.arrows[arrows] === undefined) {
        const arrow = new THREE.ArrowHelper(new THREE.Vector3(0, 0, 1), new THREE.Vector3(), 0.1, COLORS.force, 0.03, 0.018);
        arrow.traverse((child) => {
          child.renderOrder = 3;
          const material = (child as THREE.Mesh).material as THREE.Material | undefined;
          if (material !== undefined) Object.assign(material, OPEN);
        });
        this.arrows.push(arrow);
        this.scene.add(arrow);
      }
      const arrow = this.arrows[arrows++];
      arrow.position.copy(vectorOf(pair.p_WP));
      arrow.setDirection(force.divideScalar(newtons));
      arrow.setLength(this.size * Math.min(LONGEST_ARROW, 0.04 + METRES_PER_NEWTON * newtons), this.size * 0.03, this.size * 0.018);
    }
    this.contacts.count = count;
    this.contacts.instanceMatrix.needsUpdate = true;
    if (this.contacts.instanceColor !== null) this.contacts.instanceColor.needsUpdate = true;
    this.arrows.forEach((arrow, i) => (arrow.visible = i < arrows));
  }
}
