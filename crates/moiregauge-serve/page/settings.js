// The form of the settings of an analysis. What stands at its default is left out of the settings.

import { field, h, select } from "./dom.js";
import { store } from "./store.js";

/** @type {[string, string][]} */
const MATERIALS = ["graphene", "hBN", "MoS2", "MoSe2", "MoTe2", "WS2", "WSe2", "NbSe2"].map((m) => [m, m]);

/** @typedef {{key: string, label: string, kind: "choice" | "number" | "check", options?: [string, string][], usual: any,
 *   hint?: string, more?: boolean}} Entry */

/** @type {Entry[]} */
const ENTRIES = [
  { key: "channel", label: "Channel", kind: "choice", options: [["", "chosen by the program"]], usual: "" },
  { key: "material", label: "Upper layer", kind: "choice", options: [["", "graphene, assumed"], ...MATERIALS], usual: "" },
  { key: "substrate", label: "Lower layer", kind: "choice", options: [["", "the same"], ...MATERIALS], usual: "" },
  { key: "method", label: "Method", kind: "choice", usual: "lattice", options: [["lattice", "lattice fit (best)"], ["autocorrelation", "autocorrelation"], ["fourier", "Fourier"], ["paper", "as published, biased"]] },
  { key: "line", label: "Lines", kind: "choice", usual: "both", options: [["both", "trace and retrace"], ["trace", "trace"], ["retrace", "retrace"]] },
  { key: "background", label: "Background", kind: "choice", usual: "plane", more: true, options: ["mean", "plane", "quadratic", "cubic", "line-mean"].map((b) => [b, b]) },
  { key: "grouping", label: "Sets by", kind: "choice", usual: "auto", more: true, options: [["auto", "axis, rate, size, channel"], ["folder", "folder"], ["file", "file"]] },
  { key: "strain_convention", label: "Strain", kind: "choice", usual: "real-space", more: true, options: [["real-space", "real space"], ["k-space", "k space"]] },
  { key: "ruler", label: "Atoms beside the moiré", kind: "choice", usual: "auto", more: true, options: [["auto", "measure it where that is better"], ["2", "are the upper layer's"], ["1", "are the lower layer's"], ["off", "are left out"]] },
  { key: "moires", label: "Moirés in an image", kind: "number", usual: 1, more: true },
  { key: "seed", label: "Seed", kind: "number", usual: 1, more: true },
  { key: "frame_time_sigma_s", label: "Error of frame times (s)", kind: "number", usual: 0.6, more: true },
  { key: "drift_prior_nm_per_min", label: "Drift where scans do not tell it, ± (nm/min)", kind: "number", usual: 1, more: true },
  { key: "exclude_outliers", label: "Leave out scans that do not fit", kind: "check", usual: false, more: true },
  { key: "overlap", label: "Only the region all scans share", kind: "check", usual: false, more: true },
];

/** The settings that are not about a certain lattice or certain scans. @param {any} settings */
export function general(settings) {
  const keys = [...ENTRIES.map((e) => e.key), "layers_chosen"];
  return Object.fromEntries(Object.entries(settings).filter(([key]) => keys.includes(key)));
}

export class SettingsForm {
  /** @param {() => void} changed */
  constructor(changed) {
    /** Settings that the form has no control for go through unchanged. @type {any} */
    this.others = {};
    /** What the controls said when settings were written into them. @type {Map<string, any>} */
    this.written = new Map(ENTRIES.map((e) => [e.key, e.usual]));
    /** @type {Map<string, HTMLInputElement | HTMLSelectElement>} */
    this.controls = new Map();
    const make = (/** @type {Entry} */ entry) => this.control(entry, changed);
    this.element = h("div", { class: "settings" },
      h("div", { class: "pair" }, ENTRIES.filter((e) => !e.more).map(make)),
      h("details", {}, h("summary", { text: "More settings" }), h("div", { class: "pair" }, ENTRIES.filter((e) => e.more && e.kind !== "check").map(make)), ENTRIES.filter((e) => e.kind === "check").map(make)));
  }

  /** @param {Entry} entry @param {() => void} changed */
  control(entry, changed) {
    if (entry.kind === "check") {
      const box = h("input", { type: "checkbox", onchange: changed });
      this.controls.set(entry.key, box);
      return h("label", { class: "check" }, box, entry.label);
    }
    const control = entry.kind === "choice" ? select(entry.options ?? [], entry.usual, changed)
      : h("input", { type: "number", value: entry.usual, step: "any", onchange: changed });
    this.controls.set(entry.key, control);
    return field(entry.label, control, entry.hint);
  }

  /** The channels of the chosen scans. @param {string[]} files */
  async offerChannels(files) {
    if (files.length === 0) return;
    const control = /** @type {HTMLSelectElement} */ (this.controls.get("channel"));
    try {
      const info = await store.inspect(files[0]);
      const names = [...new Set(info.channels.map((/** @type {any} */ c) => c.name))];
      const value = control.value;
      control.replaceChildren(h("option", { value: "", text: "chosen by the program" }), ...names.map((n) => h("option", { value: n, text: n })));
      control.value = names.includes(value) ? value : "";
    } catch {
      // The program says what is wrong with the file when it is run.
    }
  }

  /** What a control says. @param {Entry} entry */
  valueOf(entry) {
    const control = /** @type {HTMLInputElement | HTMLSelectElement} */ (this.controls.get(entry.key));
    if (entry.kind === "check") return /** @type {HTMLInputElement} */ (control).checked;
    return entry.kind === "number" ? Number(control.value) : control.value;
  }

  /** Whether something was changed since the settings were written into the form. */
  get isChanged() {
    return ENTRIES.some((entry) => this.valueOf(entry) !== this.written.get(entry.key));
  }

  /** The settings with what was changed in the form. @returns {any} */
  read() {
    /** @type {any} */
    const settings = { ...this.others };
    for (const entry of ENTRIES) {
      const value = this.valueOf(entry);
      if (value === this.written.get(entry.key)) continue;
      if (value !== entry.usual) settings[entry.key] = value;
      else delete settings[entry.key];
      // Who names layers names them; who does not, leaves them to the program.
      if (entry.key === "material" || entry.key === "substrate") delete settings.layers_chosen;
    }
    for (const [key, value] of Object.entries(settings)) if (value === null) delete settings[key];
    return settings;
  }

  /** @param {any} settings */
  write(settings) {
    this.others = { ...settings };
    for (const entry of ENTRIES) {
      const control = this.controls.get(entry.key);
      const assumed = entry.key === "material" && settings?.layers_chosen === false;
      const given = assumed ? null : settings?.[entry.key];
      const value = given === null || given === undefined ? entry.usual : given;
      if (!control) continue;
      if (entry.kind === "check") /** @type {HTMLInputElement} */ (control).checked = !!value;
      else {
        const words = typeof value === "object" ? String(value.name ?? "") : String(value);
        if (control instanceof HTMLSelectElement && ![...control.options].some((o) => o.value === words)) control.append(h("option", { value: words, text: words }));
        control.value = words;
      }
      this.written.set(entry.key, this.valueOf(entry));
    }
  }
}
