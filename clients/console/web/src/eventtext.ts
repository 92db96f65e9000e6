// Events of the server in the language of this page. The server writes English; what has no rule here stays as it is.
import type { DeskAnswer } from "./live";
import type { EventLog } from "./messages";
import type { Session } from "./session";
import { hasText, language, localized, n, retold, SPEAKERS, t, type Key } from "./strings";

const ROLES = ["admin", "instructor", "trainee", "observer", "recorder"]; // as in the messages
/** The rules of the safety layer by their bits, as devices/safety_rules.cpp names them. */
const SAFETY = [
  "non-finite force request",
  "force fading by age",
  "force request timed out",
  "stiffness limited",
  "soft start",
  "force ramp limited",
  "passivity damping",
  "workspace limit",
  "force limited",
  "thermal limit",
  "motor command saturated",
  "overspeed, braking",
  "force near the clutch limit",
  "clutch open",
  "dead-man switch released",
  "emergency stop",
  "forces off",
  "not armed",
];
/** What a server writes of a stop by itself. */
const STOPS: Record<string, Key> = { "it stood when this server started": "stop.stood", "it stood when the former server was killed": "stop.stood.killed" };

/** Why a stop was raised, or a request refused: a person's words, or one of a page's or of the server's. */
export function reasonTold(text: string): string {
  return STOPS[text] === undefined ? retold(text, "stop.reason", "refusal.stopped", "refusal.too_many") : t(STOPS[text]);
}

/** Texts by what they match. Groups: who and reason as they are; step, title, hand, role and word are translated. */
const RULES: [RegExp, Key][] = [
  [/^(?<who>.+): a hand without input is held still after (?<freeze>\d+) ms and parked after (?<park>\d+) ms; inputs come up to (?<gap>\d+) ms apart, (?<lost>[\d.]+) % are lost$/, "event.link"],
  [/^(?<who>.+): contacts are not felt over this link: (?<delay>\d+) ms one way, (?<most>\d+) ms at most; guidance continues$/, "event.link.far"],
  [/^(?<who>.+): contacts are felt again: (?<delay>\d+) ms one way$/, "event.link.near"],
  [/^waiting for people$/, "event.waiting"],
  [/^waiting for people: (?<missing>.+)$/, "event.waiting.for"],
  [/^running$/, "event.running"],
  [/^paused$/, "event.paused"],
  [/^stopped$/, "event.stopped"],
  [/^emergency stop$/, "event.emergency"],
  [/^forces frozen$/, "event.frozen"],
  [/^everything is mounted$/, "event.mounted"],
  [/^ended, (?<count>\d+) steps? skipped$/, "event.ended"],
  [/^ended, (?<count>\d+) steps? skipped, (?<late>\d+) steps? not done in time$/, "event.ended.both"],
  [/^ended, (?<late>\d+) steps? not done in time$/, "event.ended.late"],
  [/^step '(?<step>[^']+)' was not done in time(?:: (?<reason>.+))?$/, "event.failed"],
  [/^(?<step>\w+) \((?<seconds>[\d.]+) s\)$/, "event.step.time"],
  [/^(?<title>.+) \((?<hand>\w+) hand\)$/, "event.by.hand"],
  [/^hand '(?<hand>[^']+)' is absent: the object it held is parked$/, "event.hand.gone"],
  [/^hand '(?<hand>[^']+)' is held still \(last input (?<ms>\d+) ms ago\)$/, "event.hand.frozen"],
  [/^hand '(?<hand>[^']+)' moves again$/, "event.hand.free"],
  [/^(?<who>.+) \((?<role>\w+)\) has joined$/, "event.joined"],
  [/^(?<who>.+) \((?<role>\w+)\) has rejoined$/, "event.rejoined"],
  [/^(?<who>.+) \((?<role>\w+)\) has left$/, "event.left"],
  [/^(?<who>.+) \((?<role>\w+)\) was removed by (?<by>.+)$/, "event.removed"],
  [/^(?<who>.+) \((?<role>\w+)\) had left, was removed by (?<by>.+), and may not come back$/, "event.removed.away"],
  [/^(?<who>.+) may not join: you were removed from this session/, "event.join.removed"],
  [/^(?<who>.+) may not join: (?<reason>.+)$/, "event.join.refused"],
  [/^(?<who>.+?): (?<word>\w+)(?: .*)? \(an emergency stop came before its tick\)$/, "event.dropped.stop"],
  [/^(?<who>.+?): (?<word>\w+)(?: .*)? \(the run has ended before its tick\)$/, "event.dropped.end"],
  [/^engaged by (?<who>.+?): (?<reason>.*)$/, "event.engaged"],
  [/^an emergency stop raised before this server's start still stands: engaged by (?<who>.+?): (?<reason>.*)$/, "event.stands"],
  [/^cleared by (?<who>.+?): (?<reason>.*?)(?:; )?the session is paused until 'resume'$/, "event.cleared"],
  [/^hand '(?<hand>[^']+)' is guided no more: (?<reason>.+)$/, "event.guidance.ended"],
  [/^hand (?<hand>\w+): safety: (?<rule>.+) \((?<force>[\d.]+) N requested.*\), step \d+$/, "event.safety"],
  [/^hand (?<hand>\w+): safety: (?<rule>.+) ended, active for (?<seconds>[\d.]+) s, step \d+$/, "event.safety.ended"],
  [/^(?<who>.+?): '(?<word>\w+)': (?<reason>.+)$/, "event.refused"],
  [/^(?<count>\d+) ticks? (?:is|are) missing in the journal: (?<cause>.+)$/, "event.journal"],
  [/^(?<count>\d+) more ticks? (?:is|are) missing in the journal, (?<all>\d+) in all: (?<cause>.+)$/, "event.journal.more"],
];

