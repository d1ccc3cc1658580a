// Analyse: from chosen scans to twist, heterostrain and drift.

import { get } from "./api.js";
import { baseName, empty, field, fill, h, say, scroll, select } from "./dom.js";
import { total } from "./format.js";
import { leading, showing } from "./host.js";
import { KnownForm } from "./known.js";
import { drawLattice, drawSpots, frameSpots } from "./overlay.js";
import { overlayOf, showPart, showScan, showSpectrum } from "./pictures.js";
import { budgetTable, caveatList, failedList, first, headline, meanOf, scanTable } from "./result.js";
import { ScanList } from "./scanlist.js";
import { ScanPlots } from "./scanplots.js";
import { SettingsForm } from "./settings.js";
import { store } from "./store.js";
import { Viewer } from "./viewer.js";
import { work } from "./work.js";

export class AnalyseView {
  /**
   * @param {(words: string) => void} failed
   * @param {(view: string) => void} open
   */
  constructor(failed, open) {
    this.failed = failed;
    this.open = open;
    this.picked = "";
    this.set = "";
    this.form = new SettingsForm(() => this.showState());
    this.known = new KnownForm();
    this.list = new ScanList((file) => this.pick(file), failed);
    this.plots = new ScanPlots((file) => this.pick(file, true));
    this.run = h("button", { type: "button", class: "main", text: "Analyse", onclick: () => this.start() });
    this.cancel = h("button", { type: "button", text: "Cancel", onclick: () => this.guard(work.do("cancel")) });
    this.bar = h("div", { role: "progressbar", "aria-label": "Progress of the analysis" });
    this.barBox = h("div", { class: "progress", hidden: true }, this.bar);
    this.stage = h("p", { class: "stage-words", role: "status" });
    this.chosen = h("p", { class: "hint" });
    this.results = h("div", {});
    this.pictures = this.makePictures();
    this.left = h("section", { "aria-label": "Scans and settings" },
      h("h2", { text: "Scans" }), this.chosen, this.list.element,
      h("h3", { text: "Settings" }), this.form.element, this.known.element,
      h("div", { class: "buttons" }, this.run, this.cancel), this.barBox, this.stage);
    this.middle = h("section", { class: "middle", "aria-label": "Results" }, this.results);
    this.element = h("div", { class: "columns" }, this.left, this.middle);
    work.addEventListener("state", () => this.showState());
    work.addEventListener("results", () => this.showResults());
    store.addEventListener("chosen", () => this.showState());
    this.showState();
    this.showResults();
    work.restore().then(() => this.adopt(), () => undefined);
  }

  shown() {
    this.showState();
    const files = work.id && !this.otherScans ? work.is?.files ?? [] : [...store.chosen];
    this.form.offerChannels(files);
    this.known.about(files[0]);
  }

  refresh() {
    this.guard(work.refresh());
  }

  /** Form and list follow a work that was there before. */
  async adopt() {
    if (!work.is) return;
    await Promise.all(work.is.files.map((f) => store.inspect(f).catch(() => null)));
    await this.form.offerChannels(work.is.files);
    this.writeForms();
    this.showState();
    if (work.results) this.showResults();
  }

  writeForms() {
    this.form.write(work.is?.settings ?? {});
    this.known.write(work.is?.known ?? {});
  }

  /** Whether other scans are chosen than those of the work. */
  get otherScans() {
    const files = work.is?.files ?? [];
    return store.chosen.size > 0 && (files.length !== store.chosen.size || files.some((f) => !store.chosen.has(f)));
  }

  async start() {
    try {
      const settings = this.form.read();
      if (!work.id || this.otherScans) {
        const order = (/** @type {string} */ f) => `${store.files.get(f)?.folder ?? ""}/${store.name(f)}`;
        const files = [...store.chosen].sort((a, b) => order(a).localeCompare(order(b), "en", { numeric: true }));
        this.picked = "";
        await Promise.all(files.map((f) => store.inspect(f).catch(() => null)));
        await work.create(files, settings, this.known.read());
        this.writeForms();
        await work.do("run");
      } else if (this.form.isChanged || this.known.isChanged) {
        await work.change({ settings, known: this.known.read() });
        this.writeForms();
      }
      else await work.do("run");
    } catch (error) {
      this.failed(/** @type {Error} */ (error).message);
    }
  }

  /** @param {Promise<any>} promise */
  guard(promise) {
    promise.catch((error) => this.failed(error.message));
  }

