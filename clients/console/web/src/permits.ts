// Which commands the server refuses now, as far as is known here, so that their buttons say so before they are pressed. As CommandGate and rights.h of the server have it.
import type { Session } from "./session";
import type { Key } from "./strings";

const OF_TRAINEES = ["fulfilled", "signal", "note"];
/** Neither an emergency stop nor a session that waits for people holds them up. */
const IN_ANY_PHASE = ["note", "kick", "guide", "record", "release", "collision", "stop", "clear", "freeze"];

/** Why not, by the first word of a command; `role`: of the seat at this page, empty where there is none. */
export function whyNot(word: string, role: string, session: Pick<Session, "isWaiting" | "standing">): Key | undefined {
  if (role === "trainee" && !OF_TRAINEES.includes(word)) return "refusal.not_permitted";
  if (role === "" || IN_ANY_PHASE.includes(word)) return undefined;
  if (session.isWaiting) return "refusal.waiting";
  return session.standing.length > 0 && word !== "pause" ? "refusal.stopped" : undefined;
}
