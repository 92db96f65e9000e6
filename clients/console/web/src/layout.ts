// What the page consists of around the scene, before anything is known of a session.
import { h, icon } from "./dom";
import { language, languageNames, nameOfLanguage, t, type Key } from "./strings";

export const title = h("span", "title");
export const link = h("span", "badge info");
export const time = h("time", "clock");
export const languages = h("select", "");
export const themeButton = h("button", "");
export const helpButton = h("button", "help");
export const fileButton = h("button", "open-file");
export const fileInput = Object.assign(h("input"), { type: "file", accept: ".mcap", hidden: true });
export const strip = h("div", "strip");
export const stage = h("main", "stage");
export const card = h("section", "card");
export const cover = h("div", "cover");
cover.setAttribute("role", "status");
export const legend = h("div", "legend");
export const note = h("p", "note");
export const status = h("footer", "status");
export const sections = {
  steps: { head: h("h2"), body: h("div", "body") },
  plots: { head: h("h2"), body: h("div", "body plot") },
  people: { head: h("h2"), body: h("div", "body") },
  events: { head: h("h2"), body: h("div", "body") },
};
export const noForce = h("p", "muted");
export const plotHost = h("div");
sections.plots.body.append(noForce, plotHost);
const side = h("aside", "side");
for (const [name, { head, body }] of Object.entries(sections)) {
  // scrolled by keys, too
  body.tabIndex = 0;
  body.setAttribute("role", "group");
  side.append(h("section", `panel panel-${name}`, head, body));
}
const tabs = h("nav", "tabs");
const tabButtons = (["steps", "plots", "people", "events"] as const).map((name) => {
  const button = h("button", "");
  button.addEventListener("click", () => showTab(name));
  tabs.append(button);
  return { name, button };
});
stage.append(card, legend, note, cover);
const brand = h("span", "brand", "Tenon");
export const all = Object.assign(h("a", "all"), { href: "/", hidden: true });
export const stripText = h("span", "strip-text");
const top_ = h("header", "top", brand, all, title, h("span", "grow"), time, link, fileButton, fileInput, helpButton, languages, themeButton);
export const app = document.getElementById("app") as HTMLElement;
strip.append(stripText);
stripText.setAttribute("role", "status");

export function showElements(): void {
  app.append(top_, strip, stage, tabs, side, status);
}

/** One of them on a phone. */
export function showTab(name: string): void {
  side.dataset["tab"] = name;
  for (const tab of tabButtons) tab.button.setAttribute("aria-pressed", String(tab.name === name));
}

export function setWordsOfElements(): void {
  const heads: [HTMLElement, Key][] = [
    [sections.steps.head, "steps"], [sections.plots.head, "plots"], [sections.people.head, "people"], [sections.events.head, "events"],
    [noForce, "force.none"],
  ];
  for (const [element, key] of heads) element.textContent = t(key);
  for (const { head, body } of Object.values(sections)) body.setAttribute("aria-label", head.textContent);
  for (const { name, button } of tabButtons) button.textContent = t(`tab.${name}`);
  legend.replaceChildren(
    ...(["target", "within", "device", "contact", "workspace"] as const).map((name) => h("span", `key-${name}`, h("i"), t(`legend.${name}`))),
  );
  languages.replaceChildren(...languageNames.map((name) => Object.assign(h("option", "", nameOfLanguage(name)), { value: name, selected: name === language })));
  languages.setAttribute("aria-label", t("language"));
  for (const [button, name, key] of [[themeButton, "half", "theme"], [helpButton, "help", "keys.open"], [fileButton, "open", "file.open"]] as const) {
    button.replaceChildren(icon(name));
    button.setAttribute("aria-label", t(key));
    button.title = t(key);
  }
}
