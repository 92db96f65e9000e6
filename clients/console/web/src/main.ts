import "./style.css";

import { FRAME, playsBeside, showBeside, tellBeside, type Played } from "./beside";
import { coverOf, isEmpty, isSilent, linkBadge, PROTOCOL, type Opening, type Standing } from "./cover";
import { Desk, PASS } from "./desk";
import { h, icon, marked, renew } from "./dom";
import { addressOf, LiveSource, type LiveState } from "./live";
import { Lobby } from "./lobby";
import type { Gateway, LobbyState } from "./messages";
import { Labels } from "./labels";
import * as panels from "./panels";
import { Part } from "./part";
import { Plots } from "./plot";
import { Player } from "./player";
import { fromAddress, fromFile, Recording } from "./recording";
import { SceneView } from "./scene";
import { Session, TOPICS } from "./session";
import { ViewTools } from "./viewtools";
import { keep, kept, language, languageNames, nameOfLanguage, setLanguage, t, type Key } from "./strings";

const PANEL_PERIOD = 100; // ms

// ?picture is nothing but the scene: of it `tenon picture` makes its pictures, and waits until it is complete
const wanted = new URLSearchParams(location.search);
const isPicture = wanted.has("picture");
const SETTLED = 1000; // [ms] without a change
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

const title = h("span", "title");
const link = h("span", "badge info");
const time = h("time", "clock");
const languages = h("select", "");
const themeButton = h("button", "");
const strip = h("div", "strip");
const stage = h("main", "stage");
const card = h("section", "card");
const cover = h("div", "cover");
cover.setAttribute("role", "status");
const legend = h("div", "legend");
const note = h("p", "note");
const status = h("footer", "status");
const sections = {
  steps: { head: h("h2"), body: h("div", "body") },
  plots: { head: h("h2"), body: h("div", "body plot") },
  people: { head: h("h2"), body: h("div", "body") },
  events: { head: h("h2"), body: h("div", "body") },
};
const noForce = h("p", "muted");
const plotHost = h("div");
sections.plots.body.append(noForce, plotHost);
sections.plots.body.tabIndex = 0;
const side = h("aside", "side");
for (const [name, { head, body }] of Object.entries(sections)) {
  // scrolled by keys, too
  body.tabIndex = 0;
  body.setAttribute("role", "group");
  side.append(h("section", `panel panel-${name}`, head, body));
}
const tabs = h("nav", "tabs");
const tabButtons = (["steps", "plots", "people"] as const).map((name) => {
  const button = h("button", "");
  button.addEventListener("click", () => showTab(name));
  tabs.append(button);
  return { name, button };
});
stage.append(card, legend, note, cover);
const brand = h("span", "brand", "Tenon");
const all = Object.assign(h("a", "all"), { href: "/", hidden: true });
const stripText = h("span", "strip-text");
const top_ = h("header", "top", brand, all, title, h("span", "grow"), time, link, languages, themeButton);
const app = document.getElementById("app") as HTMLElement;
app.append(top_, strip, stage, tabs, side, status);
strip.append(stripText);
stripText.setAttribute("role", "status");

// ---- the scene and the plot
let view: SceneView | undefined;
try {
  // ?drawing=full or simple overrides what was found out about the graphics hardware
  view = new SceneView(stage, t("view.label"), wanted.get("drawing"));
} catch (problem) {
  console.warn(problem);
}
const tools = view === undefined ? undefined : new ViewTools(view, session);
if (view !== undefined && tools !== undefined) {
  const labels = new Labels(view);
  labels.from(() => tools.labels());
  labels.from(() => (isPicture ? [] : panels.holders(session)));
  view.canvas.after(labels.element);
  stage.append(tools.element);
}
const plots = new Plots(plotHost, noForce);
sections.plots.head.after(plots.choice);

// ---- words, light and dark
function showTab(name: string): void {
  side.dataset["tab"] = name;
  for (const tab of tabButtons) tab.button.setAttribute("aria-pressed", String(tab.name === name));
}

