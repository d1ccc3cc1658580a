// What was found, drawn over images as SVG: the lattice, its spots, the region that carries it.

import { reciprocal } from "./byhand.js";
import { fill, s } from "./dom.js";

/** @typedef {import("./viewer.js").Viewer} Viewer */
/** @typedef {[number, number]} Pair */
/** @typedef {{line?: string, origin_px?: Pair, lattice_px: [Pair, Pair], lattice_nm?: [Pair, Pair],
 *   outline_px?: [Pair, Pair][], displacement_px?: Pair[], grains?: {share: number, lattice_nm: number[][]}[]}} Overlay the outline is a set of sides; the origin is that of the drawing */

/** At most this many cells are drawn; more would hide the image. */
const MOST = 4000;

/**
 * The lattice over an image: a circle on every lattice point, one cell, and the outline of the region.
 * @param {SVGGElement} group
 * @param {Viewer} viewer
 * @param {Overlay | null} overlay
 * @param {{cell?: boolean}} [options]
 */
export function drawLattice(group, viewer, overlay, options = {}) {
  fill(group);
  if (!overlay?.lattice_px || !viewer.image) return;
  group.append(dots(viewer, overlay));
  if (options.cell !== false) group.append(...cell(viewer, overlay));
  const sides = (overlay.outline_px ?? []).map(([a, b]) => `M${place(viewer, a[0], a[1])}L${place(viewer, b[0], b[1])}`).join("");
  if (sides) group.append(s("path", { d: sides, class: "cell-halo" }), s("path", { d: sides, class: "outline" }));
}

/**
 * How far from its own place a pixel is on a straight grid: between the places that are known.
 * @param {Viewer} viewer
 * @param {Overlay} overlay
 * @param {Pair} pixel
 * @returns {Pair}
 */
export function displacement(viewer, { displacement_px: known }, [x, y]) {
  if (!known?.length) return [0, 0];
  const side = Math.round(Math.sqrt(known.length));
  const along = (/** @type {number} */ at, /** @type {number} */ size) => {
    const u = Math.max(0, Math.min(1, at / (size - 1))) * (side - 1);
    const first = Math.min(side - 2, Math.floor(u));
    return { first, share: u - first };
  };
  const [i, j] = [along(x, viewer.columns), along(y, viewer.rows)];
  const at = (/** @type {number} */ k) => {
    const row = (/** @type {number} */ n) => {
      const from = n * side + i.first;
      return known[from][k] * (1 - i.share) + known[from + 1][k] * i.share;
    };
    return row(j.first) * (1 - j.share) + row(j.first + 1) * j.share;
  };
  return [at(0), at(1)];
}

/**
 * The pixel at which a scanner that bends was at a place of the straight grid.
 * @param {Viewer} viewer
 * @param {Overlay} overlay
 * @param {Pair} straight
 * @returns {Pair}
 */
export function pixelOf(viewer, overlay, straight) {
  let pixel = straight;
  for (let n = 0; n < 3; n++) {
    const [u, v] = displacement(viewer, overlay, pixel);
    pixel = [straight[0] - u, straight[1] - v];
  }
  return pixel;
}

/** @param {Viewer} viewer @param {number} x @param {number} y */
function place(viewer, x, y) {
  const at = viewer.toScreen(x, y);
  return `${at.x.toFixed(1)},${at.y.toFixed(1)}`;
}

/**
 * Where circles are put: on the brightest place of the image folded into one cell. It is for the eye; nothing is
 * measured with it.
 * @param {Viewer} viewer
 * @param {Overlay} overlay
 * @returns {Pair}
 */
