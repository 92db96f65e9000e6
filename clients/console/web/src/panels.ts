// What stands around the scene: instruction, steps, people, events, status. Each part is made anew from the session when it changed.
import { Vector3 } from "three";

import { forbid, h, icon, type Icon } from "./dom";
import { conditionOf, interventions, kindOf, missingOf, modelOf, problemOfRecorder, reasonTold, textOf } from "./eventtext";
import type { Label } from "./labels";
import { NONE, Role, RunPhase, StepPhase, type EventLog } from "./messages";
import type { Session, StepEntry } from "./session";
import { clock, localized, n, retold, significant, SPEAKERS, t, type Key } from "./strings";

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
const SINGLE = 0; // ConditionGroup of the messages: no group
const EVENTS_SHOWN = 40;

/** Colour, icon and word. */
function badge([key, name, tone]: [Key, Icon, string]): HTMLElement {
  return h("span", `badge ${tone}`, icon(name), t(key));
}

/** A name as people read it. */
export function titleOfStep(step: { name: string; title: StepEntry["title"] }): string {
  return localized(step.title) || step.name.replace(/_/g, " ");
}

export function phase({ run, isOver, isWaiting, isStopped, isRaised }: Session): HTMLElement | undefined {
  if (isRaised && !isOver) return badge([isStopped ? "run.emergency" : "run.raised", "stop", "bad"]);
  if (isWaiting) return badge(RUN[RunPhase.Waiting]);
  if (run?.forces_frozen === true && run.phase === RunPhase.Running && !isOver) return badge(["run.frozen", "frozen", "warn"]);
  // as endOf() of server/session/event_generator.cpp: such a run has not failed, but not everything is mounted
  if (run?.phase === RunPhase.Succeeded && (run.steps_skipped ?? 0) + (run.steps_timed_out ?? 0) > 0) return badge(["run.ended", "over", "warn"]);
  return run === undefined ? undefined : badge(RUN[run.phase]);
}

/** Why the run is as it is, in this page's words. */
export function reasonOfEnd(session: Session): string {
  return session.run === undefined ? "" : textOf(session, { kind: "run", text: session.run.reason });
}

/** For whom it waits, where the server says so: while a stop stands it does not. */
export function waitsFor(session: Session): string {
  const names = /^waiting for people: (.+)$/.exec(session.run?.reason ?? "")?.[1];
  return names === undefined ? t("run.waiting.more") : t("run.waiting.for", { missing: missingOf(session, names) });
}

const SOON = 0.2; // of a step's time limit, when it is nearly over

/** What is left of the time of the step that runs; undefined where it has no limit. */
export function timeLeft(session: Session): { text: string; isSoon: boolean } | undefined {
  const limit = session.step?.timeout ?? 0;
  const seconds = session.steps.find(({ isNow }) => isNow)?.seconds;
  if (limit <= 0 || seconds === undefined) return undefined;
  const left = Math.max(0, limit - seconds);
  return { text: t("step.left", { left: clock(Math.ceil(left)), limit: clock(limit) }), isSoon: left <= SOON * limit };
}

export function instruction(session: Session): Node[] {
  const { step, run } = session;
  const badges = [phase(session)].filter((one) => one !== undefined);
  if (session.isOver && run !== undefined) return [h("div", "card-head", ...badges), h("p", "instruction", reasonOfEnd(session))];
  if (session.isWaiting) return [h("div", "card-head", ...badges), h("h1", "step-title", session.title), h("p", "instruction", waitsFor(session))];
  if (step === undefined) return [h("div", "card-head", ...badges), h("p", "instruction muted", t("step.none"))];
  const count = h("span", "muted", t("step.count", { step: step.step + 1, steps: step.steps }));
  const head = h("div", "card-head", count, h("span", "part", session.retitled(step.part)), ...badges);
  const time = timeLeft(session);
  const limit = time === undefined ? [] : [h("p", time.isSoon ? "limit soon" : "limit", icon(time.isSoon ? "warn" : "wait"), time.text)];
  return [head, h("h1", "step-title", localized(step.title) || step.name), h("p", "instruction", localized(step.instruction)), ...limit, ...conditions(session)];
}

