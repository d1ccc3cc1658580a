// What a person may choose in place of the program: another solution of the lattice, another grain of the frame.

import { h, scroll, table } from "./dom.js";
import { number } from "./format.js";

/** @type {Record<string, string>} */
const STANDINGS = { reported: "used", open: "as plausible", "against-image": "the image speaks against it", "against-orientation": "the orientation speaks against it", unlikely: "needs much strain" };

/**
 * The names of the lattice, and with each its twist and strain.
 * @param {any[]} names as the program tells them
 * @param {(waves: number[][]) => void} use
 */
export function readingList(names, use) {
  if (names.length < 2) return null;
  const rows = names.map((name, n) => [
    `${number(name.twist_deg, 4)}`, `${number(name.strain_percent, 3)}`, STANDINGS[name.standing] ?? name.standing,
    n === 0 ? "" : h("button", { type: "button", class: "link", text: "Use", "aria-label": `Use the solution with twist ${number(name.twist_deg, 4)}° and strain ${number(name.strain_percent, 3)} %`, onclick: () => use(name.moire_waves) })]);
  return h("details", { class: "readings" }, h("summary", { text: `${names.length} solutions of this lattice` }),
    scroll("Solutions", table("Twist and strain by which of its waves belong to the atoms", ["Twist (°)", "Strain (%)", "Standing", ""], rows, { numbers: [0, 1], shown: true })));
}

/**
 * Sets of several grains, each of which can be the only one.
 * @param {{name: string}[]} sets
 * @param {(grain: number) => void} use
 */
export function grainSets(sets, use) {
  const number = (/** @type {{name: string}} */ set) => Number(/, grain (\d+)( \(\d+\))?$/.exec(set.name)?.[1] ?? 0);
  const grains = [...new Set(sets.map(number))].filter((n) => n > 0).sort((a, b) => a - b);
  if (grains.length < 2) return null;
  return h("p", { class: "grain" }, "Each grain is a result of its own. ", grains.map((grain) =>
    h("button", { type: "button", text: `Use grain ${grain} alone`, onclick: () => use(grain) })));
}

/**
 * The grains beside the one that is used. A region around one of them chooses it.
 * @param {{share: number, lattice_nm: number[][]}[]} grains
 * @param {() => void} draw
 */
export function grainList(grains, draw) {
  return grains.map((grain) => {
    const words = `Another grain, ${number(100 * grain.share, 2)} % of the frame, ${grain.lattice_nm.map((v) => number(Math.hypot(v[0], v[1]), 3)).join(" and ")} nm`;
    return h("p", { class: "grain" }, `${words}. `, h("button", { type: "button", text: "Draw a region around it", "aria-label": `Draw a region around it: ${words}`, onclick: draw }));
  });
}
