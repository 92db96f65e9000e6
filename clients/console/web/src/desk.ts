// The instructor's desk: a seat in the session, commands, and what the server answers to each. The emergency stop needs no seat.
import { Dialog, type Asked } from "./dialog";
import { forbid, h, icon, marked, setOptions, type Icon } from "./dom";
import type { DeskAnswer, LiveSource } from "./live";
import { isRemoval, reasonOf, reasonOfLoss } from "./eventtext";
import { RunPhase, Status, type SceneObject } from "./messages";
import { Pairs } from "./pairs";
import { whyNot, type Permitted } from "./permits";
import { Presses } from "./presses";
import { askForSeat, PASS } from "./seat";
import type { Session } from "./session";
import { Signals } from "./signals";
import { keep, kept, t, type Key } from "./strings";

const NOTICE = 8000; // [ms] that an answer is shown
const NOTICES = 3;
const ROLE = "role"; // in this tab's memory, of a seat that is taken again
const OTHER_LABELS: Record<string, Key> = { note: "desk.note.said", clear: "stop.clear", collision: "desk.collision", kick: "desk.kick", goto: "desk.goto", give: "desk.give", guide: "guide" };

export class Desk {
  readonly stop = h("button", "stop");
  readonly clear = h("button", "clear"); // apart from the stop, so that a double click never clears it
  readonly sit = h("button", "sit");
  readonly bar = h("section", "desk");
  readonly notices = h("div", "notices");
  /** Said until it is known whether the stop that was pressed has taken effect. */
  readonly alarm = h("span", "alarm");
  /** That the server has granted; empty: looks on. */
  role = "";
  /** The seat, among those who are present. */
  client?: number;
  /** Whether this console has a folder for recordings. */
  canRecord = false;
  /** Whether what is known of the stop is so now. */
  isHeard: () => boolean = () => true;
  /** Why nothing that is asked here would be answered now. */
  whyCut: () => Key | undefined = () => undefined;
  /** Sessions of which the server has not said that it knows of the stop. */
  unstopped: () => string[] = () => [];
  private dialog = new Dialog(() => void this.raise());
  private buttons: { button: HTMLButtonElement; key: Key; icon?: Icon; shows?: () => boolean }[] = [];
  private signals: Signals;
  private note = h("input", "");
  private why = h("p", "why");
  private asked?: Asked & { word: string }; // a command, by the dialog
  private more = h("details", "more");
  private given = h("select"); // object to be handed over
  private hands = [h("select"), h("select")]; // that gets, that releases
  private pairs: Pairs;
  private presses = new Presses(() => this.source.ask("deskCommand", { words: ["emergency", t("stop.reason")] }), () => this.showAlarm());
  private isEnded = new AbortController();
  private permitted: Permitted = {}; // to the seat that was granted last
  private lastRefusal = ""; // of a seat
  private place = ""; // the session that was joined last

  /** `isOfAll`: the stop is for all sessions. */
  constructor(private source: LiveSource, private session: Session, gatewayRole: string, private isOfAll = false) {
    const pass = new URLSearchParams(location.hash.slice(1)).get(PASS);
    if (pass !== null) {
      keep(PASS, pass, "tab");
      history.replaceState(null, "", location.pathname + location.search);
      // not once more after the person has left the seat
      if (kept(ROLE, "tab") === null && gatewayRole !== "") keep(ROLE, gatewayRole, "tab");
    }
    this.notices.setAttribute("role", "status");
    this.stop.addEventListener("click", () => void this.raise());
    this.clear.addEventListener("click", () => void this.command("clear"));
    this.sit.addEventListener("click", () => {
      const why = this.whyCut();
      if (why !== undefined) this.notify(false, `${this.sit.textContent}: ${t(why)}`);
      else if (this.role === "") this.askForSeat();
      else void this.leave();
    });
    source.onNotice = (answer) => {
      this.role = answer.role;
      if (answer.role === "") this.offerSeat(answer.text);
      else this.notify(false, answer.text);
      this.show();
    };
    this.alarm.setAttribute("role", "alert");
    this.signals = new Signals(session, (...words) => this.command(...words));
    this.pairs = new Pairs(session, (a, b, isOn) => this.command("collision", a, b, isOn ? "on" : "off"), () => this.whyNot("collision"));
    this.more.addEventListener("toggle", () => this.pairs.show());
    // Escape and a click beside it close it
    const { signal } = this.isEnded;
    addEventListener("keydown", ({ key }) => key === "Escape" && (this.more.open = false), { signal });
    addEventListener("pointerdown", ({ target }) => target instanceof Node && !this.more.contains(target) && (this.more.open = false), { signal });
    this.build();
    this.setWords();
  }

