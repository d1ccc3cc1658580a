// Watch: a folder at the microscope, frame by frame.

import { get, query, send } from "./api.js";
import { baseName, empty, field, fill, h, say, scroll, select, table } from "./dom.js";
import { onHappening } from "./events.js";
import { plusMinus, total } from "./format.js";
import { IN_ONE_FILE, OPENS_FOLDERS, holdFolder } from "./host.js";
import { Plot } from "./plot.js";
import { caveatList, first, lines } from "./result.js";
import { store } from "./store.js";

/** Results that are held; earlier ones are let go. */
const MOST = 2000;

export class WatchView {
  /** @param {(words: string) => void} failed */
  constructor(failed) {
    this.failed = failed;
    /** @type {any} */
    this.watch = null;
    /** The watch that is followed, and how often it was asked for and answered. */
    this.following = "";
    this.looks = 0;
    this.answered = 0;
    this.folder = select([["", IN_ONE_FILE ? "none is open" : "reading the folders …"]], "", () => undefined);
    this.until = h("input", { type: "number", min: 0, step: "any", placeholder: "none" });
    this.of = select([["twist_deg", "twist (°)"], ["strain_percent", "heterostrain (%)"]], "twist_deg", () => undefined);
    this.start = h("button", { type: "button", class: "main", text: "Watch", onclick: () => this.begin() });
    this.stop = h("button", { type: "button", text: "Stop", onclick: () => this.end() });
    this.state = h("p", { class: "stage-words", role: "status" });
    this.body = h("section", { class: "middle", "aria-label": "Live result" });
    this.head = h("div", { "aria-live": "polite" });
    this.plots = { twist: plot("Twist"), strain: plot("Heterostrain"), drift: plot("Drift") };
    this.frames = scroll("Results of all frames");
    this.advice = h("div", {});
    this.element = h("div", { class: "columns" },
      h("section", { "aria-label": "Folder to watch" }, h("h2", { text: "Watch a folder" }), field("Folder", this.folder), OPENS_FOLDERS && h("button", { type: "button", text: "Open a folder…", onclick: () => this.hold() }),
        field("Stop at an error of", this.of), field("Wanted error", this.until), h("div", { class: "buttons" }, this.start, this.stop), this.state,
        IN_ONE_FILE && !OPENS_FOLDERS && h("p", { class: "hint", text: "This browser cannot hold a folder open: Chromium, Chrome and Edge can, and so do moiregauge watch and moiregauge serve." }),
        h("p", { class: "hint", text: "New scans are analysed as soon as their files are complete. Nothing is written into the folder." })),
      this.body);
    onHappening("watch", (event) => this.happened(event));
    this.show();
    this.restore();
  }

  shown() {
    this.offerFolders();
  }

  refresh() {
    if (this.following) this.take(this.following).catch((e) => this.failed(e.message));
  }

  /** A line comes with its event, so that nothing is asked anew. @param {import("./events.js").Happening} event */
  happened(event) {
    if (event.id !== this.following) return;
    // An answer that is under way may be older than the event.
    if (this.looks !== this.answered) return this.refresh();
    const frames = this.watch.frames ?? [];
    const last = frames.at(-1);
    if (event.line && !(last?.file === event.line.file && last?.frames === event.line.frames)) {
      frames.push(event.line);
      if (frames.length > MOST) frames.splice(0, frames.length - MOST);
      this.watch = { ...this.watch, frames, advice: event.line.advice, warnings: event.line.warnings };
      this.tell(event.line);
    }
    this.watch.state = event.state ?? this.watch.state;
    this.show();
  }

  /** @param {any} line */
  tell(line) {
    say(`${baseName(line.file ?? "")}: twist ${total(twistOf(line), "°")}`);
    document.documentElement.dataset.watched = String(line.frames ?? 0);
  }

  async restore() {
    const known = /** @type {string[]} */ (store.state.watches ?? []);
    if (known.length > 0) await this.take(known[known.length - 1]).catch(() => undefined);
  }

  /** A folder that the user opens. */
  async hold() {
    try {
      const { root, under, name } = await holdFolder();
      this.folder.append(h("option", { value: JSON.stringify([root, under]), text: name, selected: true }));
    } catch (error) {
      // Closed without a choice.
      if (/** @type {Error} */ (error).name !== "AbortError") this.failed(/** @type {Error} */ (error).message);
    }
  }

