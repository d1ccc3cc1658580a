// Samples: the table of a campaign, two of them side by side, trends.

import { get, query, send } from "./api.js";
import { baseName, empty, field, fill, h, scroll, select } from "./dom.js";
import { number, withError } from "./format.js";
import { onHappening } from "./events.js";
import { leading, showing } from "./host.js";
import { Plot } from "./plot.js";
import { general } from "./settings.js";
import { store } from "./store.js";
import { work } from "./work.js";

/** Columns with an error of their own, which is shown with them. */
const PAIRS = /** @type {Record<string, string>} */ ({
  twist_deg: "twist_sigma_total_deg", heterostrain_percent: "heterostrain_sigma_total_percent", drift_x_nm_per_min: "drift_x_sigma_nm_per_min", drift_y_nm_per_min: "drift_y_sigma_nm_per_min",
});

/** Columns in words. @type {Record<string, string>} */
const HEADS = { sample: "Sample", moire: "Moiré", status: "Status", scans: "Scans", twist_deg: "Twist (°)", heterostrain_percent: "Heterostrain (%)",
  drift_x_nm_per_min: "Drift x (nm/min)", drift_y_nm_per_min: "Drift y (nm/min)", caveats: "Caveats", failed_files: "Failed files", error: "Error" };

/** @param {string} column */
function head(column) {
  return HEADS[column] ?? column.replace(/_/g, " ");
}

export class SamplesView {
  /** @param {(words: string) => void} failed */
  constructor(failed) {
    this.failed = failed;
    /** @type {{columns: string[], rows: any[], thumbs: (string | null)[], root: string, under: string}} */
    this.table = { columns: [], rows: [], thumbs: [], root: "", under: "" };
    this.sorted = { column: "sample", down: false };
    /** @type {Set<string>} */
    this.pair = new Set();
    /** How often a table was asked for: of several answers that are under way the last asked for counts. */
    this.asked = 0;
    /** The reading of the folders, once for all who wait for it. @type {Promise<void> | null} */
    this.reading = null;
    this.folder = select([["", "reading the folders …"]], "", () => this.load());
    this.host = scroll("Table of samples");
    this.compare = h("div", { class: "compare" });
    this.trend = new Plot({ title: "Trend", x: [], xLabel: "Sample", series: [] });
    this.trend.element.hidden = true;
    this.quantity = select([["twist_deg", "Twist"], ["heterostrain_percent", "Heterostrain"], ["drift_x_nm_per_min", "Drift x"], ["drift_y_nm_per_min", "Drift y"]], "twist_deg", () => this.showTrend());
    /** The campaign that runs. */
    this.campaign = "";
    this.run = h("button", { type: "button", text: "Analyse the samples in it", onclick: () => this.begin() });
    this.cancel = h("button", { type: "button", text: "Cancel", disabled: true, onclick: () => this.end() });
    this.state = h("p", { class: "stage-words", role: "status" });
    this.taken = h("p", {});
    onHappening("campaign", (event) => this.happened(event));
    this.trendBar = h("div", { hidden: true }, field("Trend of", this.quantity));
    this.element = h("div", { class: "columns" },
      h("section", { "aria-label": "Campaign" }, h("h2", { text: "Samples" }), field("Folder of results", this.folder), this.taken, this.trendBar,
        h("h3", { text: "Campaign" }), h("p", { class: "hint", text: "Each folder of scans below the chosen one is a sample. Settings are those of the last analysis." }),
        h("div", { class: "buttons" }, this.run, this.cancel), this.state,
        h("p", { class: "hint", text: "Click the head of a column to sort. Tick two samples to see them side by side." })),
      h("section", { class: "middle", "aria-label": "Samples" }, this.host, this.trend.element, this.compare));
    fill(this.host, empty("Choose the folder with the results of a campaign, or a folder of samples to analyse. You see one row for each sample, with a picture."));
  }

  /** Folders may have been dropped since. */
  shown() {
    return (this.reading ??= this.offerFolders().finally(() => (this.reading = null)));
  }

  async begin() {
    try {
      const [root, under] = JSON.parse(this.folder.value || "[]");
      if (!root) throw new Error("Choose a folder of samples.");
      const { campaign } = await send("POST", "campaigns", { root, under, settings: general(work.is?.settings ?? {}), known: work.is?.known ?? {} });
      this.campaign = campaign;
      await this.follow();
    } catch (error) {
      this.failed(/** @type {Error} */ (error).message);
    }
  }

