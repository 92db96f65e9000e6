// What the page says of itself where it cannot show a session as it is: empty, loading, reconnecting, refused, old, not to be drawn.
import type { Icon } from "./dom";
import { reasonOfLoss } from "./eventtext";
import type { LiveState } from "./live";
import type { Lobby } from "./lobby";
import { strip } from "./panels";
import type { Player } from "./player";
import { whyUnreadable } from "./recording";
import type { SceneView } from "./scene";
import type { Session } from "./session";
import { t, type Key } from "./strings";

export const PROTOCOL = TENON_PROTOCOL;
const COMMAND = "./tenon demo";
/** Why the gateway closes a connection, in its words. */
const CLOSES: [RegExp, Key][] = [
  [/^a newer viewer came: (?<count>\d+) /, "closed.crowded"],
  [/^more than \d+ messages a second/, "closed.messages"],
  [/^a message longer than (?<most>\d+) kB/, "closed.large"],
  [/^more was asked for than was read/, "closed.unread"],
  [/^the session is over/, "closed.over"],
];
const ABSENT = /^(there is no such session|the session is over)/;

/** In this page's language where it has words for it. */
export function reasonOfClose(text: string): string {
  const known = CLOSES.find(([pattern]) => pattern.test(text));
  return known === undefined ? text : t(known[1], known[0].exec(text)?.groups ?? {});
}


/** `opening`: of a recording that is opened: how much is read, or why it cannot be. */
export interface Opening { fraction: number; problem?: unknown }
/** `file`: the name of what is played; `chosen`: the session of the page's address; `only`: what the gateway shows, where that is one session or recording; `age`, `silence`: [s] since the last poses of the session, and since the last message of the gateway. */
export interface Standing {
  isDropping: boolean; opening?: Opening; player?: Player; file: string; lobby?: Lobby; live: LiveState; session: Session; view?: SceneView; chosen: string; only: string; age: number; silence: number;
}
/** The page's address names a session, and its gateway shows another one, or a recording, alone. */
export const isElsewhere = ({ chosen, only }: Pick<Standing, "chosen" | "only">): boolean => chosen !== "" && only !== "" && only !== chosen;

/** `leads`: the words of a link to what the gateway shows by itself. */
export interface Cover { state: string; icon: Icon; head: string; more: string; command?: string; leads?: string; covers: boolean }
/** Nothing of a session or recording is to be seen: there is none yet, or it cannot be had. */
export const isEmpty = (over: Cover | undefined, { session, lobby }: Standing): boolean => over?.covers === true && lobby === undefined && session.objects.size === 0;

/** What covers the scene, if anything does. */
export function coverOf({ isDropping, opening, player, file, lobby, live, session, view, chosen, only }: Standing): Cover | undefined {
  if (isDropping) return { state: "drop", icon: "over", head: t("cover.drop"), more: t("cover.drop.more"), covers: true };
  const problem = opening?.problem ?? player?.problem;
  if (problem !== undefined) return { state: "file", icon: "warn", head: t("cover.file", { name: file }), more: whyUnreadable(problem, file), covers: true };
  if (opening !== undefined) return { state: "reading", icon: "wait", head: t("cover.reading"), more: t("cover.reading.more", { percent: Math.round(100 * opening.fraction) }), covers: true };
  if (isElsewhere({ chosen, only }) && player === undefined)
    return { state: "elsewhere", icon: "warn", head: t("cover.elsewhere", { name: chosen }), more: t("cover.elsewhere.more", { only }), leads: t("cover.elsewhere.show", { only }), covers: true };
  if (lobby !== undefined && live.kind === "open") return undefined;
  const make = (state: string, name: Icon, covers: boolean, values = {}): Cover => {
    const more = `cover.${state}.more` as Key;
    return { state, icon: name, head: t(`cover.${state}` as Key), more: t(more, values), covers };
  };
  const { link: gateway } = session;
  if (player === undefined && live.kind === "reconnecting") {
    const name = session.link?.session || chosen;
    if (name !== "" && ABSENT.test(live.reason))
      return { state: "absent", icon: "wait", head: t("cover.absent", { name }), more: t("cover.absent.more"), leads: t("lobby.all"), covers: session.link === undefined };
    const over = make("reconnecting", "warn", session.link === undefined, { seconds: live.seconds });
    return live.reason === "" ? over : { ...over, more: t("cover.reconnecting.closed", { reason: reasonOfClose(live.reason), seconds: live.seconds }) };
  }
  if (player !== undefined) return view === undefined ? { state: "webgl", icon: "warn", head: t("cover.webgl"), more: t("cover.webgl.more"), covers: true } : undefined;
  if (live.kind === "connecting" || gateway === undefined) return make("connecting", "wait", true);
  if (gateway.protocol !== PROTOCOL) return make("protocol", "warn", true);
  if (gateway.state === "refused") return { state: "refused", icon: "warn", head: t("cover.refused"), more: reasonOfLoss(gateway.reason), covers: true };
  if (gateway.state === "searching" && only !== "") return { state: "searching", icon: "wait", head: t("cover.awaited", { name: only }), more: t("cover.awaited.more"), covers: true };
  if (gateway.state === "searching") return { ...make("searching", "wait", true), command: COMMAND };
  if (gateway.state === "lost") return make("lost", "warn", false);
  return view === undefined ? make("webgl", "warn", true) : undefined;
}

