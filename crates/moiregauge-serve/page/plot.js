// Plots with errors, values under the pointer, points to click, and the same numbers as a table.

import uPlot from "./uPlot.esm.js";
import { fill, h, scroll, table } from "./dom.js";
import { number, withError } from "./format.js";

/** @typedef {{label: string, unit: string, y: (number | null)[], sigma?: (number | null)[], colour?: number,
 *   line?: boolean}} Series */
/** @typedef {{title: string, x: number[], xLabel: string, xUnit?: string, names?: string[], series: Series[],
 *   height?: number, pick?: (index: number) => void, zero?: boolean, folded?: boolean, fine?: boolean}} PlotIs */

/** @type {Set<Plot>} */
const plots = new Set();

/** Colours come from the style sheet. @param {string} name */
function token(name) {
  return getComputedStyle(document.documentElement).getPropertyValue(name).trim();
}

/** Draws all plots anew after the colours changed. */
export function recolour() {
  for (const plot of plots) plot.build();
}

export class Plot {
  /** @param {PlotIs} is */
  constructor(is) {
    this.is = is;
    this.host = h("div", { class: "plot-host", "aria-hidden": "true" });
    this.readout = h("div", { class: "plot-readout", "aria-hidden": "true" });
    this.tableHost = scroll(`Table: ${is.title}`);
    this.details = h("details", { class: "figure-table" }, h("summary", { text: "Table" }), this.tableHost);
    this.details.addEventListener("toggle", () => this.fillTable());
    this.caption = h("figcaption", { text: is.title });
    this.element = h("figure", { class: "plot" }, this.caption, this.host, this.readout, this.details);
    /** @type {any} */
    this.chart = null;
    new ResizeObserver(() => this.fitWidth()).observe(this.host);
    plots.add(this);
  }

  /** @param {PlotIs} is */
  set(is) {
    this.is = is;
    this.caption.textContent = is.title;
    this.build();
    this.fillTable();
  }

  fitWidth() {
    const width = this.host.clientWidth;
    if (width === 0) return;
    if (!this.chart) this.build();
    else if (Math.abs(this.chart.width - width) > 1) this.chart.setSize({ width, height: this.chart.height });
  }

  build() {
    this.chart?.destroy();
    this.chart = null;
    fill(this.host);
    const width = this.host.clientWidth;
    if (width === 0 || this.is.x.length === 0) return;
    const ink = token("--soft");
    const grid = { stroke: token("--hair"), width: 1 };
    const axis = { stroke: ink, grid, ticks: { ...grid, size: 4 }, font: "11px system-ui, sans-serif", labelFont: "11px system-ui, sans-serif", labelSize: 18, labelGap: 0 };
    const unit = this.is.series[0]?.unit;
    const label = (/** @type {string} */ words, /** @type {string | undefined} */ u) => (u && words ? `${words} (${u})` : words || u || "");
    // Numbers of scans are whole.
    const whole = this.is.x.every(Number.isInteger) ? { incrs: [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000] } : {};
    const shared = this.is.series.length > 1 ? "" : this.is.series[0].label;
    const plain = (/** @type {any} */ _u, /** @type {number[]} */ ticks) => ticks.map((t) => String(Number(t.toPrecision(9))).replace("-", "\u2212"));
    this.chart = new uPlot({
      width,
      height: this.is.height ?? 190,
      padding: [8, 12, 0, 0],
      legend: { show: false },
      cursor: { y: false, points: { size: 8 }, drag: { x: true, y: false } },
      scales: { x: { time: false, range: (/** @type {any} */ _u, /** @type {number} */ a, /** @type {number} */ b) => this.rangeX(a, b) }, y: { range: () => this.rangeY() } },
      axes: [
        { ...axis, ...whole, label: label(this.is.xLabel, this.is.xUnit), size: 28, values: plain },
        { ...axis, label: label(shared, unit), size: 62, values: plain },
      ],
      series: [{}, ...this.is.series.map((sr, i) => this.lineOf(sr, i))],
      hooks: { draw: [(/** @type {any} */ u) => this.drawErrors(u)], setCursor: [(/** @type {any} */ u) => this.tell(u.cursor.idx)] },
    }, /** @type {any} */ ([this.is.x, ...this.is.series.map((sr) => sr.y)]), this.host);
    if (this.is.pick) {
      this.chart.over.classList.add("pickable");
      this.chart.over.addEventListener("click", () => {
        const index = this.chart.cursor.idx;
        if (index !== null && index !== undefined) this.is.pick?.(index);
      });
    }
    this.tell(null);
  }