export function brightPlace(viewer, overlay) {
  const [a, b] = overlay.lattice_px;
  const { image, shown, step } = viewer;
  const det = a[0] * b[1] - a[1] * b[0];
  const bins = 16;
  if (!image || !shown || !(Math.abs(det) > 0)) return [0, 0];
  const sums = new Float64Array(bins * bins);
  const counts = new Float64Array(bins * bins);
  for (let j = 0, n = 0; j < image.height; j++) {
    for (let i = 0; i < image.width; i++, n++) {
      const z = shown[n];
      if (Number.isNaN(z)) continue;
      const [column, row] = [(i + 0.5) * step - 0.5, (j + 0.5) * step - 0.5];
      const off = displacement(viewer, overlay, [column, row]);
      const [x, y] = [column + off[0], row + off[1]];
      const u = (x * b[1] - y * b[0]) / det;
      const v = (a[0] * y - a[1] * x) / det;
      const bin = Math.floor((v - Math.floor(v)) * bins) * bins + Math.floor((u - Math.floor(u)) * bins);
      sums[bin] += z;
      counts[bin]++;
    }
  }
  const mean = (/** @type {number} */ i, /** @type {number} */ j) => {
    const bin = ((j + bins) % bins) * bins + ((i + bins) % bins);
    return counts[bin] > 0 ? sums[bin] / counts[bin] : 0;
  };
  let best = -Infinity;
  let at = [0, 0];
  for (let j = 0; j < bins; j++) {
    for (let i = 0; i < bins; i++) {
      let sum = 0;
      for (let k = -2; k <= 2; k++) for (let l = -2; l <= 2; l++) sum += mean(i + k, j + l);
      if (sum > best) [best, at] = [sum, [(i + 0.5) / bins, (j + 0.5) / bins]];
    }
  }
  // The middle of what is bright about it.
  const [bi, bj] = [Math.floor(at[0] * bins), Math.floor(at[1] * bins)];
  let low = Infinity;
  for (let j = -3; j <= 3; j++) for (let i = -3; i <= 3; i++) low = Math.min(low, mean(bi + i, bj + j));
  let [weight, u, v] = [0, 0, 0];
  for (let j = -3; j <= 3; j++) {
    for (let i = -3; i <= 3; i++) {
      const w = (mean(bi + i, bj + j) - low) ** 2;
      weight += w;
      u += w * i;
      v += w * j;
    }
  }
  if (weight > 0) at = [at[0] + u / weight / bins, at[1] + v / weight / bins];
  return [at[0] * a[0] + at[1] * b[0], at[0] * a[1] + at[1] * b[1]];
}

/** The lattice point nearest to the middle of what is seen. @param {Viewer} viewer @param {Overlay} overlay @returns {Pair} */
export function nearMiddle(viewer, { origin_px: o = [0, 0], lattice_px: [a, b] }) {
  const det = a[0] * b[1] - a[1] * b[0];
  const [x, y] = [viewer.columns / 2 - o[0], viewer.rows / 2 - o[1]];
  const m = Math.round((x * b[1] - y * b[0]) / det);
  const n = Math.round((a[0] * y - a[1] * x) / det);
  return [o[0] + m * a[0] + n * b[0], o[1] + m * a[1] + n * b[1]];
}

/** @param {Viewer} viewer @param {Overlay} overlay */
function dots(viewer, overlay) {
  const group = s("g", { class: "dots" });
  const [a, b] = overlay.lattice_px;
  const o = nearMiddle(viewer, overlay);
  const area = Math.abs(a[0] * b[1] - a[1] * b[0]);
  if (!(area > 0) || (viewer.columns * viewer.rows) / area > MOST) return group;
  const shortest = Math.min(Math.hypot(...a), Math.hypot(...b), Math.hypot(b[0] - a[0], b[1] - a[1]), Math.hypot(b[0] + a[0], b[1] + a[1]));
  const radius = Math.max(2, Math.min(9, 0.14 * shortest * viewer.pixelX * viewer.view.scale));
  const reach = Math.ceil(Math.hypot(viewer.columns, viewer.rows) * Math.max(Math.hypot(...a), Math.hypot(...b)) / area) + 1;
  for (let m = -reach; m <= reach; m++) {
    for (let n = -reach; n <= reach; n++) {
      const [x, y] = pixelOf(viewer, overlay, [o[0] + m * a[0] + n * b[0], o[1] + m * a[1] + n * b[1]]);
      if (x < -0.5 || y < -0.5 || x > viewer.columns - 0.5 || y > viewer.rows - 0.5) continue;
      const at = viewer.toScreen(x, y);
      if (at.x < -20 || at.y < -20 || at.x > viewer.stage.clientWidth + 20 || at.y > viewer.stage.clientHeight + 20) continue;
      group.append(s("circle", { cx: at.x.toFixed(1), cy: at.y.toFixed(1), r: radius, class: "halo" }), s("circle", { cx: at.x.toFixed(1), cy: at.y.toFixed(1), r: radius }));
    }
  }
  return group;
}

