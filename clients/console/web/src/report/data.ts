// What a report has inside it: blocks of the page, named by `data-name`. Written by clients/report/page.cpp; SI units, loads in percent.

/** null: samples are missing that it rests on. */
export type Known = number | null;
export interface Metrics { peak_force: Known; mean_force: Known; contact_seconds: Known; device_proxy_gap: Known; field_depth: Known; load_percent: Known }
export interface Visit extends Metrics {
  step: number; name: string; title: string; part: string; attempt: number; path: Known; collisions: Known; phase: string; begin: number; end: number; seconds: number; // of its own time, without pauses
  position_error?: Known; position_tolerance?: number;
}
export interface Summary {
  title: string; session: string; recording: string; problem: string; began_ns: number; lockstep: boolean; succeeded: boolean; outcome: string; reason: string;
  final_hash: string; seconds: number; path: Known; collisions: Known; whole: Metrics; compute_seconds: { median: number; p99: number; max: number };
  late_ticks: number; oldest_input_seconds: number; messages: number; aids: string[]; people: { name: string; role: string }[]; steps: Visit[];
  input_to_force_seconds: {
    who: string; median: number; p99: number; max: number; jitter: number; inputs_lost: number; answers_lost: number; freeze_ms: number;
    round_trip: number | null; clock_offset: number | null; clock_error: number | null;
  }[];
}
export type SeriesName = "trainee_force" | "instructor_force" | "gap" | "depth" | "load" | "compute";
export interface ReportEvent { time: number; kind: string; text: string; tone: "good" | "warn" | "bad" | ""; more?: number; until?: number }
export interface Report {
  version: number; summary: Summary; steps_of_exercise: number;
  plots: { seconds: number; count: number; series: Partial<Record<SeriesName, (number | null)[]>>; compute_cut: { limit: number; above: number; largest: number } };
  events: ReportEvent[]; unlisted_events: number; other_events: Record<string, number>;
  player?: { rate: number; objects: number; models: number };
  no_player?: string;
}

function textOf(name: string): string | undefined {
  return document.querySelector(`script[data-name="${CSS.escape(name)}"]`)?.textContent ?? undefined;
}

/** Fails when the page is not a report yet. */
export function readReport(): Report {
  const text = textOf("report");
  if (text === undefined) throw new Error("this page has no report inside: `tenon report FILE.mcap -o FOLDER` makes one");
  return JSON.parse(text) as Report;
}

export function bytesOf(name: string): Uint8Array<ArrayBuffer> | undefined {
  const text = textOf(name);
  if (text === undefined) return undefined;
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) bytes[i] = binary.charCodeAt(i);
  return bytes;
}
