// Of a page that is nothing but the scene: says to whom makes a picture of it when it is complete, or why it cannot be.
import type { Cover } from "./cover";
import type { SceneView } from "./scene";
import type { Session } from "./session";

const SETTLED = 1000; // [ms] without a change
const FAILURES = ["file", "refused", "webgl", "protocol", "lost"]; // covers after which there will be none

export class Picture {
  private settled = 0;
  private told = "";

  /** `frame`: shows what the picture is to show, once all is there. */
  constructor(private session: Session, private state: () => { over?: Cover; view?: SceneView; isReading: boolean }, private frame?: () => void) {}

  /** Called for each frame of the display. */
  update(now: number): void {
    const { over, view, isReading } = this.state();
    const { dataset } = document.body;
    if (over !== undefined && FAILURES.includes(over.state)) dataset["picture"] = `${over.head}: ${over.more}`;
    const state = `${this.session.objects.size} ${this.session.step?.revision} ${view?.models} ${isReading}`;
    if (view?.isComplete !== true || isReading || state !== this.told) this.settled = now;
    this.told = state;
    if (now - this.settled < SETTLED) return;
    if (this.frame !== undefined && this.session.step !== undefined && dataset["near"] === undefined) {
      dataset["near"] = "";
      this.frame();
      this.settled = now;
    } else dataset["picture"] = "ready";
  }
}
