// Results in words: headline, budget, caveats. Numbers are those of the document, rounded.

import { get } from "./api.js";
import { h, table } from "./dom.js";
import { number, plusMinus, quantity, total, withError, words } from "./format.js";

/** @type {Promise<any[]> | null} */
let explained = null;

/** What caveats mean, asked once. @returns {Promise<any[]>} */
function explanations() {
  explained ??= get("caveats").catch(() => {
    explained = null;
    return [];
  });
  return explained;
}

/**
 * The mean that stands for the results: of all sets together, or that of one set, without a drift with an assumed one in its errors.
 * @param {any} results
 * @param {string} [chosen] name of a set
 */
export function meanOf(results, chosen) {
  const sets = results?.sets ?? [];
  const set = sets.find((/** @type {any} */ s) => s.name === chosen);
  if (!set && results?.combined && sets.length > 1) return { name: "all sets together", mean: results.combined, drift: results.combined.drift, corrected: true };
  const one = set ?? sets[0];
  if (!one) return null;
  return { name: one.name, mean: one.mean ?? one.uncorrected, drift: one.drift, corrected: !!one.mean && !one.mean.drift_assumed };
}

/**
 * @param {string} name
 * @param {string} value
 * @param {string | null} [more]
 * @param {boolean} [small]
 */
function item(name, value, more, small) {
  return h("div", {}, h("span", { class: "name", text: name }), h("span", { class: small ? "value small" : "value", text: value }), more ? h("span", { class: "more", text: more }) : null);
}

/** @param {any} estimate @param {string} unit */
function statistical(estimate, unit) {
  return estimate?.sigma_total === undefined || !estimate ? null : `statistical ${plusMinus(estimate.sigma, unit)}`;
}

/**
 * Twist, heterostrain, drift and lattice with their total errors.
 * @param {NonNullable<ReturnType<typeof meanOf>>} found
 */
export function headline(found) {
  const { mean, drift } = found;
  const interval = mean?.strain_interval_95_percent;
  const axis = mean?.strain_axis_lab_deg;
  return h("div", { class: "headline" },
    item("Twist θ", total(mean?.twist_deg, "°"), statistical(mean?.twist_deg, "°")),
    item("Heterostrain ε", total(mean?.heterostrain_percent, "%"), interval ? `95 %: ${number(interval[0])} to ${number(interval[1])} % (statistical)` : statistical(mean?.heterostrain_percent, "%")),
    item("Axis of tension, to x", axis ? total(axis, "°") : "not significant", axis ? statistical(axis, "°") : null),
    drift ? lines(drift.given ? "Drift, as given" : "Drift", [["x", total(drift.x_nm_per_min, "nm/min")], ["y", total(drift.y_nm_per_min, "nm/min")]])
      : item("Drift", "not determined", mean?.drift_assumed ? `assumed: 0 ± ${number(mean.drift_assumed.sigma_nm_per_min)} nm/min, in the errors` : "Twist and strain are not corrected for drift", true),
    lines("Wavelengths, angles to x", (mean?.vectors ?? []).map((/** @type {any} */ v) => [total(v.wavelength_nm, "nm"), `at ${number(v.polar_angle_deg, 4)}°`])));
}

/**
 * Several numbers under one name.
 * @param {string} name
 * @param {[string, string][]} rows
 */
export function lines(name, rows) {
  return h("div", {}, h("span", { class: "name", text: name }), h("div", { class: "lines" }, rows.flatMap(([a, b]) => [h("span", { text: a }), h("span", { text: b })])));
}

