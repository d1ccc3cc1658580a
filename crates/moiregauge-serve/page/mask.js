// A mask that is painted: which pixels of a frame are used. It is told to the program as runs, row by row from the bottom.

/** @typedef {{columns: number, rows: number, runs: number[]}} Mask */
/** @typedef {import("./viewer.js").Viewer} Viewer */

/**
 * Whether each pixel is used; all of them without a mask, or with one of another image.
 * @param {Mask | null | undefined} mask
 * @param {number} columns
 * @param {number} rows
 */
export function usedOf(mask, columns, rows) {
  const used = new Uint8Array(columns * rows);
  if (!mask || mask.columns !== columns || mask.rows !== rows) return used.fill(1);
  let at = 0;
  mask.runs.forEach((run, i) => {
    if (i % 2 === 1) used.fill(1, at, at + run);
    at += run;
  });
  return used;
}

/**
 * The mask of these pixels; none where all are used.
 * @param {Uint8Array} used
 * @param {number} columns
 * @param {number} rows
 * @returns {Mask | null}
 */
export function maskOf(used, columns, rows) {
  if (!used.includes(0)) return null;
  const runs = [0];
  let last = 0;
  for (const pixel of used) {
    if (pixel !== last) {
      runs.push(0);
      last = pixel;
    }
    runs[runs.length - 1]++;
  }
  return { columns, rows, runs };
}

/** How much of a frame a mask leaves out. @param {Mask} mask */
export function leftOut(mask) {
  const used = mask.runs.reduce((sum, run, i) => sum + (i % 2 === 1 ? run : 0), 0);
  return 1 - used / (mask.columns * mask.rows);
}

/**
 * Paints from one place to another with a round brush; places in pixels, whole numbers being the middles of pixels.
 * @param {Uint8Array} used
 * @param {[number, number]} size columns and rows
 * @param {{x: number, y: number}} from
 * @param {{x: number, y: number}} to
 * @param {number} radius px
 * @param {0 | 1} value
 */
export function paint(used, [columns, rows], from, to, radius, value) {
  const [dx, dy] = [to.x - from.x, to.y - from.y];
  const length = dx * dx + dy * dy;
  const first = Math.max(0, Math.ceil(Math.min(from.y, to.y) - radius));
  const last = Math.min(rows - 1, Math.floor(Math.max(from.y, to.y) + radius));
  const left = Math.max(0, Math.ceil(Math.min(from.x, to.x) - radius));
  const right = Math.min(columns - 1, Math.floor(Math.max(from.x, to.x) + radius));
  for (let j = first; j <= last; j++) {
    for (let i = left; i <= right; i++) {
      const share = length > 0 ? Math.max(0, Math.min(1, ((i - from.x) * dx + (j - from.y) * dy) / length)) : 0;
      if (Math.hypot(i - from.x - share * dx, j - from.y - share * dy) <= radius) used[j * columns + i] = value;
    }
  }
}

/** Lines of a drawing: more would not be seen. */
const LINES = 256;

/**
 * What is left out, as a path over the image.
 * @param {Viewer} viewer
 * @param {Uint8Array} used
 * @param {[number, number]} size columns and rows
 */
export function maskPath(viewer, used, [columns, rows]) {
  const step = Math.max(1, Math.round(rows / LINES));
  let path = "";
  for (let j = 0; j < rows; j += step) {
    const row = j * columns;
    for (let i = 0; i < columns; i++) {
      if (used[row + i]) continue;
      const begin = i;
      while (i < columns && !used[row + i]) i++;
      const [a, b] = [viewer.toScreen(begin - 0.5, j - 0.5), viewer.toScreen(i - 0.5, Math.min(rows, j + step) - 0.5)];
      path += `M${a.x.toFixed(1)},${a.y.toFixed(1)}H${b.x.toFixed(1)}V${b.y.toFixed(1)}H${a.x.toFixed(1)}Z`;
    }
  }
  return path;
}
