// A question to the person at this page, or something to read. The emergency stop can be pressed in it: the one beside it cannot while it is open.
import { h, icon } from "./dom";
import { t } from "./strings";

let dialogs = 0;

/** `why`: where it is said why `go` does nothing now. */
export interface Asked { go: HTMLButtonElement; why: HTMLElement }

export class Dialog {
  readonly element = h("dialog", "");
  private titleId = `dialog-${++dialogs}`;

  /** `raise`: the emergency stop. */
  constructor(private raise: () => void) {
    this.element.setAttribute("aria-labelledby", this.titleId);
    document.body.append(this.element);
  }

  /** Closes when `done` has come true. */
  open(title: string, nodes: Node[], action: string, done: () => Promise<boolean>): Asked {
    const cancel = Object.assign(h("button", "", t("desk.cancel")), { type: "button" });
    const go = h("button", "primary", action);
    const why = h("p", "warn");
    why.setAttribute("role", "status");
    const form = h("form", "", this.head(title), ...nodes, why, h("div", "row end", this.stop(t("stop.press")), cancel, go));
    cancel.addEventListener("click", () => this.element.close());
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      void done().then((accepted) => accepted && this.element.close());
    });
    this.element.replaceChildren(form);
    this.element.showModal();
    // the stop is the first in the order, and Enter is not to press it; Escape leaves
    if (form.querySelector("input, select") === null) cancel.focus();
    return { go, why };
  }

  /** Something to read. `stop`: the words of the emergency stop, where there is one. */
  tell(title: string, nodes: Node[], stop?: string): void {
    const close = h("button", "primary", t("dialog.close"));
    close.addEventListener("click", () => this.element.close());
    this.element.replaceChildren(this.head(title), ...nodes, h("div", "row end", ...(stop === undefined ? [] : [this.stop(stop)]), close));
    this.element.classList.add("wide");
    this.element.addEventListener("close", () => this.element.classList.remove("wide"), { once: true });
    this.element.showModal();
    close.focus();
  }

  private head(title: string): HTMLElement {
    return Object.assign(h("h2", "", title), { id: this.titleId });
  }

  private stop(text: string): HTMLElement {
    const stop = Object.assign(h("button", "stop", icon("stop"), text), { type: "button" });
    stop.addEventListener("click", () => this.raise());
    return stop;
  }

  /** It is not shown any more. */
  remove(): void {
    this.element.remove();
  }
}
