// Elements in one line: h("p", "muted", text, child, ...)
export function h<K extends keyof HTMLElementTagNameMap>(tag: K, className = "", ...children: (Node | string)[]): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  if (className !== "") element.className = className;
  element.append(...children);
  return element;
}

const keyOf = (node: Node): string | undefined => (node instanceof HTMLElement ? node.dataset["key"] : undefined);
const isSame = (a: Node, b: Node): boolean => a.nodeName === b.nodeName && keyOf(a) === keyOf(b);

/**
 * Gives an element these children. Those with a `data-key` are known by it, others by their place: what was there stays, with its focus and a press that has begun on it,
 * and takes the new attributes and text. Rows may come and go between; a row that changes its order is made anew. Listeners of the new ones are lost: they belong on
 * the element.
 */
export function renew(element: Element, nodes: readonly Node[]): void {
  nodes.forEach((next, i) => {
    const stays = (node: Node): boolean => keyOf(node) !== undefined && nodes.slice(i).some((one) => isSame(node, one));
    if (keyOf(next) !== undefined && [...element.childNodes].slice(i).some((old) => isSame(old, next)))
      for (let old = element.childNodes[i]; old !== undefined && !isSame(old, next) && !stays(old); old = element.childNodes[i]) old.remove();
    const old = element.childNodes[i];
    if (old === undefined) element.append(next);
    else if (!isSame(old, next)) {
      if (stays(old)) old.before(next);
      else old.replaceWith(next);
    } else if (old instanceof Element && next instanceof Element) {
      for (const { name } of [...old.attributes]) if (!next.hasAttribute(name)) old.removeAttribute(name);
      for (const { name, value } of next.attributes) {
        if (old.getAttribute(name) === value) continue;
        if (name === "style") (old as HTMLElement | SVGElement).style.cssText = value; // as an attribute the page's policy forbids it
        else old.setAttribute(name, value);
      }
      renew(old, [...next.childNodes]);
    } else if (old instanceof Text && next instanceof Text && old.data !== next.data) old.data = next.data;
  });
  while (element.childNodes.length > nodes.length) element.lastChild?.remove();
}

/** Says of a button why it does nothing now; an empty text: it acts. It can still be reached, so that its reason is read. */
export function forbid(button: HTMLElement, why: string): void {
  if (button.title === why) return;
  button.title = why;
  if (why === "") button.removeAttribute("aria-disabled");
  else button.setAttribute("aria-disabled", "true");
}

/** Gives a list these options. The first one is shown until a person chooses; where that choice is no longer there, nothing is: nobody chose the first one instead. */
export function setOptions(select: HTMLSelectElement, options: { name: string; title: string }[]): void {
  const listed = JSON.stringify(options);
  if (select.dataset["listed"] === listed) return;
  if (select.dataset["listed"] === undefined) select.addEventListener("change", () => (select.dataset["chosen"] = "yes"));
  select.dataset["listed"] = listed;
  const chosen = select.dataset["chosen"] === undefined ? undefined : select.value;
  select.replaceChildren(...options.map(({ name, title }) => Object.assign(h("option", "", title || name), { value: name })));
  if (chosen !== undefined) select.value = chosen;
}

/** Pixels of the page in one of an element, which may be zoomed. */
export function zoomOf(element: HTMLElement): number {
  return element.getBoundingClientRect().width / Math.max(1, element.offsetWidth) || 1;
}

/** A sentence in which what is between backticks is code, as what is to be typed. */
export function marked(text: string): Node[] {
  return text.split("`").map((piece, i) => (i % 2 === 1 ? h("code", "", piece) : document.createTextNode(piece)));
}

