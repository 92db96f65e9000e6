// Pairs of objects that may collide: how each stands, and a switch for its collisions.
import { forbid, h, icon } from "./dom";
import type { Session } from "./session";
import { t, type Key } from "./strings";

const PERIOD = 300; // [ms] between looks
type State = "off" | "touching" | "near" | "apart";
const ORDER: State[] = ["off", "touching", "near", "apart"];
const NEAR = 0.05; // [m]

export class Pairs {
  readonly element = h("div", "pairs");
  private head = h("h3", "");
  private filter = h("input", "");
  private list = h("ul", "");
  private rows = new Map<string, { row: HTMLElement; state: HTMLElement; button: HTMLButtonElement; shown: string }>();
  private shown = 0;

  /** `set` switches the collisions of two objects, by their names; `whyNot`: why it cannot be done now. */
  constructor(private session: Session, private set: (a: string, b: string, isOn: boolean) => Promise<boolean>, private whyNot: () => Key | undefined) {
    this.filter.type = "search";
    this.filter.addEventListener("input", () => this.order());
    this.element.append(h("div", "row", this.head, this.filter), this.list);
  }

  setWords(): void {
    this.head.textContent = t("pairs");
    this.filter.placeholder = t("pairs.filter");
    this.filter.setAttribute("aria-label", t("pairs.filter"));
    this.rows.clear();
    this.list.replaceChildren();
    this.shown = 0;
  }

  private stateOf(pair: { enabled: boolean; colliding: boolean; gap: number; tick: number }): State {
    if (!pair.enabled) return "off";
    if (pair.colliding && this.session.tick - pair.tick <= 1500) return "touching";
    return pair.gap < NEAR ? "near" : "apart";
  }

  /** Called when the session has changed. */
  show(): void {
    const now = performance.now();
    if (now - this.shown < PERIOD) return;
    this.shown = now;
    const why = this.whyNot();
    for (const [key, pair] of this.session.pairs) {
      const [a, b] = [this.session.objects.get(pair.a), this.session.objects.get(pair.b)];
      if (a === undefined || b === undefined) continue;
      const state = this.stateOf(pair);
      let known = this.rows.get(key);
      if (known === undefined) {
        const button = h("button", "switch");
        button.setAttribute("role", "switch");
        button.addEventListener("click", () => void this.set(a.name, b.name, button.getAttribute("aria-checked") !== "true"));
        const names = `${this.session.titleOf(pair.a)} – ${this.session.titleOf(pair.b)}`;
        button.setAttribute("aria-label", t("pairs.switch", { names }));
        known = { row: h("li", "", h("span", "name", names)), state: h("span", "badge"), button, shown: "" };
        known.row.append(known.state, button);
        this.rows.set(key, known);
      }
      forbid(known.button, why === undefined ? "" : t(why));
      if (known.shown === state) continue;
      known.shown = state;
      known.row.dataset["state"] = state;
      known.button.setAttribute("aria-checked", String(state !== "off"));
      known.button.replaceChildren(t(state === "off" ? "desk.off" : "desk.on"));
      known.state.className = `badge ${state === "off" ? "warn" : state === "touching" ? "info" : "muted"}`;
      known.state.replaceChildren(icon(state === "off" ? "over" : state === "touching" ? "now" : "wait"), t(`pairs.${state}`));
    }
    this.order();
  }

  /** What matters first: switched off, then touching. Without moving rows about that stay where they are. */
  private order(): void {
    const wanted = this.filter.value.trim().toLowerCase();
    const rows = [...this.rows.values()].sort((a, b) => ORDER.indexOf(a.shown as State) - ORDER.indexOf(b.shown as State) || a.row.textContent!.localeCompare(b.row.textContent!));
    for (const { row } of rows) row.hidden = !(row.firstElementChild?.textContent ?? "").toLowerCase().includes(wanted);
    if (rows.some(({ row }, i) => this.list.children[i] !== row) && !this.list.contains(document.activeElement)) this.list.replaceChildren(...rows.map(({ row }) => row));
  }
}