  /** Folders to the third level below the roots. */
  async offerFolders() {
    // There are those that the user opens.
    if (IN_ONE_FILE) return;
    /** @type {[string, string][]} */
    const found = [];
    const walk = async (/** @type {any} */ root, /** @type {string} */ under, /** @type {number} */ depth) => {
      found.push([JSON.stringify([root.root, under]), under ? `${baseName(root.name)} / ${under.replace(/\//g, " / ")}` : baseName(root.name)]);
      if (depth === 0 || found.length > 300) return;
      const { folders } = await get(`folder${query({ root: root.root, under })}`);
      for (const name of folders) await walk(root, under ? `${under}/${name}` : name, depth - 1);
    };
    try {
      for (const root of store.state.roots.filter((/** @type {any} */ r) => r.root !== "dropped")) await walk(root, "", 2);
    } catch (error) {
      this.failed(/** @type {Error} */ (error).message);
    }
    const value = this.folder.value;
    fill(this.folder, found.map(([v, words]) => h("option", { value: v, text: words })));
    if (found.some(([v]) => v === value)) this.folder.value = value;
  }

  async begin() {
    try {
      const [root, under] = JSON.parse(this.folder.value || "[]");
      if (!root) return this.failed("Open a folder first.");
      const wish = Number(this.until.value) > 0 ? { until: { [this.of.value]: Number(this.until.value) } } : {};
      const { watch } = await send("POST", "watches", { root, under, ...wish });
      await this.take(watch);
    } catch (error) {
      const e = /** @type {import("./api.js").ApiError} */ (error);
      this.failed(e.missing ? "This version of the program cannot watch folders from the page." : e.message);
    }
  }

  async end() {
    if (!this.watch) return;
    try {
      await send("DELETE", `watches/${this.watch.watch}`);
      this.watch = { ...this.watch, state: "ended" };
      this.show();
    } catch (error) {
      this.failed(/** @type {Error} */ (error).message);
    }
  }

  /** Follows a watch; of several answers that are under way the last asked for counts. @param {string} id */
  async take(id) {
    this.following = id;
    const look = ++this.looks;
    try {
      const is = await get(`watches/${id}`);
      if (look !== this.looks) return;
      this.watch = { watch: id, ...is };
    } finally {
      if (look === this.looks) this.answered = look;
    }
    const last = this.watch.frames?.at(-1);
    if (last) this.tell(last);
    this.show();
  }

  show() {
    const going = this.watch && !["ended", "done", "failed", "cancelled"].includes(this.watch.state);
    this.start.disabled = !!going;
    this.stop.disabled = !going;
    const frames = this.watch?.frames ?? [];
    this.state.textContent = !this.watch ? "" : going ? `Watching; ${frames.length} ${frames.length === 1 ? "result" : "results"}` : words(this.watch.error) || (this.watch.state === "done" ? "The wanted error is reached." : "Ended.");
    if (!this.watch) {
      fill(this.body, empty("Choose the folder that the microscope writes to. After each frame you see twist, heterostrain and drift with their errors, what the next frames would give, and when to stop."));
      return;
    }
    if (this.head.parentElement !== this.body) fill(this.body, this.head, this.advice, h("div", { class: "watch-plots" }, Object.values(this.plots).map((p) => p.element)), h("h3", { text: "Frames" }), this.frames);
    const last = frames[frames.length - 1];
    fill(this.head, last ? liveHeadline(last) : empty("No frame yet."));
    this.showAdvice(last);
    this.showPlots(frames);
    this.showFrames(frames);
  }

  /** @param {any} last */
  async showAdvice(last) {
    const advice = list(this.watch.advice);
    const warnings = [...list(this.watch.warnings), ...(last?.error ? [last.error] : []), ...(last?.failed ?? [])];
    const caveats = last?.caveats?.length && typeof last.caveats[0] === "object" ? await caveatList(last.caveats) : null;
    fill(this.advice,
      advice.length > 0 ? h("section", { "aria-label": "Advice" }, h("h3", { text: "Advice" }), h("ul", { class: "advice" }, advice.map((a) => h("li", { text: first(words(a)) })))) : null,
      warnings.length > 0 ? h("section", { "aria-label": "Warnings" }, h("h3", { text: "Warnings" }), h("ul", { class: "warnings" }, warnings.map((w) => h("li", { text: first(words(w)) })))) : null,
      caveats);
  }

