// What is plotted, over the session's time: the newest half minute of it.
import type { ContactPairs, HandState, Telemetry, TickStats } from "./messages";

const LENGTH = 3000; // samples of a track: 30 s at 100 Hz
const FELT = 0.05; // [N] from which on it matters that a force is limited

/** Of one time the value that `worst` prefers counts. Times in s of the session, increasing. */
export class Track {
  times: number[] = [];
  values: number[] = [];

  add(seconds: number, value: number, worst: (a: number, b: number) => number = Math.max): void {
    const last = this.times.length - 1;
    if (last >= 0 && seconds <= this.times[last]) {
      this.values[last] = worst(this.values[last], value);
      return;
    }
    this.times.push(seconds);
    this.values.push(value);
    if (this.times.length <= LENGTH) return;
    this.times.shift();
    this.values.shift();
  }

  /** Puts what was before in front. */
  prepend(before: Track): void {
    const last = before.times[before.times.length - 1] ?? -Infinity;
    const later = this.times.findIndex((time) => time > last);
    const from = later < 0 ? this.times.length : later;
    this.times = [...before.times, ...this.times.slice(from)];
    this.values = [...before.values, ...this.values.slice(from)];
  }
}

/** Tracks by their names: `force 3` is that of hand 3, `limited 3` that of it where the safety layer acts, with `safety 3` its rules as bits, `age 7` that of client 7, `gap` that of the scene. */
export class Tracks {
  readonly all = new Map<string, Track>();

  of(name: string): Track {
    let track = this.all.get(name);
    if (track === undefined) this.all.set(name, (track = new Track()));
    return track;
  }

  feel(seconds: number, { hand_id, F_Ho_W, safety_flags }: HandState): void {
    const { force } = F_Ho_W;
    const newtons = Math.hypot(force[0], force[1], force[2]);
    this.of(`force ${hand_id}`).add(seconds, newtons);
    if (safety_flags === 0 || newtons <= FELT) return;
    this.of(`limited ${hand_id}`).add(seconds, newtons);
    this.of(`safety ${hand_id}`).add(seconds, safety_flags, (a, b) => a | b);
  }

  /** Gap of the nearest pair, or how deep the deepest one is in: below 0 [m]. */
  touch({ tick, pairs }: ContactPairs): void {
    for (const { enabled, colliding, gap, peak_depth } of pairs) if (enabled) this.of("gap").add(Number(tick) / 1000, colliding ? -peak_depth : gap, Math.min);
  }

  count({ tick, compute_seconds_max, load_percent }: TickStats): void {
    this.of("compute").add(Number(tick) / 1000, compute_seconds_max);
    this.of("load").add(Number(tick) / 1000, load_percent);
  }

  link(seconds: number, { client_id, samples, age, jitter, answers_lost, inputs_lost }: Telemetry): void {
    if (samples === 0n) return;
    this.of(`age ${client_id}`).add(seconds, age);
    this.of(`jitter ${client_id}`).add(seconds, jitter);
    this.of(`loss ${client_id}`).add(seconds, Math.max(answers_lost, inputs_lost));
  }

  prepend(before: Tracks): void {
    for (const [name, track] of before.all) this.of(name).prepend(track);
  }
}
