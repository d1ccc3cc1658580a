// Moiré and plan: layers, twist and strain give the cell; wished errors give a plan.

import { send } from "./api.js";
import { empty, field, fill, h, s, scroll, select, table } from "./dom.js";
import { number, power, quantity } from "./format.js";

/** @type {[string, string][]} */
const LAYERS = [["graphene", "graphene"], ["hBN", "hBN"], ["MoS2", "MoS₂"], ["MoSe2", "MoSe₂"], ["MoTe2", "MoTe₂"], ["WS2", "WS₂"], ["WSe2", "WSe₂"], ["NbSe2", "NbSe₂"]];

/** @typedef {{key: string, label: string, unit: string, low: number, high: number, step: number, value: number}} SliderIs */

/** @type {SliderIs[]} */
const SLIDERS = [
  { key: "twist_deg", label: "Twist", unit: "°", low: 0, high: 5, step: 0.01, value: 1.1 },
  { key: "strain_percent", label: "Uniaxial strain", unit: "%", low: -2, high: 2, step: 0.01, value: 0 },
  { key: "strain_axis_deg", label: "Axis of the strain, from layer 1", unit: "°", low: 0, high: 180, step: 1, value: 0 },
  { key: "biaxial_percent", label: "Biaxial strain", unit: "%", low: -2, high: 2, step: 0.01, value: 0 },
];

export class MoireView {
  constructor() {
    /** @type {Record<string, number>} */
    this.values = Object.fromEntries(SLIDERS.map((x) => [x.key, x.value]));
    this.upper = select(LAYERS, "graphene", () => this.ask());
    this.lower = select(LAYERS, "graphene", () => this.ask());
    this.cell = h("section", { "aria-label": "Moiré", "aria-live": "polite" });
    this.plan = h("section", { "aria-label": "Plan" });
    /** @type {[string, HTMLInputElement][]} */
    this.wishes = [["twist_deg", "Twist (°)"], ["strain_percent", "Strain (%)"], ["drift_nm_per_min", "Drift (nm/min)"]].map(([key, label]) => [key, h("input", { type: "number", min: 0, step: "any", "aria-label": `Wanted error of the ${label}`, placeholder: "any", value: key === "twist_deg" ? 0.02 : "" })]);
    this.maxSize = h("input", { type: "number", min: 0, step: "any", placeholder: "as usual" });
    this.maxRate = h("input", { type: "number", min: 0, step: "any", placeholder: "as usual" });
    this.planState = h("p", { class: "stage-words", role: "status" });
    this.element = h("div", { class: "columns" },
      h("section", { "aria-label": "Layers and plan" }, h("h2", { text: "Layers" }),
        h("div", { class: "pair" }, field("Upper layer (2)", this.upper), field("Lower layer (1)", this.lower)), SLIDERS.map((x) => this.slider(x)),
        h("h2", { text: "Plan" }), h("p", { class: "hint", text: "Errors that you want, for the sample above and the default instrument." }),
        this.wishes.map(([key, input]) => field({ twist_deg: "σ of the twist (°)", strain_percent: "σ of the strain (%)", drift_nm_per_min: "σ of the drift (nm/min)" }[key] ?? key, input)),
        h("div", { class: "pair" }, field("Largest frame (nm)", this.maxSize), field("Fastest (Hz)", this.maxRate)),
        h("div", { class: "buttons" }, h("button", { type: "button", class: "main", text: "Plan", onclick: () => this.askPlan() })), this.planState),
      h("section", { class: "middle" }, this.cell, this.plan));
    fill(this.plan, empty("The plan appears here: how many scans, how fast and how large."));
    /** Of several answers that are under way the last asked for counts. */
    this.asked = 0;
    this.plans = 0;
    this.ask();
  }

  /** @param {SliderIs} is */
  slider(is) {
    const id = `moire-${is.key}`;
    const range = h("input", { type: "range", id, min: is.low, max: is.high, step: is.step, value: is.value });
    const exact = h("input", { type: "number", step: "any", value: is.value, "aria-label": `${is.label}, ${is.unit}` });
    const take = (/** @type {string} */ text) => {
      const value = Number(text);
      if (!Number.isFinite(value) || text === "") return;
      this.values[is.key] = value;
      range.value = String(value);
      if (document.activeElement !== exact) exact.value = String(value);
      this.ask();
    };
    range.addEventListener("input", () => take(range.value));
    exact.addEventListener("input", () => take(exact.value));
    return h("div", { class: "slider" }, h("label", { for: id, text: `${is.label} (${is.unit})` }), range, exact);
  }

  layers() {
    const settings = /** @type {any} */ ({ material: this.upper.value });
    if (this.lower.value !== this.upper.value) settings.substrate = this.lower.value;
    return settings;
  }

  /** The last question counts. */
  async ask() {
    const mine = ++this.asked;
    const body = { given: { layers: this.values }, settings: this.layers() };
    try {
      const answer = await send("POST", "moire", body);
      if (mine === this.asked) this.show(answer);
    } catch (error) {
      const e = /** @type {import("./api.js").ApiError} */ (error);
      if (mine === this.asked) fill(this.cell, empty(e.missing ? "This version of the program does not calculate moirés for the page." : [e.message, e.what].filter(Boolean).join(" ")));
    }
  }

