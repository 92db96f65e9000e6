import "./style.css";

import { h, icon, type Icon } from "./dom";
import { LiveSource, type LiveState } from "./live";
import * as panels from "./panels";
import { ForcePlot } from "./plot";
import { SceneView } from "./scene";
import { Session, TOPICS } from "./session";
import { language, languageNames, nameOfLanguage, setLanguage, t, type Key } from "./strings";

const PROTOCOL = 3;
const PANEL_PERIOD = 100; // ms
const COMMAND = "./tenon demo";

const session = new Session();
let live: LiveState = { kind: "connecting" };

// ---- what the page consists of
setLanguage(language);
const theme = localStorage.getItem("theme") ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");
document.documentElement.dataset["theme"] = theme;

const title = h("span", "title");
const link = h("span", "badge info");
const time = h("time", "clock");
const languages = h("select", "");
const themeButton = h("button", "");
const strip = h("div", "strip");
strip.setAttribute("role", "status");
const stage = h("main", "stage");
const card = h("section", "card");
const cover = h("div", "cover");
cover.setAttribute("role", "status");
const tools = h("div", "tools");
const frameButton = h("button", "");
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
const side = h("aside", "side");
for (const [name, { head, body }] of Object.entries(sections)) side.append(h("section", `panel panel-${name}`, head, body));
const tabs = h("nav", "tabs");
const tabButtons = (["steps", "plots", "people"] as const).map((name) => {
  const button = h("button", "");
  button.addEventListener("click", () => showTab(name));
  tabs.append(button);
  return { name, button };
});
tools.append(frameButton);
stage.append(card, legend, tools, note, cover);
const brand = h("span", "brand", "Tenon");
document.getElementById("app")?.append(h("header", "top", brand, title, h("span", "grow"), time, link, languages, themeButton), strip, stage, tabs, side, status);

// ---- the scene and the plot
let view: SceneView | undefined;
try {
  // ?drawing=full or simple overrides what was found out about the graphics hardware
  view = new SceneView(stage, t("view.label"), new URLSearchParams(location.search).get("drawing"));
} catch (problem) {
  console.warn(problem);
}
const plot = new ForcePlot(plotHost, noForce);

// ---- words, light and dark
function showTab(name: string): void {
  side.dataset["tab"] = name;
  for (const tab of tabButtons) tab.button.setAttribute("aria-pressed", String(tab.name === name));
}

function setWords(): void {
  const heads: [HTMLElement, Key][] = [
    [sections.steps.head, "steps"], [sections.plots.head, "force"], [sections.people.head, "people"], [sections.events.head, "events"],
    [frameButton, "view.reset"], [themeButton, "theme"], [noForce, "force.none"],
  ];
  for (const [element, key] of heads) element.textContent = t(key);
  for (const { name, button } of tabButtons) button.textContent = t(`tab.${name}`);
  legend.replaceChildren(
    ...(["target", "within", "device", "contact"] as const).map((name) => h("span", `key-${name}`, h("i"), t(`legend.${name}`))),
  );
  languages.replaceChildren(...languageNames.map((name) => Object.assign(h("option", "", nameOfLanguage(name)), { value: name, selected: name === language })));
  languages.setAttribute("aria-label", t("language"));
  note.textContent = view?.simple === true ? t("view.simple") : "";
  view?.setLabel(t("view.label"));
  plot.rebuild();
  shown = "";
}

function setTheme(name: string): void {
  document.documentElement.dataset["theme"] = name;
  localStorage.setItem("theme", name);
  view?.setTheme();
  plot.rebuild();
}

languages.addEventListener("change", () => {
  setLanguage(languages.value);
  setWords();
});
themeButton.addEventListener("click", () => setTheme(document.documentElement.dataset["theme"] === "light" ? "dark" : "light"));
frameButton.addEventListener("click", () => view?.frame());
addEventListener("keydown", (event) => {
  const isTyping = event.target instanceof HTMLInputElement || event.target instanceof HTMLTextAreaElement || event.target instanceof HTMLSelectElement;
  if (isTyping || event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === "r") view?.frame();
  if (event.key === "l") themeButton.click();
});

// ---- how the connection stands
interface Cover { state: string; icon: Icon; head: string; more: string; command?: string; covers: boolean }

