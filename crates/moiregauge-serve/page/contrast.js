// The histogram of an image with two handles, which are sliders for mouse and keyboard.

import { h, s, fill } from "./dom.js";
import { colourTable } from "./colours.js";
import { number } from "./format.js";
import { histogram } from "./levels.js";

/** @typedef {{low: number, high: number}} Range */

export class Contrast {
  /**
   * @param {(range: Range) => void} changed
   * @param {string} [what] what the values are, in the names of the handles
   */
  constructor(changed, what = "contrast") {
    this.changed = changed;
    this.unit = "";
    /** @type {ReturnType<typeof histogram>} */
    this.all = { low: 0, high: 1, from: 0, to: 1, counts: new Uint32Array(1) };
    /** @type {Range} */
    this.range = { low: 0, high: 1 };
    this.colours = "viridis";
    this.bars = s("svg", { class: "histogram-bars", viewBox: "0 0 100 40", preserveAspectRatio: "none", "aria-hidden": "true" });
    this.lowHandle = this.handle("low", `Lower end of the ${what}`);
    this.highHandle = this.handle("high", `Upper end of the ${what}`);
    this.track = h("div", { class: "histogram-track" }, this.bars, this.lowHandle, this.highHandle);
    this.words = h("div", { class: "histogram-words" });
    this.element = h("div", { class: "histogram" }, this.track, this.words);
  }

  /** @param {"low" | "high"} which @param {string} label */
  handle(which, label) {
    const handle = h("button", { type: "button", class: `handle-${which}`, role: "slider", "aria-label": label, "aria-orientation": "horizontal" });
    handle.addEventListener("pointerdown", (event) => {
      handle.setPointerCapture(event.pointerId);
      handle.onpointermove = (e) => {
        const box = this.track.getBoundingClientRect();
        const share = Math.min(1, Math.max(0, (e.clientX - box.left) / box.width));
        this.move(which, this.all.low + share * (this.all.high - this.all.low));
      };
    });
    const stop = () => (handle.onpointermove = null);
    handle.addEventListener("pointerup", stop);
    handle.addEventListener("pointercancel", stop);
    handle.addEventListener("keydown", (event) => {
      const step = (this.all.high - this.all.low) * (event.shiftKey ? 0.1 : 0.01);
      /** @type {Record<string, number>} */
      const to = {
        ArrowLeft: this.range[which] - step, ArrowDown: this.range[which] - step,
        ArrowRight: this.range[which] + step, ArrowUp: this.range[which] + step,
        Home: this.all.low, End: this.all.high,
      };
      if (!(event.key in to)) return;
      event.preventDefault();
      this.move(which, to[event.key]);
    });
    return handle;
  }

  /** @param {"low" | "high"} which @param {number} value */
  move(which, value) {
    const gap = (this.all.high - this.all.low) / 500;
    const { low, high } = this.range;
    const inside = Math.min(this.all.high, Math.max(this.all.low, value));
    this.set(which === "low" ? { low: Math.min(inside, high - gap), high } : { low, high: Math.max(inside, low + gap) });
  }

  /** @param {Range} range */
  set(range) {
    this.range = range;
    this.draw();
    this.changed(range);
  }

  /**
   * Takes the numbers of another image; the limits leave out the outermost half per cent.
   * @param {Float32Array} data
   * @param {string} unit
   */
  take(data, unit) {
    this.all = histogram(data);
    this.unit = unit;
    this.auto();
  }

  auto() {
    this.set({ low: this.all.from, high: this.all.to });
  }

  full() {
    this.set({ low: this.all.low, high: this.all.high });
  }

  /** @param {string} name */
  setColours(name) {
    this.colours = name;
    this.draw();
  }

  draw() {
    const { low, high, counts } = this.all;
    const most = Math.max(1, ...counts);
    const table = colourTable(this.colours);
    const n = counts.length;
    fill(this.bars, [...counts].map((count, i) => {
      const tall = 38 * Math.sqrt(count / most);
      const value = low + ((i + 0.5) / n) * (high - low);
      const t = Math.round(255 * Math.min(1, Math.max(0, (value - this.range.low) / (this.range.high - this.range.low))));
      const colour = `rgb(${table[3 * t]},${table[3 * t + 1]},${table[3 * t + 2]})`;
      return s("rect", { x: (100 * i) / n, y: 40 - tall, width: 100 / n + 0.05, height: tall, fill: colour });
    }));
    for (const which of /** @type {("low" | "high")[]} */ (["low", "high"])) {
      const handle = which === "low" ? this.lowHandle : this.highHandle;
      handle.style.left = `${(100 * (this.range[which] - low)) / (high - low)}%`;
      handle.setAttribute("aria-valuemin", String(low));
      handle.setAttribute("aria-valuemax", String(high));
      handle.setAttribute("aria-valuenow", String(this.range[which]));
      handle.setAttribute("aria-valuetext", `${number(this.range[which])} ${this.unit}`);
    }
    fill(this.words, h("span", { text: number(this.range.low) }), h("span", { class: "soft", text: this.unit }), h("span", { text: number(this.range.high) }));
  }
}
