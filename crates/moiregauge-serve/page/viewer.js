// One image on a canvas: zoom, pan, contrast, scale bar, and a layer of SVG and buttons over it.

import { paint } from "./colours.js";
import { quantity, roundBelow } from "./format.js";
import { h, s, fill } from "./dom.js";
import { Tiles } from "./tiles.js";

/** @typedef {import("./api.js").Floats} Floats */
/** @typedef {{x: number, y: number}} Point */
/** @typedef {{down: (at: Point, event: PointerEvent) => boolean, move?: (at: Point, event: PointerEvent) => void,
 *   up?: (at: Point, event: PointerEvent) => void}} Tool places in pixels of the file */

const FACTOR = 1.25;

export class Viewer extends EventTarget {
  /**
   * @param {string} label what is shown, for people who cannot see it
   * @param {{scaleBar?: boolean, readout?: boolean}} [options]
   */
  constructor(label, options = {}) {
    super();
    this.options = { scaleBar: true, readout: true, ...options };
    this.canvas = h("canvas", { tabindex: 0, role: "img", "aria-label": label });
    this.overlay = s("svg", { class: "overlay", "aria-hidden": "true" });
    this.ruler = s("g", { class: "ruler" });
    this.drawing = s("g", {});
    this.overlay.append(this.drawing, this.ruler);
    this.handles = h("div", { class: "handles" });
    this.readout = h("output", { class: "readout", "aria-live": "off" });
    this.message = h("p", { class: "viewer-message" });
    this.stage = h("div", { class: "stage" }, this.canvas, this.overlay, this.handles, this.message);
    this.element = h("div", { class: "viewer" }, this.stage, this.options.readout ? this.readout : null);
    /** @type {Floats | null} */
    this.image = null;
    /** What is shown: the image without its background. @type {Float32Array | null} */
    this.shown = null;
    /** Samples of the overview are blocks of this many pixels of the file. */
    this.step = 1;
    this.look = { low: 0, high: 1, colours: "viridis" };
    /** Size of the file, where blocks do not fill it. @type {{columns: number, rows: number} | null} */
    this.full = null;
    /** Screen points per nm and the place of the corner of the frame. */
    this.view = { scale: 1, x: 0, y: 0 };
    this.fitted = true;
    /** @type {Tool | null} */
    this.tool = null;
    /** @type {HTMLCanvasElement | null} */
    this.picture = null;
    this.tiles = new Tiles(() => this.redraw());
    this.asked = 0;
    new ResizeObserver(() => this.resize()).observe(this.stage);
    this.listen();
  }

  /** Pixels of the file. */
  get columns() {
    return this.image ? this.full?.columns ?? this.image.width * this.step : 0;
  }
  get rows() {
    return this.image ? this.full?.rows ?? this.image.height * this.step : 0;
  }
  /** Size of a pixel of the file, nm; pixels without a size count as one. */
  get pixelX() {
    return this.image && this.image.pixelX > 0 ? this.image.pixelX / this.step : 1;
  }
  get pixelY() {
    return this.image && this.image.pixelY > 0 ? this.image.pixelY / this.step : 1;
  }
  get hasSize() {
    return !!this.image && this.image.pixelX > 0;
  }

  /**
   * Shows an image.
   * @param {Floats} image
   * @param {{step?: number, shown?: Float32Array, keepView?: boolean, full?: {columns: number, rows: number}}} [more]
   */
  show(image, more = {}) {
    const before = [this.columns, this.rows];
    this.image = image;
    this.step = more.step ?? 1;
    this.full = more.full ?? null;
    const same = before[0] === this.columns && before[1] === this.rows;
    this.shown = more.shown ?? image.data;
    this.picture = null;
    this.tiles.clear();
    this.message.textContent = "";
    if (!same || !more.keepView) this.fitted = true;
    if (this.fitted) this.fit();
    this.redraw();
  }

  /** @param {string} words */
  clear(words) {
    this.image = null;
    this.shown = null;
    this.picture = null;
    this.message.textContent = words;
    this.redraw();
  }

  /** @param {Partial<{low: number, high: number, colours: string}>} look */
  setLook(look) {
    Object.assign(this.look, look);
    this.picture = null;
    this.tiles.repaint();
    this.redraw();
  }