function coverOf(): Cover | undefined {
  const make = (state: string, name: Icon, covers: boolean, values = {}): Cover => {
    const more = `cover.${state}.more` as Key;
    return { state, icon: name, head: t(`cover.${state}` as Key), more: t(more, values), covers };
  };
  if (live.kind === "reconnecting") return make("reconnecting", "warn", session.link === undefined, { seconds: live.seconds });
  const { link: gateway } = session;
  if (live.kind === "connecting" || gateway === undefined) return make("connecting", "wait", true);
  if (gateway.protocol !== PROTOCOL) return make("protocol", "warn", true);
  if (gateway.state === "refused") return { state: "refused", icon: "warn", head: t("cover.refused"), more: gateway.reason, covers: true };
  if (gateway.state === "searching") return { ...make("searching", "wait", true), command: COMMAND };
  if (gateway.state === "lost") return make("lost", "warn", false);
  return view === undefined ? make("webgl", "warn", true) : undefined;
}

function linkBadge(): [Key, Icon, string] {
  if (live.kind === "reconnecting") return ["link.reconnecting", "warn", "warn"];
  switch (live.kind === "connecting" ? undefined : session.link?.state) {
    case "joined": return ["link.joined", "live", "good"];
    case "searching": return ["link.searching", "wait", "info"];
    case "refused": return ["link.refused", "warn", "bad"];
    case "lost": return ["link.lost", "warn", "bad"];
    case "ended": return ["link.ended", "over", "info"];
    default: return ["link.connecting", "wait", "info"];
  }
}

// ---- showing it
let shown = "";
let shownAt = 0;

/** Replaces the children only where that changes something, so that nothing is read out or loses its focus without reason. */
function show(element: HTMLElement, nodes: Node[]): void {
  const next = h("div", "", ...nodes);
  if (next.innerHTML === element.innerHTML) return;
  element.replaceChildren(...next.childNodes);
  const current = element.querySelector<HTMLElement>("[aria-current]");
  if (current !== null) element.scrollTop = current.offsetTop - element.offsetTop - element.clientHeight / 2;
}

function showPanels(age: number): void {
  const [key, name, tone] = linkBadge();
  link.className = `badge ${tone}`;
  show(link, [icon(name), document.createTextNode(t(key))]);
  title.textContent = session.link?.title || t("title.none");
  document.title = session.link?.title ? `${session.link.title} – Tenon` : "Tenon";
  time.textContent = panels.clock(session.tick / 1000);
  const { text, isRaised } = panels.strip(session);
  strip.className = isRaised ? "strip raised" : "strip";
  show(strip, [icon(isRaised ? "stop" : "done"), document.createTextNode(text)]);
  show(card, panels.instruction(session));
  show(sections.steps.body, panels.steps(session));
  show(sections.people.body, panels.people(session));
  show(sections.events.body, panels.events(session));
  show(status, panels.status(session, age));
  const over = coverOf();
  cover.hidden = over === undefined;
  cover.className = over?.covers === true ? "cover full" : "cover";
  cover.dataset["state"] = over?.state ?? "none";
  show(cover, over === undefined ? [] : [h("div", "", icon(over.icon), h("h2", "", over.head), h("p", "", over.more), ...(over.command ? [h("code", "", over.command)] : []))]);
  const hasSession = session.link !== undefined && session.objects.size > 0;
  card.hidden = legend.hidden = !hasSession;
  document.body.classList.toggle("stale", live.kind !== "open" || session.link?.state === "lost");
}

function frame(now: number): void {
  const age = session.heard === 0 ? 0 : (now - session.heard) / 1000;
  view?.update(session, now);
  plot.update(session, now);
  const state = `${session.changed} ${session.moved} ${live.kind} ${age > 0.5 ? age.toFixed(1) : ""}`;
  if (now - shownAt >= PANEL_PERIOD && state !== shown) {
    shownAt = now;
    shown = state;
    showPanels(age);
  }
  requestAnimationFrame(frame);
}

setWords();
showTab("steps");
showPanels(0);
const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`;
new LiveSource(address, TOPICS, (topic, message, isGone) => session.receive(topic, message, isGone), (state) => (live = state));
requestAnimationFrame(frame);

// for tests, and for whoever wants to look
Object.assign(window, { tenon: { session, view } });