const SILENT = 3; // [s] without poses of a session that runs
const DEAF = 5; // [s] without a message of the gateway, which sends one at least every 2 s

/** The gateway or the server hangs, or the link has broken unnoticed: what is shown may be wrong. */
export function isSilent({ player, lobby, live, session, age, silence }: Standing): boolean {
  if (player !== undefined || live.kind !== "open") return false;
  if (silence > DEAF) return true;
  return lobby === undefined && session.link?.state === "joined" && !session.link.lockstep && !session.isOver && age > SILENT;
}

/** Why nothing that is asked of the session would be answered now. */
export function whyCut({ live, session, silence }: Pick<Standing, "live" | "session" | "silence">): Key | undefined {
  if (live.kind !== "open") return "cut.gateway";
  if (silence > DEAF) return "cut.silent";
  return session.link?.state === "lost" ? "lost.gone" : undefined;
}

/** In lockstep there are no poses while a station is missing; what the server says of the stop is heard all the same. */
const speaksWithoutPoses = ({ link, newestRaise }: Session): boolean => link?.lockstep === true && newestRaise !== undefined;

/** What is shown of the stop is so now: the server says so, or it is the record of a session. */
export function isHeard(standing: Standing): boolean {
  const { opening, player, lobby, live, session } = standing;
  if (opening !== undefined || player !== undefined) return true;
  if (live.kind !== "open" || isSilent(standing)) return false;
  return lobby !== undefined || session.link?.state === "ended" || (session.link?.state === "joined" && (session.hasPoses || session.isWaiting || session.isOver || speaksWithoutPoses(session)));
}

/** What the strip says of the stop; undefined where no session is shown, or none that could be stopped. */
export function stopOf(standing: Standing): { state: "none" | "raised" | "unknown"; icon: Icon; text: string } | undefined {
  const { lobby, live, session } = standing;
  const { text, isRaised } = strip(session);
  if (isHeard(standing)) return lobby !== undefined || session.objects.size === 0 ? undefined : { state: isRaised ? "raised" : "none", icon: isRaised ? "stop" : "done", text };
  const isAbsent = live.kind === "reconnecting" && ABSENT.test(live.reason);
  if (lobby === undefined && ((session.objects.size === 0 && !isRaised) || (isAbsent && session.isOver))) return undefined;
  return { state: "unknown", icon: "warn", text: isRaised ? `${t("stop.unknown")}. ${t("stop.last", { raise: text })}` : t("stop.unknown") };
}

export function linkBadge(standing: Standing): [Key, Icon, string] {
  const { opening, player, lobby, live, session } = standing;
  if (isElsewhere(standing) && player === undefined && opening === undefined) return ["link.elsewhere", "warn", "warn"];
  if (opening !== undefined) return opening.problem === undefined ? ["link.reading", "wait", "info"] : ["link.unreadable", "warn", "bad"];
  if (player !== undefined) return ["link.recorded", "over", "info"];
  if (live.kind === "reconnecting") return ABSENT.test(live.reason) ? ["link.absent", "wait", "info"] : ["link.reconnecting", "warn", "warn"];
  if (isSilent(standing)) return ["link.silent", "warn", "bad"];
  if (lobby !== undefined && live.kind === "open") return ["link.lobby", "live", "good"];
  switch (live.kind === "connecting" ? undefined : session.link?.state) {
    case "joined": return ["link.joined", "live", "good"];
    case "searching": return ["link.searching", "wait", "info"];
    case "refused": return ["link.refused", "warn", "bad"];
    case "lost": return ["link.lost", "warn", "bad"];
    case "ended": return ["link.ended", "over", "info"];
    default: return ["link.connecting", "wait", "info"];
  }
}