  fit() {
    const { clientWidth: w, clientHeight: hgt } = this.stage;
    if (!this.image || w === 0 || hgt === 0) return;
    const sizeX = this.columns * this.pixelX;
    const sizeY = this.rows * this.pixelY;
    this.view.scale = Math.min(w / sizeX, hgt / sizeY);
    this.view.x = (w - sizeX * this.view.scale) / 2;
    this.view.y = (hgt - sizeY * this.view.scale) / 2;
    this.fitted = true;
    this.redraw();
  }

  /**
   * @param {number} factor
   * @param {Point} [about] on the screen; else the middle
   */
  zoom(factor, about = { x: this.stage.clientWidth / 2, y: this.stage.clientHeight / 2 }) {
    const least = 20 / Math.max(1e-9, this.columns * this.pixelX);
    const most = 60 / this.pixelX;
    const scale = Math.min(most, Math.max(least, this.view.scale * factor));
    const f = scale / this.view.scale;
    this.view = { scale, x: about.x - (about.x - this.view.x) * f, y: about.y - (about.y - this.view.y) * f };
    this.fitted = false;
    this.redraw();
  }

  /** @param {number} dx @param {number} dy */
  pan(dx, dy) {
    this.view.x += dx;
    this.view.y += dy;
    this.fitted = false;
    this.redraw();
  }

  /**
   * Where a place of the file (centres of pixels are whole numbers, y up) is on the screen.
   * @param {number} px
   * @param {number} py
   * @returns {Point}
   */
  toScreen(px, py) {
    const { scale, x, y } = this.view;
    return { x: x + (px + 0.5) * this.pixelX * scale, y: y + (this.rows - py - 0.5) * this.pixelY * scale };
  }

  /** @param {number} x @param {number} y @returns {Point} */
  toFile(x, y) {
    const { scale, x: ox, y: oy } = this.view;
    return { x: (x - ox) / (this.pixelX * scale) - 0.5, y: this.rows - 0.5 - (y - oy) / (this.pixelY * scale) };
  }

  /**
   * The number shown at a place of the file, NaN outside.
   * @param {number} px
   * @param {number} py
   */
  valueAt(px, py) {
    if (!this.image || !this.shown) return NaN;
    const column = Math.floor((px + 0.5) / this.step);
    const row = Math.floor((py + 0.5) / this.step);
    if (column < 0 || row < 0 || column >= this.image.width || row >= this.image.height) return NaN;
    return this.shown[row * this.image.width + column];
  }

  resize() {
    if (this.fitted) this.fit();
    this.redraw();
  }

  redraw() {
    if (this.asked) return;
    this.asked = requestAnimationFrame(() => {
      this.asked = 0;
      this.draw();
    });
  }

