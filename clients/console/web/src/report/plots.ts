// The plots of a report: one time, one cursor, one zoom. Steps are bands, events are marks.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

import { h } from "../dom";
import { n, t } from "../strings";
import type { Report, ReportEvent, SeriesName, Visit } from "./data";
import { r, type Text } from "./texts";

const KEY = "report"; // of what all plots have in common
const HEIGHT = 150; // px
const DASHES = [[], [7, 4]];
const MARK = 4; // [px] half of a mark
const FRAME = 18; // [px] border and padding of a figure
const CLICK = 3; // [px] a longer motion is a drag

interface Curve { label: Text; series: SeriesName; colour: number }
interface Plot { title: Text; unit: string; scale: number; least: number; digits: number; curves: Curve[]; highest?: number; limit?: { value: number; label: Text } }

const PLOTS: Plot[] = [
  { title: "plot.force", unit: "N", scale: 1, least: 1, digits: 1, curves: [{ label: "curve.trainee", series: "trainee_force", colour: 0 }, { label: "curve.instructor", series: "instructor_force", colour: 1 }] },
  { title: "plot.gap", unit: "mm", scale: 1e3, least: 1, digits: 2, curves: [{ label: "curve.gap", series: "gap", colour: 0 }, { label: "curve.depth", series: "depth", colour: 1 }] },
  { title: "plot.load", unit: "%", scale: 1, least: 10, digits: 0, curves: [{ label: "curve.load", series: "load", colour: 2 }] },
  { title: "plot.compute", unit: "ms", scale: 1e3, least: 1.2, digits: 2, curves: [{ label: "curve.compute", series: "compute", colour: 3 }], limit: { value: 1, label: "curve.limit" } },
];

function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** A line as the curve is drawn: colours alone do not tell curves apart. */
function swatch(stroke: string, dash: number[]): HTMLElement {
  const line = h("i", "swatch");
  line.style.borderTop = `3px ${dash.length > 0 ? "dashed" : "solid"} ${stroke}`;
  return line;
}

export class Plots {
  readonly element = h("div", "plots");
  private plots: { plot: uPlot; now: HTMLElement }[] = [];
  private values: { output: HTMLElement; data: (number | null)[]; text: (value: number) => string }[] = [];
  private readout = h("output", "readout");
  private time = 0;
  private times: number[];
  private pressed?: { x: number; y: number };

  constructor(private report: Report, private titleOf: (visit: Visit) => string, private textOf: (event: ReportEvent) => string, private onPick: (seconds: number) => void) {
    const { count, seconds } = report.plots;
    this.times = Array.from({ length: count }, (_, i) => (i + 0.5) * seconds);
    new ResizeObserver(() => this.plots.forEach(({ plot }) => plot.setSize({ width: this.width(), height: HEIGHT }))).observe(this.element);
  }

  private width(): number {
    return Math.max(240, this.element.clientWidth - FRAME);
  }

  /** Makes all anew: words, colours or both have changed. */
  rebuild(): void {
    for (const { plot } of this.plots) plot.destroy();
    this.plots = [];
    this.values = [];
    const shown = PLOTS.map((plot) => ({ ...plot, curves: plot.curves.filter(({ series }) => this.report.plots.series[series] !== undefined) }));
    const figures = shown.filter(({ curves }) => curves.length > 0).map((plot) => this.figure(plot));
    this.element.replaceChildren(this.readout, ...figures.map(({ figure }) => figure));
    for (const { plot, host, data } of figures) this.plots.push(this.draw(plot, host, data));
    this.showTime(this.time);
    this.tell(undefined);
  }

  private figure(plot: Plot): { figure: HTMLElement; plot: Plot; host: HTMLElement; data: (number | null)[][] } {
    const { compute_cut: cut, series } = this.report.plots;
    const data = plot.curves.map((curve) => (series[curve.series] ?? []).map((value) => (value === null ? null : value * plot.scale)));
    const rows = plot.curves.map((curve, i) => {
      const output = h("output");
      this.values.push({ output, data: data[i], text: (value) => `${n(value, plot.digits)} ${plot.unit}` });
      const above = curve.series === "compute" && cut.above > 0 ? r("curve.above", { count: cut.above, largest: n(1e3 * cut.largest, 1) }) : "";
      return h("span", "curve", swatch(colour(`--series-${curve.colour}`), DASHES[i]), r(curve.label), ...(above === "" ? [] : [h("small", "muted", above)]), output);
    });
    if (plot.limit !== undefined) rows.push(h("span", "curve", swatch(colour("--bad"), [2, 3]), r(plot.limit.label)));
    const host = h("div", "plot-host");
    return { figure: h("figure", "", h("figcaption", "", h("h3", "", r(plot.title), h("small", "muted", ` [${plot.unit}]`)), ...rows), host), plot, host, data };
  }

