// All sessions of the bus, each a card that follows it.
import { h, icon } from "./dom";
import { addressOf, LiveSource, type LiveState } from "./live";
import { Role, type LobbyState } from "./messages";
import * as panels from "./panels";
import { SceneView } from "./scene";
import { Session } from "./session";
import { t } from "./strings";

const TOPICS = ["/console", "SceneObject", "SceneHand", "SceneTitle", "ObjectSnapshot", "WorldFrame_30", "SceneStep", "StepState", "RunState", "Presence", "EmergencyStop", "EmergencyClear", "NewestRaise", "EventLog", "__instance_state"];
const PERIOD = 500; // [ms] between looks
const PICTURES = 8; // sessions that are drawn: a browser draws in so many places only

interface Card { element: HTMLAnchorElement; picture: HTMLElement; text: HTMLElement; view?: SceneView; session: Session; source?: LiveSource; live: LiveState["kind"]; info: LobbyState["sessions"][number]; shown: string; isSilent: boolean }

/** What a card shows is old. */
const isLost = ({ live, session, isSilent }: Card): boolean => isSilent || live === "reconnecting" || session.link?.state === "lost";
/** It is over, or nothing was ever seen of it. */
const isEnded = ({ session }: Card): boolean => session.isOver || session.link?.state === "ended" || session.objects.size === 0;

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
    const infos = new Map(state.sessions.map((info) => [info.session, info]));
    for (const [name, card] of this.cards) {
      // one that has ended says so; of another one the devices may still be on
      if (infos.has(name)) card.isSilent = false;
      else if (isEnded(card)) this.close(name, card);
      else card.isSilent = true;
    }
    [...infos.values()].forEach((info, i) => {
      const card: Card = this.cards.get(info.session) ?? this.card(info);
      card.info = info;
      this.cards.set(info.session, card);
      // one that has its place keeps the focus there
      if (this.list.children[i] !== card.element) this.list.insertBefore(card.element, this.list.children[i] ?? null);
      if (!info.served || card.source !== undefined) return;
      card.element.href = `/?session=${encodeURIComponent(info.session)}`;
      const follow = (topic: string, message: unknown, isGone: boolean): void => card.session.receive(topic, message, isGone);
      card.source = new LiveSource(addressOf(`/live/${encodeURIComponent(info.session)}`), TOPICS, follow, ({ kind }) => (card.live = kind));
    });
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

  /** Names of the sessions whose servers have not said that they know of an emergency stop. */
  get unstopped(): string[] {
    return [...this.cards.values()].filter((card) => card.info.served && !isEnded(card) && (card.isSilent || !card.session.isStopKnown)).map(({ info }) => info.session);
  }

  private card(info: Card["info"]): Card {
    const [picture, text] = [h("div", "picture-of"), h("div", "session-text")];
    return { element: h("a", "session", picture, text), picture, text, session: new Session(), live: "connecting", info, shown: "", isSilent: false };
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
      card.element.classList.toggle("lost", isLost(card));
      const content = h("div", "", ...this.contentOf(card));
      if (content.innerHTML === card.shown) continue;
      card.shown = content.innerHTML;
      card.text.replaceChildren(...content.childNodes);
    }
  }

  private contentOf(card: Card): Node[] {
    const { session, info } = card;
    const people = [...session.people.values()].filter((person) => person.alive && person.role <= Role.Trainee); // others look on
    const steps = session.steps;
    const done = steps.filter((step) => step.ended !== undefined).length;
    const bar = h("i", "good");
    bar.style.width = `${steps.length === 0 ? 0 : Math.round((100 * done) / steps.length)}%`;
    if (!info.served) return [h("div", "card-head", h("span", "part", info.session)), h("h2", "", info.title), h("p", "muted", t("lobby.unserved"))];
    if (card.isSilent) return [h("div", "card-head", h("span", "part", info.session), h("span", "badge bad", icon("warn"), t("lobby.silent"))), h("h2", "", session.title || info.title), h("p", "", t("lobby.silent.more"))];
    return [
      h("div", "card-head", h("span", "part", info.session), isLost(card) ? h("span", "badge warn", icon("warn"), t("lobby.lost")) : (panels.phase(session) ?? "")),
      h("h2", "", session.title || info.title),
      h("p", "", session.isWaiting ? panels.waitsFor(session) : session.step === undefined || session.isOver ? panels.reasonOfEnd(session) : panels.titleOfStep(session.step)),
      h("div", "bar", bar),
      h("p", "muted", [t("lobby.steps", { done, steps: steps.length }), t("lobby.people", { people: people.length }), info.host].join(" · ")),
    ];
  }
}
