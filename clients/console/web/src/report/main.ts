// A report: tables, plots and the session itself, all inside this page.
import "../style.css";
import "./report.css";

import { setAssetSource } from "../assets";
import { h, icon } from "../dom";
import { textOf as eventText } from "../eventtext";
import * as panels from "../panels";
import { Player } from "../player";
import { fromBytes, Recording } from "../recording";
import { SceneView } from "../scene";
import { Session } from "../session";
import { keep, kept, language, languageNames, locale, localized, n, nameOfLanguage, retold, setLanguage, SPEAKERS, t } from "../strings";
import { bytesOf, readReport, type Report, type ReportEvent, type Visit } from "./data";
import { Plots } from "./plots";
import * as tables from "./tables";
import { kindIn, r, said } from "./texts";

const PANEL_PERIOD = 100; // ms
const PICTURE = 34; // [ticks] between two poses
const FIRST = 0.2; // [s] after the begin of the first step all objects are known
// #t=SECONDS shows that moment of the session; #picture nothing but the scene
const wanted = new URLSearchParams(location.hash.slice(1));
const isPicture = wanted.has("picture");

const session = new Session();
/** Who has no name is called by the role. */
const nameWithRole = (name: string, role: string): string => (name === role ? name : `${name} (${role})`);
let view: SceneView | undefined;
let player: Player | undefined;
let problem = "";

setLanguage(language);
document.documentElement.dataset["theme"] = isPicture ? "light" : (kept("theme") ?? (matchMedia("(prefers-color-scheme: dark)").matches ? "dark" : "light"));

const languages = h("select");
const themeButton = h("button", "", icon("half"));
const title = h("span", "title");
const top_ = h("header", "top", h("span", "brand", "Tenon"), title, h("span", "grow"), languages, themeButton);
const head = h("section", "head");
const show = h("section", "show");
const stage = h("div", "stage");
const card = h("section", "card");
const legend = h("div", "legend");
const frameButton = h("button");
const printed = h("canvas", "printed");
const remarks = h("div", "remarks");
const stepsSection = h("section", "steps-section");
const plotsHead = h("h2");
const plotsNote = h("p", "remark");
const plotsSection = h("section", "plots-section");
const eventsSection = h("section");
const engineersSection = h("section");
const performanceSection = h("section");
const footer = h("footer");

/** The recording has the titles in all of its languages, the summary in one. */
function titleOf(visit: Visit): string {
  const step = [...session.sceneSteps.values()].find(({ name }) => name === visit.name);
  const text = (step === undefined ? "" : localized(step.title)) || visit.title || visit.name;
  return visit.attempt > 1 ? r("step.attempt", { title: text, attempt: visit.attempt }) : text;
}

/** Why the session ended. */
function wordsOf(reason: string): string {
  const text = eventText(session, { kind: "run", text: reason });
  return text === reason ? said(text) : text;
}

/** What the server wrote, in the language of this page and with titles instead of names. */
function words(event: ReportEvent): string {
  const text = eventText(session, event);
  return text === event.text ? said(text) : text;
}

class Page {
  private plots: Plots;
  private hasSession = bytesOf("recording") !== undefined;
  private app = document.getElementById("app") as HTMLElement;
  private shown = -1;
  private shownAt = 0;
  private named = 0; // objects and steps whose titles are known

  constructor(private report: Report) {
    const textOf = (event: ReportEvent): string => `${kindIn(event.kind)}: ${tables.textOf(event, words)}`;
    this.plots = new Plots(report, titleOf, textOf, (seconds) => this.pick(seconds, false));
    plotsSection.append(plotsHead, this.plots.element, plotsNote);
    this.app.append(top_, h("main", "report", head, show, stepsSection, plotsSection, eventsSection, engineersSection, performanceSection, footer));
    show.classList.toggle("empty", !this.hasSession);
    document.body.classList.toggle("picture", isPicture);
    this.listen();
    this.listenToPrinter();
    this.setWords();
    void this.open().catch((reason) => (problem = reason instanceof Error ? reason.message : String(reason))).finally(() => {
      if (!this.hasSession || problem !== "") show.append(remarks);
      this.setWords();
      Object.assign(window, { tenon: { report, session, view, player, plots: this.plots, isReady: true } });
      requestAnimationFrame((now) => this.frame(now));
    });
  }

