// Take away: the result as files, the command that repeats it, the settings.

import { ask, get } from "./api.js";
import { empty, fill, h, say } from "./dom.js";
import { size } from "./format.js";
import { leading } from "./host.js";
import { work } from "./work.js";

export class TakeView {
  /** @param {(words: string) => void} failed */
  constructor(failed) {
    this.failed = failed;
    this.body = h("div", {});
    this.element = h("div", { class: "page-body" }, h("h2", { text: "Take the result away" }), this.body);
    this.asked = 0;
    work.addEventListener("results", () => this.show());
    work.addEventListener("state", () => work.is?.state !== "done" && this.show());
  }

  shown() {
    work.restore().catch(() => undefined).then(() => this.show());
  }

  async show() {
    const mine = ++this.asked;
    if (!work.id || !work.results) {
      fill(this.body, empty("There is no result yet. Analyse scans first."));
      return;
    }
    const files = h("section", {}, h("h3", { text: "Files" }), h("p", { class: "hint", role: "status", text: "Figures are being drawn …" }));
    const parts = await Promise.all([this.command(), this.settings()]);
    if (mine !== this.asked) return;
    fill(this.body,
      h("p", { class: "buttons" }, leading(h("a", { class: "button", download: "moiregauge-result.zip", text: "Everything as zip" }), work.path("archive.zip")),
        h("span", { class: "hint", text: "results.json, tables, figures and report, as the program writes them" })), parts, files);
    this.outputs().then((found) => mine === this.asked && files.replaceWith(found));
  }

  /**
   * A text to copy.
   * @param {string} title
   * @param {string} text
   * @param {string} hint
   */
  text(title, text, hint) {
    const copy = h("button", { type: "button", text: "Copy", "aria-label": `Copy: ${title}`, onclick: async () => {
      try {
        await navigator.clipboard.writeText(text);
        say("Copied");
        copy.textContent = "Copied";
        setTimeout(() => (copy.textContent = "Copy"), 1500);
      } catch {
        this.failed("The browser does not allow copying; select the text instead.");
      }
    } });
    return h("section", {}, h("div", { class: "bar" }, h("h3", { text: title }), copy), h("p", { class: "hint", text: hint }), h("pre", { tabindex: 0, "aria-label": title }, text));
  }

  async command() {
    try {
      const { command } = await get(work.path("command"));
      return this.text("Command", command, "This command gives the same files in a terminal.");
    } catch (error) {
      return h("section", {}, h("h3", { text: "Command" }), empty(/** @type {Error} */ (error).message));
    }
  }

  async settings() {
    try {
      const text = await (await ask(work.path("settings.toml"))).text();
      return text.trim() === "" ? h("section", {}, h("h3", { text: "Settings" }), h("p", { class: "hint", text: "All settings have their defaults: no file is needed." })) : this.text("Settings", text, "As settings.toml, for --config settings.toml.");
    } catch (error) {
      return h("section", {}, h("h3", { text: "Settings" }), empty(/** @type {Error} */ (error).message));
    }
  }

  async outputs() {
    try {
      const outputs = await get(work.path("outputs"));
      const link = (/** @type {any} */ o) => h("li", {}, leading(h("a", { target: "_blank", rel: "noopener", text: o.name }), work.path(`outputs/${o.name.split("/").map(encodeURIComponent).join("/")}`)), h("span", { class: "soft", text: `  ${size(o.bytes)}` }));
      return h("section", {}, h("h3", { text: `${outputs.length} files` }), h("ul", { class: "outputs" }, outputs.map(link)));
    } catch (error) {
      return h("section", {}, h("h3", { text: "Files" }), empty(/** @type {Error} */ (error).message));
    }
  }
}
