// Taking part: a place in the session for who sits at this page, and what stands around the hand while it is taken.
import { Dialog } from "./dialog";
import { forbid, h, icon, marked, type Icon } from "./dom";
import { reasonOf } from "./eventtext";
import { gamepad } from "./gamepad";
import { Hand } from "./hand";
import { hasHeadset, Headset, type CardText } from "./headset";
import type { DeskAnswer, LiveSource } from "./live";
import { NONE, Role, RunPhase } from "./messages";
import { reasonOfEnd, timeLeft } from "./panels";
import type { SceneView } from "./scene";
import { askForSeat, SEATS, type SeatName } from "./seat";
import type { Session } from "./session";
import { keep, kept, localized, n, retold, SPEAKERS, t, type Key } from "./strings";

const MOST_HANDS = 2;
const TAUGHT = "taught"; // in this browser's memory
const LOUDEST = 10; // [N]
const HOLD_PERIOD = 30; // [ms] in which a button that is held moves the hand
const ICONS_ONLY: Key[] = ["part.sound", "part.help"];
const MOVES: Key[] = ["part.nearer", "part.farther", "part.turn", "part.fine", "part.depth", "part.align"]; // nothing, while the hand is held still
/** What moves the hand, and what it does: of mouse and keys, and of a finger and the buttons below the scene. */
const GESTURES = (["drag", "wheel", "depth", "turn", "vertical", "align", "fine", "look", "view"] as const).map((name): [Key, Key] => [`part.do.${name}`, `part.does.${name}`]);
const TOUCHES: [Key, Key][] = [
  ["part.do.finger", "part.does.drag"], ["part.do.hold", "part.does.hold"], ["part.depth", "part.does.depth"], ["part.turn", "part.does.turning"], ["part.align", "part.does.align"],
  ["part.fine", "part.does.fine"], ["part.look", "part.does.look"], ["part.do.fingers", "part.does.fingers"],
];
const HEADSET: [Key, Key] = ["part.do.headset", "part.does.headset"];

export class Part {
  readonly take = h("button", "take");
  /** What to do with the hand now, and what it feels. */
  readonly bar = h("section", "handbar");
  readonly lesson = h("section", "lesson");
  hand?: Hand;
  private dialog = new Dialog(() => this.raise());
  private state = h("div", "hand-state");
  private arm = h("button", "primary arm");
  private tools = h("div", "hand-tools");
  private buttons: { button: HTMLButtonElement; key: Key; icon?: Icon; isPressed?: () => boolean; shows?: () => boolean }[] = [];
  private audio?: AudioContext;
  private headset?: Headset;
  private hasHeadset = false;
  private byTouch = matchMedia("(pointer: coarse)"); // the person points with a finger
  /** What is wrong with the stop, for a headset, in which nothing of the page is seen; and how the loss of a place is said. */
  alarm: () => string = () => "";
  onLoss?: (cause: string, again: () => void) => void;
  onTaken?: () => void;
  /** Whether the seat at this page may clear an emergency stop. */
  canClear: () => boolean = () => false;
  /** Why nothing that is asked of the session would be answered now. */
  whyCut: () => Key | undefined = () => undefined;
  isLocal = true; // nobody elsewhere reaches the gateway: a trainee needs no key
  private isAsking = false;
  private isEnded = new AbortController();
  private step = -1;
  private invited = new URLSearchParams(location.search).get("you") ?? ""; // to this role's place, by the address
  private isNew = false; // of the step nothing was shown yet