  private pick(seconds: number, scrolls: boolean): void {
    if (player === undefined) return;
    player.seekTick(1000 * seconds + PICTURE); // what is there has the poses of the tick after
    if (scrolls && show.getBoundingClientRect().top < 0) show.scrollIntoView({ block: "start" });
  }

  private setWords(): void {
    const { report } = this;
    this.setHead();
    legend.replaceChildren(...(["target", "within", "device", "contact"] as const).map((key) => h("span", `key-${key}`, h("i"), t(`legend.${key}`))));
    frameButton.textContent = t("view.reset");
    stepsSection.replaceChildren(...tables.steps(report, titleOf, (part) => session.retitled(part)));
    plotsHead.textContent = r("plots");
    plotsNote.textContent = r("plots.marks");
    eventsSection.replaceChildren(...tables.events(report, words));
    engineersSection.replaceChildren(...tables.engineers(report, titleOf));
    performanceSection.replaceChildren(...tables.performance(report));
    this.setFooter();
    remarks.replaceChildren(...this.notes().map((note) => h("p", "remark", note)));
    view?.setLabel(t("view.label"));
    player?.setWords();
    this.plots.rebuild();
    this.shown = -1;
  }

  private setHead(): void {
    const { summary } = this.report;
    const name = session.title || summary.title || summary.session;
    document.title = `${name} – ${r("report")}`;
    title.textContent = r("report");
    languages.replaceChildren(...languageNames.map((known) => Object.assign(h("option", "", nameOfLanguage(known)), { value: known, selected: known === language })));
    languages.setAttribute("aria-label", t("language"));
    for (const attribute of ["aria-label", "title"]) themeButton.setAttribute(attribute, t("theme"));
    const date = new Date(summary.began_ns / 1e6).toLocaleString(locale(), { dateStyle: "long", timeStyle: "short", timeZone: "UTC" });
    const people = summary.people.filter(({ role }) => role !== "recorder").map(({ name: known, role }) => nameWithRole(retold(known, ...SPEAKERS), said(role)));
    const facts = [r("date", { date }), ...people, ...(summary.lockstep ? [r("lockstep")] : [])];
    const outcome = h("span", `outcome ${summary.succeeded ? "good" : "bad"}`, icon(summary.succeeded ? "done" : "warn"), said(summary.outcome));
    head.replaceChildren(h("h1", "", name), h("p", "muted", facts.join(" · ")), h("p", "", outcome, " ", h("span", "muted", wordsOf(summary.reason))),
      ...(summary.problem === "" ? [] : [h("p", "warning", h("b", "warn", r("warning")), ` ${summary.problem}`)]), tables.tiles(this.report));
  }

  private setFooter(): void {
    const { summary } = this.report;
    const hash = Number(`0x${summary.final_hash}`) === 0 ? "" : `, ${r("footer.hash", { hash: summary.final_hash })}`;
    const licences = document.querySelector("script[data-name=licences]")?.textContent ?? "";
    footer.replaceChildren(r("footer", { file: summary.recording, messages: summary.messages }) + hash, h("details", "", h("summary", "", r("footer.licences")), h("pre", "", licences)));
  }