  showState() {
    const n = store.chosen.size;
    const state = work.is?.state;
    this.run.disabled = work.running || (!work.id && n === 0);
    this.run.textContent = this.otherScans && work.id ? `Analyse the ${n} chosen` : work.id ? "Analyse again" : "Analyse";
    this.cancel.disabled = !work.running;
    fill(this.chosen, work.id ? (this.otherScans ? `${n} other scans are chosen in Look.` : "") :
      n > 0 ? `${n} ${n === 1 ? "scan" : "scans"} chosen.` : empty("No scans are chosen.", h("button", { type: "button", text: "Choose in Look", onclick: () => this.open("look") })));
    this.list.show(this.picked);
    this.list.element.hidden = !work.id;
    const p = work.progress;
    this.barBox.hidden = !work.running;
    const share = p?.of ? Math.min(1, (p.done ?? 0) / p.of) : 0;
    this.bar.style.width = `${100 * share}%`;
    this.bar.setAttribute("aria-valuenow", String(Math.round(100 * share)));
    const words = { running: p?.stage ? `${first(p.stage)}${p.of ? `, ${p.done} of ${p.of}` : ""}` : "Running", cancelled: "Cancelled.", done: work.is?.result?.unsaved ? `Done, but ${work.is.result.unsaved}` : work.is?.result?.saved ? "Done and saved." : "Done.", idle: "" }[state ?? "idle"];
    this.stage.textContent = state === "failed" ? "" : words ?? "";
    if (state === "failed") this.showFailure();
  }

  showFailure() {
    fill(this.results, h("div", { class: "caveat serious", role: "alert" }, h("p", {}, h("b", { text: "No result. " }), work.is?.error ?? "")), failedList(work.is?.failed ?? []));
  }

  makePictures() {
    const make = (/** @type {string} */ label, /** @type {boolean} */ scaleBar) => new Viewer(label, { scaleBar });
    this.image = make("Scan with the lattice found", true);
    this.spectrum = make("Transform of the scan with the spots of the lattice", false);
    this.residual = make("Residual: data minus fit", true);
    this.cellImage = make("Mean moiré cell", true);
    /** @type {import("./overlay.js").Overlay | null} */
    this.overlay = null;
    this.image.addEventListener("view", () => this.image && drawLattice(this.image.drawing, this.image, this.latticeShown ? this.overlay ?? null : null));
    this.spectrum.addEventListener("view", () => this.spectrum && drawSpots(this.spectrum.drawing, this.spectrum, this.latticeShown ? this.overlay ?? null : null));
    this.latticeShown = true;
    const panel = (/** @type {string} */ title, /** @type {Viewer} */ viewer) => h("figure", { class: "panel" }, h("figcaption", { text: title }), viewer.element);
    this.scanName = h("h2", {});
    this.scanNumbers = scroll("Numbers of this scan");
    const toggle = h("input", { type: "checkbox" });
    toggle.checked = true;
    toggle.addEventListener("change", () => {
      this.latticeShown = toggle.checked;
      this.image?.redraw();
      this.spectrum?.redraw();
    });
    return h("section", { class: "section", "aria-label": "One scan" },
      h("div", { class: "bar" }, this.scanName, h("div", { class: "toolbar" },
        h("label", { class: "check" }, toggle, "Lattice"),
        h("button", { type: "button", text: "Previous", onclick: () => this.step(-1) }), h("button", { type: "button", text: "Next", onclick: () => this.step(1) }))),
      h("div", { class: "panels four" }, panel("Scan and lattice", this.image), panel("Transform and spots", this.spectrum), panel("Residual, data − fit", this.residual), panel("Mean moiré cell", this.cellImage)),
      h("details", {}, h("summary", { text: "Numbers of this scan" }), this.scanNumbers));
  }

  /** @param {number} by */
  step(by) {
    const files = work.is?.files ?? [];
    const at = files.indexOf(this.picked);
    if (files.length > 0) this.pick(files[(at + by + files.length) % files.length]);
  }

