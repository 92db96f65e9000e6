// All sessions of the bus, each a card that follows it.
import { h, icon } from "./dom";
import { addressOf, LiveSource } from "./live";
import type { LobbyState } from "./messages";
import * as panels from "./panels";
import { SceneView } from "./scene";
import { Session } from "./session";
import { t } from "./strings";

const TOPICS = ["/console", "SceneObject", "SceneHand", "ObjectSnapshot", "WorldFrame_30", "SceneStep", "StepState", "RunState", "Presence", "EmergencyStop", "EmergencyClear", "EventLog", "__instance_state"];
const TRAINEE = 2; // whose role is larger looks on
const PERIOD = 500; // [ms] between looks
const PICTURES = 8; // sessions that are drawn: a browser draws in so many places only

interface Card { element: HTMLAnchorElement; picture: HTMLElement; text: HTMLElement; view?: SceneView; session: Session; source?: LiveSource; info: LobbyState["sessions"][number]; shown: string }

export class Lobby {
  readonly element = h("section", "lobby");
  private cards = new Map<string, Card>();
  private list = h("div", "cards");
  private head = h("h1", "");
  private none = h("div", "none");
  private more = h("p", "muted");
  private shown = 0;
  private isBlind = false; // without WebGL

  constructor() {
    this.more.hidden = true;
    this.element.append(this.head, this.list, this.none, this.more);
  }

  receive(state: LobbyState): void {
    const names = new Set(state.sessions.map(({ session }) => session));
    for (const [name, card] of this.cards) {
      if (!names.has(name)) this.close(name, card);
    }
    for (const info of state.sessions) {
      const card: Card = this.cards.get(info.session) ?? this.card(info);
      card.info = info;
      this.cards.set(info.session, card);
      this.list.append(card.element);
      if (!info.served || card.source !== undefined) continue;
      card.element.href = `/?session=${encodeURIComponent(info.session)}`;
      const follow = (topic: string, message: unknown, isGone: boolean): void => card.session.receive(topic, message, isGone);
      card.source = new LiveSource(addressOf(`/live/${encodeURIComponent(info.session)}`), TOPICS, follow, () => undefined);
    }
    this.more.hidden = state.more !== true;
    this.shown = 0;
  }

  private close(name: string, card: Card): void {
    card.source?.close();
    card.view?.end();
    card.element.remove();
    this.cards.delete(name);
  }

  /** It is not shown any more. */
  end(): void {
    for (const [name, card] of this.cards) this.close(name, card);
    this.element.remove();
  }

  private card(info: Card["info"]): Card {
    const [picture, text] = [h("div", "picture-of"), h("div", "session-text")];
    return { element: h("a", "session", picture, text), picture, text, session: new Session(), info, shown: "" };
  }

  /** Draws it as it is now, in a canvas that takes no part in the page. */
  private draw(card: Card, now: number): void {
    const { session } = card;
    const drawn = [...this.cards.values()].filter(({ view }) => view !== undefined).length;
    if (card.view === undefined && session.objects.size > 0 && drawn < PICTURES && !this.isBlind) {
      try {
        card.view = new SceneView(card.picture, "", "simple");
        card.view.canvas.removeAttribute("tabindex");
        card.view.canvas.setAttribute("aria-hidden", "true");
        card.view.setTheme();
      } catch {
        this.isBlind = true;
      }
    }
    card.view?.update(session, now);
  }

  setTheme(): void {
    for (const { view } of this.cards.values()) view?.setTheme();
  }

  setWords(): void {
    this.head.textContent = t("lobby");
    this.none.replaceChildren(icon("wait"), h("h2", "", t("lobby.none")), h("p", "muted", t("cover.searching.more")), h("code", "", "./tenon demo"));
    this.more.textContent = t("lobby.more");
    for (const card of this.cards.values()) card.shown = "";
    this.shown = 0;
  }

  update(now: number): void {
    if (now - this.shown < PERIOD) return;
    this.shown = now;
    this.none.hidden = this.cards.size > 0;
    this.list.hidden = this.cards.size === 0;
    for (const card of this.cards.values()) {
      this.draw(card, now);
      const content = h("div", "", ...this.contentOf(card));
      if (content.innerHTML === card.shown) continue;
      card.shown = content.innerHTML;
      card.text.replaceChildren(...content.childNodes);
    }
  }

  private contentOf({ session, info }: Card): Node[] {
    const people = [...session.people.values()].filter((person) => person.alive && person.role <= TRAINEE);
    const steps = session.steps;
    const done = steps.filter((step) => step.ended !== undefined).length;
    const bar = h("i", "good");
    bar.style.width = `${steps.length === 0 ? 0 : Math.round((100 * done) / steps.length)}%`;
    if (!info.served) return [h("div", "card-head", h("span", "part", info.session)), h("h2", "", info.title), h("p", "muted", t("lobby.unserved"))];
    return [
      h("div", "card-head", h("span", "part", info.session), panels.phase(session) ?? ""),
      h("h2", "", info.title),
      h("p", "", session.isWaiting ? t("run.waiting.more") : session.step === undefined || session.isOver ? panels.reasonOfEnd(session) : panels.titleOfStep(session.step)),
      h("div", "bar", bar),
      h("p", "muted", [t("lobby.steps", { done, steps: steps.length }), t("lobby.people", { people: people.length }), info.host].join(" · ")),
    ];
  }
}
