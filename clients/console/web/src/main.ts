import "./style.css";

import { FRAME, playsBeside, showBeside, tellBeside, type Played } from "./beside";
import { coverOf, isElsewhere, isEmpty, isHeard, isSilent, linkBadge, PROTOCOL, stopOf, whyCut, type Opening, type Standing } from "./cover";
import { Desk } from "./desk";
import { Dialog } from "./dialog";
import { h, icon, marked, renew } from "./dom";
import { reasonOfLoss } from "./eventtext";
import { showKeys } from "./help";
import { addressOf, LiveSource, type LiveState } from "./live";
import { Lobby } from "./lobby";
import type { Gateway, LobbyState } from "./messages";
import { Labels } from "./labels";
import {
  all, app, card, cover, fileButton, fileInput, helpButton, languages, legend, link, noForce, note, plotHost, sections, setWordsOfElements, showElements, showTab, stage, status,
  strip, stripText, themeButton, time, title,
} from "./layout";
import * as panels from "./panels";
import { Part } from "./part";
import { Picture } from "./picture";
import { Plots } from "./plot";
import { Player } from "./player";
import { fromAddress, fromFile, Recording } from "./recording";
import { SceneView } from "./scene";
import { Session, TOPICS } from "./session";
import { ViewTools } from "./viewtools";
import { clock, keep, kept, language, setLanguage, t } from "./strings";

const PANEL_PERIOD = 100; // ms
const SOUGHT_PERIOD = 300; // [ms] likewise, while one place after the other is sought

// ?picture is nothing but the scene: of it `tenon picture` makes its pictures, and waits until it is complete
const wanted = new URLSearchParams(location.search);
const isPicture = wanted.has("picture");
const DESCRIBED = 1000; // [ms] after which the page draws without a word of the gateway
const ADDRESS = "file"; // of a recording, in the page's own address

// asked for before all that takes its time
const described = fetch("/gateway.json").then((answer) => (answer.ok ? (answer.json() as Promise<Gateway>) : undefined)).catch(() => undefined);
const session = new Session();
let live: LiveState = { kind: "connecting" };
// one of them shows where the session comes from
let source: LiveSource | undefined;
let desk: Desk | undefined;
let part: Part | undefined;
let lobby: Lobby | undefined;
let player: Player | undefined;
let opening: Opening | undefined;
let isDropping = false;
let fileName = ""; // of what is played
let ownFile = ""; // of the gateway

// ---- what the page consists of
setLanguage(language);
const theme = (isPicture ? null : kept("theme")) ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");
document.documentElement.dataset["theme"] = theme;
document.documentElement.classList.toggle("picture", isPicture);

const keysDialog = new Dialog(() => void desk?.raise());
showElements();