  private build(): void {
    const add = (host: HTMLElement, key: Key, words: string[], name?: Icon, shows?: () => boolean, confirm = false): void => {
      const button = h("button", "");
      button.dataset["command"] = words.join(" ");
      button.addEventListener("click", () => void (confirm ? this.confirm(key, words) : this.command(...words)));
      this.buttons.push({ button, key, icon: name, shows });
      host.append(button);
    };
    const isPaused = (): boolean => this.session.run?.phase === RunPhase.Paused;
    add(this.bar, "desk.pause", ["pause"], "pause", () => !isPaused());
    add(this.bar, "desk.resume", ["resume"], "now", isPaused);
    const isFrozen = (): boolean => this.session.run?.forces_frozen === true;
    add(this.bar, "desk.freeze", ["freeze", "on"], "frozen", () => !isFrozen());
    add(this.bar, "desk.thaw", ["freeze", "off"], "frozen", isFrozen);
    add(this.bar, "desk.back", ["back"], "back");
    add(this.bar, "desk.repeat", ["repeat"], "repeat");
    add(this.bar, "desk.skip", ["skip"], "skip");
    const isRecording = (): boolean => this.session.link?.recorded === true;
    add(this.bar, "desk.record", ["record", "start"], "record", () => this.canRecord && !isRecording());
    add(this.bar, "desk.record.stop", ["record", "stop"], "over", () => this.canRecord && isRecording());
    this.bar.append(this.signals.buttons);
    this.note.maxLength = 200;
    this.note.addEventListener("keydown", (event) => {
      if (event.key !== "Enter" || this.note.value.trim() === "") return;
      const text = this.note.value;
      void this.command("note", text).then((accepted) => accepted && this.note.value === text && (this.note.value = ""));
    });
    this.why.setAttribute("role", "status");
    this.bar.append(this.note, this.more, this.why);
    const rows = h("div", "rows");
    const row = (...nodes: Node[]): HTMLElement => h("div", "row", ...nodes);
    const give = row(this.given, this.hands[0]);
    const release = row(this.hands[1]);
    const addRow = (host: HTMLElement, key: Key, words: () => string[]): void => {
      const button = h("button", "");
      button.dataset["command"] = words()[0];
      button.addEventListener("click", () => (words().includes("") ? this.notify(false, `${t(key)}: ${t("desk.choose")}`) : void this.command(...words())));
      this.buttons.push({ button, key });
      host.append(button);
    };
    addRow(give, "desk.give", () => ["give", this.given.value, this.hands[0].value]);
    addRow(release, "desk.release", () => ["release", this.hands[1].value]);
    addRow(this.signals.row, "desk.signal", () => ["signal", this.signals.chosen]);
    const whole = row();
    add(whole, "desk.swap", ["swap"], "swap");
    add(whole, "desk.reset", ["reset"], "repeat", undefined, true);
    add(whole, "desk.end", ["stop"], "over", undefined, true);
    rows.append(give, release, this.signals.row, this.pairs.element, whole);
    this.more.append(h("summary", ""), rows);
  }

  setWords(): void {
    for (const { button, key, icon: name } of this.buttons) button.replaceChildren(...(name === undefined ? [] : [icon(name)]), t(key));
    this.note.placeholder = t("desk.note");
    this.note.setAttribute("aria-label", t("desk.note"));
    this.more.firstElementChild?.replaceChildren(t("desk.more"));
    this.pairs.setWords();
    const labels: [HTMLElement, Key][] = [
      [this.given, "desk.object"], [this.hands[0], "desk.hand"], [this.hands[1], "desk.hand"],
    ];
    for (const [element, key] of labels) element.setAttribute("aria-label", t(key));
    this.signals.setWords();
    this.showAlarm();
    this.show();
  }

