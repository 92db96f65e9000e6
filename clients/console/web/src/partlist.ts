// The objects of the scene as a list with one cursor: by it parts are picked without a pointer, also those that are hidden, or behind others.
import { h, icon, renew } from "./dom";
import { NONE } from "./messages";
import type { SceneView } from "./scene";
import type { Session } from "./session";
import { language, t } from "./strings";

const PERIOD = 300; // [ms] between two updates
const PAGE = 8; // rows

/** `pick`: the cursor has come to an object; `use`: Enter on it; `close`: Escape. */
export interface PartListActions { pick: (object: number) => void; use: (object: number) => void; close: () => void }

export class PartList {
  readonly element = h("div", "partlist");
  private head = h("h2", "");
  private list = h("ul", "");
  private ids: number[] = [];
  private cursor?: number;
  private shownAt = 0;

  constructor(private view: SceneView, private session: Session, private actions: PartListActions) {
    this.element.hidden = true;
    this.list.tabIndex = 0;
    this.list.setAttribute("role", "listbox");
    this.head.id = "partlist-head";
    this.list.setAttribute("aria-labelledby", this.head.id);
    this.list.addEventListener("keydown", (event) => this.onKey(event));
    this.list.addEventListener("click", (event) => {
      const row = (event.target as HTMLElement).closest<HTMLElement>("li[data-key]");
      if (row !== null) this.go(Number(row.dataset["key"]));
    });
    this.list.addEventListener("focus", () => this.cursor === undefined && this.ids.length > 0 && this.go(this.ids[0]));
    this.element.append(this.head, this.list);
  }

  get isOpen(): boolean {
    return !this.element.hidden;
  }

  open(isOpen: boolean): void {
    this.element.hidden = !isOpen;
    this.shownAt = 0;
    if (!isOpen) return;
    this.show();
    this.list.focus();
  }

  /** The cursor goes to what was picked in the scene. */
  follow(object: number | undefined): void {
    this.cursor = object;
    this.show();
    this.scroll();
  }

  private go(object: number): void {
    this.actions.pick(object);
  }

  private onKey(event: KeyboardEvent): void {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const at = this.cursor === undefined ? -1 : this.ids.indexOf(this.cursor);
    const leaps: Record<string, number> = { ArrowUp: at - 1, ArrowDown: at + 1, PageUp: at - PAGE, PageDown: at + PAGE, Home: 0, End: this.ids.length - 1 };
    if (event.key in leaps && this.ids.length > 0) this.go(this.ids[Math.min(this.ids.length - 1, Math.max(0, leaps[event.key]))]);
    else if (event.key === "Enter" && this.cursor !== undefined) this.actions.use(this.cursor);
    else if (event.key === "Escape") this.actions.close();
    else return;
    // the arrows do not move the hand or the view as well
    event.preventDefault();
    event.stopPropagation();
  }

  setWords(): void {
    this.head.textContent = t("parts");
    this.show();
  }

  /** Called for each frame of the display. */
  update(now: number): void {
    if (!this.isOpen || now - this.shownAt < PERIOD) return;
    this.shownAt = now;
    this.show();
  }

  private show(): void {
    if (!this.isOpen) return;
    const { session, view } = this;
    const parts = [...view.parts.all].filter(([id, { isShown }]) => isShown && !session.isOwn(id)).map(([id]) => ({ id, title: session.titleOf(id) || (session.objects.get(id)?.name ?? "") }));
    parts.sort((a, b) => a.title.localeCompare(b.title, language, { numeric: true }));
    this.ids = parts.map(({ id }) => id);
    const rows = parts.map(({ id, title }) => {
      const isHidden = view.parts.hidden.has(id);
      const holder = session.holderOf(id);
      const states = [...(isHidden ? [t("parts.hidden")] : []), ...(holder === NONE ? [] : [t("parts.held", { hand: session.nameOfHand(holder) })])];
      const swatch = h("i", "");
      swatch.style.background = session.objects.get(id)?.color.slice(0, 7) ?? "";
      const row = h("li", isHidden ? "is-hidden" : "", swatch, h("span", "name", title), h("small", "muted", states.join(", ")), ...(isHidden ? [icon("hidden")] : []));
      row.id = `part-${id}`;
      row.dataset["key"] = String(id);
      row.setAttribute("role", "option");
      row.setAttribute("aria-selected", String(id === this.cursor));
      return row;
    });
    renew(this.list, rows);
    const has = this.cursor !== undefined && this.ids.includes(this.cursor);
    if (has) this.list.setAttribute("aria-activedescendant", `part-${this.cursor}`);
    else this.list.removeAttribute("aria-activedescendant");
  }

  private scroll(): void {
    this.list.querySelector("[aria-selected=true]")?.scrollIntoView({ block: "nearest" });
  }
}
