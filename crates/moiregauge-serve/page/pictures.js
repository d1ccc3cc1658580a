// Images of an analysis put into viewers.

import { floats, get, query } from "./api.js";
import { background, histogram, without } from "./levels.js";
import { brightPlace } from "./overlay.js";
import { store } from "./store.js";
import { work } from "./work.js";

/** @typedef {import("./viewer.js").Viewer} Viewer */

/** Samples along a side that a small picture needs. */
const ENOUGH = 1024;

/**
 * The number of the channel that was analysed, in the file.
 * @param {string} file
 * @param {string | null | undefined} name
 */
async function channelOf(file, name) {
  const info = await store.inspect(file);
  const hit = info.channels.findIndex((/** @type {any} */ c) => c.name === name);
  return { info, channel: Math.max(0, hit) };
}

/**
 * The scan itself, levelled for the eye.
 * @param {Viewer} viewer
 * @param {string} file
 * @param {string | null | undefined} channelName
 * @param {import("./overlay.js").Overlay | null} overlay is given its place on the image
 */
export async function showScan(viewer, file, channelName, overlay) {
  const { info, channel } = await channelOf(file, channelName);
  const about = info.channels[channel];
  const step = Math.max(1, Math.ceil(Math.max(about.columns, about.rows) / ENOUGH));
  const image = await floats(`image${query({ file, channel, step: step > 1 ? step : null })}`);
  image.unit ||= about.unit ?? "";
  const shown = without(image, background(image, "plane"));
  const { from, to } = histogram(shown);
  viewer.setLook({ low: from, high: to, colours: localStorage.getItem("colours") ?? "viridis" });
  viewer.show(image, { step, shown, full: { columns: about.columns, rows: about.rows } });
  if (overlay?.lattice_px && !overlay.origin_px) overlay.origin_px = brightPlace(viewer, overlay);
  return channel;
}

/**
 * Its transform: the logarithm of the power.
 * @param {Viewer} viewer
 * @param {string} file
 * @param {number} channel
 */
export async function showSpectrum(viewer, file, channel) {
  const image = await floats(`spectrum${query({ file, channel })}`);
  // The background of noise is dark, the strongest spots are bright.
  const { low, high } = histogram(image.data);
  // Places on the screen are those of wave vectors: as square as they are.
  image.pixelX = 1;
  image.pixelY = image.steps[0] > 0 ? image.steps[1] / image.steps[0] : 1;
  viewer.setLook({ low: low + 0.35 * (high - low), high, colours: "magma" });
  viewer.show(image);
}

/**
 * A picture of the results: "residual" or "cell".
 * @param {Viewer} viewer
 * @param {"residual" | "cell"} what
 * @param {string} file
 */
export async function showPart(viewer, what, file) {
  try {
    const image = await floats(work.picture(what, file));
    const { from, to } = histogram(image.data);
    const most = Math.max(Math.abs(from), Math.abs(to));
    viewer.setLook(what === "residual" ? { low: -most, high: most, colours: "blue-red" } : { low: from, high: to, colours: localStorage.getItem("colours") ?? "viridis" });
    viewer.show(image);
  } catch (error) {
    const e = /** @type {import("./api.js").ApiError} */ (error);
    viewer.clear(e.message.charAt(0).toUpperCase() + e.message.slice(1));
  }
}

/**
 * What was found on a scan, or nothing.
 * @param {string} file
 * @returns {Promise<import("./overlay.js").Overlay | null>}
 */
export async function overlayOf(file) {
  try {
    const { lines, grains } = await get(work.picture("overlay", file));
    const line = lines.find((/** @type {any} */ l) => l.line === "trace") ?? lines[0];
    return line ? { ...line, grains } : null;
  } catch {
    return null;
  }
}
