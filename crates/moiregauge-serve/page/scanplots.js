// The numbers of all scans, one plot for each quantity.

import { fill, h } from "./dom.js";
import { Plot } from "./plot.js";

/** @typedef {ReturnType<typeof import("./work.js").work.scans>} Scans */

/** @param {any} scan */
function strain(scan) {
  return scan?.twist_strain?.drift_corrected ?? scan?.twist_strain?.sensor ?? scan?.twist_strain?.nominal ?? null;
}

export class ScanPlots {
  /** @param {(file: string) => void} pick */
  constructor(pick) {
    this.pick = pick;
    /** @type {Map<string, Plot>} */
    this.plots = new Map();
    this.element = h("div", { class: "watch-plots" });
  }

  /** @param {Scans} all */
  show(all) {
    const scans = all.filter((s) => s.scan);
    const x = scans.map((_, i) => i + 1);
    const names = scans.map((s) => s.name);
    const pick = (/** @type {number} */ i) => this.pick(scans[i].file);
    const of = (/** @type {(scan: any) => any} */ take) => {
      const found = scans.map((s) => take(s.scan));
      return { y: found.map((f) => f?.value ?? null), sigma: found.map((f) => f?.sigma ?? null) };
    };
    const usual = { x, names, xLabel: "Scan", pick, height: 180 };
    const vectors = [0, 1, 2].map((k) => ({ label: `L${k + 1}`, unit: "nm", ...of((s) => (s.vectors?.[k]?.drift_corrected ?? s.vectors?.[k]?.sensor ?? s.vectors?.[k]?.nominal)?.wavelength_nm) }));
    this.put("twist", { ...usual, title: "Twist of each scan, drift removed", series: [{ label: "θ", unit: "°", ...of((s) => strain(s)?.twist_deg) }] });
    this.put("strain", { ...usual, title: "Heterostrain of each scan, drift removed", series: [{ label: "ε", unit: "%", ...of((s) => strain(s)?.heterostrain_percent) }] });
    this.put("raw", { ...usual, title: "Twist before and after the drift is removed", series: [
      { label: "as scanned", unit: "°", ...of((s) => (s.twist_strain?.sensor ?? s.twist_strain?.nominal)?.twist_deg) },
      { label: "corrected", unit: "°", ...of((s) => s.twist_strain?.drift_corrected?.twist_deg) }] });
    this.put("wavelengths", { ...usual, title: "Wavelengths of each scan", series: vectors });
    const off = (/** @type {number} */ k) => scans.map((s) => (s.scan.residual?.displacement_nm?.[k] ?? null) === null ? null : 1000 * s.scan.residual.displacement_nm[k]);
    if (scans.some((s) => s.scan.residual)) {
      this.put("residual", { ...usual, title: "Residuals of the joint fit", series: [{ label: "x", unit: "pm", y: off(0) }, { label: "y", unit: "pm", y: off(1) }] });
    }
    const noise = (/** @type {number} */ k) => scans.map((s) => s.scan.lines?.[k]?.signal_to_noise ?? null);
    const lines = [...new Set(scans.flatMap((s) => (s.scan.lines ?? []).map((/** @type {any} */ l) => l.line)))];
    this.put("noise", { ...usual, title: "Signal to noise", zero: true, series: lines.map((label, k) => ({ label, unit: "", y: noise(k) })) });
  }

  /** @param {string} key @param {import("./plot.js").PlotIs} is */
  put(key, is) {
    let plot = this.plots.get(key);
    if (!plot) {
      plot = new Plot(is);
      this.plots.set(key, plot);
      this.element.append(plot.element);
    }
    plot.set(is);
  }

  clear() {
    for (const plot of this.plots.values()) plot.remove();
    this.plots.clear();
    fill(this.element);
  }
}