function meter(label: string, text: string, fraction: number, isMet: boolean): HTMLElement {
  const bar = h("i", isMet ? "good" : "");
  bar.style.width = `${Math.round(100 * Math.min(1, Math.max(0.02, fraction)))}%`;
  return h("li", isMet ? "met" : "", icon(isMet ? "done" : "wait"), h("span", "", label), h("output", "", text), h("div", "bar", bar));
}

/** A row of the condition tree below `depth` groups. */
function nested(depth: number, row: HTMLElement): HTMLElement {
  row.style.setProperty("--depth", String(depth));
  return row;
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
      meter(t("condition.position"), `${n(mm, mm < 10 ? 1 : 0)} / ${n(limits[0], 0)} mm`, limits[0] / Math.max(mm, 1e-9), mm <= limits[0]),
      meter(t("condition.angle"), `${n(degrees, degrees < 10 ? 1 : 0)} / ${n(limits[1], 0)}°`, limits[1] / Math.max(degrees, 1e-9), degrees <= limits[1]),
    );
  }
  for (const { text, value, limit, group, met, depth } of progress.conditions) {
    if (step.has_target && depth === 0 && text.startsWith("pose of")) continue; // the two rows above
    const { label, unit } = conditionOf(session, text);
    if (group !== SINGLE) {
      rows.push(nested(depth, h("li", met ? "group met" : "group", icon(met ? "done" : "wait"), h("span", "", label), h("output", "", `${value} / ${limit}`))));
      continue;
    }
    // not evaluated yet, as under a stop: its limit is not told
    const reading = limit === 0 && !met ? "" : unit === "" ? `${significant(value)} / ${significant(limit)}` : `${n(value, 1)} / ${n(limit, 1)} ${unit}`;
    rows.push(nested(depth, meter(label, reading, limit === 0 ? (met ? 1 : 0) : value / limit, met)));
  }
  const more = progress.nodes - progress.conditions.length;
  if (more > 0) rows.push(h("li", "", icon("wait"), h("span", "", t("condition.more", { count: more }))));
  return rows.length === 0 ? [] : [h("ul", "conditions", ...rows)];
}

/** `leads`: each can be gone to. */
export function steps(session: Session, leads: boolean): Node[] {
  const list = session.steps;
  if (list.length === 0) return [h("p", "muted", t("step.none"))];
  let part = "";
  const rows: HTMLElement[] = [];
  for (const entry of list) {
    if (entry.part !== part && entry.part !== "") rows.push(h("li", "group", session.retitled(entry.part)));
    part = entry.part;
    const time = entry.seconds === undefined ? "" : `${n(entry.seconds, 1)} s`;
    const state = entry.phase === undefined ? h("span", "badge muted", t("step.ahead")) : badge(STEP[entry.phase]);
    const row = h("li", entry.isNow ? "now" : entry.phase === undefined ? "ahead" : "", state, h(leads ? "button" : "span", "name", titleOfStep(entry)), h("time", "", time));
    row.dataset["step"] = row.dataset["key"] = entry.name;
    if (entry.isNow) row.setAttribute("aria-current", "step");
    rows.push(row);
  }
  return [h("ol", "steps", ...rows)];
}

const QUIET = { age: 0.02, lost: 0.1, freeze: 50 }; // [s], [%], [ms] up to which a link is not worth a line

/** What the link of a station does now: age of the displayed force, its jitter, losses, and how well the clocks are known; whether it is worth a line. */
function linkOf(session: Session, client: number): { text: string; isQuiet: boolean } {
  const link = session.telemetry.get(client);
  if (link === undefined || link.samples === 0n) return { text: "", isQuiet: true };
  const ms = (seconds: number) => n(1000 * seconds, seconds < 0.01 ? 1 : 0);
  const lost = 100 * Math.max(link.inputs_lost, link.answers_lost);
  const now = t("link", { age: ms(link.age), jitter: ms(link.jitter), lost: n(lost, 1) });
  const hands = Array.from(session.people.get(client)?.hands ?? []);
  const freeze = Math.max(0, ...hands.map((hand) => session.sceneHands.get(hand)?.freeze_ticks ?? 0));
  const far = hands.some((hand) => session.sceneHands.get(hand)?.guidance_alone === true) ? `${t("link.far")}; ` : "";
  const text = far + (freeze === 0 ? now : `${now}, ${t("link.freeze", { freeze })}`);
  const isQuiet = far === "" && link.age < QUIET.age && lost < QUIET.lost && freeze <= QUIET.freeze;
  return { text: link.clock_known ? `${text}, ${t("link.trip", { trip: ms(link.round_trip), error: ms(link.clock_error) })}` : text, isQuiet };
}