/** What moves a hand; `radius` [m]: what it reaches about the centre of its workspace. */
export interface Device { model: string; radius: number }

/** What a station says of a hand's device, as describe() of clients/haptic/station.cpp does. */
export function deviceOf(text: string): { hand: string; device: Device } | undefined {
  const { hand, model, radius } = /^hand (?<hand>\w+): (?<model>.+), workspace radius (?<radius>[\d.]+) m$/.exec(text)?.groups ?? {};
  return hand === undefined ? undefined : { hand, device: { model, radius: Number(radius) } };
}

/** The model of a device in this page's words. */
export function modelOf({ model }: Device): string {
  return model === "remote hand" ? t("device.remote") : model.replace("(simulated)", t("device.simulated"));
}

/** What the safety layer of a hand does now, in words. */
export function interventions(flags: number): string {
  return SAFETY.map((_, bit) => bit).filter((bit) => (flags & (1 << bit)) !== 0).map((bit) => t(`safety.${bit}` as Key)).join(", ");
}

/** A text of the server with the titles of objects and steps instead of their names. */
export function readable(session: Session, text: string): string {
  const titles = new Map([...session.objects.values()].map((object) => [object.name, session.titleOf(object.object_id)]));
  for (const step of session.sceneSteps.values()) titles.set(step.name, localized(step.title) || step.name.replace(/_/g, " "));
  return text.replace(/\w+/g, (word) => titles.get(word) ?? word);
}

/** How the server names a condition of a step, as describe() of server/game_control/step_messages.cpp does; its text; the unit of its value. */
const CONDITIONS: [RegExp, Key, string?][] = [
  [/^pose of (?<a>.+)$/, "condition.pose"],
  [/^force on (?<a>.+)$/, "condition.force", "N"],
  [/^contact (?<a>\w+)-(?<b>\w+)$/, "condition.pair", "s"],
  [/^contact of (?<a>.+)$/, "condition.contact", "s"],
  [/^signal (?<a>.+)$/, "condition.signal"],
  [/^command fulfilled(?<a>)$/, "condition.fulfilled"],
  [/^all(?<a>)$/, "condition.all"],
  [/^any(?<a>)$/, "condition.any"],
];

export function conditionOf(session: Session, text: string): { label: string; unit: string } {
  for (const [pattern, key, unit] of CONDITIONS) {
    const groups = pattern.exec(text)?.groups;
    if (groups !== undefined) return { label: t(key, { a: readable(session, groups["a"]), b: readable(session, groups["b"] ?? "") }), unit: unit ?? "" };
  }
  return { label: readable(session, text), unit: "" };
}

/** What a word of `tenon command` is called here. */
function command(word: string): string {
  const key = `event.command.${word}`;
  return hasText(key) ? t(key) : word;
}

/** Hands and roles by their names, as the server lists those that it waits for. */
export function missingOf(session: Session, names: string): string {
  const wordOf = (name: string): string => {
    const hand = [...session.sceneHands.values()].find((known) => known.name === name);
    if (hand !== undefined) return session.placeOfHand(hand.hand_id);
    return ROLES.includes(name) ? t(`role.${ROLES.indexOf(name)}` as Key) : name;
  };
  return [...new Set(names.split(", ").map(wordOf))].join(", ");
}

function value(session: Session, name: string, text: string): string {
  switch (name) {
    case "step": return readable(session, text);
    case "title": return session.retitled(text);
    case "hand": {
      const hand = [...session.sceneHands.values()].find((known) => known.name === text);
      return hand === undefined ? text : session.nameOfHand(hand.hand_id);
    }
    case "role": return ROLES.includes(text) ? t(`role.${ROLES.indexOf(text)}` as Key) : text;
    case "word": return command(text);
    case "who": case "by": return retold(text, ...SPEAKERS);
    case "seconds": case "ms": case "force": case "lost": return n(Number(text), /\.(\d+)/.exec(text)?.[1].length ?? 0);
    case "reason": return reasonTold(text);
    case "cause": return retold(text, "journal.slow", "journal.recorder");
    case "missing": return missingOf(session, text);
    case "rule": return SAFETY.includes(text) ? t(`safety.${SAFETY.indexOf(text)}` as Key) : text;
    default: return text;
  }
}

export function kindOf(event: Pick<EventLog, "kind">): string {
  const key = `event.kind.${event.kind.replace(/ /g, "_")}`;
  return hasText(key) ? t(key) : event.kind;
}

