// What was done by hand, in words, each with a way back.

import { h } from "./dom.js";
import { number } from "./format.js";
import { leftOut } from "./mask.js";
import { store } from "./store.js";

/**
 * @param {import("./work.js").WorkState} is
 * @param {(change: any, words: string) => void} tell
 * @param {(excluded: string[]) => void} exclude
 * @param {() => void} anyReading
 * @param {() => void} allGrains
 */
export function byHandList(is, tell, exclude, anyReading, allGrains) {
  const hand = is.settings?.by_hand ?? {};
  const row = (/** @type {string} */ words, /** @type {string} */ back, /** @type {() => void} */ undo) =>
    h("li", {}, h("span", { text: words }), h("button", { type: "button", class: "link", text: back, "aria-label": `${back}: ${words}`, onclick: undo }));
  const rows = [];
  if (hand.lattice_nm) {
    const vectors = hand.lattice_nm.map((/** @type {number[]} */ v) => `(${number(v[0], 4)}, ${number(v[1], 4)})`).join(", ");
    rows.push(row(`Lattice about ${vectors} nm`, "Drop", () => tell({ lattice_nm: null }, "Lattice by hand dropped")));
  }
  if (hand.near_nm) rows.push(row(`Mean wavelength about ${number(hand.near_nm)} nm`, "Drop", () => tell({ near_nm: null }, "Mean wavelength dropped")));
  const regions = hand.regions_nm ?? [];
  regions.forEach((/** @type {any[]} */ ring, /** @type {number} */ i) =>
    rows.push(row(`Region ${i + 1}, ${ring.length} corners`, "Remove", () => tell({ regions_nm: regions.filter((/** @type {any} */ _, /** @type {number} */ k) => k !== i) }, `Region ${i + 1} removed`))));
  if (hand.mask) rows.push(row(`Mask, ${number(100 * leftOut(hand.mask), 2)} % left out`, "Remove", () => tell({ mask: null }, "Mask removed")));
  if (is.settings?.moire_waves) rows.push(row("Solution chosen", "Drop", anyReading));
  if (is.settings?.grain) rows.push(row(`Grain ${is.settings.grain} alone`, "Use all", allGrains));
  for (const file of is.excluded) rows.push(row(`${store.name(file)} left out`, "Use again", () => exclude(is.excluded.filter((f) => f !== file))));
  return rows.length > 0 ? rows : [h("li", { class: "hint", text: "Nothing." })];
}
