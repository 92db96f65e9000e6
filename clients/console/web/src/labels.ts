// Words at places of the scene: over the canvas, moved with each picture.
import type * as THREE from "three";

import { h, zoomOf } from "./dom";
import type { SceneView } from "./scene";

export interface Label { place: THREE.Vector3; text: string; tone?: string }

/** [pixels] */
export interface Box { x: number; y: number; width: number; height: number }

const MARGIN = 4; // [pixels] between a label and what it gives way to
const OFFSET = 12; // [pixels] of a label from its place, to the right and down
const GIVES_WAY = 160; // [pixels] at most: farther away it would not be read as the place's

const COVERS = ".tools > :not(.unseen), .card, .legend, .handbar, .lesson, .notice";

const meets = (a: Box, b: Box): boolean => a.x < b.x + b.width && b.x < a.x + a.width && a.y < b.y + b.height && b.y < a.y + a.height;
const within = (value: number, most: number): number => Math.max(0, Math.min(value, most));

/**
 * Puts labels where they can be read: inside of the scene, beside what lies over it, and beside those before them, as near to their wishes as that is. Undefined: what
 * lies over the scene leaves no place near enough, and half a label says nothing.
 */
export function arrange(wishes: Box[], taken: Box[], scene: { width: number; height: number }): (Box | undefined)[] {
  const placed: Box[] = [];
  const result: (Box | undefined)[] = [];
  for (const wish of wishes) {
    const others = [...taken, ...placed];
    const [right, bottom] = [scene.width - wish.width, scene.height - wish.height];
    const across = [wish.x, ...others.flatMap(({ x, width }) => [x - wish.width - MARGIN, x + width + MARGIN])].map((x) => within(x, right));
    const down = [wish.y, ...others.flatMap(({ y, height }) => [y - wish.height - MARGIN, y + height + MARGIN])].map((y) => within(y, bottom));
    const [first, ...besides] = across.flatMap((x) => down.map((y) => ({ ...wish, x, y })));
    const farness = ({ x, y }: Box): number => Math.hypot(x - first.x, y - first.y);
    const free = [first, ...besides].filter((box) => farness(box) <= GIVES_WAY && !others.some((other) => meets(box, other)));
    const place = free.sort((a, b) => farness(a) - farness(b))[0] ?? (taken.some((other) => meets(first, other)) ? undefined : first);
    if (place !== undefined) placed.push(place);
    result.push(place);
  }
  return result;
}

export class Labels {
  readonly element = h("div", "labels");
  private shown = new Map<string, { element: HTMLElement; size: { width: number; height: number } }>();
  private sources: (() => Label[])[] = [];

  constructor(private view: SceneView) {
    this.element.setAttribute("aria-hidden", "true"); // the lists beside the scene say it, too
    view.onPicture = () => this.show();
  }

  /** Asked before each picture. */
  from(source: () => Label[]): void {
    this.sources.push(source);
  }

  // reads all before it writes anything, so that the page is laid out at most once a picture
  private show(): void {
    const { canvas } = this.view;
    const box = canvas.getBoundingClientRect();
    const zoom = zoomOf(canvas);
    const labels = this.sources.flatMap((source) => source()).flatMap(({ place, text, tone }) => {
      const { x, y, isAhead } = this.view.project(place);
      const isSeen = isAhead && x >= box.left && x <= box.right && y >= box.top && y <= box.bottom;
      return isSeen ? [{ x: (x - box.left) / zoom + OFFSET, y: (y - box.top) / zoom + OFFSET, text, tone }] : [];
    });
    const taken = labels.length === 0 ? [] : this.covers(box, zoom);
    const texts = new Set(labels.map(({ text }) => text));
    for (const [text, { element }] of this.shown) if (!texts.has(text) && this.shown.delete(text)) element.remove();
    for (const { text, tone } of labels) this.add(text, tone);
    const places = arrange(labels.map(({ x, y, text }) => ({ x, y, width: 0, height: 0, ...this.shown.get(text)?.size })), taken, { width: box.width / zoom, height: box.height / zoom });
    labels.forEach(({ text }, i) => {
      const element = this.shown.get(text)?.element;
      const place = places[i];
      if (element === undefined) return;
      element.classList.toggle("none", place === undefined);
      if (place !== undefined) element.style.transform = `translate(${Math.round(place.x)}px, ${Math.round(place.y)}px)`;
    });
  }

  private add(text: string, tone = ""): void {
    if (this.shown.has(text)) return;
    const element = h("span", `label ${tone}`, text);
    this.element.append(element);
    this.shown.set(text, { element, size: { width: element.offsetWidth, height: element.offsetHeight } }); // it keeps its size
  }

  /** What lies over the scene. */
  private covers(box: DOMRect, zoom: number): Box[] {
    const rows = [...(this.element.parentElement?.querySelectorAll(COVERS) ?? [])].map((row) => row.getBoundingClientRect()).filter(({ width }) => width > 0);
    return rows.map(({ left, top, width, height }) => ({ x: (left - box.left) / zoom, y: (top - box.top) / zoom, width: width / zoom, height: height / zoom }));
  }
}
