// External signals at the desk: a button for each that the step waits for, and a list of all that the scenario knows.
import { h, icon, setOptions } from "./dom";
import type { Session } from "./session";
import { t } from "./strings";

const SIGNAL = "signal "; // of a condition that waits for one, before its name
const CONFIRMS = ["command fulfilled", "fulfilled"]; // of one that a person confirms
const spaced = (name: string): string => name.replace(/_/g, " ");

export class Signals {
  /** What the step waits for. */
  readonly buttons = h("span", "signals");
  /** All by their names; the button that sends belongs to the desk. */
  readonly row = h("div", "row");
  private all = h("select");
  private shown?: string; // that have a button

  constructor(private session: Session, private command: (...words: string[]) => Promise<boolean>) {
    this.row.append(this.all);
  }

  /** That is chosen of all; empty: none. */
  get chosen(): string {
    return this.all.value;
  }

  setWords(): void {
    this.all.setAttribute("aria-label", t("desk.signal.which"));
    this.shown = undefined;
  }

  /** Called when the session has changed. */
  show(): void {
    const waited = (this.session.progress?.conditions ?? []).map(({ text }) => text).filter((text) => text.startsWith(SIGNAL) || CONFIRMS.includes(text));
    this.showWaited(waited);
    this.list(waited.filter((text) => text.startsWith(SIGNAL)).map((text) => text.slice(SIGNAL.length)));
  }

  /** Those that the step waits for first. */
  private list(waited: string[]): void {
    const all = [...this.session.sceneSignals.values()].sort((a, b) => a.signal - b.signal).map(({ name }) => name);
    const isWaited = (name: string): boolean => waited.includes(name);
    const options = [
      ...all.filter(isWaited).map((name) => ({ name, title: t("desk.signal.waited", { name: spaced(name) }) })),
      ...all.filter((name) => !isWaited(name)).map((name) => ({ name, title: spaced(name) })),
    ];
    this.row.hidden = all.length === 0;
    setOptions(this.all, options);
  }

  private showWaited(waited: string[]): void {
    if (waited.join() === this.shown) return;
    this.shown = waited.join();
    this.buttons.replaceChildren(
      ...waited.map((text) => {
        const isSignal = text.startsWith(SIGNAL);
        const words = isSignal ? ["signal", text.slice(SIGNAL.length)] : ["fulfilled"];
        const button = h("button", "", icon("bell"), isSignal ? spaced(words[1]) : t("desk.fulfilled"));
        button.dataset["command"] = words.join(" ");
        button.addEventListener("click", () => void this.command(...words));
        return button;
      }),
    );
  }
}