  /** @param {Series} series @param {number} i */
  lineOf(series, i) {
    const stroke = this.colour(series, i);
    const points = { show: !this.is.fine, size: 6, stroke, fill: token("--ground"), width: 1.5 };
    return { label: series.label, stroke, width: series.line === false ? 0 : 1.4, points };
  }

  /** @param {Series} series @param {number} i */
  colour(series, i) {
    return token(`--series-${((series.colour ?? i) % 4) + 1}`);
  }

  /** @param {number} low @param {number} high @returns {[number, number]} */
  rangeX(low, high) {
    const gap = this.is.fine ? 0 : high > low ? (high - low) * 0.03 : 1;
    return [low - gap, high + gap];
  }

  /** The values with their errors. @returns {[number, number]} */
  rangeY() {
    let low = Infinity, high = -Infinity;
    for (const { y, sigma } of this.is.series) {
      y.forEach((value, i) => {
        if (value === null || !Number.isFinite(value)) return;
        const e = sigma?.[i] ?? 0;
        low = Math.min(low, value - e);
        high = Math.max(high, value + e);
      });
    }
    if (!(high >= low)) return [0, 1];
    if (this.is.zero) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
    const gap = (high - low || Math.abs(high) * 0.1 || 1) * 0.08;
    return [low - gap, high + gap];
  }

  /** @param {any} u */
  drawErrors(u) {
    const context = u.ctx;
    context.save();
    context.lineWidth = 1.2 * devicePixelRatio;
    this.is.series.forEach((series, i) => {
      if (!series.sigma) return;
      context.strokeStyle = this.colour(series, i);
      context.beginPath();
      series.y.forEach((value, k) => {
        const e = series.sigma?.[k];
        if (value === null || !e) return;
        const x = u.valToPos(this.is.x[k], "x", true);
        context.moveTo(x, u.valToPos(value - e, "y", true));
        context.lineTo(x, u.valToPos(value + e, "y", true));
      });
      context.stroke();
    });
    context.restore();
  }

  /** @param {number | null | undefined} index */
  tell(index) {
    if (index === null || index === undefined) {
      // The names stay, so that the colours have a meaning without a pointer.
      fill(this.readout, this.is.series.length > 1 ? this.is.series.map((sr, i) => this.key(sr, i, sr.label)) : "\u00a0");
      return;
    }
    const name = this.is.names?.[index] ?? `${this.is.xLabel} ${number(this.is.x[index])}\u202f${this.is.xUnit ?? ""}`;
    fill(this.readout, h("b", { text: name }),
      this.is.series.map((sr, i) => this.key(sr, i, `${this.is.series.length > 1 ? sr.label + " " : ""}${this.words(sr, index)}`)));
  }

  /** @param {Series} sr @param {number} i @param {string} text */
  key(sr, i, text) {
    return h("span", { class: "key" }, h("i", { css: { background: this.colour(sr, i) } }), text);
  }

  /** @param {Series} series @param {number} i */
  words(series, i) {
    const value = series.y[i];
    if (series.sigma?.[i]) return withError(value, series.sigma[i], series.unit);
    return `${number(value, 5)}${series.unit === "°" ? "" : "\u202f"}${series.unit}`;
  }

  fillTable() {
    if (!this.details.open) return fill(this.tableHost);
    const first = this.is.names ? "Scan" : `${this.is.xLabel}${this.is.xUnit ? ` (${this.is.xUnit})` : ""}`;
    const head = [first, ...this.is.series.map((sr) => `${sr.label}${sr.unit ? ` (${sr.unit})` : ""}`)];
    const rows = this.is.x.slice(0, 2000).map((x, i) => {
      const name = this.is.names?.[i] ?? number(x, 6);
      const pick = this.is.pick;
      const cell = pick ? h("button", { type: "button", class: "link", text: name, onclick: () => pick(i) }) : name;
      return [cell, ...this.is.series.map((sr) => (sr.sigma ? withError(sr.y[i], sr.sigma[i]) : number(sr.y[i], 6)))];
    });
    fill(this.tableHost, table(this.is.title, head, rows, { numbers: head.map((_, i) => i).slice(1) }));
  }

  remove() {
    plots.delete(this);
    this.chart?.destroy();
    this.element.remove();
  }
}