const SVG = "http://www.w3.org/2000/svg";
const PATHS = {
  live: "M8 3a5 5 0 1 0 0 10A5 5 0 0 0 8 3z",
  wait: "M8 1.5a6.5 6.5 0 1 0 6.5 6.5h-2A4.5 4.5 0 1 1 8 3.5z",
  warn: "M8 1l7 13H1zM7 6h2v4H7zM7 11h2v2H7z",
  stop: "M5 1h6l4 4v6l-4 4H5l-4-4V5z",
  done: "M2 8l2-2 3 3 5-6 2 2-7 8z",
  now: "M4 2l9 6-9 6z",
  skip: "M2 3l6 5-6 5zM8 3l6 5-6 5z",
  over: "M4 3h8v10H4z",
  half: "M8 1a7 7 0 1 1 0 14A7 7 0 0 1 8 1zM8 3v10A5 5 0 0 0 8 3z",
  pause: "M4 2h3v12H4zM9 2h3v12H9z",
  back: "M14 3v10L8 8zM8 3v10L2 8z",
  on: "M2 3l6 5-6 5zM8 3l6 5-6 5z",
  repeat: "M8 2a6 6 0 1 0 6 6h-2a4 4 0 1 1-4-4v3l5-4-5-4z",
  swap: "M1 5h9V2l5 4.500-5 4V8H1zM15 12H6v3l-5-4 5-4v3h9z",
  bell: "M8 1a5 5 0 0 1 5 5v4l2 2v1H1v-1l2-2V6a5 5 0 0 1 5-5zM6 14h4l-2 2z",
  hand: "M6 1.500a1 1 0 0 1 2 0V7h.500V2.500a1 1 0 0 1 2 0V7.500h.500V4a1 1 0 0 1 2 0v6c0 3-2 5-5 5-2 0-3.500-1-4.500-3L1.500 9a1 1 0 0 1 1.700-1L4 9V3.500a1 1 0 0 1 2 0z",
  up: "M8 2l6 7h-4v5H6V9H2z",
  down: "M8 14L2 7h4V2h4v5h4z",
  help: "M8 1a7 7 0 1 1 0 14A7 7 0 0 1 8 1zM5 6h2c0-2 2-2 2-.500 0 1-2 1.500-2 3.500h2c0-1.500 2-1.800 2-3.500C11 2 5 2 5 6zM7 10.500v2h2v-2z",
  frozen: "M7 1h2v3l2-1 1 2-2 1 3 1v2l-3 1 2 1-1 2-2-1v3H7v-3l-2 1-1-2 2-1-3-1V7l3-1-2-1 1-2 2 1z",
  record: "M8 2a6 6 0 1 0 0 12A6 6 0 0 0 8 2z",
  whole: "M1 1h5v2H3v3H1zM10 1h5v5h-2V3h-3zM1 10h2v3h3v2H1zM13 10h2v5h-5v-2h3z",
  follow: "M7 0h2v2.100A6 6 0 0 1 13.900 7H16v2h-2.100A6 6 0 0 1 9 13.900V16H7v-2.100A6 6 0 0 1 2.100 9H0V7h2.100A6 6 0 0 1 7 2.100zM8 4a4 4 0 1 0 0 8 4 4 0 0 0 0-8zM8 6.500a1.500 1.500 0 1 1 0 3 1.500 1.500 0 0 1 0-3z",
  eye: "M8 3c3.500 0 6 2.500 7.500 5-1.500 2.500-4 5-7.500 5S2 10.500.500 8C2 5.500 4.500 3 8 3zM8 5a3 3 0 1 0 0 6 3 3 0 0 0 0-6zM8 6.500a1.500 1.500 0 1 1 0 3 1.500 1.500 0 0 1 0-3z",
  section: "M1 3h6v10H1zM7 0h2v16H7zM10.500 3H12v2h-1.500zM13.500 3H15v2h-1.500zM13.500 6.500H15v3h-1.500zM13.500 11H15v2h-1.500zM10.500 11H12v2h-1.500z",
  list: "M1 2h3v3H1zM6 2.500h9v2H6zM1 6.500h3v3H1zM6 7h9v2H6zM1 11h3v3H1zM6 11.500h9v2H6z",
  hidden: "M2.400 1.300l12.300 12.300-1.400 1.400-2.500-2.500C9.900 12.800 9 13 8 13 4.500 13 2 10.500.500 8c.700-1.200 1.700-2.400 2.900-3.300L1 2.700zM8 3c3.500 0 6 2.500 7.500 5-.500.900-1.200 1.700-2 2.500L6.300 3.300C6.800 3.100 7.400 3 8 3z",
  open: "M1 3h5l2 2h7v2H4.500L3 12H1zM5 8h11l-2 6H3z",
  measure: "M.500 5h15v6H.500zM2 6.500v3h12v-3h-1V8.500h-1v-2h-1.500V8.500h-1v-2H8V8.500H7v-2H5.500V8.500h-1v-2H3V8.500z",
  sphere: "M8 1a7 7 0 1 1 0 14A7 7 0 0 1 8 1zM8 2.500a5.500 5.500 0 0 0-5.450 4.800C3.800 8.400 5.800 9 8 9s4.200-.600 5.450-1.700A5.500 5.500 0 0 0 8 2.500zM2.600 9.100a5.500 5.500 0 0 0 10.800 0C12 10 10.100 10.500 8 10.500S4 10 2.600 9.100z",
  beside: "M1 2h6v12H1zM2.500 3.500v9h3v-9zM9 2h6v12H9zM10.500 3.500v9h3v-9z",
  person: "M8 2a3 3 0 1 1 0 6 3 3 0 0 1 0-6zM2 14c0-3 3-5 6-5s6 2 6 5z",
} as const;
export type Icon = keyof typeof PATHS;

export function icon(name: Icon): SVGSVGElement {
  const svg = document.createElementNS(SVG, "svg");
  svg.setAttribute("viewBox", "0 0 16 16");
  svg.setAttribute("aria-hidden", "true");
  svg.classList.add("icon");
  const path = document.createElementNS(SVG, "path");
  path.setAttribute("d", PATHS[name]);
  path.setAttribute("fill-rule", "evenodd");
  svg.append(path);
  return svg;
}
