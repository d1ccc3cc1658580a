// The scans of a work: used or left out, one of them looked at.

import { fill, h } from "./dom.js";
import { store } from "./store.js";
import { work } from "./work.js";

export class ScanList {
  /**
   * @param {(file: string) => void} pick
   * @param {(words: string) => void} failed
   */
  constructor(pick, failed) {
    this.pick = pick;
    this.failed = failed;
    this.picked = "";
    this.element = h("ul", { class: "scans", "aria-label": "Scans of this analysis" });
  }

  /** @param {string} picked */
  show(picked) {
    this.picked = picked;
    const focused = document.activeElement instanceof HTMLElement && this.element.contains(document.activeElement) ? document.activeElement.dataset.key : null;
    const out = new Set(work.is?.excluded ?? []);
    fill(this.element, (work.is?.files ?? []).map((file) => {
      const name = store.name(file);
      const box = h("input", { type: "checkbox", "aria-label": `Use ${name}`, title: "Use this scan", "data-key": `use ${file}` });
      box.checked = !out.has(file);
      box.addEventListener("change", () => this.use(file, box.checked));
      return h("li", { class: out.has(file) ? "left-out" : null }, box,
        h("button", { type: "button", class: "link", text: name, title: name, "aria-current": file === picked ? "true" : null, "data-key": `look ${file}`, onclick: () => this.pick(file) }),
        out.has(file) ? h("span", { class: "soft", text: "left out" }) : null);
    }));
    if (focused) [...this.element.querySelectorAll("[data-key]")].forEach((e) => e instanceof HTMLElement && e.dataset.key === focused && e.focus());
  }

  /** @param {string} file @param {boolean} on */
  async use(file, on) {
    const excluded = (work.is?.excluded ?? []).filter((f) => f !== file);
    if (!on) excluded.push(file);
    try {
      await work.change({ excluded });
    } catch (error) {
      this.failed(/** @type {Error} */ (error).message);
      this.show(this.picked);
    }
  }
}
