// Asks for a place in the session: as what, under which name, and with which key.
import type { Dialog } from "./dialog";
import { h, icon, marked } from "./dom";
import { Role } from "./messages";
import { keep, kept, t, type Key } from "./strings";

export const PASS = "pass"; // in the address, and in this tab's memory
export const SEATS = { instructor: Role.Instructor, trainee: Role.Trainee } as const;
export type SeatName = keyof typeof SEATS;

/** `wanted`: the role that is chosen at first; `needsKey`: of a role; `noteOf`: what is said of its place; `wasRemoved`: the person, from this session. */
export interface SeatQuestion {
  title: string; what?: string; action: string; roles: SeatName[]; wanted?: string;
  needsKey?: (role: SeatName) => boolean;
  noteOf?: (role: SeatName) => string;
  wasRemoved: boolean;
  done: (role: SeatName, name: string, key: string) => Promise<boolean>;
}

export function askForSeat(dialog: Dialog, { title, what, action, roles, wanted, needsKey, noteOf, wasRemoved, done }: SeatQuestion): void {
  const role = h("select", "");
  role.append(...roles.map((name) => Object.assign(h("option", "", t(`role.name.${name}`)), { value: name })));
  if (roles.some((name) => name === wanted)) role.value = wanted ?? "";
  const name = Object.assign(h("input", ""), { maxLength: 40, value: kept("name") ?? "", autocomplete: "off" });
  const key = Object.assign(h("input", ""), { type: "password", autocomplete: "off", value: kept(PASS, "tab") ?? "" });
  const field = (label: Key, input: HTMLElement, hint?: Key): HTMLElement => h("label", "field", h("span", "", t(label)), input, ...(hint === undefined ? [] : [h("small", "muted", ...marked(t(hint)))]));
  const keyField = field("desk.sit.key", key, "desk.sit.hint");
  const note = h("p", "muted place");
  const chosen = (): SeatName => role.value as SeatName;
  const update = (): void => {
    keyField.hidden = needsKey?.(chosen()) === false;
    note.textContent = noteOf?.(chosen()) ?? "";
    note.hidden = note.textContent === "";
  };
  role.addEventListener("change", update);
  update();
  const text = [...(what === undefined ? [] : [h("p", "", what)]), ...(wasRemoved ? [h("p", "removed", icon("warn"), t("desk.sit.removed"))] : [])];
  dialog.open(title, [...text, field("desk.sit.role", role), field("desk.sit.name", name), keyField, note], action, () => {
    keep("name", name.value);
    return done(chosen(), name.value, key.value.trim());
  });
}