  private showAlarm(): void {
    const { isUnconfirmed } = this.presses;
    document.body.classList.toggle("unconfirmed", isUnconfirmed);
    const understood = h("button", "", t("part.understood"));
    understood.addEventListener("click", () => this.presses.forget());
    this.alarm.replaceChildren(...(isUnconfirmed ? [icon("warn"), h("span", "", this.alarmText), understood] : []));
    // nothing is in front of it
    if (isUnconfirmed) for (const dialog of document.querySelectorAll("dialog")) dialog.close();
  }

  /** Empty while nothing is wrong. */
  get alarmText(): string {
    const { isUnconfirmed, isMissed, reached } = this.presses;
    return !isUnconfirmed ? "" : t(isMissed ? "stop.missed" : reached === "devices" ? "stop.devices" : reached === "some sessions" ? "stop.partly" : "stop.unconfirmed") + this.namesOfUnstopped();
  }

  /** Of all sessions: those that have not confirmed the stop. */
  private namesOfUnstopped(): string {
    const names = this.presses.reached === "some sessions" ? this.unstopped() : [];
    return names.length === 0 ? "" : `. ${t("stop.partly.names", { names: names.join(", ") })}`;
  }

  /** While a stop is unconfirmed: who has answered since. */
  renewAlarm(): void {
    if (this.presses.isUnconfirmed && this.alarm.querySelector("span")?.textContent !== this.alarmText) this.showAlarm();
  }

  /** The session is there again, or all of them. */
  async repeatStop(): Promise<void> {
    this.place = this.session.link?.session ?? "";
    const repeated = this.presses.rejoin(this.place);
    if (repeated !== undefined) this.tellOfStop(await repeated);
  }

  /** A raise or a clear of the stop, or the state of the run, has come from the session. */
  hearStop(): void {
    this.presses.hear(() => this.source.isOpen && this.session.link?.state === "joined" && this.session.isStopKnown);
  }

  /** Why the server would refuse a command now, by its first word. */
  whyNot(word: string): Key | undefined {
    const cut = this.whyCut();
    if (cut !== undefined) return cut;
    if (word === "give" && this.role !== "" && this.hands[0].options.length === 0) return whyNot(word, this.permitted, this.session) ?? "refusal.nobody_there";
    if (word === "release" && this.role !== "" && !this.holdsAnything(this.hands[1].value)) return whyNot(word, this.permitted, this.session) ?? "refusal.holds_nothing";
    return whyNot(word, this.role === "" ? undefined : this.permitted, this.session);
  }

  private holdsAnything(name: string): boolean {
    const { session } = this;
    const hand = [...session.sceneHands.values()].find((known) => known.name === name);
    return hand !== undefined && [...session.grabs.values()].some(({ hand_id, object_id }) => hand_id === hand.hand_id && !session.isOwn(object_id));
  }

  /** What does nothing now says why. */
  private showPermitted(): void {
    const reasons = new Set<string>();
    for (const button of this.bar.querySelectorAll<HTMLElement>("button[data-command]")) {
      const why = this.whyNot(button.dataset["command"]?.split(" ")[0] ?? "");
      forbid(button, why === undefined ? "" : t(why));
      if (why !== undefined && !button.hidden && (this.more.open || !this.more.contains(button))) reasons.add(t(why));
    }
    const text = [...reasons].join(" · ");
    if (this.why.dataset["text"] !== text) this.why.replaceChildren(...(text === "" ? [] : [icon("warn"), h("span", "", text)]));
    this.why.dataset["text"] = text;
    if (this.asked === undefined) return;
    const why = this.whyNot(this.asked.word);
    forbid(this.asked.go, why === undefined ? "" : t(why));
    this.asked.why.textContent = why === undefined ? "" : t(why);
  }

  get canClear(): boolean {
    return this.role !== "" && this.permitted["clear"] !== undefined;
  }

