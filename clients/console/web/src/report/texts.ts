// The texts of a report that the console does not have: one file a language.
import { kindOf } from "../eventtext";
import { filled, language, n } from "../strings";
import de from "./de.json";
import en from "./en.json";

export type Text = keyof typeof en.texts;
const TEXTS: Record<string, { texts: Record<Text, string>; said: Record<string, string> }> = { en, de };

export function r(key: Text, values: Record<string, string | number> = {}): string {
  return filled((TEXTS[language] ?? en).texts[key], values);
}

/** A sentence of the server or of `tenon report` in this language; as it is when it is not known. Numbers stand for `#`. */
export function said(text: string): string {
  const numbers: string[] = [];
  const known = (TEXTS[language] ?? en).said[text.replace(/\d+(?:\.\d+)?/g, (number) => (numbers.push(number), "#"))];
  return known === undefined ? text : known.replace(/#/g, () => localNumber(numbers.shift() ?? ""));
}

/** The kind of an event: by the report's own word, or the console's. */
export function kindIn(kind: string): string {
  const word = said(kind);
  return word === kind && language !== "en" ? kindOf({ kind }) : word;
}

function localNumber(number: string): string {
  return n(Number(number), number.split(".")[1]?.length ?? 0);
}