  async showResults() {
    const results = work.results;
    if (!results) {
      fill(this.results, empty("Results appear here after an analysis: twist, heterostrain and drift with their errors, the uncertainty budget, and caveats."));
      return;
    }
    const found = meanOf(results, this.set);
    const sets = results.sets ?? [];
    const names = /** @type {[string, string][]} */ ([...(results.combined ? [["", "all sets together"]] : []), ...sets.map((/** @type {any} */ s) => [s.name, s.name])]);
    const chooser = sets.length > 1 ? field("Result of", select(names, this.set || names[0][0], (name) => {
      this.set = name;
      this.showResults();
    })) : null;
    if (!this.picked || !work.is?.files.includes(this.picked)) this.picked = work.is?.files.find((f) => !work.is?.excluded.includes(f)) ?? "";
    const scans = work.scans();
    const caveats = await caveatList(results.caveats ?? []);
    if (results !== work.results) return;
    fill(this.results,
      h("div", { class: "bar" }, h("h2", { text: found ? title(results, found) : "No result" }), h("div", { class: "toolbar" }, this.moireChooser(), chooser)),
      found ? headline(found) : null,
      results.failed?.length ? failedList(results.failed) : null,
      results.caveats?.length ? h("section", { "aria-label": "Caveats" }, h("h3", { text: `${results.caveats.length} ${results.caveats.length === 1 ? "caveat" : "caveats"}` }), caveats) : null,
      this.pictures,
      h("section", { class: "section" }, h("h2", { text: "Scan by scan" }), this.plots.element),
      found ? h("section", { class: "section" }, h("h2", { text: "Where the error comes from" }), scroll("Uncertainty budget", budgetTable(found.mean))) : null,
      h("section", { class: "section" }, h("h2", { text: "Figures of the report" }), this.figures()));
    this.plots.show(scans);
    this.list.show(this.picked);
    if (found) say(`New result: twist ${total(found.mean?.twist_deg, "°")}, heterostrain ${total(found.mean?.heterostrain_percent, "%")}`);
    document.documentElement.dataset.result = String(work.version);
    await this.showPictures();
  }

  /** Where images show several moirés. */
  moireChooser() {
    const n = work.is?.result?.moires ?? 1;
    if (n < 2) return null;
    const options = /** @type {[string, string][]} */ (Array.from({ length: n }, (_, i) => [String(i + 1), `${i + 1} of ${n}`]));
    return field("Moiré", select(options, String(work.moire), (value) => {
      work.moire = Number(value);
      this.guard(work.load());
    }));
  }

  /** All figures, asked when they are opened. */
  figures() {
    const host = h("div", { class: "figures" });
    const details = h("details", {}, h("summary", { text: "Show all figures" }), host);
    details.addEventListener("toggle", async () => {
      if (!details.open || host.childElementCount > 0) return;
      try {
        const outputs = await get(work.path("outputs"));
        const figures = outputs.filter((/** @type {any} */ o) => o.name.endsWith(".svg"));
        fill(host, figures.map((/** @type {any} */ o) => {
          const path = work.path(`outputs/${o.name.split("/").map(encodeURIComponent).join("/")}`);
          const words = baseName(o.name).replace(/\.svg$/, "").replace(/-/g, " ");
          return h("figure", {}, leading(h("a", { target: "_blank", rel: "noopener" }, showing(h("img", { alt: words, loading: "lazy" }), path)), path), h("figcaption", { text: words }));
        }));
        if (figures.length === 0) fill(host, empty("There are no figures."));
      } catch (error) {
        fill(host, empty(/** @type {Error} */ (error).message));
      }
    });
    return details;
  }

  /** @param {string} file @param {boolean} [look] */
  pick(file, look = false) {
    this.picked = file;
    this.list.show(file);
    if (look) this.pictures.scrollIntoView({ block: "start" });
    this.showPictures();
  }

  async showPictures() {
    const file = this.picked;
    if (!file || !this.image || !this.spectrum || !this.residual || !this.cellImage || !this.scanName || !this.scanNumbers) return;
    const entry = work.scans().find((s) => s.file === file);
    this.scanName.textContent = store.name(file);
    fill(this.scanNumbers, entry?.scan ? scanTable(entry.scan) : empty("This scan has no result."));
    const channel = entry?.set?.channel ?? work.is?.settings?.channel;
    const rest = [showPart(this.residual, "residual", file), showPart(this.cellImage, "cell", file)];
    try {
      const overlay = await overlayOf(file);
      if (file !== this.picked) return;
      this.overlay = overlay;
      const number = await showScan(this.image, file, channel, overlay);
      await showSpectrum(this.spectrum, file, number);
      frameSpots(this.spectrum, overlay);
    } catch (error) {
      this.image.clear(/** @type {Error} */ (error).message);
    }
    await Promise.all(rest);
  }
}

/** @param {any} results @param {NonNullable<ReturnType<typeof meanOf>>} found */
function title(results, found) {
  const scans = (results.sets ?? []).reduce((/** @type {number} */ n, /** @type {any} */ s) => n + s.scans.filter((/** @type {any} */ x) => !x.excluded).length, 0);
  const name = found.name ? `${found.name.charAt(0).toUpperCase()}${found.name.slice(1)}` : "Result";
  return `${name}${found.name === "all sets together" ? `, ${scans} scans` : ""}${found.corrected ? "" : ", not corrected for drift"}`;
}