/** The hands that somebody moves, each with its device, and the age of their contacts [ms]. */
function devicesOf(session: Session, hands: number[]): string {
  const names = hands.filter((hand) => hand !== NONE && !session.isTracked(hand)).map((hand) => {
    const device = session.deviceOf(hand);
    return device === undefined ? session.nameOfHand(hand) : `${session.nameOfHand(hand)}: ${modelOf(device)}`;
  });
  const ages = hands.flatMap((hand) => session.hands.get(hand)?.manifold_age ?? []).filter((age) => age !== NONE);
  return [...names, ...(ages.length === 0 ? [] : [`${Math.max(...ages)} ms`])].join(", ");
}

/** Who holds what, at the places of the hands. */
export function holders(session: Session): Label[] {
  return [...session.hands].flatMap(([id, { X_WH }]): Label[] => {
    const holds = [...session.grabs.values()].some(({ hand_id, object_id }) => hand_id === id && !session.isOwn(object_id) && session.holderOf(object_id) === id);
    const person = [...session.people.values()].find(({ alive, hands }) => alive && Array.from(hands).includes(id));
    if (!holds || person === undefined || session.isTracked(id)) return [];
    return [{ place: new Vector3(X_WH.p[0], X_WH.p[1], X_WH.p[2]), text: `${retold(person.name, ...SPEAKERS)} · ${session.nameOfHand(id)}` }];
  });
}

/** `self`: the client that this page is, as a seat. What the person at this page may do with people: remove them, and take what they hold into the hand of this name, or why not now. */
export interface Lead { leads: boolean; hand?: string; whyNoTaking?: string; self?: number }

export function people(session: Session, { leads, hand, whyNoTaking, self }: Lead): Node[] {
  const here = [...session.people.values()].filter((person) => person.alive).sort((a, b) => a.client_id - b.client_id);
  if (here.length === 0) return [h("p", "muted", t("people.none"))];
  const rows = here.map((person) => {
    const hands = Array.from(person.hands);
    const held = [...session.grabs.values()].filter((grab) => grab.hand_id !== NONE && hands.includes(grab.hand_id) && !session.isOwn(grab.object_id));
    const what = held.map((grab) => session.titleOf(grab.object_id)).join(", ");
    const devices = devicesOf(session, hands);
    const [name, role] = [retold(person.name, ...SPEAKERS), t(`role.${person.role}` as Key)];
    const head = h("div", "", h("span", "name", name), h("span", "muted", name === role ? "" : role), h("span", "holds", what === "" ? "" : t("holds", { what })));
    const link = linkOf(session, person.client_id);
    const actions: HTMLElement[] = [];
    const act = (name: string, value: string, label: string, more: string, text = label, why = ""): void => {
      const button = h("button", "", text);
      if (why !== "") forbid(button, why);
      button.dataset[name] = value;
      button.dataset["key"] = `${name} ${value}`;
      button.setAttribute("aria-label", `${label}: ${more}`);
      actions.push(button);
    };
    const isOwn = hand !== undefined && hands.some((id) => session.sceneHands.get(id)?.name === hand);
    if (leads && hand !== undefined && !isOwn)
      for (const { object_id } of held) act("takeOver", session.objects.get(object_id)?.name ?? "", t("desk.takeover"), t("desk.takeover.more", { what: session.titleOf(object_id) }), undefined, whyNoTaking);
    const guided = hands.filter((id) => session.isGuided(id));
    if (leads && person.role === Role.Trainee) {
      const own = hands.filter((one) => session.sceneHands.has(one) && !session.isTracked(one));
      for (const id of own) {
        const [name, what] = [session.sceneHands.get(id)?.name ?? "", session.nameOfHand(id)];
        for (const kind of ["show", "together", "off"] as const)
          act("guide", `${kind} ${name}`, t(`guide.${kind}`), t(`guide.${kind}.more`, { what }), own.length > 1 ? `${t(`guide.${kind}`)}: ${what}` : undefined);
      }
    }
    const limited = hands.map((id) => interventions(session.hands.get(id)?.safety_flags ?? 0)).find((text) => text !== "") ?? "";
    const guidance = guided.length === 0 ? "" : t("guide.acts", { what: guided.map((id) => session.nameOfHand(id)).join(", ") });
    // the gateway of the console is an observer
    if (leads && person.role !== Role.Observer && person.client_id !== self) act("kick", String(person.client_id), t("desk.kick"), `${t("desk.kick")}: ${person.name}`);
    head.title = link.text; // all of it, of a link that is not worth a line
    const details = [devices, link.isQuiet ? "" : link.text, guidance].filter((text) => text !== "").map((text) => h("small", "muted", text));
    if (limited !== "") details.push(h("small", "warn", limited));
    const row = h("li", "", icon("person"), head, ...details, ...(actions.length === 0 ? [] : [h("div", "row", ...actions)]));
    row.dataset["key"] = String(person.client_id);
    return row;
  });
  return [h("ul", "people", ...rows)];
}

