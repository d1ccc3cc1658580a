// What files do not say and somebody knows: the size of a frame, the line rate, the direction.

import { field, fill, h, select } from "./dom.js";
import { store } from "./store.js";

/** @type {[string, string][]} */
const DIRECTIONS = [["", "not given"], ["up", "up"], ["down", "down"], ["alternating-up", "in turn, up first"], ["alternating-down", "in turn, down first"]];

export class KnownForm {
  constructor() {
    const number = (/** @type {string} */ label) => h("input", { type: "number", min: 0, step: "any", "aria-label": label, placeholder: "not given" });
    this.width = number("Width of the frame, nm");
    this.height = number("Height of the frame, nm");
    this.rate = number("Line rate, Hz");
    this.direction = select(DIRECTIONS, "", () => undefined);
    this.missing = h("p", { class: "hint" });
    this.element = h("details", {}, h("summary", { text: "What the files do not say" }), this.missing, h("div", { class: "pair" },
      field("Width (nm)", this.width), field("Height (nm)", this.height), field("Line rate (Hz)", this.rate), field("Slow scan", this.direction)));
    this.written = "{}";
  }

  /** Says what is missing in a file, and opens. @param {string | undefined} file */
  async about(file) {
    if (!file) return;
    try {
      const info = await store.inspect(file);
      const missing = info.missing_for_analysis ?? [];
      fill(this.missing, missing.length > 0 ? `${store.name(file)}: ${missing.join("; ")}.` : "");
      if (missing.some((/** @type {string} */ m) => /size|line rate/.test(m))) this.element.open = true;
    } catch {
      // The program says what is wrong with the file when it is run.
    }
  }

  /** @returns {any} */
  read() {
    const positive = (/** @type {HTMLInputElement} */ i) => (Number(i.value) > 0 ? Number(i.value) : null);
    const known = /** @type {any} */ ({});
    const [w, t, rate] = [positive(this.width), positive(this.height), positive(this.rate)];
    if (w) known.size_nm = [w, t ?? w];
    if (rate) known.line_rate_hz = rate;
    if (this.direction.value) known.frame_direction = this.direction.value;
    return known;
  }

  /** @param {any} known */
  write(known) {
    this.width.value = String(known?.size_nm?.[0] ?? "");
    this.height.value = String(known?.size_nm?.[1] ?? "");
    this.rate.value = String(known?.line_rate_hz ?? "");
    this.direction.value = known?.frame_direction ?? "";
    this.written = JSON.stringify(this.read());
  }

  get isChanged() {
    return JSON.stringify(this.read()) !== this.written;
  }
}
