// Which commands the server refuses now, as it says itself, so that their buttons say so before they are pressed.
import type { Session } from "./session";
import type { Key } from "./strings";

/** The words of the commands that a role may give, with the bit of each in RunState.open_commands; null: the gateway carries it out, in any state. */
export type Permitted = Readonly<Record<string, number | null>>;

/** Why not, by the first word of a command; `permitted`: to the seat at this page, undefined where there is none. */
export function whyNot(word: string, permitted: Permitted | undefined, { run, isOver, isWaiting }: Pick<Session, "run" | "isOver" | "isWaiting">): Key | undefined {
  if (permitted === undefined) return undefined;
  const bit = permitted[word];
  if (bit === undefined) return "refusal.not_permitted";
  if (bit === null || run === undefined || ((run.open_commands ?? ~0) >>> bit & 1) === 1) return undefined;
  if (isOver) return "refusal.over";
  if (isWaiting) return "refusal.waiting";
  return run.emergency_stop === true ? "refusal.stopped" : "refusal.already";
}