  /** `tell` says what came of a request. */
  constructor(private source: LiveSource, private session: Session, private view: SceneView, private tell: (isGood: boolean, text: string) => void, private raise: () => void) {
    const lookForHeadset = (): void => void hasHeadset().then((has) => {
      this.hasHeadset = has;
      this.setWords();
    });
    lookForHeadset();
    navigator.xr?.addEventListener("devicechange", lookForHeadset, { signal: this.isEnded.signal });
    this.byTouch.addEventListener("change", () => this.setWords(), { signal: this.isEnded.signal });
    this.take.addEventListener("click", () => {
      const why = this.whyCut();
      if (this.hand !== undefined) void this.leave();
      else if (why !== undefined) this.tell(false, `${t("part.take")}: ${t(why)}`);
      else this.ask();
    });
    this.arm.addEventListener("click", () => this.hand?.press());
    source.onHandNotice = (answer) => {
      this.end();
      if (session.isOver) tell(true, answer.text === "" ? t("part.over") : answer.text);
      else this.onLoss?.(answer.text, () => this.ask());
    };
    source.onHands = (views) => this.hand?.receive(views);
    const add = (key: Key, name: Icon | undefined, act: () => void, options: { isPressed?: () => boolean; shows?: () => boolean } = {}): HTMLButtonElement => {
      const button = h("button", "");
      button.addEventListener("click", act);
      this.buttons.push({ button, key, icon: name, ...options });
      this.tools.append(button);
      return button;
    };
    const { isFine, isTurning, isAligning } = { isFine: () => this.hand?.isFine === true, isTurning: () => this.hand?.isTurning === true, isAligning: () => this.hand?.isAligning === true };
    this.holdable(add("part.nearer", "down", () => {}), -1);
    this.holdable(add("part.farther", "up", () => {}), 1);
    add("part.turn", "repeat", () => this.hand !== undefined && (this.hand.isTurning = !this.hand.isTurning), { isPressed: isTurning });
    add("part.fine", "half", () => this.hand !== undefined && (this.hand.isFine = !this.hand.isFine), { isPressed: isFine });
    add("part.look", "live", () => this.look());
    add("part.depth", "up", () => this.hand?.deepen(), { isPressed: () => this.hand?.isDeepening === true, shows: () => this.hand?.guide !== undefined });
    add("part.align", "done", () => this.hand?.align(), { isPressed: isAligning, shows: () => this.hand?.canAlign === true });
    add("part.other", "swap", () => this.hand?.choose((this.hand.current + 1) % this.hand.views.length), { shows: () => (this.hand?.views.length ?? 0) > 1 });
    add("part.headset", "live", () => void this.wear(), { isPressed: () => this.headset !== undefined, shows: () => this.hasHeadset });
    add("part.sound", "bell", () => this.toggleSound(), { isPressed: () => this.audio !== undefined });
    add("part.help", "help", () => this.teach(this.lesson.hidden));
    this.bar.append(this.state, this.arm, this.tools);
    this.bar.hidden = this.lesson.hidden = true;
    this.setWords();
  }

  /** A button that moves the hand as long as it is held. */
  private holdable(button: HTMLButtonElement, direction: number): void {
    let timer = 0;
    const stop = (): void => clearInterval(timer);
    const go = (): void => {
      // hidden by a stop it hears of no release
      if (this.hand?.isOn !== true || button.offsetParent === null) return stop();
      this.hand.go(0, 0, (direction * HOLD_PERIOD * (this.hand.isFine ? 0.1 : 1)) / 1000);
    };
    const begin = (): void => {
      stop();
      timer = window.setInterval(go, HOLD_PERIOD);
    };
    button.addEventListener("pointerdown", begin);
    button.addEventListener("keydown", ({ key, repeat }) => key === "Enter" && !repeat && begin());
    for (const name of ["pointerup", "pointerleave", "pointercancel", "keyup", "blur"] as const) button.addEventListener(name, stop);
    addEventListener("blur", stop, { signal: this.isEnded.signal });
  }

  setWords(): void {
    for (const { button, key, icon: name } of this.buttons) {
      button.replaceChildren(...(name === undefined ? [] : [icon(name)]), ...(ICONS_ONLY.includes(key) ? [] : [t(key)]));
      button.setAttribute("aria-label", t(key));
      button.title = t(key);
    }
    this.arm.replaceChildren(icon("on"), t("part.arm"), h("kbd", "", t("part.arm.key")));
    const rows = [...(this.byTouch.matches ? TOUCHES : GESTURES), ...(this.hasHeadset ? [HEADSET] : [])].map(([gesture, does]) => h("li", "", h("kbd", "", t(gesture)), h("span", "", t(does))));
    const close = h("button", "primary", t("part.understood"));
    close.addEventListener("click", () => this.teach(false));
    this.lesson.replaceChildren(h("h2", "", t("part.lesson")), h("ul", "gestures", ...rows), h("div", "row end", close));
    this.show();
  }

