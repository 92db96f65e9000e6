// The texts of the page: one file a language. Another language is one more file and its line here.
import de from "./strings/de.json";
import en from "./strings/en.json";

export type Key = keyof typeof en;
const languages: Record<string, Record<Key, string>> = { en, de };

function initial(): string {
  const wanted = [localStorage.getItem("language"), ...navigator.languages.map((name) => name.slice(0, 2))];
  return wanted.find((name) => name !== null && name in languages) ?? "en";
}

export let language = initial();
export const languageNames = Object.keys(languages);

export function setLanguage(name: string): void {
  language = name in languages ? name : "en";
  localStorage.setItem("language", language);
  document.documentElement.lang = language;
}

export function t(key: Key, values: Record<string, string | number> = {}): string {
  return languages[language][key].replace(/\{(\w+)\}/g, (_, name: string) => String(values[name] ?? ""));
}

export function nameOfLanguage(name: string): string {
  return languages[name]["language"];
}

/** Of texts in several languages the one of this page, else the first. */
export function localized(texts: { language: string; text: string }[]): string {
  return (texts.find((text) => text.language === language) ?? texts[0])?.text ?? "";
}
