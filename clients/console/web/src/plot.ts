// Plots of the last half minute, below each other, with one cursor.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

import { h, zoomOf } from "./dom";
import { interventions } from "./eventtext";
import type { Session } from "./session";
import { keep, kept, n, t, type Key } from "./strings";

const WINDOW = 30; // s
const CURSOR_STEP = 4; // [pixels] by a key
const PERIOD = 150; // [ms] between pictures
const SERIES = 4;
const DASHES = [[], [7, 4], [2, 3], [10, 3, 2, 3]];

/** `limit`: a line at this value; `least`: what the scale shows at least. Values in `unit`, which is `scale` times that of the messages. */
interface Kind { name: string; unit: string; scale: number; digits: number; least: number; limit?: number; of: "hand" | "client" | "scene" }
const KINDS: Kind[] = [
  { name: "force", unit: "N", scale: 1, digits: 1, least: 10, of: "hand" },
  { name: "gap", unit: "mm", scale: 1000, digits: 2, least: 5, of: "scene" },
  { name: "compute", unit: "ms", scale: 1000, digits: 2, least: 1.2, limit: 1, of: "scene" },
  { name: "load", unit: "%", scale: 1, digits: 0, least: 100, of: "scene" },
  { name: "age", unit: "ms", scale: 1000, digits: 1, least: 10, of: "client" },
  { name: "jitter", unit: "ms", scale: 1000, digits: 1, least: 5, of: "client" },
  { name: "loss", unit: "%", scale: 100, digits: 1, least: 2, of: "client" },
];

interface Line { track: string; name: string }

/** The lines of a kind, by the session as it is. */
function linesOf(kind: Kind, session: Session): Line[] {
  if (kind.of === "scene") return session.tracks.all.has(kind.name) ? [{ track: kind.name, name: t(`plot.${kind.name}` as Key) }] : [];
  const ids = [...session.tracks.all.keys()].filter((track) => track.startsWith(`${kind.name} `)).map((track) => Number(track.split(" ")[1]));
  const shown = ids.filter((id) => kind.of === "client" || !session.isTracked(id)).sort((a, b) => a - b).slice(0, SERIES);
  return shown.map((id) => ({ track: `${kind.name} ${id}`, name: kind.of === "hand" ? session.nameOfHand(id) : (session.people.get(id)?.name ?? String(id)) }));
}

/** Joins tracks on their times: uPlot wants one list of times. */
function joined(session: Session, tracks: string[], scale: number): [number[], ...(number | null)[][]] {
  const known = tracks.map((name) => session.tracks.all.get(name) ?? { times: [], values: [] });
  const times = [...new Set(known.flatMap((track) => track.times))].sort((a, b) => a - b);
  const index = new Map(times.map((time, i) => [time, i]));
  const series = known.map((track) => {
    const values = new Array<number | null>(times.length).fill(null);
    track.times.forEach((time, i) => (values[index.get(time) as number] = scale * track.values[i]));
    return values;
  });
  return [times, ...series];
}

class Plot {
  readonly element = h("div", "chart");
  private head = h("h3");
  private host = h("div");
  private marks = h("p", "marks"); // what the dots are
  private session?: Session;
  private plot?: uPlot;
  private lines: Line[] = [];
  private names = "";

  constructor(private kind: Kind) {
    this.element.append(this.head, this.host, this.marks);
    new ResizeObserver(() => this.plot?.setSize(this.size())).observe(this.host);
  }

  private size(): { width: number; height: number } {
    return { width: Math.max(200, this.host.clientWidth), height: innerHeight < 900 ? 104 : 136 };
  }

  /** Theme or language have changed. */
  rebuild(): void {
    this.plot?.destroy();
    this.plot = undefined;
    this.names = "";
  }

  update(session: Session): void {
    this.session = session;
    const lines = linesOf(this.kind, session);
    this.element.classList.toggle("none", lines.length === 0);
    this.head.textContent = t(`plot.${this.kind.name}` as Key);
    if (lines.length === 0) return this.rebuild();
    const names = lines.map(({ name }) => name).join("\n");
    if (names !== this.names) this.build(lines, names);
    const { unit, scale, least, of, name } = this.kind;
    const limited = name === "force" ? this.lines.map(({ track }) => track.replace("force", "limited")) : [];
    const data = joined(session, [...this.lines.map(({ track }) => track), ...limited], scale);
    this.plot?.setData(data, false);
    this.marks.hidden = !limited.some((track) => session.tracks.all.has(track));
    const marks = t("plot.limited");
    if (this.marks.textContent !== marks) this.marks.replaceChildren(h("i"), marks);
    const values = data.slice(1).flat().filter((value): value is number => value !== null);
    const [low, high] = values.reduce(([a, b], value) => [Math.min(a, value), Math.max(b, value)], [0, least]);
    const end = session.tick / 1000;
    this.plot?.batch(() => {
      this.plot?.setScale("x", { min: Math.max(0, end - WINDOW), max: Math.max(WINDOW, end) });
      this.plot?.setScale("y", { min: 1.1 * low, max: of === "scene" && unit === "%" ? Math.max(100, high) : 1.1 * high });
    });
  }

  /** Where the cursor is [pixels]; the right border, where there is none. Undefined: nothing is plotted. */
  get cursor(): number | undefined {
    const { plot } = this;
    if (plot === undefined) return undefined;
    const left = plot.cursor.left ?? -1;
    return left < 0 ? plot.over.clientWidth - 1 : left;
  }
  set cursor(left: number) {
    const { plot } = this;
    plot?.setCursor({ left: Math.min(plot.over.clientWidth - 1, Math.max(0, left)), top: plot.over.clientHeight / 2 });
  }