/** Without "hand free", which only ends what "hand frozen" says, and with repetitions in one row. `leads`: each can be gone to. */
export function events(session: Session, leads: boolean): Node[] {
  const told: { event: EventLog; first: EventLog; times: number }[] = [];
  for (const event of session.events) {
    const before = told[told.length - 1];
    if (event.kind === "hand free") continue;
    if (before?.event.kind === event.kind && ["hand frozen", "safety"].includes(event.kind)) Object.assign(before, { event, times: before.times + 1 });
    else told.push({ event, first: event, times: 1 });
  }
  const rows = told.slice(-EVENTS_SHOWN).reverse().map(({ event, first, times }) => {
    const text = textOf(session, event);
    const kind = h("span", "kind", kindOf(event));
    const row = h("li", ["", "warn", "bad"][event.severity] ?? "", h("time", "", clock(Number(event.tick) / 1000)), kind, h(leads ? "button" : "span", "text", times > 1 ? `${text} (×${times})` : text));
    row.dataset["tick"] = String(event.tick);
    row.dataset["key"] = `${first.tick} ${first.kind} ${first.text}`;
    return row;
  });
  return [h("ol", "events", ...rows)];
}

/** The emergency strip: always there. */
export function strip(session: Session): { text: string; isRaised: boolean } {
  const { raise } = session;
  return raise === undefined ? { text: t("stop.none"), isRaised: false } : { text: t("stop.raised", { who: retold(raise.who, ...SPEAKERS), reason: reasonTold(raise.reason) }), isRaised: true };
}

export function status(session: Session, age: number): Node[] {
  const { stats } = session;
  const item = (label: Key, value: string, tone = ""): HTMLElement => h("span", `stat ${tone}`, h("span", "muted", t(label)), h("b", "", value));
  const touching = [...session.pairs.values()].filter((pair) => pair.colliding && session.tick - pair.tick <= 300).length;
  const items = [item("status.tick", String(session.tick))];
  if (stats !== undefined) {
    const ms = 1000 * stats.compute_seconds_max;
    items.push(item("status.compute", `${n(ms, 2)} ms`, ms > 1 && session.link?.lockstep !== true ? "warn" : ""), item("status.load", `${n(stats.load_percent, 0)} %`), item("status.late", String(stats.late_ticks)));
    // in lockstep ticks wait, so slow writes delay nothing that is missed
    const slow = session.link?.lockstep === true ? 0n : stats.slow_writes;
    if (slow + stats.unsent_samples > 0n) items.push(item("status.writes", `${stats.slow_writes} / ${stats.unsent_samples}`, stats.unsent_samples > 0n ? "warn" : ""));
  }
  items.push(item("status.contacts", String(touching)));
  const { recorder } = session;
  if (recorder !== undefined) {
    const text = recorder.recording ? t("recorder.on", { count: String(recorder.messages) }) : problemOfRecorder(recorder.problem) || t("recorder.off");
    items.push(h("span", `stat ${recorder.problem === "" ? "" : "bad"}`, icon(recorder.recording ? "live" : "over"), text));
  }
  if (age > 0.5 && session.link?.state === "joined" && !session.isOver) items.push(h("span", "stat warn", icon("warn"), t("status.stale", { seconds: n(age, 1) })));
  return items;
}