export function textOf(session: Session, event: Pick<EventLog, "kind" | "text">): string {
  if (event.kind === "note") return event.text;
  if (event.kind === "mounted" || event.kind === "put in place") return session.retitled(event.text);
  if (event.kind === "command") {
    const [, who, word, rest] = /^(.+?): (\w+) ?(.*)$/.exec(event.text) ?? [];
    return word === undefined ? event.text : `${retold(who, ...SPEAKERS)}: ${command(word)} ${readable(session, rest).replace(/\b(on|off)$/, (state) => t(`event.${state as "on" | "off"}`))}`.trim();
  }
  for (const [pattern, key] of RULES) {
    const groups = pattern.exec(event.text)?.groups;
    if (groups === undefined && !pattern.test(event.text)) continue;
    const values = Object.fromEntries(Object.entries(groups ?? {}).map(([name, text]) => [name, text === undefined ? "" : value(session, name, text)]));
    if (key === "event.by.hand" && values["title"] === values["hand"]) return values["hand"]; // its own object
    const twice = values["who"] !== undefined && values["who"] === values["role"] ? ` (${values["role"]})` : ""; // who has no name is called by the role
    return t(key, values).replace(twice, "").replace(/[:;,.] *$/, "").trim();
  }
  return (event.kind.startsWith("step") ? readable(session, event.text) : event.text).replace(/(?<!\.)\.$/, "");
}

/** Texts of the gateway and of the server, of a seat that is no more. */
const LOSSES: [RegExp, Key][] = [
  [/ was removed by (?<by>[^;]+)/, "lost.removed"],
  [/^you were removed from this session/, "lost.removed.somebody"],
  [/ is gone(?:;|$)/, "lost.gone"],
  [/: has left$|has been silent for |join first$/, "lost.expired"],
  [/^nothing was heard of this page/, "lost.page"],
];

/** Somebody who leads has removed the person, who is not to come back by himself. */
export function isRemoval(text: string): boolean {
  return LOSSES.find(([pattern]) => pattern.test(text))?.[1].startsWith("lost.removed") === true;
}

/** Why a seat was lost, in this page's language where it has words for it. */
export function reasonOfLoss(text: string): string {
  const known = LOSSES.find(([pattern]) => pattern.test(text));
  if (known === undefined) return text.replace(/\.$/, "");
  return t(known[1], { by: retold(known[0].exec(text)?.groups?.["by"] ?? "", ...SPEAKERS) });
}

/** Why a recorder writes no more, as idl/record/mcap_writer.cpp says it; causes by the words of the C library. */
const RECORDER: [RegExp, Key][] = [
  [/^(?<file>.+): cannot write \((?<cause>.+)\)$/, "recorder.write"],
  [/^(?<file>.+): cannot be closed \((?<cause>.+)\)$/, "recorder.close"],
];
const CAUSES: Record<string, Key> = {
  "No space left on device": "cause.space", "Disk quota exceeded": "cause.quota", "File too large": "cause.large", "Input/output error": "cause.disk", "Read-only file system": "cause.readonly",
};

export function problemOfRecorder(text: string): string {
  const known = RECORDER.find(([pattern]) => pattern.test(text));
  if (known === undefined) return text;
  const { file = "", cause = "" } = known[0].exec(text)?.groups ?? {};
  return t(known[1], { file, cause: CAUSES[cause] === undefined ? cause : t(CAUSES[cause]) });
}

/** Answers of the gateway without a code, each of which its text here replaces: who sits at a browser reaches no file of the server. */
const ANSWERS: [RegExp, Key][] = [
  [/^the role (?<role>\w+) needs the key of the session: /, "refusal.needs_key"],
  [/^this gateway was not started with --role (?<role>\w+)$/, "refusal.other_role"],
  [/^there is no session yet$/, "refusal.record_none"],
  [/^the key is not the one of this session/, "refusal.wrong_key"],
  [/^hand '(?<hand>[^']+)' is already moved by somebody else$/, "refusal.hand_taken"],
  [/^hand '(?<hand>[^']+)' belongs to the /, "refusal.hand_of"],
  [/^the session has no such hand$/, "refusal.no_hand"],
  [/^all (?:\d+ places|seats) of this gateway are taken$/, "refusal.full"],
];

function answerOf(text: string): string {
  const known = ANSWERS.find(([pattern]) => pattern.test(text));
  if (known === undefined) return reasonOfLoss(text);
  const { role = "", hand = "" } = known[0].exec(text)?.groups ?? {};
  const title = `role.name.${role}`;
  return t(known[1], { role, hand, title: hasText(title) ? t(title) : role });
}

/** What the gateway or the server answers, in this page's language where it has words for it. In English the server says more: it names what is missing. */
export function reasonOf(answer: DeskAnswer): string {
  const key = `refusal.${answer.code}` as Key;
  if (answer.accepted || answer.code === undefined || !hasText(key)) return answer.accepted ? answer.text : answerOf(answer.text);
  return language === "en" && answer.text !== "" ? answer.text : t(key, { reason: answer.text }).replace(/: *$/, "");
}