// ---- the scene and the plot
let view: SceneView | undefined;
try {
  // ?drawing=full or simple overrides what was found out about the graphics hardware
  view = new SceneView(stage, t("view.label"), wanted.get("drawing"));
} catch (problem) {
  console.warn(problem);
}
const picture = isPicture ? new Picture(session, () => ({ over: coverOf(standing()), view, isReading: player?.isReading === true }), wanted.has("near") ? () => tools?.showWork() : undefined) : undefined;
const tools = view === undefined ? undefined : new ViewTools(view, session);
if (view !== undefined && tools !== undefined) {
  const labels = new Labels(view);
  labels.from(() => tools.labels());
  labels.from(() => (isPicture ? [] : panels.holders(session)));
  view.canvas.after(labels.element);
  view.headset.onFrame = tick;
  stage.append(tools.element);
}
const plots = new Plots(plotHost, noForce);
sections.plots.head.after(plots.choice);
sections.plots.body.addEventListener("keydown", (event) => {
  const direction = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (direction === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
  plots.moveCursor(direction * (event.shiftKey ? 5 : 1));
  // it moves neither the hand nor the view as well
  event.preventDefault();
  event.stopPropagation();
});

// ---- words, light and dark
function setWords(): void {
  desk?.setWords();
  part?.setWords();
  player?.setWords();
  lobby?.setWords();
  tools?.setWords();
  setWordsOfElements();
  all.textContent = t(wanted.has(ADDRESS) || opening !== undefined || player !== undefined ? "file.leave" : "lobby.all");
  note.textContent = view?.parts.areBoxes === true ? t("view.boxes") : view?.simple === true ? t("view.simple") : "";
  view?.setLabel(t("view.label"));
  plots.rebuild();
  shown = "";
}

function setTheme(name: string): void {
  document.documentElement.dataset["theme"] = name;
  keep("theme", name);
  view?.setTheme();
  lobby?.setTheme();
  plots.rebuild();
}

languages.addEventListener("change", () => {
  setLanguage(languages.value);
  setWords();
});
const showHelp = (): void => showKeys(keysDialog, { plays: player !== undefined, hasHand: part !== undefined });
helpButton.addEventListener("click", showHelp);
fileButton.addEventListener("click", () => fileInput.click());
fileInput.addEventListener("change", () => {
  const file = fileInput.files?.[0];
  fileInput.value = ""; // the same one once more is a choice, too
  if (file !== undefined) drop(file);
});
themeButton.addEventListener("click", () => setTheme(document.documentElement.dataset["theme"] === "light" ? "dark" : "light"));
addEventListener("keydown", (event) => {
  const isText = (event.target instanceof HTMLInputElement && !["range", "checkbox", "radio", "button"].includes(event.target.type)) || event.target instanceof HTMLTextAreaElement;
  if (isReplaced || isText || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === " ") {
    // the stop comes before whatever has the focus: a list, a slider, a dialog
    event.preventDefault();
    if (event.repeat) return;
    if (player !== undefined) player.toggle();
    else void desk?.raise();
  }
  if (event.target instanceof HTMLInputElement || event.target instanceof HTMLSelectElement || document.querySelector("dialog[open]") !== null) return;
  if (part?.onKeyDown(event) === true || (lobby === undefined && tools?.onKeyDown(event) === true)) return;
  if (event.key === "r") view?.frame();
  if (event.key === "?") showHelp();
  if (event.key === "l") themeButton.click();
  if (event.key === ",") player?.step(-1);
  if (event.key === ".") player?.step(1);
});
addEventListener("keyup", (event) => {
  if (event.key === " " && event.target instanceof HTMLButtonElement) event.preventDefault(); // else it is pressed as well
});
// who leads may go to a step of the list
sections.steps.body.addEventListener("click", (event) => {
  const row = (event.target as HTMLElement).closest<HTMLElement>("li[data-step]");
  if (row === null) return;
  const name = row.dataset["step"] ?? "";
  if (player !== undefined) {
    const visit = session.steps.find((step) => step.name === name)?.started;
    if (visit !== undefined) player.seekTick(visit * 1000);
  } else if (desk?.role === "instructor" && !session.isOver) desk.goTo(name, row.querySelector(".name")?.textContent ?? name);
});
sections.people.body.addEventListener("click", (event) => {
  const { kick, takeOver, guide } = (event.target as HTMLElement).closest<HTMLElement>("button")?.dataset ?? {};
  if (kick !== undefined) desk?.remove(Number(kick));
  if (takeOver !== undefined && part?.handName !== undefined) void desk?.command("give", takeOver, part.handName);
  if (guide !== undefined) void desk?.command("guide", ...guide.split(" "));
});
sections.events.body.addEventListener("click", (event) => {
  const row = (event.target as HTMLElement).closest<HTMLElement>("li[data-tick]");
  if (row !== null) player?.seekTick(Number(row.dataset["tick"]));
});

// ---- showing it
let age = 0; // s since the last message
const chosen = wanted.get("session") ?? "";
let only = ""; // what this gateway shows, where that is one session or recording
const standing = (): Standing => ({ isDropping, opening, player, file: fileName, lobby, live, session, view, chosen, only, age, silence: source?.silence ?? 0 });
let shown = "";
let shownAt = 0;
let sought = 0; // places of a recording, when the last picture was drawn

/** Updates only the nodes that differ: keeps focus, presses and screen-reader output. */
function show(element: HTMLElement, nodes: Node[]): void {
  const before = element.querySelector("[aria-current]");
  renew(element, nodes);
  // not away from under a pointer or the focus
  if (element.querySelector("[aria-current]") !== before && !element.matches(":hover, :focus-within")) toCurrent(element);
}

/** Scrolls a list to what is current in it. */
function toCurrent(element: HTMLElement): void {
  const current = element.querySelector<HTMLElement>("[aria-current]");
  if (current !== null) element.scrollTop = current.offsetTop - element.offsetTop - element.clientHeight / 2;
}
new ResizeObserver(() => toCurrent(sections.steps.body)).observe(sections.steps.body);

function showPanels(): void {
  const [key, name, tone] = linkBadge(standing());
  link.className = `badge ${tone}`;
  show(link, [icon(name), document.createTextNode(t(key))]);
  title.textContent = lobby !== undefined ? "" : [session.title || t("title.none"), fileName].filter((text) => text !== "").join(" · ");
  document.title = session.title !== "" ? `${session.title} – Tenon` : "Tenon";
  time.textContent = clock(session.tick / 1000);
  const stop = stopOf(standing());
  strip.className = stop === undefined || stop.state === "none" ? "strip" : `strip ${stop.state}`;
  strip.hidden = (player !== undefined || opening !== undefined) && stop?.state !== "raised";
  show(stripText, stop === undefined ? [] : [icon(stop.icon), document.createTextNode(stop.text)]);
  desk?.show();
  part?.show();
  const whyNoSteps = desk?.whyNot("goto");
  const whyNoTaking = desk?.whyNot("give");
  app.classList.toggle("leads", player !== undefined || (desk?.role === "instructor" && !session.isOver && whyNoSteps === undefined));
  show(card, panels.instruction(session));
  // a seek begins with nothing known: a row that it brings back keeps its focus
  if (player?.isReading !== true) {
    show(sections.steps.body, panels.steps(session, app.classList.contains("leads")));
    show(sections.people.body, panels.people(session, { leads: desk?.role === "instructor" && !session.isOver && desk.whyCut() === undefined, hand: part?.handName, self: desk?.client, whyNoTaking: whyNoTaking && t(whyNoTaking) }));
    show(sections.events.body, panels.events(session, player !== undefined));
  }
  show(status, panels.status(session, age));
  const over = coverOf(standing());
  cover.hidden = over === undefined;
  cover.className = `cover${over?.covers === true ? " full" : ""}${over?.icon === "warn" ? " warns" : ""}`;
  cover.dataset["state"] = over?.state ?? "none";
  show(cover, over === undefined ? [] : [h("div", "", icon(over.icon), h("h2", "", over.head), h("p", "", ...marked(over.more)), ...(over.command ? [h("code", "", over.command)] : []), ...(over.leads === undefined ? [] : [Object.assign(h("a", "", over.leads), { href: "/" })]))]);
  const isBlank = isEmpty(over, standing());
  app.classList.toggle("blank", isBlank);
  time.hidden = isBlank || lobby !== undefined || player !== undefined; // a player has its own
  title.hidden = isBlank;
  const hasSession = session.link !== undefined && session.objects.size > 0;
  card.hidden = legend.hidden = !hasSession;
  const workspaceKey = legend.querySelector<HTMLElement>(".key-workspace");
  if (workspaceKey !== null) workspaceKey.hidden = view?.hasWorkspace !== true;
  document.body.classList.toggle("stale", player === undefined && (live.kind !== "open" || session.link?.state === "lost" || isSilent(standing())));
  view?.setCover(card.hidden || isPicture ? undefined : card);
}

let isReplaced = false; // by two pages beside each other

function frame(now: number): void {
  if (isReplaced) return;
  if (view?.headset.isDriving !== true) tick(now);
  requestAnimationFrame(frame);
}

/** Once for each frame of the window, or of a headset that draws. */
function tick(now: number): void {
  age = session.heard === 0 || session.isWaiting || player !== undefined ? 0 : (now - session.heard) / 1000;
  player?.update(now);
  lobby?.update(now);
  if (lobby !== undefined) desk?.renewAlarm();
  picture?.update(now);
  if (player?.isReading === true) return; // what is known of the place that is sought is not whole
  tools?.update(now);
  if (lobby === undefined) view?.update(session, now);
  // of a place that was just sought the scene comes first, the rest with the next pictures; in a drag now and then
  const isFresh = player !== undefined && player.sought !== sought;
  sought = player?.sought ?? 0;
  if (isFresh && now - shownAt < SOUGHT_PERIOD) return;
  plots.update(session, now);
  const hand = part?.hand;
  const state = `${hand?.views.length} ${hand?.isOn} ${hand?.current} ${hand?.isAligning} ${hand?.isDeepening} ${hand?.isFine} ${hand?.isTurning} ${session.changed} ${session.moved} ${JSON.stringify(live)} ${desk?.role} ${isDropping} ${opening?.fraction.toFixed(2)} ${opening?.problem} ${player?.problem} ${player?.isReading} ${view?.hasWorkspace} ${age > 0.5 ? age.toFixed(1) : ""} ${isHeard(standing())}`;
  if (now - shownAt >= PANEL_PERIOD && state !== shown) {
    shownAt = now;
    shown = state;
    showPanels();
  }
}

// ---- where the session comes from
function follow(room: string, { role, recordings, local }: Gateway): void {
  let joined = false;
  source = new LiveSource(addressOf(room), TOPICS, (topic, message, isGone) => {
    session.receive(topic, message, isGone);
    const isJoined = session.link?.state === "joined";
    if (isJoined && !joined) {
      void desk?.repeatStop();
      void desk?.takeSeatAgain();
    }
    joined = isJoined;
    if (topic === "EmergencyStop" || topic === "EmergencyClear" || topic === "NewestRaise" || topic === "RunState") desk?.hearStop();
  }, (state) => {
    live = state;
    if (state.kind !== "reconnecting") return;
    joined = false;
    desk?.loseSeat();
    part?.lose();
  });
  desk = new Desk(source, session, role);
  desk.canRecord = recordings === true;
  desk.isHeard = () => isHeard(standing());
  desk.whyCut = () => whyCut(standing());
  const { notify } = desk;
  if (view !== undefined) {
    part = new Part(source, session, view, (isGood, text) => notify.call(desk, isGood, text), () => void desk?.raise());
    part.isLocal = local === true;
    part.canClear = () => desk?.canClear === true;
    part.alarm = () => desk?.alarmText ?? "";
    part.whyCut = () => whyCut(standing());
    part.onLoss = (cause, again) => desk?.tellLoss("hand", t("part.lost", { reason: reasonOfLoss(cause) }), cause, t("part.take.again"), again);
    part.onTaken = () => desk?.withdraw("hand");
    strip.append(part.take);
    stage.append(part.bar);
    app.append(part.lesson);
    Object.assign(window, { tenon: { session, view, player, part } });
  }
  strip.prepend(desk.alarm);
  strip.append(desk.sit, desk.clear, desk.stop);
  strip.after(desk.bar);
  stage.append(desk.notices);
}

function showLobby(role: string): void {
  lobby = new Lobby();
  lobby.setWords();
  app.classList.add("shows-lobby");
  stage.append(lobby.element);
  source = new LiveSource(addressOf("/lobby"), ["/lobby"], (_, message) => lobby?.receive(message as LobbyState), (state) => {
    if (state.kind === "open") void desk?.repeatStop();
    live = state;
  });
  desk = new Desk(source, session, role, true);
  desk.unstopped = () => lobby?.unstopped ?? [];
  strip.prepend(desk.alarm);
  strip.append(desk.stop);
  stage.append(desk.notices);
}

let opens = 0;

async function play(file: Played): Promise<void> {
  const mine = ++opens; // of several files that are dropped one after the other the last one counts
  source?.close();
  part?.remove();
  desk?.end();
  lobby?.end();
  player?.end();
  [source, desk, part, lobby, player] = [undefined, undefined, undefined, undefined, undefined];
  app.classList.remove("shows-lobby");
  opening = { fraction: 0 };
  fileName = file === undefined ? ownFile : file instanceof File ? file.name : (file.split(/[?#]/)[0].split("/").pop() ?? "");
  // back to what this gateway shows else
  all.hidden = file === undefined || wanted.has(FRAME);
  setWords();
  session.forget();
  try {
    const recording = await Recording.open(file instanceof File ? fromFile(file) : await fromAddress(file ?? "/recording.mcap"), (topic, message, isGone) => mine === opens && session.receive(topic, message, isGone), (fraction) => mine === opens && (opening = { fraction }));
    if (mine !== opens) return;
    player = new Player(recording, session);
    status.before(player.element);
    if (wanted.has(FRAME)) player.onCommand = tellBeside;
    else player.allowCompare((other) => {
      isReplaced = true;
      showBeside(app, file, other, () => {
        isReplaced = false;
        requestAnimationFrame(frame);
      });
    });
    opening = undefined;
    const start = wanted.get("t");
    if (start === "end") player.seek(player.recording.seconds);
    else if (start !== null && Number.isFinite(Number(start))) player.seekTick(1000 * Number(start) || 1); // the first tick
  } catch (problem) {
    if (mine !== opens) return;
    console.warn(problem);
    opening = { fraction: 0, problem };
  }
  Object.assign(window, { tenon: { session, view, player } });
}

async function begin(): Promise<void> {
  const gateway = (await described) ?? { session: "", recording: "", role: "", protocol: PROTOCOL };
  ownFile = gateway.recording;
  only = gateway.session || gateway.recording;
  app.classList.toggle("framed", wanted.has(FRAME));
  all.hidden = chosen === "" || gateway.session !== "";
  if (wanted.has(FRAME)) playsBeside((file) => void play(file), () => player);
  else if (wanted.has(ADDRESS)) await play(wanted.get(ADDRESS) ?? "");
  else if (isElsewhere(standing())) return;
  else if (gateway.recording !== "") await play(undefined);
  else if (gateway.session === "" && chosen === "") showLobby(gateway.role);
  else follow(gateway.session === "" ? `/live/${encodeURIComponent(chosen)}` : "/live", gateway);
}

for (const name of ["dragover", "dragleave", "drop"] as const)
  addEventListener(name, (event) => {
    event.preventDefault();
    isDropping = name === "dragover" && event.dataTransfer?.types.includes("Files") === true;
    const file = name === "drop" ? event.dataTransfer?.files[0] : undefined;
    if (file !== undefined && !isReplaced) drop(file);
  });

/** A file must not end a session by mistake. */
function drop(file: File): void {
  const isRecording = file.name.toLowerCase().endsWith(".mcap");
  if (desk === undefined) void play(file);
  else if (!isRecording) desk.notify(false, t("drop.refused", { name: file.name }));
  else if (desk.role !== "" || part?.hand !== undefined) desk.askToLeave(file.name, () => void play(file));
  else void play(file);
}

setWords();
showTab("steps");
showPanels();
// for tests, and for whoever wants to look
Object.assign(window, { tenon: { session, view, player } });
void begin();
void Promise.race([described, new Promise((done) => setTimeout(done, DESCRIBED))]).then(() => requestAnimationFrame(frame)); // the session is asked for before anything is drawn