  /** At the hand and where it is to go. */
  private look(): void {
    const { guide, now } = this.hand ?? {};
    if (guide !== undefined) this.view.frame([guide.from, guide.to]);
    else if (now !== undefined) this.view.frame([now.hand.p]);
  }

  private teach(shows: boolean): void {
    this.lesson.hidden = !shows;
    if (!shows) keep(TAUGHT, "yes");
  }

  /** Called when the session or the hand has changed. */
  show(): void {
    const { hand, session } = this;
    const label = t(this.isAsking ? "part.asking" : hand === undefined ? "part.take" : "part.leave");
    if (this.take.textContent !== label) this.take.replaceChildren(icon("hand"), label);
    this.take.disabled = this.isAsking;
    const cut = this.whyCut();
    forbid(this.take, hand === undefined && cut !== undefined ? t(cut) : "");
    this.take.hidden = session.isOver || session.sceneHands.size === 0;
    if (!this.take.hidden && this.invited !== "" && session.link?.state === "joined") this.ask();
    this.bar.hidden = hand === undefined || session.link?.state === "lost";
    document.body.classList.toggle("takes-part", hand !== undefined);
    if (hand === undefined) return;
    if (session.step !== undefined && session.step.revision !== this.step) {
      this.step = session.step.revision;
      hand.follow();
      this.isNew = true;
    }
    if (this.isNew && hand.guide !== undefined) {
      this.isNew = false;
      if (![hand.guide.from, hand.guide.to].every((place) => this.view.isInSight(place))) this.look();
    }
    const stopped = session.isRaised;
    this.arm.hidden = hand.isOn || stopped || hand.now === undefined || cut !== undefined;
    const texts = this.describe(hand, stopped);
    const node = h("div", "", ...texts);
    if (node.innerHTML !== this.state.innerHTML) this.state.replaceChildren(...node.childNodes);
    this.tools.hidden = !hand.isOn;
    const still = this.stillness();
    for (const { button, key, isPressed, shows } of this.buttons) {
      if (MOVES.includes(key) && (button.disabled = still !== undefined) !== (button.title !== t(key))) button.title = t(still ?? key);
      button.hidden = shows !== undefined && !shows();
      if (isPressed !== undefined) button.setAttribute("aria-pressed", String(isPressed()));
    }
  }

  private describe(hand: Hand, stopped: boolean): Node[] {
    const { now, guide, session } = { now: hand.now, guide: hand.guide, session: this.session };
    if (now === undefined) return [h("span", "", t("part.wait"))];
    const name = session.titleOf(now.objectId) || session.nameOfHand(this.ids[hand.current]);
    if (stopped) return [icon("stop"), h("b", "", name), h("span", "bad", ...marked(this.whatStopped()))];
    if (this.whyCut() !== undefined) return [icon("warn"), h("b", "", name), h("span", "bad", t("part.still"))];
    if (!hand.isOn) return [icon("hand"), h("b", "", name), h("span", "", t("part.off"))];
    const still = this.stillness();
    if (still !== undefined) return [icon("hand"), h("b", "", name), h("span", "", t(still))];
    const force = h("span", now.inContact ? "force touching" : "force", now.inContact ? t("part.force", { force: n(now.force, 1) }) : t("part.free"));
    const way: Node[] = [];
    if (session.isGuided(this.ids[hand.current])) way.push(h("span", "way", t("part.guided")));
    if (guide !== undefined) {
      const mm = (metres: number): string => (Math.abs(metres) < 0.1 ? `${n(1000 * metres, 0)} mm` : `${n(100 * metres, 0)} cm`);
      way.push(h("span", "way", t("part.way", { distance: mm(guide.distance) })));
      const depth: Key = Math.abs(guide.farther) < 0.005 ? "part.way.level" : guide.farther > 0 ? "part.way.farther" : "part.way.nearer";
      way.push(h("span", "depth", t(depth, { distance: mm(Math.abs(guide.farther)) })));
      if (guide.angle !== undefined && guide.angle > 0.035) way.push(h("span", "angle", t("part.way.angle", { angle: n((guide.angle * 180) / Math.PI, 0) })));
    }
    return [icon("hand"), h("b", "", name), force, ...way];
  }