  /** Of the safety layer, as bits; of other tracks than forces none. */
  private rulesAt(track: string, seconds: number): number {
    const rules = this.session?.tracks.all.get(track.replace("force", "safety"));
    if (!track.startsWith("force ") || rules === undefined) return 0;
    return rules.values[rules.times.lastIndexOf(seconds)] ?? 0;
  }

  private build(lines: Line[], names: string): void {
    this.rebuild();
    this.lines = lines;
    this.names = names;
    const { unit, digits, limit, name } = this.kind;
    const style = getComputedStyle(document.documentElement);
    const color = (of: string): string => style.getPropertyValue(of).trim();
    const axis = { stroke: color("--muted"), grid: { stroke: color("--grid"), width: 1 }, ticks: { show: false }, font: "12px system-ui" };
    // at the cursor, else the newest; and which rules of the safety layer act there
    const value = (plot: uPlot, at: number | null, series: number, index: number | null): string => {
      const values = plot.data[series] ?? [];
      let i = index ?? values.length - 1;
      if (index === null || index === undefined) while (i > 0 && values[i] === null) --i;
      const shown = at ?? values[i];
      if (shown === null || shown === undefined) return "–";
      const rules = interventions(this.rulesAt(lines[series - 1].track, plot.data[0][i]));
      return `${n(shown, digits)} ${unit}${rules === "" ? "" : `, ${rules}`}`;
    };
    const series = lines.map((line, i) => ({ label: line.name, stroke: color(`--series-${i}`), width: 1.75, dash: DASHES[i], spanGaps: true, points: { show: false }, value }));
    // where the safety layer acts
    const limited = name !== "force" ? [] : lines.map(() => ({ label: "", stroke: color("--warn"), width: 0, points: { show: true, size: 4, fill: color("--warn"), stroke: color("--warn") } }));
    const drawLimit = (plot: uPlot): void => {
      if (limit === undefined) return;
      const { ctx, bbox } = plot;
      const y = plot.valToPos(limit, "y", true);
      ctx.save();
      ctx.strokeStyle = color("--bad");
      ctx.setLineDash([4, 4]);
      ctx.beginPath();
      ctx.moveTo(bbox.left, y);
      ctx.lineTo(bbox.left + bbox.width, y);
      ctx.stroke();
      ctx.restore();
    };
    this.plot = new uPlot(
      {
        ...this.size(),
        scales: { x: { time: false, auto: false }, y: { auto: false } },
        axes: [{ ...axis, size: 24, values: (_, ticks) => ticks.map((tick) => `${tick} s`) }, { ...axis, size: 52, space: 28, values: (_, ticks) => ticks.map((tick) => `${tick} ${unit}`) }],
        series: [{ label: "s", value: (_, time: number | null) => (time === null ? "–" : n(time, 1)) }, ...series, ...limited],
        // the page may be zoomed, as on a wall; the plot counts in its own pixels
        cursor: { drag: { x: false, y: false }, sync: { key: "session" }, move: (plot, left, top) => [left / zoomOf(plot.over), top / zoomOf(plot.over)] },
        legend: { live: true, isolate: false, markers: { width: 2 } },
        hooks: { draw: [drawLimit] },
      },
      [[], ...series.map(() => []), ...limited.map(() => [])],
      this.host,
    );
    // of the marks the legend needs no line
    this.host.querySelectorAll(".u-series").forEach((row, i) => i > series.length && row.remove());
  }
}

/** Which plots are shown is the viewer's choice, and kept. */
export class Plots {
  readonly choice = h("div", "chips");
  private plots = new Map<string, Plot>();
  private shown: Set<string>;
  private drawn = 0;

  constructor(private host: HTMLElement, private none: HTMLElement) {
    this.shown = new Set((kept("plots") ?? "force").split(" ").filter((name) => KINDS.some((kind) => kind.name === name)));
    for (const { name } of KINDS) {
      const chip = h("button", "chip");
      chip.dataset["plot"] = name;
      chip.addEventListener("click", () => this.toggle(name));
      this.choice.append(chip);
    }
    this.lay();
  }

  /** The cursor of all plots goes to the left or right: what it is at is read below each of them. */
  moveCursor(direction: number): void {
    const plots = [...this.plots.values()];
    const left = plots.map(({ cursor }) => cursor).find((place) => place !== undefined);
    if (left !== undefined) for (const plot of plots) plot.cursor = left + CURSOR_STEP * direction; // all have the same scale of time
  }

  private toggle(name: string): void {
    if (!this.shown.delete(name)) this.shown.add(name);
    keep("plots", [...this.shown].join(" "));
    this.lay();
  }

  private lay(): void {
    for (const plot of this.plots.values()) plot.rebuild();
    this.plots = new Map(KINDS.filter(({ name }) => this.shown.has(name)).map((kind) => [kind.name, new Plot(kind)]));
    this.host.replaceChildren(...[...this.plots.values()].map(({ element }) => element));
    for (const chip of this.choice.querySelectorAll("button")) chip.setAttribute("aria-pressed", String(this.shown.has(chip.dataset["plot"] ?? "")));
    this.drawn = 0;
  }

  /** Theme or language have changed. */
  rebuild(): void {
    for (const plot of this.plots.values()) plot.rebuild();
    for (const chip of this.choice.querySelectorAll("button")) chip.textContent = t(`plot.${chip.dataset["plot"]}.short` as Key);
  }

  update(session: Session, now: number): void {
    if (now - this.drawn < PERIOD || this.host.clientWidth === 0) return;
    this.drawn = now;
    this.none.hidden = session.tracks.all.size > 0;
    for (const plot of this.plots.values()) plot.update(session);
  }
}