  /** @param {any} answer */
  show(answer) {
    const c = answer.cell;
    const rows = [
      ["Wavelengths", c.wavelengths_nm.map((/** @type {number} */ w) => number(w, 5)).join(", "), "nm"],
      ["Directions", c.polar_angles_deg.map((/** @type {number} */ w) => number(w, 4)).join(", "), "° to x"],
      ["Angle between the first two", number(c.angle_deg, 5), "°"],
      ["Area of the cell", number(c.area_nm2, 5), "nm²"],
      ["One electron per cell", power(c.density_per_electron_cm2), "cm⁻²"],
      [`Full filling, ${c.band_degeneracy} electrons`, power(c.density_full_cm2), "cm⁻²"],
    ];
    fill(this.cell, h("h2", { text: answer.layers ? `Moiré of ${answer.layers}` : "Moiré" }), h("p", { class: "soft", text: answer.input ?? "" }), h("div", { class: "cell-and-table" }, cellFigure(c.vectors_nm), table("The cell", ["Quantity", "Value", "Unit"], rows, { numbers: [1] })));
  }

  async askPlan() {
    const positive = (/** @type {HTMLInputElement} */ i) => (Number(i.value) > 0 ? Number(i.value) : null);
    const wishes = Object.fromEntries(this.wishes.map(([key, input]) => [key, positive(input)]));
    const { twist_deg, strain_percent, strain_axis_deg, biaxial_percent } = this.values;
    const sample = { ...this.layers(), twist_deg, strain_percent, strain_axis_deg, biaxial_percent };
    const mine = ++this.plans;
    this.planState.textContent = "Searching for a plan …";
    try {
      const answer = await send("POST", "plan", { wishes, conditions: { sample }, max_size_nm: positive(this.maxSize), max_rate_hz: positive(this.maxRate) });
      if (mine !== this.plans) return;
      this.showPlan(answer);
      this.planState.textContent = "";
    } catch (error) {
      if (mine !== this.plans) return;
      const e = /** @type {import("./api.js").ApiError} */ (error);
      this.planState.textContent = "";
      fill(this.plan, h("h2", { text: "Plan" }), empty(e.missing ? "This version of the program does not plan for the page." : [e.message, e.what, e.where].filter(Boolean).join(" ")));
    }
  }

  /** The plans as the program ranks them. @param {any} answer */
  showPlan(answer) {
    const plans = answer.plans ?? [];
    const expected = (/** @type {any} */ e) => `${number(e.statistical, 2)} (${number(e.total, 2)})`;
    const rows = plans.map((/** @type {any} */ p, /** @type {number} */ i) => [
      i === 0 && p.met ? "recommended" : p.met ? "" : "misses a wanted error", String(p.set.raster.scans), number(p.set.raster.line_rate_hz, 3), p.size_nm.map((/** @type {number} */ x) => number(x, 3)).join(" × "),
      number(p.duration_s / 60, 3), number(p.drift_sigma_nm_per_min, 2), expected(p.twist_sigma_deg), expected(p.strain_sigma_percent), (p.limited_by ?? "").replace(/-/g, " ")]);
    const beyond = (plans[0]?.out_of_reach ?? []).map((/** @type {any} */ o) => h("p", { class: "caveat warning", text: `The wanted error of the ${o.is_twist ? "twist" : "strain"} is out of reach: calibration and model alone, mostly ${o.largest.replace(/-/g, " ")}, give ${number(o.floor, 2)} ${o.is_twist ? "°" : "%"}.` }));
    fill(this.plan, h("h2", { text: "Plan" }), beyond,
      rows.length > 0 ? scroll("Plans", table("Errors are statistical, and in brackets with calibration and model", ["Plan", "Scans", "Hz", "Frame (nm)", "Minutes", "σ drift (nm/min)", "σ twist (°)", "σ strain (%)", "Limited by"], rows, { numbers: [1, 2, 3, 4, 5, 6, 7], shown: true })) : empty("No plan within these limits."));
  }
}

/**
 * The lattice about one cell.
 * @param {number[][]} vectors nm
 */
function cellFigure(vectors) {
  const [a, b] = vectors;
  // The cell is in the middle.
  const [ox, oy] = [(a[0] + b[0]) / 2, -(a[1] + b[1]) / 2];
  const reach = 2 * Math.max(...vectors.map((v) => Math.hypot(v[0], v[1])));
  const at = (/** @type {number} */ m, /** @type {number} */ n) => [m * a[0] + n * b[0] - ox, -(m * a[1] + n * b[1]) - oy];
  const k = 200 / reach;
  const sites = [];
  for (let m = -6; m <= 6; m++) {
    for (let n = -6; n <= 6; n++) {
      const [x, y] = at(m, n);
      if (Math.abs(x) < reach && Math.abs(y) < reach) sites.push(s("circle", { cx: x * k, cy: y * k, r: 5, class: "site" }));
    }
  }
  const corner = (/** @type {number} */ m, /** @type {number} */ n) => at(m, n).map((v) => v * k).join(",");
  const words = (/** @type {string} */ name, /** @type {number} */ m, /** @type {number} */ n) => {
    const [x, y] = at(m * 0.55, n * 0.55);
    return s("text", { x: x * k + 6, y: y * k - 6 }, name);
  };
  const label = `Lattice vectors ${vectors.slice(0, 2).map((v) => `(${quantity(v[0], "", 4)}, ${quantity(v[1], "nm", 4)})`).join(" and ")}`;
  return s("svg", { class: "cell-figure", viewBox: "-200 -200 400 400", role: "img", "aria-label": label },
    s("polygon", { points: [corner(0, 0), corner(1, 0), corner(1, 1), corner(0, 1)].join(" "), class: "cell" }), ...sites,
    ...[[1, 0], [0, 1]].map(([m, n]) => {
      const [[x0, y0], [x, y]] = [at(0, 0), at(m, n)];
      return s("line", { x1: x0 * k, y1: y0 * k, x2: x * k, y2: y * k, class: "vector" });
    }), words("L1", 1, 0), words("L2", 0, 1));
}