  /** What the player does not show, and why. */
  private notes(): string[] {
    const { player: inside, no_player: none = "" } = this.report;
    return [
      ...(none === "" ? [] : [r("player.none", { reason: said(none) })]), ...(problem === "" ? [] : [r("player.failed", { reason: problem })]),
      ...(inside !== undefined && inside.rate < 29 ? [r("player.rate", { rate: n(inside.rate, inside.rate < 3 ? 1 : 0) })] : []),
      ...(inside !== undefined && inside.models < inside.objects ? [r("player.models", { missing: inside.objects - inside.models, objects: inside.objects })] : []),
      ...(view?.simple === true ? [t("view.simple")] : []), ...(this.hasSession && view === undefined ? [t("cover.webgl"), t("cover.webgl.more")] : []),
    ];
  }

  private setTheme(name: string): void {
    document.documentElement.dataset["theme"] = name;
    view?.setTheme();
    this.plots.rebuild();
  }

  private listen(): void {
    languages.addEventListener("change", () => {
      setLanguage(languages.value);
      this.setWords();
    });
    themeButton.addEventListener("click", () => {
      this.setTheme(document.documentElement.dataset["theme"] === "light" ? "dark" : "light");
      keep("theme", document.documentElement.dataset["theme"] ?? "light");
    });
    frameButton.addEventListener("click", () => view?.frame());
    this.app.addEventListener("click", (event) => {
      const row = (event.target as HTMLElement).closest<HTMLElement>("tr[data-time]");
      if (row !== null) this.pick(Number(row.dataset["time"]), true);
    });
    show.addEventListener("keydown", (event) => {
      if (player === undefined || event.target instanceof HTMLSelectElement || event.ctrlKey || event.metaKey || event.altKey) return;
      if (event.key === " " && !(event.target instanceof HTMLButtonElement)) {
        event.preventDefault();
        player.toggle();
      }
      if (event.key === "r") view?.frame();
      if (event.key === ",") player.step(-1);
      if (event.key === ".") player.step(1);
    });
  }

  /** On paper: light, and the scene as it is shown. */
  private listenToPrinter(): void {
    let before = "light";
    addEventListener("beforeprint", () => {
      before = document.documentElement.dataset["theme"] ?? "light";
      if (before !== "light") this.setTheme("light");
      view?.copyTo(printed);
    });
    addEventListener("afterprint", () => before !== "light" && this.setTheme(before));
  }

  private frame(now: number): void {
    player?.update(now);
    view?.update(session, now);
    if (session.moved + session.changed !== this.shown && now - this.shownAt >= PANEL_PERIOD) this.showMoment(now);
    requestAnimationFrame((next) => this.frame(next));
  }

  private showMoment(now: number): void {
    this.shown = session.moved + session.changed;
    this.shownAt = now;
    const names = session.sceneSteps.size + session.objects.size + (session.sceneTitle === undefined ? 0 : 1);
    if (names > this.named) {
      this.named = names; // titles instead of names
      this.setWords();
    }
    card.replaceChildren(...panels.instruction(session));
    view?.setCover(card);
    this.plots.showTime(session.tick / 1000);
  }

  private async open(): Promise<void> {
    const bytes = bytesOf("recording");
    if (bytes === undefined) return;
    setAssetSource((name) => {
      const model = bytesOf(name);
      return model === undefined ? Promise.reject(new Error(`asset ${name}: is not in this report`)) : Promise.resolve(model.buffer);
    });
    stage.append(card, legend, h("div", "tools", frameButton), printed);
    show.append(stage, remarks);
    try {
      view = new SceneView(stage, t("view.label"), wanted.get("drawing"));
    } catch (reason) {
      console.warn(reason);
    }
    const recording = await Recording.open(fromBytes(bytes), (topic, message, isGone) => session.receive(topic, message, isGone), () => {});
    player = new Player(recording, session);
    stage.after(player.element);
    // before the first step there is little to see
    const start = Number(wanted.get("t") ?? (this.report.summary.steps[0]?.begin ?? 0) + FIRST);
    if (start > 0) player.seekTick(1000 * start);
  }
}

try {
  new Page(readReport());
} catch (reason) {
  document.body.textContent = reason instanceof Error ? reason.message : String(reason);
}
