// What stands around the scene: instruction, steps, people, events, status. Each part is made anew from the session when it changed.
import { h, icon, type Icon } from "./dom";
import { NONE, RunPhase, StepPhase } from "./messages";
import type { Session, StepEntry } from "./session";
import { localized, t, type Key } from "./strings";

const RUN: Record<RunPhase, [Key, Icon, string]> = {
  [RunPhase.Waiting]: ["run.waiting", "wait", "info"],
  [RunPhase.Running]: ["run.running", "live", "good"],
  [RunPhase.Paused]: ["run.paused", "over", "warn"],
  [RunPhase.Succeeded]: ["run.succeeded", "done", "good"],
  [RunPhase.Failed]: ["run.failed", "warn", "bad"],
  [RunPhase.Stopped]: ["run.stopped", "over", "warn"],
};
const STEP: Record<StepPhase, [Key, Icon, string]> = {
  [StepPhase.Waiting]: ["step.waiting", "wait", "info"],
  [StepPhase.Active]: ["step.active", "now", "info"],
  [StepPhase.Done]: ["step.done", "done", "good"],
  [StepPhase.TimedOut]: ["step.timed_out", "warn", "warn"],
  [StepPhase.Skipped]: ["step.skipped", "skip", "warn"],
};
const EVENTS_SHOWN = 40;

