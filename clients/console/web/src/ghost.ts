// The object of the step where it is to go, coloured by whether it is within tolerance.
import * as THREE from "three";

import { COLORS } from "./markers";
import { StepPhase } from "./messages";
import type { Parts } from "./parts";
import { place } from "./pose";
import type { Session } from "./session";

export class Ghost {
  private shown?: { object: number; model: THREE.Object3D; group: THREE.Group; material: THREE.MeshBasicMaterial };

  constructor(private scene: THREE.Scene) {}

  clear(): void {
    if (this.shown === undefined) return;
    this.scene.remove(this.shown.group);
    this.shown.material.dispose(); // its geometry is the part's
    this.shown = undefined;
  }

  take(session: Session, parts: Parts): void {
    const { step } = session;
    const model = step === undefined ? undefined : parts.all.get(step.object_id)?.model;
    const shows = step !== undefined && model !== undefined && step.has_target && step.phase <= StepPhase.Active;
    if (!shows || this.shown?.object !== step.object_id || this.shown.model !== model) this.clear();
    if (!shows) return;
    this.shown ??= this.make(step.object_id, model);
    place(this.shown.group, step.X_WG);
    this.shown.material.color.setHex(session.isWithinTolerance ? COLORS.within : COLORS.target);
  }

  private make(object: number, model: THREE.Object3D): NonNullable<Ghost["shown"]> {
    const material = new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.32, depthWrite: false, side: THREE.DoubleSide });
    const group = new THREE.Group();
    const copy = model.clone(true);
    copy.traverse((child) => {
      if (!(child instanceof THREE.Mesh)) return;
      child.material = material;
      child.castShadow = child.receiveShadow = false;
    });
    group.add(copy);
    group.renderOrder = 1;
    this.scene.add(group);
    return { object, model, group, material };
  }
}
