// Force in each hand over the last 30 s.
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

import { t } from "./strings";
import type { Session } from "./session";

const WINDOW = 30; // s
const PERIOD = 150; // [ms] between pictures
const SERIES = 4;
const DASHES = [[], [7, 4], [2, 3], [10, 3, 2, 3]];

/** Joins the series of several hands on their times: uPlot wants one list of times. */
function joined(session: Session, hands: number[]): [number[], ...(number | null)[][]] {
  const times = [...new Set(hands.flatMap((id) => session.history.get(id)?.times ?? []))].sort((a, b) => a - b);
  const index = new Map(times.map((time, i) => [time, i]));
  const series = hands.map((id) => {
    const values = new Array<number | null>(times.length).fill(null);
    const history = session.history.get(id);
    history?.times.forEach((time, i) => (values[index.get(time) as number] = history.forces[i]));
    return values;
  });
  return [times, ...series];
}

export class ForcePlot {
  private plot?: uPlot;
  private hands: number[] = [];
  private names = "";
  private drawn = 0;

  constructor(private host: HTMLElement, private none: HTMLElement) {
    new ResizeObserver(() => this.plot?.setSize(this.size())).observe(host);
  }

  private size(): { width: number; height: number } {
    return { width: Math.max(200, this.host.clientWidth), height: innerHeight < 900 ? 128 : 168 };
  }

  /** Theme or language have changed. */
  rebuild(): void {
    this.plot?.destroy();
    this.plot = undefined;
    this.names = "";
  }

  update(session: Session, now: number): void {
    if (now - this.drawn < PERIOD || this.host.clientWidth === 0) return;
    this.drawn = now;
    const hands = [...session.history.keys()].filter((id) => !session.isTracked(id)).sort((a, b) => a - b).slice(0, SERIES);
    this.none.hidden = hands.length > 0;
    if (hands.length === 0) return this.rebuild();
    const names = hands.map((id) => session.nameOfHand(id));
    if (names.join() !== this.names) this.build(hands, names);
    const end = session.tick / 1000;
    this.plot?.setData(joined(session, this.hands), false);
    const highest = Math.max(10, ...this.hands.map((id) => Math.max(0, ...(session.history.get(id)?.forces ?? []))));
    this.plot?.batch(() => {
      this.plot?.setScale("x", { min: Math.max(0, end - WINDOW), max: Math.max(WINDOW, end) });
      this.plot?.setScale("y", { min: 0, max: 1.1 * highest });
    });
  }

  private build(hands: number[], names: string[]): void {
    this.rebuild();
    this.hands = hands;
    this.names = names.join();
    const style = getComputedStyle(document.documentElement);
    const value = (name: string): string => style.getPropertyValue(name).trim();
    const axis = { stroke: value("--muted"), grid: { stroke: value("--grid"), width: 1 }, ticks: { stroke: value("--grid"), width: 1 }, font: "12px system-ui" };
    this.plot = new uPlot(
      {
        ...this.size(),
        scales: { x: { time: false, auto: false }, y: { auto: false } },
        axes: [{ ...axis, size: 28, values: (_, ticks) => ticks.map((tick) => `${tick} s`) }, { ...axis, size: 44, values: (_, ticks) => ticks.map((tick) => `${tick} ${t("force.unit")}`) }],
        series: [
          { label: "s", value: (_, time: number | null) => (time === null ? "–" : time.toFixed(1)) },
          ...hands.map((_, i) => ({
            label: names[i], stroke: value(`--series-${i}`), width: 1.75, dash: DASHES[i], spanGaps: true, points: { show: false },
            value: (_plot: uPlot, force: number | null) => (force === null ? "–" : `${force.toFixed(1)} ${t("force.unit")}`),
          })),
        ],
        cursor: { drag: { x: false, y: false }, sync: { key: "session" } },
        legend: { live: true },
      },
      [[], ...hands.map(() => [])],
      this.host,
    );
  }
}