/** What contributes how much to the error. @param {any} mean */
export function budgetTable(mean) {
  const budget = mean?.budget;
  if (!budget?.twist_deg) return null;
  const sources = Object.keys(budget.twist_deg).filter((k) => k !== "total");
  const greatest = (/** @type {any} */ b) => Math.max(...sources.map((k) => b[k]));
  const share = (/** @type {any} */ b, /** @type {string} */ k) =>
    h("div", { class: "share-bar", css: { width: `${Math.max(0.5, (100 * b[k]) / greatest(b))}%` } });
  const digits = (/** @type {number} */ v) => (v === 0 ? "0" : number(v, 2));
  const { twist_deg: t, heterostrain_percent: e } = budget;
  /** @type {import("./dom.js").Child[][]} */
  const rows = sources.map((k) => [words(k), share(t, k), digits(t[k]), share(e, k), digits(e[k])]);
  rows.push([h("b", { text: "all together" }), "", h("b", { text: digits(t.total) }), "", h("b", { text: digits(e.total) })]);
  const made = table("One standard deviation for each source of error", ["Source", "Share", "Twist (°)", "Share", "Heterostrain (%)"], rows, { numbers: [2, 4], class: "bars" });
  for (const cell of made.querySelectorAll("td:nth-child(2), td:nth-child(4)")) cell.classList.add("share");
  return made;
}

/**
 * Doubts, those of one kind together, the serious ones first, with what to do.
 * @param {any[]} caveats
 */
export async function caveatList(caveats) {
  const table = await explanations();
  /** @type {Map<string, any[]>} */
  const kinds = new Map();
  for (const c of caveats) kinds.set(c.code, [...(kinds.get(c.code) ?? []), c]);
  const order = ["serious", "warning", "note"];
  const known = [...kinds].map(([code, all]) => ({ code, all, about: table.find((e) => e.code === code) ?? { severity: "warning" } }));
  known.sort((a, b) => order.indexOf(a.about.severity) - order.indexOf(b.about.severity));
  return h("ul", { class: "caveats" }, known.map(({ code, all, about }) =>
    h("li", { class: `caveat ${about.severity}` },
      h("p", {}, h("span", { class: "code", text: first(code.replace(/-/g, " ")) }), h("span", { class: "soft", text: `  ${about.severity}` })),
      all.slice(0, 3).map((c) => h("p", {}, `${first(c.message)}. `, h("span", { class: "where", text: c.where }))),
      all.length > 3 ? h("p", { class: "where", text: `and ${all.length - 3} more: ${all.slice(3).map((c) => c.where).join(", ")}` }) : null,
      about.what_to_do ? h("p", {}, h("b", { text: "What to do: " }), about.what_to_do) : null,
      about.meaning ? h("details", {}, h("summary", { text: "What it means" }), h("p", { text: about.meaning })) : null)));
}

/** With a capital letter. @param {string} text */
export function first(text) {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

/** Files that could not be used. @param {any[]} failed */
export function failedList(failed) {
  return h("ul", { class: "caveats" }, failed.map((f) => h("li", { class: "caveat serious" },
    h("p", {}, h("span", { class: "code", text: "not used " }), h("span", { class: "where", text: f.file ?? "" })),
    h("p", { text: f.error ?? f.message ?? f.reason ?? (typeof f === "string" ? f : JSON.stringify(f)) }))));
}

/** The numbers of one scan. @param {any} scan */
export function scanTable(scan) {
  const ts = scan.twist_strain ?? {};
  const best = ts.drift_corrected ?? ts.sensor ?? ts.nominal;
  const rows = [];
  if (best) {
    rows.push(["Twist", total(best.twist_deg, "°")], ["Heterostrain", total(best.heterostrain_percent, "%")]);
    if (best.strain_axis_lab_deg) rows.push(["Axis of tension, to x", total(best.strain_axis_lab_deg, "°")]);
  }
  for (const v of scan.vectors ?? []) {
    const at = v.drift_corrected ?? v.sensor ?? v.nominal;
    rows.push([`${v.name}`, `${withError(at.wavelength_nm.value, at.wavelength_nm.sigma, "nm")} at ${quantity(v.polar_angle_deg, "°")}`]);
  }
  rows.push(["Frame", [scan.frame_direction, scan.acquired?.replace("T", " ")].filter(Boolean).join(", ")]);
  if (scan.residual) rows.push(["Fit to the others", `χ² ${number(scan.residual.chi2, 3)} of ${scan.residual.degrees_of_freedom}, p = ${number(scan.residual.p_value, 2)}`]);
  return table("Numbers of this scan, statistical errors", ["Quantity", "Value"], rows);
}
