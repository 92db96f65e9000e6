// Words at places of the scene: over the canvas, moved with each picture.
import type * as THREE from "three";

import { h, zoomOf } from "./dom";
import type { SceneView } from "./scene";

export interface Label { place: THREE.Vector3; text: string; tone?: string }

export class Labels {
  readonly element = h("div", "labels");
  private shown = new Map<string, HTMLElement>();
  private sources: (() => Label[])[] = [];

  constructor(private view: SceneView) {
    this.element.setAttribute("aria-hidden", "true"); // the lists beside the scene say it, too
    view.onPicture = () => this.show();
  }

  /** Asked before each picture. */
  from(source: () => Label[]): void {
    this.sources.push(source);
  }

  private show(): void {
    const box = this.view.canvas.getBoundingClientRect();
    const zoom = zoomOf(this.view.canvas);
    const left = new Map(this.shown);
    for (const { place, text, tone } of this.sources.flatMap((source) => source())) {
      const { x, y, isAhead } = this.view.project(place);
      if (!isAhead || x < box.left || x > box.right || y < box.top || y > box.bottom) continue;
      let label = this.shown.get(text);
      if (label === undefined) this.element.append((label = h("span", `label ${tone ?? ""}`, text)));
      label.style.transform = `translate(${Math.round((x - box.left) / zoom)}px, ${Math.round((y - box.top) / zoom)}px)`;
      this.shown.set(text, label);
      left.delete(text);
    }
    for (const [text, label] of left) {
      label.remove();
      this.shown.delete(text);
    }
  }
}
