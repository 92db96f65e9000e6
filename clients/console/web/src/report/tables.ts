// The tables of a report. A row that stands for a moment has it in `data-time` [s].
import { h, type Icon, icon } from "../dom";
import type { Known, Metrics, Report, ReportEvent, Summary, Visit } from "./data";
import { clock, n, retold, SPEAKERS } from "../strings";
import { kindIn, r, said, type Text } from "./texts";

const EVENTS_SHOWN = 200;
const PHASES: Record<string, [Icon, string]> = { done: ["done", "good"], "timed out": ["warn", "bad"], skipped: ["skip", "warn"], abandoned: ["skip", "warn"], "not finished": ["wait", "warn"] };

export type TitleOf = (visit: Visit) => string;

/** Blank where it is not known. */
const known = (value: Known, digits: number, scale = 1): string => (value === null ? "" : n(scale * value, digits));

function tile(value: string, what: Text): HTMLElement {
  return h("div", "tile", h("b", "", value), h("span", "muted", r(what)));
}

const withUnit = (value: Known, unit: string): string => (value === null ? "–" : `${n(value, 1)} ${unit}`);

export function tiles({ summary, steps_of_exercise: steps }: Report): HTMLElement {
  const done = summary.steps.filter(({ phase }) => phase === "done").length;
  return h(
    "div", "tiles",
    tile(`${clock(summary.seconds)}${n(summary.seconds % 1, 1).slice(1)}`, "tile.time"), tile(withUnit(summary.whole.peak_force, "N"), "tile.force"),
    tile(withUnit(summary.whole.contact_seconds, "s"), "tile.contact"), tile(summary.collisions === null ? "–" : String(summary.collisions), "tile.collisions"), tile(withUnit(summary.path, "m"), "tile.path"),
    tile(r("of", { done, all: steps }), "tile.steps"),
  );
}

function table(className: string, heads: Text[], rows: HTMLElement[]): HTMLElement {
  const head = h("tr", "", ...heads.map((text) => h("th", "", text === "step" ? "" : r(text))));
  (head.firstElementChild as HTMLElement).textContent = "#";
  for (const cell of head.children) cell.setAttribute("scope", "col");
  return h("div", "scroll", h("table", className, h("thead", "", head), h("tbody", "", ...rows)));
}

/** A row that the player shows when it is clicked, or when its button is. */
function jump(row: HTMLElement, seconds: number, cell: Element | null): HTMLElement {
  const button = h("button", "jump", icon("now"));
  button.setAttribute("aria-label", r("steps.jump"));
  button.title = r("steps.jump");
  cell?.prepend(button);
  row.dataset["time"] = String(seconds);
  return row;
}

/** Of the whole session, of which the first step is the begin. */
const beginOf = ({ steps: [first] }: Summary): number => first?.begin ?? 0;

const cells = (values: string[]): HTMLElement[] => values.map((value) => h("td", "number", value));

/** `partOf`: the title of a part in the page's language. */
export function steps({ summary }: Report, titleOf: TitleOf, partOf: (title: string) => string): Node[] {
  const numbers = (seconds: number, error: string, of: { path: Known; collisions: Known }, metrics: Metrics): HTMLElement[] =>
    cells([n(seconds, 1), error, known(of.path, 2), known(of.collisions, 0), known(metrics.peak_force, 1), known(metrics.mean_force, 1), known(metrics.contact_seconds, 1)]);
  const rows = summary.steps.map((visit, i) => {
    const error = visit.position_error === undefined || visit.position_error === null ? "" : r("of", { done: n(1e3 * visit.position_error, 2), all: n(1e3 * (visit.position_tolerance ?? 0), 1) });
    const [name, tone] = PHASES[visit.phase] ?? ["wait", "warn"];
    const title = h("td", "name", titleOf(visit), ...(visit.part === "" ? [] : [h("small", "muted", partOf(visit.part))]));
    const result = h("td", "", h("span", `badge ${tone}`, icon(name), said(visit.phase)));
    return jump(h("tr", "", h("td", "number", String(i + 1)), title, ...numbers(visit.seconds, error, visit, visit), result), visit.begin, title);
  });
  const whole = h("td", "name", r("whole"));
  rows.push(jump(h("tr", "sum", h("td"), whole, ...numbers(summary.seconds, "", summary, summary.whole), h("td")), beginOf(summary), whole));
  const made = table("steps-table", ["step", "step", "step.time", "step.error", "step.path", "step.collisions", "step.peak", "step.mean", "step.contact", "step.result"], rows);
  made.querySelectorAll("th")[1].textContent = r("step");
  return [h("h2", "", r("steps")), made, h("p", "remark", r("steps.note"))];
}