  draw() {
    const { clientWidth: w, clientHeight: hgt } = this.stage;
    const ratio = window.devicePixelRatio || 1;
    if (this.canvas.width !== Math.round(w * ratio) || this.canvas.height !== Math.round(hgt * ratio)) {
      this.canvas.width = Math.round(w * ratio);
      this.canvas.height = Math.round(hgt * ratio);
    }
    const context = /** @type {CanvasRenderingContext2D} */ (this.canvas.getContext("2d"));
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, w, hgt);
    if (this.image && this.shown) {
      this.picture ??= paint(this.shown, this.image.width, this.image.height, this.look);
      const sx = this.pixelX * this.view.scale;
      const sy = this.pixelY * this.view.scale;
      context.imageSmoothingEnabled = sx * this.step < 1;
      context.imageSmoothingQuality = "high";
      const [wide, high] = [this.image.width * this.step, this.image.height * this.step];
      context.drawImage(this.picture, this.view.x, this.view.y + (this.rows - high) * sy, wide * sx, high * sy);
      if (this.step > 1) this.tiles.draw(context, this);
    }
    this.drawRuler();
    this.dispatchEvent(new Event("view"));
  }

  drawRuler() {
    const { clientWidth: w, clientHeight: hgt } = this.stage;
    fill(this.ruler);
    if (!this.image || !this.options.scaleBar || !this.hasSize || w === 0) return;
    const length = roundBelow((w * 0.28) / this.view.scale);
    const width = length * this.view.scale;
    const words = length >= 1000 ? `${length / 1000} µm` : `${Number(length.toPrecision(1))} nm`;
    this.ruler.append(
      s("rect", { x: 12, y: hgt - 42, width: width + 20, height: 32, rx: 3, class: "ruler-ground" }),
      s("rect", { x: 22, y: hgt - 20, width, height: 3, class: "ruler-bar" }),
      s("text", { x: 22 + width / 2, y: hgt - 25, class: "ruler-text", "text-anchor": "middle" }, words));
  }

  /** @param {PointerEvent | WheelEvent | MouseEvent} event @returns {Point} */
  place(event) {
    const box = this.stage.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  }

  listen() {
    /** @type {Map<number, Point>} */
    const fingers = new Map();
    let busy = false;
    this.stage.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(-event.deltaY * (event.ctrlKey ? 0.01 : 0.0015)), this.place(event));
    }, { passive: false });
    this.canvas.addEventListener("pointerdown", (event) => {
      const at = this.place(event);
      fingers.set(event.pointerId, at);
      this.canvas.setPointerCapture(event.pointerId);
      const file = this.toFile(at.x, at.y);
      busy = event.button === 0 && !event.shiftKey && !!this.tool?.down(file, event);
    });
    this.canvas.addEventListener("pointermove", (event) => {
      const at = this.place(event);
      const before = fingers.get(event.pointerId);
      const file = this.toFile(at.x, at.y);
      this.tell(file);
      if (!before) return;
      if (busy) this.tool?.move?.(file, event);
      else this.drag(fingers, event.pointerId, before, at);
      fingers.set(event.pointerId, at);
    });
    const end = (/** @type {PointerEvent} */ event) => {
      fingers.delete(event.pointerId);
      const at = this.place(event);
      if (busy) this.tool?.up?.(this.toFile(at.x, at.y), event);
      busy = false;
    };
    this.canvas.addEventListener("pointerup", end);
    this.canvas.addEventListener("pointercancel", end);
    this.canvas.addEventListener("pointerleave", () => this.tell(null));
    this.canvas.addEventListener("dblclick", () => this.tool || this.fit());
    this.canvas.addEventListener("keydown", (event) => this.key(event));
  }

  /**
   * One finger pans, two zoom.
   * @param {Map<number, Point>} fingers
   * @param {number} id
   * @param {Point} before
   * @param {Point} at
   */
  drag(fingers, id, before, at) {
    const other = [...fingers].find(([k]) => k !== id)?.[1];
    if (!other) return this.pan(at.x - before.x, at.y - before.y);
    const distance = (/** @type {Point} */ p) => Math.hypot(p.x - other.x, p.y - other.y);
    this.zoom(distance(at) / Math.max(1, distance(before)), other);
  }

  /** @param {KeyboardEvent} event */
  key(event) {
    const far = event.shiftKey ? 120 : 30;
    /** @type {Record<string, () => void>} */
    const keys = {
      ArrowLeft: () => this.pan(far, 0),
      ArrowRight: () => this.pan(-far, 0),
      ArrowUp: () => this.pan(0, far),
      ArrowDown: () => this.pan(0, -far),
      "+": () => this.zoom(FACTOR),
      "=": () => this.zoom(FACTOR),
      "-": () => this.zoom(1 / FACTOR),
      "0": () => this.fit(),
    };
    if (event.ctrlKey || event.metaKey || event.altKey || !keys[event.key]) return;
    event.preventDefault();
    keys[event.key]();
  }

  /** The number under the pointer. @param {Point | null} file */
  tell(file) {
    this.dispatchEvent(new CustomEvent("cursor", { detail: file }));
    if (!this.options.readout || !this.image) return;
    const z = file ? this.valueAt(file.x, file.y) : NaN;
    if (!file || Number.isNaN(z)) {
      this.readout.textContent = "";
      return;
    }
    const [x, y] = [(file.x + 0.5) * this.pixelX, (file.y + 0.5) * this.pixelY];
    const unit = this.hasSize ? "nm" : "px";
    this.readout.textContent = `x ${quantity(x, unit)}   y ${quantity(y, unit)}   ${quantity(z, this.image.unit)}`;
  }
}