function setWords(): void {
  const heads: [HTMLElement, Key][] = [
    [sections.steps.head, "steps"], [sections.plots.head, "plots"], [sections.people.head, "people"], [sections.events.head, "events"],
    [noForce, "force.none"],
  ];
  desk?.setWords();
  part?.setWords();
  player?.setWords();
  lobby?.setWords();
  tools?.setWords();
  for (const [element, key] of heads) element.textContent = t(key);
  all.textContent = t(wanted.has(ADDRESS) || opening !== undefined || player !== undefined ? "file.leave" : "lobby.all");
  for (const { head, body } of Object.values(sections)) body.setAttribute("aria-label", head.textContent);
  for (const { name, button } of tabButtons) button.textContent = t(`tab.${name}`);
  legend.replaceChildren(
    ...(["target", "within", "device", "contact", "workspace"] as const).map((name) => h("span", `key-${name}`, h("i"), t(`legend.${name}`))),
  );
  languages.replaceChildren(...languageNames.map((name) => Object.assign(h("option", "", nameOfLanguage(name)), { value: name, selected: name === language })));
  themeButton.replaceChildren(icon("half"));
  themeButton.setAttribute("aria-label", t("theme"));
  themeButton.title = t("theme");
  languages.setAttribute("aria-label", t("language"));
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
themeButton.addEventListener("click", () => setTheme(document.documentElement.dataset["theme"] === "light" ? "dark" : "light"));
addEventListener("keydown", (event) => {
  const isText = (event.target instanceof HTMLInputElement && !["range", "checkbox", "radio", "button"].includes(event.target.type)) || event.target instanceof HTMLTextAreaElement;
  if (isText || event.ctrlKey || event.metaKey || event.altKey) return;
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
const standing = (): Standing => ({ isDropping, opening, player, lobby, live, session, view, age });
let shown = "";
let shownAt = 0;

/** Changes only what is another, so that nothing is read out, loses its focus or a press without reason. */
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

function showPanels(sinceLast: number): void {
  age = sinceLast;
  const silent = isSilent(standing());
  const [key, name, tone] = linkBadge(standing());
  link.className = `badge ${tone}`;
  show(link, [icon(name), document.createTextNode(t(key))]);
  title.textContent = lobby !== undefined ? "" : [session.link?.title || t("title.none"), fileName].filter((text) => text !== "").join(" · ");
  document.title = session.link?.title ? `${session.link.title} – Tenon` : "Tenon";
  time.textContent = panels.clock(session.tick / 1000);
  const { text, isRaised } = panels.strip(session);
  strip.className = isRaised ? "strip raised" : "strip";
  strip.hidden = (player !== undefined || opening !== undefined) && !isRaised;
  show(stripText, lobby !== undefined || session.objects.size === 0 ? [] : silent && !isRaised ? [icon("warn"), document.createTextNode(t("stop.unknown"))] : [icon(isRaised ? "stop" : "done"), document.createTextNode(text)]);
  desk?.show();
  part?.show();
  const whyNoSteps = desk?.whyNot("goto");
  const whyNoTaking = desk?.whyNot("give");
  app.classList.toggle("leads", player !== undefined || (desk?.role === "instructor" && !session.isOver && whyNoSteps === undefined));
  show(card, panels.instruction(session));
  // a seek begins with nothing known: a row that it brings back keeps its focus
  if (player?.isReading !== true) {
    show(sections.steps.body, panels.steps(session, app.classList.contains("leads")));
    show(sections.people.body, panels.people(session, { leads: desk?.role === "instructor" && !session.isOver, hand: part?.handName, whyNoTaking: whyNoTaking && t(whyNoTaking) }));
    show(sections.events.body, panels.events(session, player !== undefined));
  }
  show(status, panels.status(session, age));
  const over = coverOf(standing());
  cover.hidden = over === undefined;
  cover.className = `cover${over?.covers === true ? " full" : ""}${over?.icon === "warn" ? " warns" : ""}`;
  cover.dataset["state"] = over?.state ?? "none";
  show(cover, over === undefined ? [] : [h("div", "", icon(over.icon), h("h2", "", over.head), h("p", "", ...marked(over.more)), ...(over.command ? [h("code", "", over.command)] : []))]);
  const isBlank = isEmpty(over, standing());
  app.classList.toggle("blank", isBlank);
  time.hidden = isBlank || lobby !== undefined || player !== undefined; // a player has its own
  title.hidden = isBlank;
  const hasSession = session.link !== undefined && session.objects.size > 0;
  card.hidden = legend.hidden = !hasSession;
  const workspaceKey = legend.querySelector<HTMLElement>(".key-workspace");
  if (workspaceKey !== null) workspaceKey.hidden = view?.hasWorkspace !== true;
  document.body.classList.toggle("stale", player === undefined && (live.kind !== "open" || session.link?.state === "lost" || silent));
  view?.setCover(card.hidden || isPicture ? undefined : card);
}

let isReplaced = false; // by two pages beside each other

function frame(now: number): void {
  if (isReplaced) return;
  const sinceLast = session.heard === 0 || player !== undefined ? 0 : (now - session.heard) / 1000;
  player?.update(now);
  lobby?.update(now);
  tools?.update();
  if (lobby === undefined) view?.update(session, now);
  if (isPicture) picture(now);
  plots.update(session, now);
  const hand = part?.hand;
  const state = `${hand?.views.length} ${hand?.isOn} ${hand?.current} ${hand?.isAligning} ${hand?.isDeepening} ${hand?.isFine} ${hand?.isTurning} ${session.changed} ${session.moved} ${JSON.stringify(live)} ${desk?.role} ${isDropping} ${opening?.fraction.toFixed(2)} ${opening?.problem} ${player?.problem} ${player?.isReading} ${view?.hasWorkspace} ${sinceLast > 0.5 ? sinceLast.toFixed(1) : ""}`;
  if (now - shownAt >= PANEL_PERIOD && state !== shown) {
    shownAt = now;
    shown = state;
    showPanels(sinceLast);
  }
  requestAnimationFrame(frame);
}

let settled = 0;
let told = "";

/** Says when the picture is complete, or why it cannot be. */
function picture(now: number): void {
  const over = coverOf(standing());
  const { dataset } = document.body;
  if (over !== undefined && ["file", "refused", "webgl", "protocol", "lost"].includes(over.state)) dataset["picture"] = `${over.head}: ${over.more}`;
  const state = `${session.objects.size} ${session.step?.revision} ${view?.models} ${player?.isReading}`;
  if (view?.isComplete !== true || player?.isReading === true || state !== told) settled = now;
  told = state;
  if (now - settled < SETTLED) return;
  if (wanted.has("near") && session.step !== undefined && dataset["near"] === undefined) {
    dataset["near"] = "";
    tools?.showWork();
    settled = now;
  } else dataset["picture"] = "ready";
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
    if (topic === "EmergencyStop" || topic === "EmergencyClear" || topic === "RunState") desk?.hearStop();
  }, (state) => {
    live = state;
    if (state.kind !== "reconnecting") return;
    joined = false;
    desk?.loseSeat();
    part?.end();
  });
  desk = new Desk(source, session, role);
  desk.canRecord = recordings === true;
  const { notify } = desk;
  if (view !== undefined) {
    part = new Part(source, session, view, () => sessionStorage.getItem(PASS) ?? "", (isGood, text) => notify.call(desk, isGood, text), () => void desk?.raise());
    part.isLocal = local === true;
    part.alarm = () => desk?.alarmText ?? "";
    part.onLoss = (reason, again) => desk?.offer("hand", t("part.lost", { reason }), t("part.take.again"), again);
    part.onTaken = () => desk?.withdraw("hand");
    strip.append(part.take);
    stage.append(part.bar, part.lesson);
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
  player?.element.remove();
  [source, desk, part, lobby, player] = [undefined, undefined, undefined, undefined, undefined];
  app.classList.remove("shows-lobby");
  opening = { fraction: 0 };
  fileName = file === undefined ? ownFile : file instanceof File ? file.name : (file.split(/[?#]/)[0].split("/").pop() ?? "");
  // back to what this gateway shows else
  all.hidden = file === undefined || wanted.has(FRAME);
  setWords();
  session.forget();
  try {
    const recording = await Recording.open(file instanceof File ? fromFile(file) : await fromAddress(file ?? "/recording.mcap"), (topic, message, isGone) => session.receive(topic, message, isGone), (fraction) => mine === opens && (opening = { fraction }));
    if (mine !== opens) return;
    player = new Player(recording, session, (name) => panels.titleOfStep([...session.sceneSteps.values()].find((step) => step.name === name) ?? { name, title: [] }));
    status.before(player.element);
    if (wanted.has(FRAME)) player.onCommand = tellBeside;
    else player.allowCompare((other) => {
      isReplaced = true;
      view?.end();
      showBeside(app, file, other);
    });
    opening = undefined;
    const start = wanted.get("t") === "end" ? player.recording.seconds : Number(wanted.get("t") ?? 0);
    if (start > 0) player.seek(start);
  } catch (problem) {
    if (mine !== opens) return;
    opening = { fraction: 0, problem: problem instanceof Error ? problem.message : String(problem) };
  }
  Object.assign(window, { tenon: { session, view, player } });
}

async function begin(): Promise<void> {
  const gateway = (await described) ?? { session: "", recording: "", role: "", protocol: PROTOCOL };
  const chosen = wanted.get("session");
  ownFile = gateway.recording;
  app.classList.toggle("framed", wanted.has(FRAME));
  all.hidden = chosen === null || gateway.session !== "";
  if (wanted.has(FRAME)) playsBeside((file) => void play(file), () => player);
  else if (wanted.has(ADDRESS)) await play(wanted.get(ADDRESS) ?? "");
  else if (gateway.recording !== "") await play(undefined);
  else if (gateway.session === "" && chosen === null) showLobby(gateway.role);
  else follow(gateway.session === "" ? `/live/${encodeURIComponent(chosen ?? "")}` : "/live", gateway);
}

for (const name of ["dragover", "dragleave", "drop"] as const)
  addEventListener(name, (event) => {
    event.preventDefault();
    isDropping = name === "dragover" && event.dataTransfer?.types.includes("Files") === true;
    const file = name === "drop" ? event.dataTransfer?.files[0] : undefined;
    if (file !== undefined) void play(file);
  });

setWords();
showTab("steps");
showPanels(0);
// for tests, and for whoever wants to look
Object.assign(window, { tenon: { session, view, player } });
void begin();
void Promise.race([described, new Promise((done) => setTimeout(done, SETTLED))]).then(() => requestAnimationFrame(frame)); // the session is asked for before anything is drawn
