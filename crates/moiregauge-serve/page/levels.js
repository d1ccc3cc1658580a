// Levelling for the eye only: what is measured sees none of it.

/** @typedef {{data: Float32Array, width: number, height: number}} Grid */

/** @type {[string, string][]} */
export const LEVELLINGS = [
  ["plane", "Plane"],
  ["lines", "Line by line (median)"],
  ["none", "None"],
];

/**
 * What is to be taken off an image for the eye, as a function of the position in samples of the grid. It also serves
 * parts of the image that come in later, whose position may lie between samples.
 * @param {Grid} grid
 * @param {string} how
 * @returns {(x: number, y: number) => number}
 */
export function background(grid, how) {
  if (how === "plane") return plane(grid);
  if (how === "lines") return lines(grid);
  return () => 0;
}

/**
 * The image without its background.
 * @param {Grid} grid
 * @param {(x: number, y: number) => number} level
 */
export function without(grid, level) {
  const out = new Float32Array(grid.data.length);
  for (let y = 0, i = 0; y < grid.height; y++) {
    const start = level(0, y);
    const slope = grid.width > 1 ? (level(grid.width - 1, y) - start) / (grid.width - 1) : 0;
    for (let x = 0; x < grid.width; x++, i++) out[i] = grid.data[i] - start - slope * x;
  }
  return out;
}

/** @param {Grid} grid */
function plane(grid) {
  const cx = (grid.width - 1) / 2;
  const cy = (grid.height - 1) / 2;
  // Sums over a full grid decouple; missing samples make this approximate, which the eye does not mind.
  let n = 0, sum = 0, sx = 0, sy = 0, xx = 0, yy = 0;
  const stride = Math.max(1, Math.floor(Math.max(grid.width, grid.height) / 512));
  for (let y = 0; y < grid.height; y += stride) {
    for (let x = 0; x < grid.width; x += stride) {
      const z = grid.data[y * grid.width + x];
      if (!Number.isFinite(z)) continue;
      const u = x - cx, v = y - cy;
      n++;
      sum += z;
      sx += u * z;
      sy += v * z;
      xx += u * u;
      yy += v * v;
    }
  }
  const mean = n > 0 ? sum / n : 0;
  const a = xx > 0 ? sx / xx : 0;
  const b = yy > 0 ? sy / yy : 0;
  return (/** @type {number} */ x, /** @type {number} */ y) => mean + a * (x - cx) + b * (y - cy);
}

/** @param {Grid} grid */
function lines(grid) {
  const offsets = new Float32Array(grid.height);
  const row = new Float32Array(grid.width);
  for (let y = 0; y < grid.height; y++) {
    let n = 0;
    for (let x = 0; x < grid.width; x++) {
      const z = grid.data[y * grid.width + x];
      if (Number.isFinite(z)) row[n++] = z;
    }
    const sorted = row.subarray(0, n).slice().sort();
    offsets[y] = n > 0 ? sorted[n >> 1] : 0;
  }
  return (/** @type {number} */ _x, /** @type {number} */ y) => offsets[Math.min(grid.height - 1, Math.max(0, Math.round(y)))];
}

/**
 * A histogram, and the limits that leave out the outermost half per cent.
 * @param {Float32Array} data
 * @param {number} [bins]
 */
export function histogram(data, bins = 160) {
  const stride = Math.max(1, Math.floor(data.length / 500000));
  let low = Infinity, high = -Infinity;
  for (let i = 0; i < data.length; i += stride) {
    const z = data[i];
    if (z < low) low = z;
    if (z > high) high = z;
  }
  if (!(high >= low)) return { low: 0, high: 1, from: 0, to: 1, counts: new Uint32Array(bins) };
  if (high === low) high = low + (Math.abs(low) || 1) * 1e-6;
  const fine = new Uint32Array(4096);
  const factor = 4095.99 / (high - low);
  let n = 0;
  for (let i = 0; i < data.length; i += stride) {
    const z = data[i];
    if (!Number.isFinite(z)) continue;
    fine[((z - low) * factor) | 0]++;
    n++;
  }
  const at = (/** @type {number} */ share) => {
    let seen = 0;
    for (let i = 0; i < 4096; i++) {
      seen += fine[i];
      if (seen > share * n) return low + (i + 0.5) / factor;
    }
    return high;
  };
  const counts = new Uint32Array(bins);
  for (let i = 0; i < 4096; i++) counts[Math.floor((i * bins) / 4096)] += fine[i];
  return { low, high, from: at(0.005), to: at(0.995), counts };
}