  /** Why the hand does not move though it is on. */
  private stillness(): Key | undefined {
    const { run } = this.session;
    const cut = this.whyCut();
    if (cut !== undefined) return cut;
    if (run?.phase === RunPhase.Paused) return "part.paused";
    return run?.forces_frozen === true ? "part.frozen" : undefined;
  }

  /** Who ends a stop, and what is to be done then. */
  private whatStopped(): string {
    if (this.canClear()) return t("part.stopped");
    const instructors = [...this.session.people.values()].filter(({ alive, role }) => alive && role <= Role.Instructor);
    return instructors.length === 0 ? t("part.stopped.alone") : t("part.stopped.by", { who: instructors.map(({ name }) => retold(name, ...SPEAKERS)).join(", ") });
  }

  /** Enters the headset, or leaves it. */
  private async wear(): Promise<void> {
    const { hand } = this;
    if (this.headset !== undefined || hand === undefined) return this.headset?.end();
    try {
      this.headset = await Headset.enter(hand, this.view, (side) => this.handOf(side), () => this.cardText(), this.raise, () => {
        this.headset = undefined;
        this.show();
      });
      if (this.hand !== hand) this.headset.end(); // the place was lost meanwhile
    } catch (problem) {
      this.tell(false, t("part.headset.not", { reason: problem instanceof Error ? problem.message : String(problem) }));
    }
    this.show();
  }

  /** The hand that a side of the person moves: that of its name, or the only one. */
  private handOf(side: XRHandedness): number {
    const named = this.ids.findIndex((id) => this.session.sceneHands.get(id)?.name.includes(side) === true);
    return named >= 0 || this.ids.length === 1 ? Math.max(0, named) : side === "left" ? 1 : 0;
  }

  private cardText(): CardText {
    const { hand, session } = this;
    const { step } = session;
    const isStopped = session.isRaised;
    const state = hand === undefined ? "" : this.describe(hand, isStopped).map((node) => node.textContent ?? "").filter((text) => text !== "").join(" · ");
    return {
      head: step === undefined ? "" : [t("step.count", { step: step.step + 1, steps: step.steps }), timeLeft(session)?.text ?? ""].filter((text) => text !== "").join(" · "),
      title: session.isOver ? reasonOfEnd(session) : step === undefined ? t("step.none") : localized(step.title) || step.name,
      text: session.isOver || step === undefined ? "" : localized(step.instruction),
      state: this.alarm() !== "" ? this.alarm() : isStopped || hand?.isOn === true ? state : t("part.headset.arm"),
      stop: t("part.headset.stop"),
    };
  }

  private ids: number[] = [];

  /** Of the scenario, the hand that is moved here; none without one that is on. */
  get handName(): string | undefined {
    return this.hand?.isOn === true ? this.session.sceneHands.get(this.ids[this.hand.current])?.name : undefined;
  }

  /** The hands of a role. */
  private handsOf(role: SeatName): { ids: number[]; names: string[] } {
    const all = [...this.session.sceneHands.values()].filter((hand) => hand.role === SEATS[role] && !this.session.isTracked(hand.hand_id) && hand.object_id !== NONE);
    const some = all.sort((a, b) => a.hand_id - b.hand_id).slice(0, MOST_HANDS);
    return { ids: some.map((hand) => hand.hand_id), names: some.map((hand) => hand.name) };
  }

  private ask(): void {
    const { invited } = this;
    this.invited = "";
    askForSeat(this.dialog, {
      title: t("part.take"), what: t("part.what"), action: t("part.take"), wanted: invited, wasRemoved: this.session.hasRemovedUs,
      roles: (["trainee", "instructor"] as const).filter((name) => this.handsOf(name).ids.length > 0),
      needsKey: (role) => role !== "trainee" || !this.isLocal,
      noteOf: (role) => {
        const wanted = this.handsOf(role).ids;
        const others = [...this.session.people.values()].filter((person) => person.alive && Array.from(person.hands).some((hand) => wanted.includes(hand)));
        return others.length === 0 ? t("part.free.place") : t("part.taken.place", { who: others.map((person) => retold(person.name, ...SPEAKERS)).join(", ") });
      },
      done: async (...place) => {
        void this.sit(...place);
        return true;
      },
    });
  }

