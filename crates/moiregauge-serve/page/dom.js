// Elements without HTML strings: names of files and channels are data and may hold anything.

const SVG = "http://www.w3.org/2000/svg";

/** @typedef {Node | string | number | null | undefined | false} Child */
/** @typedef {Record<string, any>} Props */

/**
 * Sets properties of an element: `on…` are listeners, `class` and `text` what they say, `css` an object of
 * style properties (the content policy forbids style attributes), all else attributes.
 * @param {Element} element
 * @param {Props} props
 */
function set(element, props) {
  for (const [name, value] of Object.entries(props)) {
    if (value === null || value === undefined || value === false) continue;
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (name === "text") element.textContent = String(value);
    else if (name === "css") {
      const style = /** @type {HTMLElement} */ (element).style;
      for (const [key, v] of Object.entries(value)) style.setProperty(key, String(v));
    } else if (name === "value") /** @type {any} */ (element).value = value;
    else element.setAttribute(name, value === true ? "" : String(value));
  }
}

/**
 * An HTML element.
 * @template {keyof HTMLElementTagNameMap} T
 * @param {T} tag
 * @param {Props} [props]
 * @param {...(Child | Child[])} children
 * @returns {HTMLElementTagNameMap[T]}
 */
export function h(tag, props = {}, ...children) {
  const element = document.createElement(tag);
  set(element, props);
  add(element, children);
  return element;
}

/**
 * An SVG element.
 * @template {keyof SVGElementTagNameMap} T
 * @param {T} tag
 * @param {Props} [props]
 * @param {...(Child | Child[])} children
 * @returns {SVGElementTagNameMap[T]}
 */
export function s(tag, props = {}, ...children) {
  const element = /** @type {SVGElementTagNameMap[T]} */ (document.createElementNS(SVG, tag));
  set(element, props);
  add(element, children);
  return element;
}

/**
 * @param {Element} parent
 * @param {(Child | Child[])[]} children
 */
function add(parent, children) {
  for (const child of children.flat()) {
    if (child === null || child === undefined || child === false) continue;
    parent.append(child instanceof Node ? child : String(child));
  }
}

/**
 * Replaces all children.
 * @param {Element} parent
 * @param {...(Child | Child[])} children
 */
export function fill(parent, ...children) {
  parent.replaceChildren();
  add(parent, children);
}

/**
 * A labelled control: the label stands above it.
 * @param {string} label
 * @param {HTMLElement} control
 * @param {string} [hint]
 */
export function field(label, control, hint) {
  // The text of a label would take in the options of a select.
  if (!control.hasAttribute("aria-label")) control.setAttribute("aria-label", label);
  return h("label", { class: "field" }, h("span", { class: "label", text: label }), control,
    hint ? h("span", { class: "hint", text: hint }) : null);
}

/**
 * A select element.
 * @param {[string, string][]} options value and words
 * @param {string} value
 * @param {(value: string) => void} onchange
 * @param {Props} [props]
 */
export function select(options, value, onchange, props = {}) {
  const element = h("select", { ...props, onchange: () => onchange(element.value) },
    options.map(([v, words]) => h("option", { value: v, text: words })));
  element.value = value;
  return element;
}

/**
 * A table from its head and rows; cells may be nodes. Columns named in `numbers` are right-aligned.
 * @param {string} caption
 * @param {string[]} head
 * @param {(Child)[][]} rows
 * @param {{numbers?: number[], class?: string, shown?: boolean}} [options]
 */
export function table(caption, head, rows, options = {}) {
  const numbers = new Set(options.numbers ?? []);
  const cell = (/** @type {Child} */ c, /** @type {number} */ i) =>
    i === 0 ? h("th", { scope: "row" }, c) : h("td", { class: numbers.has(i) ? "number" : null }, c);
  return h("table", { class: options.class ?? null },
    h("caption", { class: options.shown ? null : "away", text: caption }),
    h("thead", {}, h("tr", {}, head.map((t, i) => h("th", { scope: "col", class: numbers.has(i) ? "number" : null, text: t })))),
    h("tbody", {}, rows.map((row) => h("tr", {}, row.map(cell)))));
}

/**
 * What may be wider than its place: scrolled with the mouse or, since it takes the focus, with the arrow keys.
 * @param {string} label
 * @param {...(Child | Child[])} children
 */
export function scroll(label, ...children) {
  return h("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": label }, ...children);
}

/**
 * A message in place of something that is not there.
 * @param {string} words
 * @param {...Child} more
 */
export function empty(words, ...more) {
  return h("p", { class: "empty" }, words, ...more);
}

/** Says something to people who cannot see the change. @param {string} words */
export function say(words) {
  const live = document.getElementById("live");
  if (live) live.textContent = words;
}

/**
 * Offers bytes as a file.
 * @param {Blob} blob
 * @param {string} name
 */
export function download(blob, name) {
  const url = URL.createObjectURL(blob);
  const link = h("a", { href: url, download: name });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(url), 10000);
}

/**
 * The name at the end of a path.
 * @param {string} path
 */
export function baseName(path) {
  return path.split(/[\\/]/).pop() ?? path;
}
