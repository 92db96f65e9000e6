// The texts of the page: one file a language. Another language is one more file and its line here.
import de from "./strings/de.json";
import en from "./strings/en.json";

export type Key = keyof typeof en;
const languages: Record<string, Record<Key, string>> = { en, de };

/** For whom something is kept: for all pages of this browser, or for this tab. */
type Keeper = "browser" | "tab";
const unkept = new Map<string, string>(); // what the browser does not keep: where site data is blocked, and of a page that was opened as a file
const storageOf = (keeper: Keeper): Storage => (keeper === "tab" ? sessionStorage : localStorage);

/** What was kept for the page. Storage throws where site data is blocked. */
export function kept(name: string, keeper: Keeper = "browser"): string | null {
  const own = unkept.get(`${keeper} ${name}`);
  if (own !== undefined) return own;
  try {
    return storageOf(keeper).getItem(name);
  } catch {
    return null;
  }
}

/** null: no longer. What cannot be kept lasts as long as this page. */
export function keep(name: string, value: string | null, keeper: Keeper = "browser"): void {
  unkept.delete(`${keeper} ${name}`);
  try {
    if (value === null) storageOf(keeper).removeItem(name);
    else storageOf(keeper).setItem(name, value);
  } catch {
    if (value !== null) unkept.set(`${keeper} ${name}`, value);
  }
}

function initial(): string {
  // outside of a browser, as where a program reads a recording, there is none
  const preferred = typeof navigator === "undefined" ? [] : (navigator.languages ?? []);
  const wanted = [kept("language"), ...preferred.map((name) => name.slice(0, 2))];
  return wanted.find((name) => name !== null && name in languages) ?? "en";
}

export let language = initial();
export const languageNames = Object.keys(languages);

export function setLanguage(name: string): void {
  language = name in languages ? name : "en";
  keep("language", language);
  document.documentElement.lang = language;
}

/** How people of this language write dates and numbers: day before month in English, too. */
export function locale(): string {
  return language === "en" ? "en-GB" : language;
}

const formats = new Map<string, Intl.NumberFormat>();
function written(value: number, options: Intl.NumberFormatOptions): string {
  const key = `${locale()} ${JSON.stringify(options)}`;
  let format = formats.get(key);
  if (format === undefined) formats.set(key, (format = new Intl.NumberFormat(locale(), options)));
  return format.format(value);
}

/** A number as people of this language write it, with so many decimals. */
export function n(value: number, digits: number): string {
  return written(value, { minimumFractionDigits: digits, maximumFractionDigits: digits, useGrouping: Math.abs(value) >= 1e4 });
}

/** Minutes and seconds. */
export function clock(seconds: number): string {
  const whole = Math.max(0, Math.floor(seconds));
  return `${Math.floor(whole / 60)}:${String(whole % 60).padStart(2, "0")}`;
}

const FRAME = 0.05; // [s] by which what is shown may be older than the place that was sought

/** Likewise of a session, of which what is before its first tick is less than 0. */
export function moment(seconds: number): string {
  const text = clock(Math.abs(seconds) + FRAME);
  return seconds < 0 && text !== clock(0) ? `−${text}` : text;
}

/** A number with three significant digits, or fewer where the others are 0. */
export function significant(value: number): string {
  return written(value, { maximumSignificantDigits: 3, useGrouping: false });
}

/** A text with its values in the places of their names. */
export function filled(text: string, values: Record<string, string | number>): string {
  return text.replace(/\{(\w+)\}/g, (_, name: string) => String(values[name] ?? ""));
}

export function hasText(key: string): key is Key {
  return key in en;
}

export function t(key: Key, values: Record<string, string | number> = {}): string {
  return filled(languages[language][key], values);
}

/** What programs and people without a name are called. */
export const SPEAKERS: Key[] = ["desk.somebody", "person.console", "person.trainee", "person.instructor", "person.observer", "person.recorder", "person.server", "person.command_line"];

/** A text that a page of any language has sent, in this page's. */
export function retold(text: string, ...keys: Key[]): string {
  const key = keys.find((known) => Object.values(languages).some((texts) => texts[known] === text));
  return key === undefined ? text : t(key);
}

export function nameOfLanguage(name: string): string {
  return languages[name]["language"];
}

/** Of texts in several languages the one of this page, else the first. */
export function localized(texts: { language: string; text: string }[]): string {
  return (texts.find((text) => text.language === language) ?? texts[0])?.text ?? "";
}