  /** @param {any[]} frames */
  showPlots(frames) {
    const x = frames.map((f, i) => f.frames ?? i + 1);
    const names = frames.map((f) => baseName(f.file ?? ""));
    const of = (/** @type {(f: any) => any} */ take) => ({ y: frames.map((f) => take(f)?.value ?? null), sigma: frames.map((f) => take(f)?.sigma_total ?? take(f)?.sigma ?? null) });
    const usual = { x, names, xLabel: "Frames", height: 190 };
    this.plots.twist.set({ ...usual, title: "Twist, total error", series: [{ label: "θ", unit: "°", ...of((f) => f.twist_deg) }] });
    this.plots.strain.set({ ...usual, title: "Heterostrain, total error", series: [{ label: "ε", unit: "%", ...of((f) => f.heterostrain_percent) }] });
    this.plots.drift.set({ ...usual, title: "Drift, total error", series: [{ label: "x", unit: "nm/min", ...of((f) => f.drift?.x_nm_per_min) }, { label: "y", unit: "nm/min", ...of((f) => f.drift?.y_nm_per_min) }] });
  }

  /** @param {any[]} frames */
  showFrames(frames) {
    const rows = frames.slice(-200).reverse().map((f) => [String(f.frames ?? ""), baseName(f.file ?? ""), total(f.twist_deg), total(f.heterostrain_percent), total(f.drift?.x_nm_per_min), total(f.drift?.y_nm_per_min), list(f.caveats).map((c) => (typeof c === "string" ? c : c.code)).join(", ")]);
    fill(this.frames, table("Results, newest first", ["Frames", "File", "Twist (°)", "Heterostrain (%)", "Drift x (nm/min)", "Drift y (nm/min)", "Caveats"], rows, { numbers: [2, 3, 4, 5] }));
  }
}

/** @param {string} title */
function plot(title) {
  return new Plot({ title, x: [], xLabel: "Frames", series: [] });
}

/** @param {any} f */
function liveHeadline(f) {
  const item = (/** @type {string} */ name, /** @type {string} */ value, /** @type {string} */ more) => h("div", {}, h("span", { class: "name", text: name }), h("span", { class: "value", text: value }), h("span", { class: "more", text: more }));
  return h("div", { class: "headline" },
    item("Twist θ", total(twistOf(f), "°"), `after ${f.frames} ${f.frames === 1 ? "frame" : "frames"}${isKnown(f.twist_deg) ? "" : ", not corrected for drift"}`),
    item("Heterostrain ε", total(isKnown(f.heterostrain_percent) ? f.heterostrain_percent : f.uncorrected?.heterostrain_percent, "%"), f.next?.strain_sigma_total_percent ? `two more frames: ${plusMinus(f.next.strain_sigma_total_percent, "%")}` : ""),
    lines("Drift", [["x", total(f.drift?.x_nm_per_min, "nm/min")], ["y", total(f.drift?.y_nm_per_min, "nm/min")]]),
    h("div", {}, h("span", { class: "name", text: "Last frame" }), h("span", { class: "value small", text: baseName(f.file ?? "") }), h("span", { class: "more", text: (f.acquired ?? "").replace("T", " ") })));
}

/** @param {any} estimate */
function isKnown(estimate) {
  return typeof estimate?.value === "number";
}

/** Corrected for drift where that is known. @param {any} f */
function twistOf(f) {
  return isKnown(f.twist_deg) ? f.twist_deg : f.uncorrected?.twist_deg;
}

/** @param {any} value @returns {any[]} */
function list(value) {
  return Array.isArray(value) ? value : value ? [value] : [];
}

/** @param {any} value @returns {string} */
function words(value) {
  if (!value) return "";
  return typeof value === "string" ? value : value.message ?? value.words ?? value.text ?? value.error ?? JSON.stringify(value);
}