  private async sit(role: SeatName, name: string, key: string): Promise<void> {
    const { ids, names } = this.handsOf(role);
    this.isAsking = true;
    this.show();
    // it hears of its hands before the answer comes
    this.ids = ids;
    this.session.ownHands = new Set(ids);
    const hand = new Hand(this.session, this.view, ids, (bytes) => this.source.sendTargets(bytes));
    this.hand = hand;
    const answer = await this.source.ask("handTake", { role, name: name || t("desk.somebody"), key, hands: names });
    this.isAsking = false;
    if (answer?.accepted !== true) this.end();
    this.said(t("part.take"), answer);
    if (answer?.accepted === true) {
      this.session.hasRemovedUs = false;
      this.onTaken?.();
      hand.onContact = (force, index) => this.feel(force, index);
      this.step = -1;
      this.teach(kept(TAUGHT) === null);
      this.arm.focus();
    }
    this.show();
  }

  private async leave(): Promise<void> {
    this.end();
    this.said(t("part.leave"), await this.source.ask("handLeave"));
  }

  private said(what: string, answer: DeskAnswer | undefined): void {
    this.tell(answer?.accepted === true, `${what}: ${answer === undefined ? t("desk.offline") : reasonOf(answer) || t(answer.accepted ? "desk.accepted" : "desk.refused")}`);
  }

  /** The place is given up or lost. */
  end(): void {
    this.headset?.end();
    this.hand?.end();
    this.hand = undefined;
    this.session.ownHands = new Set();
    this.lesson.hidden = true;
    this.show();
  }

  /** With the connection. */
  lose(): void {
    const isLost = this.hand !== undefined && !this.isAsking;
    this.end();
    if (isLost && !this.session.isOver) this.onLoss?.(t("part.lost.link"), () => this.ask());
  }

  /** It is not shown any more. */
  remove(): void {
    this.end();
    this.isEnded.abort();
    void this.audio?.close();
    this.dialog.remove();
    for (const element of [this.take, this.bar, this.lesson]) element.remove();
  }

  /** True when it was one of the hand's keys. */
  onKeyDown(event: KeyboardEvent): boolean {
    if (this.hand === undefined) return false;
    if (event.key === "Enter" && !this.hand.isOn) {
      // what has the focus else is what Enter is for
      if (event.target !== document.body && event.target !== this.view.canvas) return false;
      if (!this.session.isRaised) this.hand.press(); // after a stop was cleared it is for the person to switch it on
    }
    else if (event.key === "m") this.toggleSound();
    else if (event.key === "c") this.look();
    else if (event.key === "h") this.teach(this.lesson.hidden);
    else return this.hand.onKeyDown(event);
    return true;
  }

  private toggleSound(): void {
    void this.audio?.close();
    this.audio = this.audio === undefined ? new AudioContext() : undefined;
  }

  /** A tick and a short vibration, stronger with more force. */
  private feel(force: number, index: number): void {
    const strength = Math.min(1, 0.3 + force / LOUDEST);
    this.headset?.feel(index, strength);
    if ("vibrate" in navigator) navigator.vibrate(Math.round(30 * strength));
    void gamepad()?.vibrationActuator?.playEffect("dual-rumble", { duration: 60, weakMagnitude: strength, strongMagnitude: strength });
    if (this.audio === undefined) return;
    const { audio } = this;
    const tone = new OscillatorNode(audio, { type: "triangle", frequency: 320 });
    const gain = new GainNode(audio, { gain: 0.25 * strength });
    gain.gain.exponentialRampToValueAtTime(0.001, audio.currentTime + 0.08);
    tone.connect(gain).connect(audio.destination);
    tone.start();
    tone.stop(audio.currentTime + 0.09);
  }
}
