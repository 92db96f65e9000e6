// Presses of the emergency stop until they are answered: a stop of which nothing is heard may have stopped nothing.
import type { DeskAnswer } from "./live";

const PATIENCE = 1000; // [ms] for an answer, and for the clear that may follow a raise
/**
 * [ms] after a press in which it is sent again by itself. Longer than a gateway needs to start again and a page to find it; shorter than somebody needs to
 * look what was wrong and clear the stop: what is sent later would stop what others have begun anew.
 */
const REPEATED = 10000;

type Reached = "nobody" | "devices" | "some sessions";
/** By the code of the gateway's answer. */
const REACHED: Record<string, Reached> = { stop_devices: "devices", stop_partly: "some sessions" };

export class Presses {
  /** The stop was pressed, and whether it has taken effect is not known. */
  isUnconfirmed = false;
  /** Moreover the session is there again, and the stop is not sent again. */
  isMissed = false;
  /** Who obeys it nevertheless. */
  reached: Reached = "nobody";
  private sent = 0;
  private confirmed = 0; // the newest that was
  private unanswered = 0;
  private pressed = 0; // [ms] of the computer's clock, which runs while the computer sleeps
  private session = ""; // in which it was pressed
  private hearing = 0;

  /** `send` answers undefined when nothing could be sent, or the connection is lost. */
  constructor(private send: () => Promise<DeskAnswer | undefined>, private onChange: () => void) {}

  press(session: string): Promise<DeskAnswer | undefined> {
    this.pressed = Date.now();
    this.session = session;
    return this.attempt();
  }

  /** The person has understood, a stop stands, or nothing of it is shown any more. */
  forget(): void {
    clearTimeout(this.hearing);
    this.confirmed = this.sent;
    this.show(false);
  }

  /** There is a connection to this session again. Sends a stop of which nothing is known again, for it is safe to repeat; undefined: there is none to be sent. */
  rejoin(session: string): Promise<DeskAnswer | undefined> | undefined {
    if (this.confirmed === this.sent) return undefined;
    const age = Date.now() - this.pressed;
    if (session === this.session && age >= 0 && age < REPEATED) return this.attempt();
    this.show(true, true);
    return undefined;
  }

  /**
   * A raise or a clear has come: a stop that stands then, whoever raised it, has done what the press was for. After a loss all come again, a raise perhaps
   * before its clear; and one of this page that is not answered yet may have reached the gateway alone.
   */
  hear(stands: () => boolean): void {
    clearTimeout(this.hearing);
    if (this.confirmed !== this.sent) this.hearing = setTimeout(() => this.unanswered === 0 && stands() && this.forget(), PATIENCE);
  }

  private async attempt(): Promise<DeskAnswer | undefined> {
    const mine = ++this.sent;
    ++this.unanswered;
    const timer = setTimeout(() => this.judge(mine, false), PATIENCE);
    const answer = await this.send();
    clearTimeout(timer);
    --this.unanswered;
    this.judge(mine, answer?.accepted === true, answer?.code);
    return answer;
  }

  /** A raise is for all: a later one that is confirmed answers for those before it. */
  private judge(mine: number, isConfirmed: boolean, code = ""): void {
    if (mine <= this.confirmed) return;
    if (isConfirmed) this.confirmed = mine;
    this.show(!isConfirmed, false, REACHED[code]);
  }

  private show(isUnconfirmed: boolean, isMissed = false, reached: Reached = "nobody"): void {
    if (isUnconfirmed === this.isUnconfirmed && isMissed === this.isMissed && reached === this.reached) return;
    this.isUnconfirmed = isUnconfirmed;
    this.isMissed = isMissed;
    this.reached = reached;
    this.onChange();
  }
}