/** `words`: its text in the language of the page. */
export function textOf(event: ReportEvent, words: (event: ReportEvent) => string): string {
  const text = words(event);
  return event.more === undefined ? text : `${text} ${r("events.more", { more: event.more, until: n(event.until ?? event.time, 1) })}`;
}

export function events(report: Report, words: (event: ReportEvent) => string): Node[] {
  const rows = report.events.map((event, i) => {
    const kind = h("td", "", h("span", event.tone === "" ? "muted" : `tone ${event.tone}`, kindIn(event.kind)));
    const row = jump(h("tr", "", h("td", "number muted", `${n(event.time, 1)} s`), kind, h("td", "", textOf(event, words))), event.time, kind);
    row.hidden = i >= EVENTS_SHOWN;
    return row;
  });
  if (rows.length === 0) return [];
  const others = Object.entries(report.other_events);
  const notes = [
    ...(report.unlisted_events > 0 ? [r("events.left", { count: report.unlisted_events })] : []),
    ...(others.length > 0 ? [r("events.others", { count: others.reduce((sum, [, count]) => sum + count, 0), kinds: others.map(([kind, count]) => `${count} ${kindIn(kind)}`).join(", ") })] : []),
  ];
  const all = h("button", "all-events", r("events.all", { count: rows.length }));
  all.hidden = rows.length <= EVENTS_SHOWN;
  all.addEventListener("click", () => {
    all.hidden = true;
    for (const row of rows) row.hidden = false;
  });
  return [h("h2", "", r("events")), h("div", "scroll", h("table", "events-table", h("tbody", "", ...rows))), all, ...notes.map((note) => h("p", "remark", note))];
}

/** What describes the simulation more than the trainee. */
export function engineers({ summary }: Report, titleOf: TitleOf): Node[] {
  const row = (number: string, title: HTMLElement, of: Metrics): HTMLElement =>
    h("tr", number === "" ? "sum" : "", h("td", "number", number), title, ...cells([known(of.device_proxy_gap, 2, 1e3), known(of.field_depth, 2, 1e3), known(of.load_percent, 0)]));
  const rows = summary.steps.map((visit, i) => {
    const title = h("td", "name", titleOf(visit));
    return jump(row(String(i + 1), title, visit), visit.begin, title);
  });
  const whole = h("td", "name", r("whole"));
  rows.push(jump(row("", whole, summary.whole), beginOf(summary), whole));
  const made = table("", ["step", "step", "engineers.gap", "engineers.depth", "engineers.load"], rows);
  made.querySelectorAll("th")[1].textContent = r("step");
  return [h("h2", "", r("engineers")), made, h("p", "remark", r("engineers.note"))];
}

export function performance({ summary }: Report): Node[] {
  const times = (of: { median: number; p99: number; max: number }, digits: number): string =>
    r("performance.times", { median: n(1e3 * of.median, digits), p99: n(1e3 * of.p99, digits), max: n(1e3 * of.max, digits) });
  const link = (of: Summary["input_to_force_seconds"][number]): string =>
    `${retold(of.who, ...SPEAKERS)}: ${r("performance.losses", { jitter: n(1e3 * of.jitter, 1), inputs: n(1e2 * of.inputs_lost, 2), contacts: n(1e2 * of.answers_lost, 2), freeze: String(of.freeze_ms) })}` +
    (of.round_trip === null ? "" : `; ${r("performance.clock", { trip: n(1e3 * of.round_trip, 1), error: n(1e3 * (of.clock_error ?? 0), 1) })}`);
  const facts: [Text, string][] = [
    ["performance.compute", times(summary.compute_seconds, 3)], ["performance.late", String(summary.late_ticks)],
    ["performance.input", `${n(1e3 * summary.oldest_input_seconds, 1)} ms`],
    ...summary.input_to_force_seconds.map((latency): [Text, string] => ["performance.latency", `${retold(latency.who, ...SPEAKERS)}: ${times(latency, 1)}`]),
    ...summary.input_to_force_seconds.map((latency): [Text, string] => ["performance.link", link(latency)]),
    ["performance.aids", summary.aids.length === 0 ? r("performance.none") : summary.aids.map(said).join("; ")],
  ];
  return [h("h2", "", r("performance")), h("dl", "facts", ...facts.flatMap(([what, value]) => [h("dt", "", r(what)), h("dd", "", value)]))];
}
