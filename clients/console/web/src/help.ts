// All keys of the page, in a dialog.
import type { Dialog } from "./dialog";
import { h } from "./dom";
import { t, type Key } from "./strings";

/** Where a group of keys acts, and each of its keys with what it does. */
export interface KeyGroup { head: Key; keys: [string, Key][] }

const PAGE: KeyGroup = { head: "keys.page", keys: [["?", "keys.help"], ["L", "keys.theme"], ["Tab", "keys.tab"], ["Esc", "keys.escape"]] };
const LIVE: KeyGroup = { head: "keys.stop", keys: [["Space", "keys.raise"]] };
const PLAYER: KeyGroup = { head: "keys.player", keys: [["Space", "keys.play"], [", .", "keys.step"], ["← →", "keys.second"], ["PgUp PgDn", "keys.ten"], ["Home End", "keys.ends"]] };
const VIEW: KeyGroup = { head: "keys.view", keys: [["R", "keys.whole"], ["1 2 3", "keys.look"], ["+ -", "keys.zoom"], ["Q E", "keys.turn"], ["← → ↑ ↓", "keys.pan"], ["S", "keys.section"], ["W", "keys.workspace"]] };
const PARTS: KeyGroup = { head: "keys.parts", keys: [["P", "keys.list"], ["↑ ↓", "keys.cursor"], ["Enter", "keys.use"], ["O", "keys.hide"], ["I", "keys.isolate"], ["A", "keys.all"], ["V", "keys.chase"], ["B", "keys.measure"]] };
const PLOTS: KeyGroup = { head: "keys.plots", keys: [["← →", "keys.plot"]] };
const HAND: KeyGroup = {
  head: "keys.hand",
  keys: [["Enter", "keys.arm"], ["← → ↑ ↓", "keys.move"], ["PgUp PgDn", "keys.depth"], ["Shift", "keys.turnhand"], ["D", "part.does.depth"], ["G", "part.does.align"], ["F", "part.does.fine"], ["C", "part.does.look"], ["T", "keys.drag"], ["X", "keys.other"], ["M", "keys.sound"], ["H", "keys.lesson"], ["Esc", "keys.relax"]],
};

/** Names of keys that are other words in other languages. */
const NAMES: Record<string, Key> = { Space: "stop.key", "PgUp PgDn": "keys.pages", "Home End": "keys.homeend", Shift: "keys.shift" };

/** `plays`: a recording, which has no stop and no hand; `hasHand`: one can be taken. */
export function showKeys(dialog: Dialog, { plays, hasHand }: { plays: boolean; hasHand: boolean }): void {
  const groups = [plays ? PLAYER : LIVE, PAGE, VIEW, PARTS, PLOTS, ...(hasHand ? [HAND] : [])];
  const rows = ([key, does]: [string, Key]): HTMLElement[] => [h("dt", "", h("kbd", "", NAMES[key] === undefined ? key : t(NAMES[key]))), h("dd", "", t(does))];
  dialog.tell(t("keys"), [h("div", "keys", ...groups.map(({ head, keys }) => h("section", "", h("h3", "", t(head)), h("dl", "", ...keys.flatMap(rows)))))], plays ? undefined : t("stop.press"));
}
