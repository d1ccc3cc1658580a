// Places on an image that can be moved: buttons, with the mouse or with the arrow keys.

import { h } from "./dom.js";

/** @typedef {import("./viewer.js").Viewer} Viewer */
/** @typedef {import("./viewer.js").Point} Point */
/** @typedef {{label: string, at: Point, kind?: string, moved: (to: Point) => void, done?: (to: Point) => void,
 *   removed?: () => void}} MarkerIs `at` in pixels of the file; `done` after a drag or a key */

export class Marker {
  /**
   * @param {Viewer} viewer
   * @param {MarkerIs} is
   */
  constructor(viewer, is) {
    this.viewer = viewer;
    this.is = is;
    this.at = is.at;
    this.button = h("button", { type: "button", class: `marker ${is.kind ?? ""}`, "aria-label": is.label, title: is.label });
    this.place = this.place.bind(this);
    viewer.handles.append(this.button);
    viewer.addEventListener("view", this.place);
    this.button.addEventListener("pointerdown", (event) => this.drag(event));
    this.button.addEventListener("keydown", (event) => this.key(event));
    this.place();
  }

  place() {
    const at = this.viewer.toScreen(this.at.x, this.at.y);
    this.button.style.left = `${at.x}px`;
    this.button.style.top = `${at.y}px`;
  }

  /** @param {Point} to */
  move(to) {
    this.at = to;
    this.place();
  }

  /** @param {PointerEvent} event */
  drag(event) {
    if (event.button !== 0) return;
    event.preventDefault();
    this.button.focus();
    this.button.setPointerCapture(event.pointerId);
    const start = this.viewer.place(event);
    const middle = this.viewer.toScreen(this.at.x, this.at.y);
    let moved = false;
    this.button.onpointermove = (e) => {
      const now = this.viewer.place(e);
      moved = true;
      this.move(this.viewer.toFile(middle.x + now.x - start.x, middle.y + now.y - start.y));
      this.is.moved(this.at);
    };
    const end = () => {
      this.button.onpointermove = null;
      this.button.onpointerup = null;
      this.button.onpointercancel = null;
      if (moved) this.is.done?.(this.at);
    };
    this.button.onpointerup = end;
    this.button.onpointercancel = end;
  }

  /** One point of the screen, ten with Shift. @param {KeyboardEvent} event */
  key(event) {
    if ((event.key === "Delete" || event.key === "Backspace") && this.is.removed) {
      event.preventDefault();
      this.is.removed();
      return;
    }
    const step = event.shiftKey ? 10 : 1;
    /** @type {Record<string, [number, number]>} */
    const ways = { ArrowLeft: [-step, 0], ArrowRight: [step, 0], ArrowUp: [0, -step], ArrowDown: [0, step] };
    const way = ways[event.key];
    if (!way) return;
    event.preventDefault();
    const at = this.viewer.toScreen(this.at.x, this.at.y);
    this.move(this.viewer.toFile(at.x + way[0], at.y + way[1]));
    this.is.moved(this.at);
    this.is.done?.(this.at);
  }

  remove() {
    this.viewer.removeEventListener("view", this.place);
    this.button.remove();
  }
}
