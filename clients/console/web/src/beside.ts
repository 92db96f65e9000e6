// Two recordings beside each other, as of two trainees: each is this page in a frame of its own, and what is done to one player is done to the other.
import { h } from "./dom";
import type { Command, Player } from "./player";
import { t } from "./strings";

/** Of a page in a frame: the frame's number, in its address. */
export const FRAME = "beside";

/** A recording: a file, an address, or undefined for the gateway's own. */
export type Played = File | string | undefined;

const DRIFT = 0.1; // [s] up to which two players are together, at speed 1

/** Keeps two players together, of which one may read slower: the one that has played more since the last command waits. In s of the recordings. */
export class Together {
  played = 0;
  private ahead = 0;

  restart(): void {
    this.played = this.ahead = 0;
  }

  /** So much the other one has played. */
  hear(played: number, speed: number): void {
    const ahead = this.played - played;
    this.ahead = ahead > DRIFT * Math.max(1, speed) ? ahead : 0;
  }

  /** What is to be played of what could be. */
  pass(seconds: number): number {
    const waits = Math.min(this.ahead, seconds);
    this.ahead -= waits;
    return seconds - waits;
  }
}

/** Shows two pages in the place of this one, of what it plays and of another file, until they are closed: then this one is there again as it was. */
export function showBeside(app: HTMLElement, first: Played, second: File, onClose: () => void): void {
  const own = [...app.childNodes];
  const isClosed = new AbortController();
  const close = h("button", "close", t("beside.close"));
  close.addEventListener("click", () => {
    isClosed.abort();
    app.replaceChildren(...own);
    onClose();
  });
  const frames = [first, second].map((file, i) => {
    const frame = h("iframe");
    frame.title = (typeof file === "string" ? file : file?.name) ?? t("beside.first");
    frame.src = `/?${FRAME}=${i}`;
    return frame;
  });
  addEventListener("message", ({ origin, source, data }) => {
    const from = frames.findIndex((frame) => frame.contentWindow === source);
    if (origin !== location.origin || from < 0) return;
    const told = data as { isReady?: true; command?: Command };
    if (told.isReady === true) frames[from].contentWindow?.postMessage({ file: [first, second][from] }, origin);
    else frames[1 - from].contentWindow?.postMessage(told, origin);
  }, { signal: isClosed.signal });
  app.replaceChildren(h("div", "beside", h("div", "beside-head", close, h("span", "muted", t("beside.more"))), ...frames));
}

/** In such a frame: what is to be played, as soon as it is known. */
export function playsBeside(play: (file: Played) => void, player: () => Player | undefined): void {
  addEventListener("message", ({ origin, source, data }) => {
    if (origin !== location.origin || source !== parent) return;
    const told = data as { file?: Played; command?: Command };
    if (told.command !== undefined) player()?.obey(told.command);
    else play(told.file);
  });
  parent.postMessage({ isReady: true }, location.origin);
}

export function tellBeside(command: Command): void {
  parent.postMessage({ command }, location.origin);
}
