// The controls of a recording: play, step, speed, and a time line with steps, events and notes on which one seeks.
import { h, icon, zoomOf, type Icon } from "./dom";
import { clock } from "./panels";
import type { Mark, Recording } from "./recording";
import type { Session } from "./session";
import { t } from "./strings";

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16];
const SETTLED = 60; // ms without another seek, after which that is read
const WINDOW = 30; // s of what is plotted before the place that was sought
const FRAME = 1 / 30; // s of a single step
const SHAPES: [(mark: Mark) => boolean, string][] = [
  [(mark) => mark.kind === "note", "note"],
  [(mark) => mark.severity >= 2 || mark.kind.includes("emergency"), "bad"],
  [(mark) => mark.severity === 1, "warn"],
  [(mark) => mark.kind === "mounted", "good"],
];

/** What somebody does with a player, so that another one can do the same: `step`: and s since it began, where both have it. */
export interface Command { isPlaying?: boolean; speed?: number; seconds?: number; step?: { name: string; after: number } }

export class Player {
  /** Called with each of them. */
  onCommand?: (command: Command) => void;
  /** Called with a recording that is to be shown beside this one. */
  onCompare?: (file: File) => void;
  readonly element = h("section", "player");
  time = 0; // s since the beginning
  isPlaying = false;
  /** A place is sought. */
  /** Why the recording could not be read last; the next place may be. */
  problem?: string;
  /** The longest of the last seeks [ms]; for tests. */
  seekMilliseconds = 0;
  private speed = 1;
  isReading = false;
  private isBusy = false;
  private wanted?: number; // where to seek next
  private seeks = 0;
  private last = 0;
  private play = h("button", "play");
  private clockText = h("time", "clock");
  private speeds = h("select");
  private line = h("div", "timeline");
  private fill = h("i", "fill");
  private knob = h("i", "knob");
  private hint = h("output", "hint");
  private compare = h("button", "compare", icon("beside"));
  private file = Object.assign(h("input"), { type: "file", accept: ".mcap" });

  constructor(readonly recording: Recording, private session: Session, private titleOf: (step: string) => string) {
    const back = this.button("back", () => this.seek(this.time - FRAME), "player.back");
    const on = this.button("on", () => this.seek(this.time + FRAME), "player.on");
    this.play.addEventListener("click", () => this.toggle());
    this.speeds.append(...SPEEDS.map((speed) => Object.assign(h("option", "", `${speed < 1 ? `1/${1 / speed}` : speed} ×`), { value: String(speed), selected: speed === 1 })));
    this.speeds.addEventListener("change", () => {
      this.speed = Number(this.speeds.value);
      this.onCommand?.({ speed: this.speed });
    });
    this.file.addEventListener("change", () => {
      const file = this.file.files?.[0];
      if (file !== undefined) this.onCompare?.(file);
    });
    this.compare.addEventListener("click", () => this.file.click());
    this.compare.hidden = this.file.hidden = true;
    this.line.tabIndex = 0;
    this.line.setAttribute("role", "slider");
    this.line.setAttribute("aria-valuemin", "0");
    this.line.setAttribute("aria-valuemax", this.recording.seconds.toFixed(1));
    this.line.addEventListener("pointerdown", (event) => {
      this.line.setPointerCapture(event.pointerId);
      this.seek(this.secondsAt(event));
    });
    this.line.addEventListener("pointermove", (event) => {
      this.showHint(event);
      if (event.buttons === 1 && this.line.hasPointerCapture(event.pointerId)) this.seek(this.secondsAt(event));
    });
    this.line.addEventListener("pointerleave", () => (this.hint.hidden = true));
    this.line.addEventListener("keydown", (event) => this.onKey(event));
    this.hint.hidden = true;
    this.element.append(back, this.play, on, this.clockText, this.line, this.speeds, this.compare, this.file);
    this.setWords();
    this.seek(0);
  }

  private button(name: Icon, action: () => void, key: "player.back" | "player.on"): HTMLButtonElement {
    const button = h("button", `square ${name}`, icon(name));
    button.addEventListener("click", action);
    button.setAttribute("aria-label", t(key));
    return button;
  }

  setWords(): void {
    this.line.setAttribute("aria-label", t("player.time"));
    this.speeds.setAttribute("aria-label", t("player.speed"));
    this.compare.setAttribute("aria-label", t("beside"));
    this.compare.title = t("beside");
    this.drawMarks();
    this.show();
  }

  private drawMarks(): void {
    const percent = (seconds: number): string => `${(100 * seconds) / Math.max(this.recording.seconds, 1e-9)}%`;
    const steps = this.recording.marks.filter((mark) => mark.kind === "step");
    const parts = steps.map((mark, i) => {
      const part = h("span", `part part-${i % 2}`);
      const begin = Math.max(0, mark.seconds); // it may have begun before the recording
      part.style.left = percent(begin);
      part.style.width = percent(Math.max(0, (steps[i + 1]?.seconds ?? this.recording.seconds) - begin));
      return part;
    });
    const marks = this.recording.marks.flatMap((mark) => {
      const shape = SHAPES.find(([fits]) => fits(mark))?.[1];
      if (shape === undefined || mark.kind === "hand free" || mark.seconds < 0) return [];
      const element = h("i", `mark ${shape}`);
      element.style.left = percent(mark.seconds);
      return [element];
    });
    this.line.replaceChildren(...parts, this.fill, ...marks, this.knob, this.hint);
  }

  private secondsAt(event: PointerEvent): number {
    const box = this.line.getBoundingClientRect();
    return ((event.clientX - box.left) / Math.max(1, box.width)) * this.recording.seconds;
  }

