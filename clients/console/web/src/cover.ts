// What the page says of itself where it cannot show a session as it is: empty, loading, reconnecting, refused, old, not to be drawn.
import type { Icon } from "./dom";
import type { LiveState } from "./live";
import type { Lobby } from "./lobby";
import type { Player } from "./player";
import type { SceneView } from "./scene";
import type { Session } from "./session";
import { t, type Key } from "./strings";

export const PROTOCOL = TENON_PROTOCOL;
const COMMAND = "./tenon demo";
/** Why the gateway closes a connection, in its words. */
const CLOSES: [RegExp, Key][] = [
  [/^a newer viewer came: (?<count>\d+) /, "closed.crowded"],
  [/^more than \d+ messages a second/, "closed.messages"],
  [/^more was asked for than was read/, "closed.unread"],
  [/^the session is over/, "closed.over"],
];

/** In this page's language where it has words for it. */
export function reasonOfClose(text: string): string {
  const known = CLOSES.find(([pattern]) => pattern.test(text));
  return known === undefined ? text : t(known[1], known[0].exec(text)?.groups ?? {});
}


/** `opening`: of a recording that is opened: how much is read, or why it cannot be. */
export interface Opening { fraction: number; problem?: string }
export interface Standing { isDropping: boolean; opening?: Opening; player?: Player; lobby?: Lobby; live: LiveState; session: Session; view?: SceneView; age: number }

export interface Cover { state: string; icon: Icon; head: string; more: string; command?: string; covers: boolean }
/** Nothing of a session or recording is to be seen: there is none yet, or it cannot be had. */
export const isEmpty = (over: Cover | undefined, { session, lobby }: Standing): boolean => over?.covers === true && lobby === undefined && session.objects.size === 0;

/** What covers the scene, if anything does. */
export function coverOf({ isDropping, opening, player, lobby, live, session, view }: Standing): Cover | undefined {
  if (isDropping) return { state: "drop", icon: "over", head: t("cover.drop"), more: t("cover.drop.more"), covers: true };
  const problem = opening?.problem ?? player?.problem;
  if (problem !== undefined) return { state: "file", icon: "warn", head: t("cover.file"), more: problem, covers: true };
  if (opening !== undefined) return { state: "reading", icon: "wait", head: t("cover.reading"), more: t("cover.reading.more", { percent: Math.round(100 * opening.fraction) }), covers: true };
  if (lobby !== undefined && live.kind === "open") return undefined;
  const make = (state: string, name: Icon, covers: boolean, values = {}): Cover => {
    const more = `cover.${state}.more` as Key;
    return { state, icon: name, head: t(`cover.${state}` as Key), more: t(more, values), covers };
  };
  const { link: gateway } = session;
  if (player === undefined && live.kind === "reconnecting") {
    const over = make("reconnecting", "warn", session.link === undefined, { seconds: live.seconds });
    return live.reason === "" ? over : { ...over, more: t("cover.reconnecting.closed", { reason: reasonOfClose(live.reason), seconds: live.seconds }) };
  }
  if (player !== undefined) return view === undefined ? { state: "webgl", icon: "warn", head: t("cover.webgl"), more: t("cover.webgl.more"), covers: true } : undefined;
  if (live.kind === "connecting" || gateway === undefined) return make("connecting", "wait", true);
  if (gateway.protocol !== PROTOCOL) return make("protocol", "warn", true);
  if (gateway.state === "refused") return { state: "refused", icon: "warn", head: t("cover.refused"), more: gateway.reason, covers: true };
  if (gateway.state === "searching") return { ...make("searching", "wait", true), command: COMMAND };
  if (gateway.state === "lost") return make("lost", "warn", false);
  return view === undefined ? make("webgl", "warn", true) : undefined;
}

const SILENT = 3; // s without a message of a session that goes on

/** The gateway is connected and hangs, or the link to it has broken unnoticed: what is shown may be wrong. */
export const isSilent = ({ player, lobby, live, session, age }: Standing): boolean =>
  player === undefined && lobby === undefined && live.kind === "open" && session.link?.state === "joined" && !session.link.lockstep && !session.isOver && age > SILENT;

export function linkBadge(standing: Standing): [Key, Icon, string] {
  const { opening, player, lobby, live, session } = standing;
  if (opening !== undefined) return opening.problem === undefined ? ["link.reading", "wait", "info"] : ["link.unreadable", "warn", "bad"];
  if (player !== undefined) return ["link.recorded", "over", "info"];
  if (live.kind === "reconnecting") return ["link.reconnecting", "warn", "warn"];
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