/** @param {Viewer} viewer @param {Overlay} overlay */
function cell(viewer, overlay) {
  const o = nearMiddle(viewer, overlay);
  const [a, b] = overlay.lattice_px;
  /** @type {Pair[]} */
  const corners = [o, [o[0] + a[0], o[1] + a[1]], [o[0] + a[0] + b[0], o[1] + a[1] + b[1]], [o[0] + b[0], o[1] + b[1]]];
  const points = corners.map((corner) => place(viewer, ...pixelOf(viewer, overlay, corner))).join(" ");
  return [s("polygon", { points, class: "cell-halo" }), s("polygon", { points, class: "cell" })];
}

/**
 * Where a wave vector lies in a transform whose zero is in the middle.
 * @param {import("./api.js").Floats} image
 * @param {Pair} k periods per pixel
 */
export function spotPlace(image, k) {
  return { x: Math.floor(image.width / 2) + k[0] / image.steps[0], y: Math.floor(image.height / 2) + k[1] / image.steps[1] };
}

/**
 * The wave vector of a place.
 * @param {import("./api.js").Floats} image
 * @param {{x: number, y: number}} at
 * @returns {Pair} periods per pixel
 */
export function waveAt(image, at) {
  return [(at.x - Math.floor(image.width / 2)) * image.steps[0], (at.y - Math.floor(image.height / 2)) * image.steps[1]];
}

/**
 * The first shell of a lattice on the image: two wave vectors and the third that closes the triangle.
 * @param {[Pair, Pair]} vectors px
 * @returns {Pair[]} periods per pixel
 */
export function firstShell(vectors) {
  const [g, k] = reciprocal(vectors);
  const sign = g[0] * k[0] + g[1] * k[1] > 0 ? -1 : 1;
  return [g, k, [g[0] + sign * k[0], g[1] + sign * k[1]]];
}

/**
 * Circles about the spots of a lattice in its transform, and those opposite to them.
 * @param {SVGGElement} group
 * @param {Viewer} viewer
 * @param {Overlay | null} overlay
 */
export function drawSpots(group, viewer, overlay) {
  fill(group);
  if (!overlay?.lattice_px || !viewer.image || !(viewer.image.steps[0] > 0)) return;
  const all = s("g", { class: "dots" });
  const both = firstShell(overlay.lattice_px).flatMap((k) => /** @type {Pair[]} */ ([k, [-k[0], -k[1]]]));
  for (const k of both) {
    const p = spotPlace(viewer.image, k);
    const at = viewer.toScreen(p.x, p.y);
    all.append(s("circle", { cx: at.x, cy: at.y, r: 9, class: "halo" }), s("circle", { cx: at.x, cy: at.y, r: 9 }));
  }
  group.append(all);
}

/**
 * Shows the part of a transform where the spots are.
 * @param {Viewer} viewer
 * @param {Overlay | null} overlay
 */
export function frameSpots(viewer, overlay) {
  viewer.fit();
  const image = viewer.image;
  if (!image || !overlay?.lattice_px || !(image.steps[0] > 0)) return;
  const farthest = Math.max(...firstShell(overlay.lattice_px).map((k) => Math.hypot(k[0] / image.steps[0], k[1] / image.steps[1])));
  const factor = image.width / (2 * 2.6 * farthest);
  if (factor > 1) {
    viewer.zoom(factor);
    const middle = viewer.toScreen(Math.floor(image.width / 2), Math.floor(image.height / 2));
    viewer.pan(viewer.stage.clientWidth / 2 - middle.x, viewer.stage.clientHeight / 2 - middle.y);
  }
}
