// The controls of a recording: play, step, speed, and a time line with steps, events and notes on which one seeks.
import { Together } from "./beside";
import { h, icon, zoomOf, type Icon } from "./dom";
import { kindOf, textOf } from "./eventtext";
import type { Mark, Recording } from "./recording";
import type { Session } from "./session";
import { moment, t } from "./strings";

const SPEEDS = [0.25, 0.5, 1, 2, 4, 8, 16];
const SETTLED = 60; // ms without another seek, after which that is read
const BETWEEN = 20; // [ms] in which a picture begins
const WINDOW = 30; // s of what is plotted before the place that was sought
const FRAME = 1 / 30; // s of a single step
const TELL = 250; // [ms] between two tellings of how much was played
const SHAPES: [(mark: Mark) => boolean, string][] = [
  [(mark) => mark.kind === "note", "note"],
  [(mark) => mark.severity >= 2 || mark.kind.includes("emergency"), "bad"],
  [(mark) => mark.severity === 1, "warn"],
  [(mark) => mark.kind === "mounted", "good"],
];

/**
 * What somebody does with a player, so that another one can do the same: `step`: and s since it began, where both have it. `played`: s of the recording since then,
 * by which the one that is ahead waits.
 */
export interface Command { isPlaying?: boolean; speed?: number; seconds?: number; step?: { name: string; after: number }; played?: number }

/** What is at a place [s] with its time of the session [s]: the step, and the first mark within `near` [s]. */
export function hintAt(session: Session, marks: Mark[], seconds: number, near: number, time = seconds): string {
  const step = marks.filter((mark) => mark.kind === "step" && mark.seconds <= seconds).pop();
  const mark = marks.find((other) => SHAPES.some(([fits]) => fits(other)) && Math.abs(other.seconds - seconds) <= near);
  const texts = [moment(time), step === undefined ? "" : textOf(session, step), mark === undefined ? "" : `${kindOf(mark)}: ${textOf(session, mark)}`];
  return texts.filter((text) => text !== "").join(" · ");
}

export class Player {
  /** Called with each of them. */
  onCommand?: (command: Command) => void;
  /** Called with a recording that is to be shown beside this one. */
  onCompare?: (file: File) => void;
  readonly element = h("section", "player");
  time = 0; // s since the beginning of the recording
  isPlaying = false;
  /** Why the recording could not be read last; the next place may be. */
  problem?: unknown;
  /** The longest of the last seeks [ms]; for tests. */
  seekMilliseconds = 0;
  private speed = 1;
  /** A seek is running. */
  isReading = false;
  private isBusy = false;
  private wanted?: number; // where to seek next
  private seeks = 0;
  /** Seeks that are done. */
  sought = 0;
  private last = 0;
  private together = new Together();
  private toldAt = 0;
  private isEnded = false;
  private play = h("button", "play");
  private clockText = h("time", "clock");
  private speeds = h("select");
  private line = h("div", "timeline");
  private fill = h("i", "fill");
  private knob = h("i", "knob");
  private hint = h("output", "hint");
  private compare = h("button", "compare", icon("beside"));
  private file = Object.assign(h("input"), { type: "file", accept: ".mcap" });

  constructor(readonly recording: Recording, private session: Session) {
    const back = this.button("back", () => this.seek(this.time - FRAME), "player.back");
    const on = this.button("on", () => this.seek(this.time + FRAME), "player.on");
    this.play.addEventListener("click", () => this.toggle());
    this.speeds.append(...SPEEDS.map((speed) => Object.assign(h("option", "", `${speed < 1 ? `1/${1 / speed}` : speed} ×`), { value: String(speed), selected: speed === 1 })));
    this.speeds.addEventListener("change", () => {
      this.speed = Number(this.speeds.value);
      this.command({ speed: this.speed });
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

  private showHint(event: PointerEvent): void {
    const width = Math.max(1, this.line.clientWidth);
    this.hint.textContent = hintAt(this.session, this.recording.marks, this.secondsAt(event), (4 / width) * this.recording.seconds, this.recording.sessionTimeOf(this.secondsAt(event)));
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
    this.command({ isPlaying: this.isPlaying });
    this.show();
  }

  /** There is a page to show another recording beside this one. */
  allowCompare(onCompare: (file: File) => void): void {
    this.onCompare = onCompare;
    this.compare.hidden = false;
  }

  private command(command: Command): void {
    this.together.restart();
    this.onCommand?.(command);
  }

  /** Does what was done to another player: of a step the same time since its beginning, else the same time. */
  obey({ isPlaying, speed, seconds, step, played }: Command): void {
    if (played !== undefined) return this.together.hear(played, this.speed);
    this.together.restart();
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
    this.command({ seconds, step: mark === undefined ? undefined : { name: mark.text, after: seconds - mark.seconds } });
    this.go(seconds);
  }

  /** It is not shown any more, and tells the session nothing more. */
  end(): void {
    this.isEnded = true;
    this.wanted = undefined;
    ++this.seeks;
    this.element.remove();
  }

  /** The last place asked for counts. */
  private go(seconds: number): void {
    this.wanted = Math.min(this.recording.seconds, Math.max(0, seconds));
    void this.work();
  }

  private async work(): Promise<void> {
    if (this.isBusy || this.isEnded) return;
    this.isBusy = true;
    while (this.wanted !== undefined) {
      this.isReading = true;
      this.time = this.wanted;
      this.wanted = undefined;
      ++this.seeks;
      this.show();
      const began = performance.now();
      this.session.reset();
      this.problem = undefined;
      await this.attempt(() => this.recording.seek(this.time));
      this.seekMilliseconds = performance.now() - began;
      this.isReading = false;
      ++this.sought;
      // where the next place is wanted already, as in a drag, this one is drawn before that is read
      if (this.wanted !== undefined) await new Promise((resolve) => setTimeout(resolve, BETWEEN));
    }
    this.isBusy = false;
    this.show();
    if (this.problem !== undefined || this.isEnded) return;
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
      console.warn(problem);
      this.problem = problem;
    }
  }

  /** Called for each frame of the display. */
  update(now: number): void {
    const elapsed = Math.min(0.1, (now - this.last) / 1000);
    this.last = now;
    if (!this.isPlaying || this.isBusy || this.isEnded) return;
    const time = Math.min(this.recording.seconds, this.time + this.together.pass(elapsed * this.speed));
    this.tellPlayed(now);
    this.isBusy = true;
    void this.attempt(async () => {
      await this.recording.advance(time);
      if (this.wanted === undefined) this.together.played += time - this.time;
      this.time = time;
      if (time >= this.recording.seconds) this.isPlaying = false;
    }).then(() => {
      this.isBusy = false;
      this.show();
      if (this.wanted !== undefined) void this.work();
    });
  }

  private tellPlayed(now: number): void {
    if (now - this.toldAt < TELL) return;
    this.toldAt = now;
    this.onCommand?.({ played: this.together.played });
  }

  /** [s] of the session, as its tables and plots count it: 0 at the first tick, less before it. */
  get sessionTime(): number {
    const counted = this.recording.sessionTimeOf(this.time);
    // before the first tick its poses are shown already
    return counted > 0 && this.session.tick > 0 && !this.isReading ? this.session.tick / 1000 : counted;
  }

  private show(): void {
    const text = `${moment(this.sessionTime)} / ${moment(this.recording.sessionTimeOf(this.recording.seconds))}`;
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