  async end() {
    await send("POST", `campaigns/${this.campaign}/cancel`).catch((error) => this.failed(error.message));
  }

  /** @param {import("./events.js").Happening} event */
  happened(event) {
    if (event.id !== this.campaign) return;
    if (event.state !== "running") this.follow(event.state);
    else if (event.of) this.state.textContent = `${event.done} of ${event.of} samples`;
  }

  /** How the campaign stands; when it is done its table is shown. @param {string} [ended] a state that the program may not know any more */
  async follow(ended) {
    const is = ended === "cancelled" ? { state: ended } : await get(`campaigns/${this.campaign}`);
    const running = is.state === "running";
    this.run.disabled = running;
    this.cancel.disabled = !running;
    this.state.textContent = { running: "Running", cancelled: "Cancelled. Begun again, it goes on where it was.", failed: is.error ?? "", done: is.failed > 0 ? `Done; ${is.failed} without a result.` : "Done." }[/** @type {string} */ (is.state)] ?? "";
    if (is.state !== "done") return;
    await this.shown();
    this.folder.value = JSON.stringify([is.root, is.under]);
    await this.load();
  }

  async offerFolders() {
    /** @type {[string, string][]} */
    const found = [["", "choose …"]];
    try {
      for (const root of store.state.roots) await this.walk(root, "", 2, found);
    } catch (error) {
      this.failed(/** @type {Error} */ (error).message);
    }
    const chosen = this.folder.value;
    fill(this.folder, found.map(([v, words]) => h("option", { value: v, text: words })));
    if (found.some(([v]) => v === chosen)) this.folder.value = chosen;
  }

  /** @param {any} root @param {string} under @param {number} depth @param {[string, string][]} found */
  async walk(root, under, depth, found) {
    found.push([JSON.stringify([root.root, under]), under ? `${baseName(root.name)} / ${under.replace(/\//g, " / ")}` : baseName(root.name)]);
    if (depth === 0 || found.length > 300) return;
    const { folders } = await get(`folder${query({ root: root.root, under })}`);
    for (const name of folders) await this.walk(root, under ? `${under}/${name}` : name, depth - 1, found);
  }

  async load() {
    const mine = ++this.asked;
    if (!this.folder.value) return;
    const [root, under] = JSON.parse(this.folder.value);
    this.pair.clear();
    try {
      const found = await get(`samples${query({ root, under })}`);
      if (mine !== this.asked) return;
      const columns = found.columns.map((/** @type {any} */ c) => (typeof c === "string" ? c : c.name));
      const rows = found.rows.map((/** @type {any} */ r) => (Array.isArray(r) ? Object.fromEntries(columns.map((/** @type {string} */ c, /** @type {number} */ i) => [c, r[i]])) : r));
      this.table = { columns, rows, thumbs: found.pictures ?? [], root, under };
    } catch (error) {
      if (mine !== this.asked) return;
      const e = /** @type {import("./api.js").ApiError} */ (error);
      this.table = { columns: [], rows: [], thumbs: [], root, under };
      fill(this.host, empty(e.missing ? "This version of the program cannot show campaigns." : [e.message, e.what].filter(Boolean).join(" ")));
    }
    if (this.table.rows.length > 0) this.show();
    fill(this.taken, this.table.rows.length > 0 && leading(h("a", { class: "button", download: "campaign.zip", text: "Table and page as zip" }), `samples/archive.zip${query({ root, under })}`));
    fill(this.compare);
    this.showTrend();
  }

  /** Columns that are shown: errors stand beside their values. */
  get shownColumns() {
    const hidden = new Set([...Object.values(PAIRS), "twist_sigma_deg", "heterostrain_sigma_percent"]);
    // What is empty for all says nothing.
    const empty = (/** @type {any} */ v) => v === "" || v === null || v === undefined || (Array.isArray(v) && v.length === 0);
    const one = this.table.rows.every((r) => Number(r.moire) === 1);
    return this.table.columns.filter((c) => !hidden.has(c) && !(c === "moire" && one) && (c === "sample" || this.table.rows.some((r) => !empty(r[c]))));
  }