export function clock(seconds: number): string {
  const whole = Math.max(0, Math.floor(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

/** Colour, icon and word. */
function badge([key, name, tone]: [Key, Icon, string]): HTMLElement {
  return h("span", `badge ${tone}`, icon(name), t(key));
}

function titleOf(step: StepEntry): string {
  return localized(step.title) || step.name.replace(/_/g, " ");
}

export function instruction(session: Session): Node[] {
  const { step, run } = session;
  const phase = run === undefined ? [] : [badge(RUN[run.phase])];
  if (session.isOver && run !== undefined) return [h("div", "card-head", ...phase), h("p", "instruction", run.reason)];
  if (step === undefined) return [h("div", "card-head", ...phase), h("p", "instruction muted", t("step.none"))];
  const count = h("span", "muted", t("step.count", { step: step.step + 1, steps: step.steps }));
  const head = h("div", "card-head", count, h("span", "part", step.part), ...phase);
  return [head, h("h1", "step-title", localized(step.title) || step.name), h("p", "instruction", localized(step.instruction)), ...conditions(session)];
}

function meter(label: string, text: string, fraction: number, isMet: boolean): HTMLElement {
  const bar = h("i", isMet ? "good" : "");
  bar.style.width = `${Math.round(100 * Math.min(1, Math.max(0.02, fraction)))}%`;
  return h("li", isMet ? "met" : "", icon(isMet ? "done" : "wait"), h("span", "", label), h("output", "", text), h("div", "bar", bar));
}

/** A condition's text, with the titles of objects instead of their names. */
function readable(session: Session, text: string): string {
  const titles = new Map([...session.objects.values()].map((object) => [object.name, object.title]));
  return text.replace(/\w+/g, (word) => titles.get(word) ?? word);
}

function conditions(session: Session): Node[] {
  const { step, progress } = session;
  if (step === undefined || progress === undefined || progress.revision !== step.revision) return [];
  const rows: HTMLElement[] = [];
  if (step.has_target) {
    const mm = 1000 * progress.position_error;
    const degrees = (180 / Math.PI) * progress.angle_error;
    const limits = [1000 * step.tolerance, (180 / Math.PI) * step.angle_tolerance];
    rows.push(
      meter(t("condition.position"), `${mm.toFixed(mm < 10 ? 1 : 0)} / ${limits[0].toFixed(0)} mm`, limits[0] / Math.max(mm, 1e-9), mm <= limits[0]),
      meter(t("condition.angle"), `${degrees.toFixed(degrees < 10 ? 1 : 0)} / ${limits[1].toFixed(0)}°`, limits[1] / Math.max(degrees, 1e-9), degrees <= limits[1]),
    );
  }
  for (const { text, value, limit, met } of progress.conditions) {
    if (step.has_target && text.startsWith("pose of")) continue;
    rows.push(meter(readable(session, text), `${Number(value.toPrecision(3))} / ${Number(limit.toPrecision(3))}`, limit === 0 ? (met ? 1 : 0) : value / limit, met));
  }
  return rows.length === 0 ? [] : [h("ul", "conditions", ...rows)];
}

export function steps(session: Session): Node[] {
  const list = session.steps;
  if (list.length === 0) return [h("p", "muted", t("step.none"))];
  let part = "";
  const rows: HTMLElement[] = [];
  for (const [i, entry] of list.entries()) {
    if (entry.part !== part && entry.part !== "") rows.push(h("li", "group", entry.part));
    part = entry.part;
    const seconds = (entry.ended ?? session.tick / 1000) - entry.started;
    const isNow = i === list.length - 1 && !session.isOver;
    const row = h("li", isNow ? "now" : "", badge(STEP[entry.phase]), h("span", "name", titleOf(entry)), h("time", "", `${seconds.toFixed(1)} s`));
    if (isNow) row.setAttribute("aria-current", "step");
    rows.push(row);
  }
  const left = (session.step?.steps ?? 0) - (session.step?.step ?? 0) - 1;
  if (left > 0 && !session.isOver) rows.push(h("li", "muted", `+ ${left}`));
  return [h("ol", "steps", ...rows)];
}

export function people(session: Session): Node[] {
  const here = [...session.people.values()].filter((person) => person.alive).sort((a, b) => a.client_id - b.client_id);
  if (here.length === 0) return [h("p", "muted", t("people.none"))];
  const rows = here.map((person) => {
    const hands = Array.from(person.hands);
    const held = [...session.grabs.values()].filter((grab) => grab.hand_id !== NONE && hands.includes(grab.hand_id) && !session.isOwn(grab.object_id));
    const what = held.map((grab) => session.titleOf(grab.object_id)).join(", ");
    return h("li", "", icon("person"), h("span", "name", person.name), h("span", "muted", t(`role.${person.role}` as Key)), h("span", "holds", what === "" ? "" : t("holds", { what })));
  });
  return [h("ul", "people", ...rows)];
}

export function events(session: Session): Node[] {
  const rows = session.events.slice(-EVENTS_SHOWN).reverse().map((event) =>
    h("li", ["", "warn", "bad"][event.severity] ?? "", h("time", "", clock(Number(event.tick) / 1000)), h("span", "kind", event.kind), h("span", "", event.text)),
  );
  return [h("ol", "events", ...rows)];
}

/** The emergency strip: always there. */
export function strip(session: Session): { text: string; isRaised: boolean } {
  const [raise] = session.standing;
  return raise === undefined ? { text: t("stop.none"), isRaised: false } : { text: t("stop.raised", { who: raise.who, reason: raise.reason }), isRaised: true };
}

export function status(session: Session, age: number): Node[] {
  const { stats } = session;
  const item = (label: Key, value: string, tone = ""): HTMLElement => h("span", `stat ${tone}`, h("span", "muted", t(label)), h("b", "", value));
  const touching = [...session.pairs.values()].filter((pair) => pair.colliding && session.tick - pair.tick <= 300).length;
  const items = [item("status.tick", String(session.tick))];
  if (stats !== undefined) {
    const ms = 1000 * stats.compute_seconds_max;
    items.push(item("status.compute", `${ms.toFixed(2)} ms`, ms > 1 && session.link?.lockstep !== true ? "warn" : ""), item("status.load", `${stats.load_percent.toFixed(0)} %`), item("status.late", String(stats.late_ticks)));
  }
  items.push(item("status.contacts", String(touching)));
  if (age > 0.5 && session.link?.state === "joined" && !session.isOver) items.push(h("span", "stat warn", icon("warn"), t("status.stale", { seconds: age.toFixed(1) })));
  return items;
}