  /** Called when the session has changed. */
  show(): void {
    const { session } = this;
    const isRaised = session.isRaised && this.isHeard();
    const words: Key = isRaised ? "stop.again" : this.isOfAll ? "stop.all" : "stop.press";
    this.clear.hidden = !isRaised || !this.canClear;
    if (this.stop.dataset["words"] !== t(words)) {
      this.stop.dataset["words"] = t(words);
      this.stop.replaceChildren(icon("stop"), h("span", "", t(words)), h("kbd", "", t("stop.key")));
      this.clear.replaceChildren(icon("done"), t("stop.clear"));
    }
    const label = this.role === "" ? t("desk.sit") : t("desk.leave");
    if (this.sit.textContent !== label) this.sit.replaceChildren(icon("person"), label);
    this.sit.hidden = this.role === "" && session.link?.state !== "joined"; // in no session there is a seat
    const cut = this.whyCut();
    forbid(this.sit, cut === undefined ? "" : t(cut));
    this.note.disabled = cut !== undefined;
    this.bar.hidden = this.role === "" || session.isOver;
    if (session.isOver) for (const name of ["seat", "hand"]) this.withdraw(name);
    // until then it is said what is lost with all that was here
    for (const offer of this.notices.querySelectorAll<HTMLElement>("[data-offer]")) offer.hidden = session.isOver || cut !== undefined || session.link?.state !== "joined";
    for (const { button, shows } of this.buttons) button.hidden = shows !== undefined && !shows();
    if (this.more.open) this.pairs.show();
    this.list();
    this.showPermitted();
  }

  /** Signals, objects and hands, by the names that people read. */
  private list(): void {
    const { session } = this;
    const named = (list: SceneObject[]): { name: string; title: string }[] => list.map((object) => ({ name: object.name, title: session.titleOf(object.object_id) }));
    setOptions(this.given, named([...session.objects.values()].filter((object) => !session.isOwn(object.object_id) && session.states.get(object.object_id)?.status !== Status.Fixed)));
    // a hand of nobody holds nothing, and takes nothing
    const moved = new Set([...session.people.values()].filter(({ alive }) => alive).flatMap(({ hands }) => Array.from(hands)));
    const hands = [...session.sceneHands.values()].filter((hand) => !session.isTracked(hand.hand_id) && moved.has(hand.hand_id)).map((hand) => ({ name: hand.name, title: session.nameOfHand(hand.hand_id) }));
    for (const select of this.hands) setOptions(select, hands);
    this.signals.show();
  }

  /** Who sits at this page takes the seat again after a loss of the connection, and of the session. */
  async takeSeatAgain(): Promise<void> {
    const [role, key] = [kept(ROLE, "tab"), kept(PASS, "tab")];
    if (role === null || key === null || this.role !== "") return;
    if (!(await this.takeSeat(role, kept("name") ?? "", key, true))) this.offerSeat(this.lastRefusal);
  }

  loseSeat(): void {
    this.role = "";
    this.show();
  }

  private offerSeat(cause: string): void {
    if (!this.session.isOver) this.tellLoss("seat", t("desk.lost", { reason: reasonOfLoss(cause) }), cause, t("desk.sit.again"), () => this.askForSeat());
  }

  /** Says that a seat or a hand is lost, and offers to get it again; not to who was removed: whether to come back is to be decided anew, with the key where one is needed. */
  tellLoss(name: string, text: string, cause: string, label: string, again: () => void): void {
    if (!isRemoval(cause)) return this.offer(name, text, label, again);
    this.session.hasRemovedUs = true;
    for (const one of [ROLE, PASS]) keep(one, null, "tab");
    this.offer(name, text, t("part.understood"), () => this.withdraw(name));
  }

  /** It is not shown any more. */
  end(): void {
    this.isEnded.abort();
    this.presses.forget();
    this.dialog.remove();
    for (const element of [this.stop, this.clear, this.sit, this.bar, this.notices, this.alarm]) element.remove();
  }

  /** `isAgain`: its refusal is not said here. */
  private async takeSeat(role: string, name: string, key: string, isAgain = false): Promise<boolean> {
    const answer = await this.source.ask("deskSit", { role, name: name || t("desk.somebody"), key });
    this.role = answer?.role ?? "";
    this.permitted = answer?.commands ?? {};
    this.client = answer?.client;
    this.lastRefusal = answer === undefined ? t("desk.offline") : reasonOf(answer);
    if (answer?.accepted === true) {
      this.withdraw("seat");
      this.session.hasRemovedUs = false;
      keep(PASS, key, "tab");
      keep(ROLE, role, "tab");
    }
    if (!isAgain || answer?.accepted === true) this.tell(t(`role.name.${role}` as Key), answer);
    this.show();
    return answer?.accepted === true;
  }

