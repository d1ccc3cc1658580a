// What a person tells the program about a scan: vectors of the lattice, regions. Places are turned into nm here.

/** @typedef {[number, number]} Pair */
/** @typedef {import("./viewer.js").Viewer} Viewer */
/** @typedef {import("./overlay.js").Overlay} Overlay */

/** @param {[Pair, Pair]} columns @returns {number} */
function determinant([a, b]) {
  return a[0] * b[1] - a[1] * b[0];
}

/**
 * Vectors on the image as vectors of the sample, nm. The program says both for the lattice it found, and the one map
 * between them holds for every vector; without that, pixels count by their size.
 * @param {Viewer} viewer
 * @param {Overlay | null} overlay
 * @param {Pair} vector px
 * @returns {Pair}
 */
export function toNm(viewer, overlay, vector) {
  const px = overlay?.lattice_px;
  const nm = overlay?.lattice_nm;
  if (!px || !nm) return [vector[0] * viewer.pixelX, vector[1] * viewer.pixelY];
  const det = determinant(px);
  const m = (vector[0] * px[1][1] - vector[1] * px[1][0]) / det;
  const n = (px[0][0] * vector[1] - px[0][1] * vector[0]) / det;
  return [m * nm[0][0] + n * nm[1][0], m * nm[0][1] + n * nm[1][1]];
}

/**
 * The two wave vectors of two lattice vectors, in cycles: g_i · a_j is 1 for i = j and 0 else. The same function leads
 * back, since the relation is mutual.
 * @param {[Pair, Pair]} vectors
 * @returns {[Pair, Pair]}
 */
export function reciprocal([a, b]) {
  const det = determinant([a, b]);
  return [[b[1] / det, -b[0] / det], [-a[1] / det, a[0] / det]];
}

/**
 * A lattice to start from where none was found: hexagonal, six periods across the frame.
 * @param {Viewer} viewer
 * @returns {Overlay}
 */
export function someLattice(viewer) {
  const length = (viewer.columns * viewer.pixelX) / 6;
  const at = (/** @type {number} */ degrees) => /** @type {Pair} */ ([
    (length * Math.cos((degrees * Math.PI) / 180)) / viewer.pixelX, (length * Math.sin((degrees * Math.PI) / 180)) / viewer.pixelY]);
  return { origin_px: [viewer.columns / 2, viewer.rows / 2], lattice_px: [at(15), at(75)] };
}

/**
 * A corner of a region: nm from the lower left corner of the frame.
 * @param {Viewer} viewer
 * @param {{x: number, y: number}} at px
 * @returns {Pair}
 */
export function cornerNm(viewer, at) {
  return [(at.x + 0.5) * viewer.pixelX, (at.y + 0.5) * viewer.pixelY];
}

/**
 * @param {Viewer} viewer
 * @param {Pair} corner nm
 */
export function cornerPx(viewer, corner) {
  return { x: corner[0] / viewer.pixelX - 0.5, y: corner[1] / viewer.pixelY - 0.5 };
}

/**
 * Settings without what is empty.
 * @param {any} settings
 * @param {any} change
 */
export function withByHand(settings, change) {
  const hand = { ...(settings?.by_hand ?? {}), ...change };
  for (const key of Object.keys(hand)) {
    const value = hand[key];
    if (value === null || value === undefined || (Array.isArray(value) && value.length === 0)) delete hand[key];
  }
  const { by_hand: _, ...rest } = settings ?? {};
  return Object.keys(hand).length > 0 ? { ...rest, by_hand: hand } : rest;
}