  /** @param {any} row @param {string} column */
  cell(row, column) {
    const value = row[column];
    if (value === "" || value === null || value === undefined) return "–";
    const n = Number(value);
    if (PAIRS[column] && Number.isFinite(n)) return withError(n, Number(row[PAIRS[column]]));
    if (Array.isArray(value)) return value.length > 0 ? value.join(", ") : "–";
    return Number.isFinite(n) && !Number.isInteger(n) && column !== "sample" ? number(n, 5) : String(value);
  }

  show() {
    const columns = this.shownColumns;
    const key = this.sorted.column;
    const value = (/** @type {any} */ r) => (Number.isFinite(Number(r[key])) && r[key] !== "" ? Number(r[key]) : String(r[key] ?? ""));
    const order = [...this.table.rows].sort((a, b) => {
      const [x, y] = [value(a), value(b)];
      const c = typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y), "en", { numeric: true });
      return this.sorted.down ? -c : c;
    });
    const heads = columns.map((c) => h("th", { scope: "col", "aria-sort": c === key ? (this.sorted.down ? "descending" : "ascending") : null },
      h("button", { type: "button", class: "sort", text: `${head(c)}${c === key ? (this.sorted.down ? " ↓" : " ↑") : ""}`, onclick: () => {
        this.sorted = { column: c, down: c === key ? !this.sorted.down : false };
        this.show();
      } })));
    const rows = order.map((row) => {
      const name = String(row.sample ?? "");
      const box = h("input", { type: "checkbox", "aria-label": `Compare ${name}` });
      box.checked = this.pair.has(name);
      box.addEventListener("change", () => this.choose(name, box.checked));
      return h("tr", { class: this.pair.has(name) ? "chosen" : null }, h("td", {}, box), h("td", {}, this.thumb(row)), columns.map((c, i) => (i === 0 ? h("th", { scope: "row", text: this.cell(row, c) }) : h("td", { text: this.cell(row, c) }))));
    });
    fill(this.host, h("table", {}, h("caption", { text: `${rows.length} samples` }), h("thead", {}, h("tr", {}, h("th", { scope: "col", text: "Compare" }), h("th", { scope: "col", text: "Picture" }), heads)), h("tbody", {}, rows)));
  }

  /** @param {any} row */
  thumb(row) {
    const { root, under, thumbs, rows } = this.table;
    const name = thumbs[rows.indexOf(row)];
    return name ? showing(h("img", { alt: "", loading: "lazy", width: 64, height: 64 }), `samples/picture${query({ root, under, name })}`) : "";
  }

  /** @param {string} name @param {boolean} on */
  choose(name, on) {
    if (on) this.pair.add(name);
    else this.pair.delete(name);
    if (this.pair.size > 2) this.pair.delete([...this.pair][0]);
    this.show();
    const rows = [...this.pair].map((n) => this.table.rows.find((r) => r.sample === n)).filter(Boolean);
    if (rows.length < 2) {
      fill(this.compare, rows.length === 1 ? empty("Choose one more sample to see the two side by side.") : null);
      return;
    }
    fill(this.compare, rows.map((row) => h("section", { class: "section", "aria-label": String(row.sample) }, h("h2", { text: row.sample }), this.thumb(row),
      h("table", {}, h("caption", { class: "away", text: `Numbers of ${row.sample}` }), h("tbody", {}, this.shownColumns.slice(1).map((c) => h("tr", {}, h("th", { scope: "row", text: head(c) }), h("td", { text: this.cell(row, c) }))))))));
  }

  showTrend() {
    const key = this.quantity.value;
    const rows = this.table.rows.filter((r) => r[key] !== "" && Number.isFinite(Number(r[key])));
    this.trendBar.hidden = rows.length < 2;
    this.trend.element.hidden = rows.length < 2;
    if (rows.length < 2) return;
    const unit = key.includes("deg") ? "°" : key.includes("percent") ? "%" : "nm/min";
    this.trend.set({ title: `${this.quantity.selectedOptions[0].text} of all samples`, x: rows.map((_, i) => i + 1), names: rows.map((r) => String(r.sample)), xLabel: "Sample",
      series: [{ label: this.quantity.selectedOptions[0].text, unit, line: false, y: rows.map((r) => Number(r[key])), sigma: rows.map((r) => Number(r[PAIRS[key]]) || null) }] });
  }
}