  private async leave(): Promise<void> {
    keep(ROLE, null, "tab");
    this.withdraw("seat");
    const answer = await this.source.ask("deskLeave");
    this.role = "";
    this.tell(t("desk.leave"), answer);
    this.show();
  }

  private askForSeat(): void {
    this.asked = undefined;
    askForSeat(this.dialog, { title: t("desk.sit.title"), action: t("desk.sit.do"), roles: ["instructor", "trainee"], wasRemoved: this.session.hasRemovedUs, done: (...seat) => this.takeSeat(...seat) });
  }

  /** Before this page leaves the session to play a file. */
  askToLeave(file: string, leave: () => void): void {
    this.asked = undefined;
    this.dialog.open(t("drop.leave"), [h("p", "muted", t("drop.leave.more", { name: file }))], t("drop.leave.do"), async () => {
      leave();
      return true;
    });
  }

  private confirm(key: Key, words: string[], text = t("desk.sure")): void {
    if (this.whyNot(words[0]) !== undefined) return void this.command(...words);
    this.asked = { word: words[0], ...this.dialog.open(t(key), [h("p", "muted", text)], t(key), () => this.command(...words)) };
    this.showPermitted();
  }

  /** Removes a person from the session, by the number of the client. */
  remove(client: number): void {
    const who = this.session.people.get(client)?.name ?? String(client);
    this.confirm("desk.kick", ["kick", String(client)], t("desk.kick.more", { who }));
  }

  goTo(step: string, title: string): void {
    this.confirm("desk.goto", ["goto", step], t("desk.goto.more", { step: title }));
  }

  /** The emergency stop; also when one stands. */
  async raise(): Promise<void> {
    const answer = this.presses.press(this.place);
    this.source.hurry();
    this.tellOfStop(await answer);
  }

  private tellOfStop(answer: DeskAnswer | undefined): void {
    this.tell(t("stop.press"), answer, t("stop.unreachable"), t("stop.confirmed"));
  }

  async command(...words: string[]): Promise<boolean> {
    const label = this.buttons.find(({ button }) => [words[0], words.join(" ")].includes(button.dataset["command"] ?? ""))?.key ?? OTHER_LABELS[words[0]] ?? "desk.command";
    const why = this.whyNot(words[0]);
    if (why !== undefined) {
      this.notify(false, `${t(label)}: ${t(why)}`);
      return false;
    }
    const answer = await this.source.ask("deskCommand", words[0] === "clear" ? { words, newestRaise: this.session.newestRaise?.number } : { words });
    this.tell(t(label), answer);
    if (answer?.code === "not_joined" && this.role !== "") {
      this.role = "";
      this.offerSeat(t("lost.expired"));
    }
    this.show();
    return answer?.accepted === true;
  }

  private tell(what: string, answer: DeskAnswer | undefined, offline = t("desk.offline"), accepted = t("desk.accepted")): void {
    if (answer === undefined) this.notify(false, `${what}: ${offline}`);
    else this.notify(answer.accepted, `${what}: ${reasonOf(answer) || (answer.accepted ? accepted : t("desk.refused"))}`);
  }

  notify(isGood: boolean, text: string): void {
    const notice = h("p", isGood ? "notice good" : "notice bad", icon(isGood ? "done" : "warn"), h("span", "", ...marked(text)));
    notice.addEventListener("click", () => notice.remove()); // it may cover what is looked for
    this.notices.append(notice);
    const passing = [...this.notices.querySelectorAll(".notice:not([data-offer])")];
    for (const old of passing.slice(0, -NOTICES)) old.remove();
    setTimeout(() => notice.remove(), NOTICE);
  }

  /** Says what was lost, and what can be done; stays until that is done or it is withdrawn. */
  offer(name: string, text: string, label: string, act: () => void): void {
    this.withdraw(name);
    const button = h("button", "", label);
    const notice = h("p", "notice bad", icon("warn"), h("span", "", ...marked(text)), button);
    notice.dataset["offer"] = name;
    button.addEventListener("click", act);
    this.notices.append(notice);
    this.show();
  }

  withdraw(name: string): void {
    this.notices.querySelector(`[data-offer="${name}"]`)?.remove();
  }
}