  /** What is there: the step, and the nearest mark within a few pixels. */
  private showHint(event: PointerEvent): void {
    const seconds = this.secondsAt(event);
    const width = Math.max(1, this.line.clientWidth);
    const near = (4 / width) * this.recording.seconds;
    const step = this.recording.marks.filter((mark) => mark.kind === "step" && mark.seconds <= seconds).pop();
    const mark = this.recording.marks.find((other) => SHAPES.some(([fits]) => fits(other)) && Math.abs(other.seconds - seconds) <= near);
    const texts = [clock(seconds), step === undefined ? "" : this.titleOf(step.text), mark === undefined ? "" : `${mark.kind}: ${mark.text}`];
    this.hint.textContent = texts.filter((text) => text !== "").join(" · ");
    this.hint.hidden = false;
    this.hint.style.left = `${Math.min(width - 120, Math.max(120, (event.clientX - this.line.getBoundingClientRect().left) / zoomOf(this.line)))}px`;
  }

  private onKey(event: KeyboardEvent): void {
    const leaps: Record<string, number> = { ArrowLeft: -1, ArrowRight: 1, PageDown: -10, PageUp: 10, Home: -Infinity, End: Infinity };
    if (!(event.key in leaps)) return;
    event.preventDefault();
    this.seek(Math.min(this.recording.seconds, Math.max(0, this.time + leaps[event.key])));
  }

  toggle(): void {
    if (!this.isPlaying && this.time >= this.recording.seconds) this.seek(0);
    else if (this.problem !== undefined) this.seek(this.time); // what is to come is read anew
    this.isPlaying = !this.isPlaying;
    this.onCommand?.({ isPlaying: this.isPlaying });
    this.show();
  }

  /** There is a page to show another recording beside this one. */
  allowCompare(onCompare: (file: File) => void): void {
    this.onCompare = onCompare;
    this.compare.hidden = false;
  }

  /** Does what was done to another player: of a step the same time since its beginning, else the same time. */
  obey({ isPlaying, speed, seconds, step }: Command): void {
    if (isPlaying !== undefined) this.isPlaying = isPlaying;
    if (speed !== undefined) this.speeds.value = String((this.speed = speed));
    const mark = step === undefined ? undefined : this.recording.marks.find(({ kind, text }) => kind === "step" && text === step.name);
    if (seconds !== undefined) this.go(mark === undefined || step === undefined ? seconds : mark.seconds + step.after);
    this.show();
  }

  step(direction: number): void {
    this.seek(this.time + direction * FRAME);
  }

  /** To where the session was at a tick. */
  seekTick(tick: number): void {
    this.seek(this.recording.secondsOf(tick));
  }

  seek(seconds: number): void {
    const mark = this.recording.marks.filter(({ kind, seconds: at }) => kind === "step" && at <= seconds).pop();
    this.onCommand?.({ seconds, step: mark === undefined ? undefined : { name: mark.text, after: seconds - mark.seconds } });
    this.go(seconds);
  }

  /** The last place asked for counts. */
  private go(seconds: number): void {
    this.wanted = Math.min(this.recording.seconds, Math.max(0, seconds));
    void this.work();
  }

  private async work(): Promise<void> {
    if (this.isBusy) return;
    this.isBusy = this.isReading = true;
    while (this.wanted !== undefined) {
      this.time = this.wanted;
      this.wanted = undefined;
      ++this.seeks;
      const began = performance.now();
      this.session.reset();
      this.problem = undefined;
      await this.attempt(() => this.recording.seek(this.time));
      this.seekMilliseconds = performance.now() - began;
    }
    this.isBusy = this.isReading = false;
    this.show();
    if (this.problem !== undefined) return;
    const { seeks } = this;
    const isStale = (): boolean => seeks !== this.seeks;
    await new Promise((resolve) => setTimeout(resolve, SETTLED));
    if (isStale()) return;
    await this.attempt(async () => {
      const before = await this.recording.tracksBefore(this.time, WINDOW, isStale);
      if (!isStale()) this.session.recall(before);
    });
  }

  /** What cannot be read stops the playing, and no more. */
  private async attempt(read: () => Promise<void>): Promise<void> {
    try {
      await read();
    } catch (problem) {
      this.isPlaying = false;
      this.problem = problem instanceof Error ? problem.message : String(problem);
    }
  }

  /** Called for each frame of the display. */
  update(now: number): void {
    const elapsed = Math.min(0.1, (now - this.last) / 1000);
    this.last = now;
    if (!this.isPlaying || this.isBusy) return;
    this.isBusy = true;
    const time = Math.min(this.recording.seconds, this.time + elapsed * this.speed);
    void this.attempt(async () => {
      await this.recording.advance(time);
      this.time = time;
      if (time >= this.recording.seconds) this.isPlaying = false;
    }).then(() => {
      this.isBusy = false;
      this.show();
      if (this.wanted !== undefined) void this.work();
    });
  }

  private show(): void {
    const text = `${clock(this.time)} / ${clock(this.recording.seconds)}`;
    if (this.clockText.textContent !== text) this.clockText.textContent = text;
    const state = this.isPlaying ? "pause" : "now";
    if (this.play.dataset["state"] !== state) {
      this.play.dataset["state"] = state;
      this.play.replaceChildren(icon(state));
    }
    this.play.setAttribute("aria-label", t(this.isPlaying ? "player.pause" : "player.play"));
    const percent = `${(100 * this.time) / Math.max(this.recording.seconds, 1e-9)}%`;
    this.fill.style.width = percent;
    this.knob.style.left = percent;
    this.line.setAttribute("aria-valuenow", this.time.toFixed(1));
    this.line.setAttribute("aria-valuetext", text);
  }
}
