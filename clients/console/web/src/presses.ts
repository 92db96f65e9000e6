// Presses of the emergency stop until they are answered: a stop of which nothing is heard may have stopped nothing.
import type { DeskAnswer } from "./live";

const PATIENCE = 1000; // [ms] for an answer

export class Presses {
  /** The stop was pressed, and whether it has taken effect is not known. */
  isUnconfirmed = false;
  private pressed = 0;
  private confirmed = 0; // the newest press that was

  /** `send` answers undefined when nothing could be sent, or the connection is lost. */
  constructor(private send: () => Promise<DeskAnswer | undefined>, private onChange: () => void) {}

  async press(): Promise<DeskAnswer | undefined> {
    const mine = ++this.pressed;
    const timer = setTimeout(() => this.judge(mine, false), PATIENCE);
    const answer = await this.send();
    clearTimeout(timer);
    this.judge(mine, answer?.accepted === true);
    return answer;
  }

  /** There is a connection again: what it says of the stop counts. */
  forget(): void {
    this.confirmed = this.pressed;
    this.show(false);
  }

  /** A raise is for all: a later one that is confirmed answers for those before it. */
  private judge(press: number, isConfirmed: boolean): void {
    if (press <= this.confirmed) return;
    if (isConfirmed) this.confirmed = press;
    this.show(!isConfirmed);
  }

  private show(isUnconfirmed: boolean): void {
    if (isUnconfirmed === this.isUnconfirmed) return;
    this.isUnconfirmed = isUnconfirmed;
    this.onChange();
  }
}