  private draw(plot: Plot, host: HTMLElement, data: (number | null)[][]): { plot: uPlot; now: HTMLElement } {
    const axis = { stroke: colour("--muted"), grid: { stroke: colour("--grid"), width: 1 }, ticks: { stroke: colour("--grid"), width: 1 }, font: "12px system-ui" };
    const cut = plot.title === "plot.compute" ? 1e3 * this.report.plots.compute_cut.limit : Infinity;
    const highest = data.reduce((most, values) => values.reduce((a: number, b) => Math.max(a, b ?? 0), most), plot.least);
    const now = h("i", "now");
    const made = new uPlot(
      {
        width: this.width(), height: HEIGHT,
        padding: [18, 8, 0, 0],
        scales: { x: { time: false, range: (_, min, max) => (min <= this.times[0] && max >= this.times[this.times.length - 1] ? [0, this.report.plots.count * this.report.plots.seconds] : [min, max]) }, y: { range: [0, Math.min(cut, 1.1 * highest)] } },
        axes: [{ ...axis, size: 28, values: (_, ticks) => ticks.map((tick) => `${n(tick, tick % 1 === 0 ? 0 : 1)} s`) }, { ...axis, size: 48, values: (_, ticks) => ticks.map((tick) => n(tick, tick % 1 === 0 ? 0 : 1)) }],
        series: [{}, ...plot.curves.map((curve, i) => ({ stroke: colour(`--series-${curve.colour}`), width: 1.5, dash: DASHES[i], spanGaps: true, points: { show: false } }))],
        cursor: { sync: { key: KEY }, drag: { x: true, y: false, dist: CLICK }, points: { size: 6 } },
        legend: { show: false },
        hooks: {
          drawClear: [(u) => this.drawSteps(u)],
          draw: [(u) => this.drawLimit(u, plot), (u) => this.drawMarks(u)],
          setCursor: [(u) => this.tell(u.cursor.idx ?? undefined)],
          setScale: [(_, scale) => scale === "x" && this.showTime(this.time)],
        },
      },
      [this.times, ...data],
      host,
    );
    made.over.append(now);
    made.over.addEventListener("pointerdown", ({ clientX: x, clientY: y }) => (this.pressed = { x, y }));
    made.over.addEventListener("click", ({ clientX, clientY, offsetX }) => {
      const { pressed } = this;
      if (pressed !== undefined && Math.hypot(clientX - pressed.x, clientY - pressed.y) <= CLICK) this.onPick(made.posToVal(offsetX, "x"));
    });
    return { plot: made, now };
  }

  private drawSteps(u: uPlot): void {
    const { ctx, bbox } = u;
    ctx.save();
    ctx.font = `${12 * devicePixelRatio}px system-ui`;
    ctx.textAlign = "center";
    ctx.textBaseline = "alphabetic";
    this.report.summary.steps.forEach((visit, i) => {
      const left = Math.max(bbox.left, u.valToPos(visit.begin, "x", true));
      const right = Math.min(bbox.left + bbox.width, u.valToPos(visit.end, "x", true));
      if (right <= left) return;
      ctx.fillStyle = colour(i % 2 === 0 ? "--band-0" : "--band-1");
      ctx.fillRect(left, bbox.top, right - left, bbox.height);
      ctx.fillStyle = colour("--muted");
      if (right - left > 16 * devicePixelRatio) ctx.fillText(String(i + 1), (left + right) / 2, bbox.top - 5 * devicePixelRatio);
    });
    ctx.restore();
  }

  private drawLimit(u: uPlot, { limit }: Plot): void {
    if (limit === undefined) return;
    const { ctx, bbox } = u;
    const y = u.valToPos(limit.value, "y", true);
    ctx.save();
    ctx.strokeStyle = colour("--bad");
    ctx.setLineDash([5 * devicePixelRatio, 4 * devicePixelRatio]);
    ctx.beginPath();
    ctx.moveTo(bbox.left, y);
    ctx.lineTo(bbox.left + bbox.width, y);
    ctx.stroke();
    ctx.restore();
  }

  private drawMarks(u: uPlot): void {
    const { ctx, bbox } = u;
    const half = MARK * devicePixelRatio;
    const y = bbox.top + 2 * half;
    ctx.save();
    for (const event of this.report.events) {
      const x = u.valToPos(event.time, "x", true);
      if (event.tone === "" || x < bbox.left || x > bbox.left + bbox.width) continue;
      ctx.fillStyle = colour(`--${event.tone}`);
      ctx.beginPath();
      if (event.tone === "good") ctx.arc(x, y, half, 0, 2 * Math.PI);
      else if (event.tone === "bad") ctx.rect(x - half, y - half, 2 * half, 2 * half);
      else [[0, -1.3], [1.3, 0], [0, 1.3], [-1.3, 0]].forEach(([dx, dy], i) => (i === 0 ? ctx.moveTo(x + dx * half, y + dy * half) : ctx.lineTo(x + dx * half, y + dy * half)));
      ctx.fill();
    }
    ctx.restore();
  }

  /** Says what is at the cursor: the values beside their curves, and the step and events above. */
  private tell(index: number | undefined): void {
    for (const { output, data, text } of this.values) {
      const value = index === undefined ? null : data[index];
      output.textContent = value === null || value === undefined ? "" : text(value);
    }
    if (index === undefined) {
      this.readout.textContent = r("plots.hint");
      return;
    }
    const time = this.times[index];
    const visit = this.report.summary.steps.find(({ begin, end }) => begin <= time && time < end);
    const [first] = this.plots;
    const near = first === undefined ? 0 : Math.abs(first.plot.posToVal(MARK + 2, "x") - first.plot.posToVal(0, "x"));
    const event = this.report.events.find((known) => known.tone !== "" && Math.abs(known.time - time) <= near);
    const texts = [`${n(time, 1)} s`, visit === undefined ? "" : this.titleOf(visit), event === undefined ? "" : this.textOf(event)];
    this.readout.textContent = texts.filter((text) => text !== "").join(" · ");
  }

  /** Marks the moment that the player shows. */
  showTime(seconds: number): void {
    this.time = seconds;
    for (const { plot, now } of this.plots) {
      const x = plot.valToPos(seconds, "x");
      now.hidden = !(x >= 0 && x <= plot.over.clientWidth);
      now.style.left = `${x}px`;
      now.title = t("player.time");
    }
  }
}
