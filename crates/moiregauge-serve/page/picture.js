// An image as a picture for a publication: the whole frame or what is shown, with scale bar and colour bar.

import { bar, paint } from "./colours.js";
import { download, s } from "./dom.js";
import { number, roundBelow } from "./format.js";

/** @typedef {import("./viewer.js").Viewer} Viewer */

const FONT = "Helvetica, Arial, sans-serif";

/**
 * What the picture holds: the samples in view, their place and size.
 * @param {Viewer} v
 */
function part(v) {
  const image = /** @type {import("./api.js").Floats} */ (v.image);
  const a = v.toFile(0, v.stage.clientHeight);
  const b = v.toFile(v.stage.clientWidth, 0);
  const clip = (/** @type {number} */ p, /** @type {number} */ n) => Math.min(n, Math.max(0, Math.round((p + 0.5) / v.step)));
  let [x0, x1, y0, y1] = [clip(a.x, image.width), clip(b.x, image.width), clip(a.y, image.height), clip(b.y, image.height)];
  if (v.fitted || x1 - x0 < 2 || y1 - y0 < 2) [x0, x1, y0, y1] = [0, image.width, 0, image.height];
  const [width, height] = [x1 - x0, y1 - y0];
  const data = new Float32Array(width * height);
  for (let y = 0; y < height; y++) data.set(/** @type {Float32Array} */ (v.shown).subarray((y0 + y) * image.width + x0, (y0 + y) * image.width + x1), y * width);
  return { data, width, height, sizeX: width * v.step * v.pixelX, sizeY: height * v.step * v.pixelY };
}

/**
 * Places of everything, in points, for a picture 8 cm wide.
 * @param {Viewer} v
 */
function layout(v) {
  const p = part(v);
  const wide = 227;
  const tall = (wide * p.sizeY) / p.sizeX;
  const length = roundBelow(p.sizeX * 0.3);
  return { p, wide, tall, length, ruler: (wide * length) / p.sizeX, barX: wide + 8, width: wide + 62, height: tall };
}

/** @param {Viewer} v @param {number} length */
function rulerWords(v, length) {
  if (!v.hasSize) return `${length} px`;
  return length >= 1000 ? `${length / 1000} µm` : `${Number(length.toPrecision(1))} nm`;
}

/** @param {Viewer} v @param {string} name */
export function saveSvg(v, name) {
  const { p, wide, tall, length, ruler, barX, width, height } = layout(v);
  const image = paint(p.data, p.width, p.height, v.look).toDataURL("image/png");
  const ramp = bar(v.look.colours).toDataURL("image/png");
  const text = { "font-family": FONT, "font-size": 7.5, fill: "#000" };
  const root = s("svg", { xmlns: "http://www.w3.org/2000/svg", width: `${width}pt`, height: `${height}pt`, viewBox: `0 0 ${width} ${height}` },
    s("title", {}, name),
    s("image", { href: image, x: 0, y: 0, width: wide, height: tall, preserveAspectRatio: "none", "image-rendering": "pixelated" }),
    s("rect", { x: 6, y: tall - 24, width: ruler + 12, height: 18, fill: "#000", "fill-opacity": 0.6 }),
    s("rect", { x: 12, y: tall - 11, width: ruler, height: 2, fill: "#fff" }),
    s("text", { ...text, fill: "#fff", x: 12 + ruler / 2, y: tall - 14, "text-anchor": "middle" }, rulerWords(v, length)),
    s("g", { transform: `translate(${barX} ${tall}) rotate(-90)` },
      s("image", { href: ramp, x: 0, y: 0, width: tall, height: 8, preserveAspectRatio: "none" }),
      s("rect", { x: 0, y: 0, width: tall, height: 8, fill: "none", stroke: "#000", "stroke-width": 0.4 })),
    s("text", { ...text, x: barX + 11, y: 7 }, number(v.look.high, 3)),
    s("text", { ...text, x: barX + 11, y: tall / 2 + 3 }, v.image?.unit ?? ""),
    s("text", { ...text, x: barX + 11, y: tall - 1 }, number(v.look.low, 3)));
  const words = `<?xml version="1.0" encoding="UTF-8"?>\n${new XMLSerializer().serializeToString(root)}\n`;
  download(new Blob([words], { type: "image/svg+xml" }), `${name}.svg`);
}

/** @param {Viewer} v @param {string} name */
export function savePng(v, name) {
  const { p, wide, tall, length, ruler, barX, width, height } = layout(v);
  // At least 300 dots per inch, and no sample of the image smaller than a dot.
  const k = Math.max(300 / 72, Math.min(4096, p.width) / wide);
  const canvas = document.createElement("canvas");
  canvas.width = Math.round(width * k);
  canvas.height = Math.round(height * k);
  const c = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  c.scale(k, k);
  c.fillStyle = "#fff";
  c.fillRect(0, 0, width, height);
  c.imageSmoothingEnabled = false;
  c.drawImage(paint(p.data, p.width, p.height, v.look), 0, 0, wide, tall);
  c.fillStyle = "rgba(0,0,0,0.6)";
  c.fillRect(6, tall - 24, ruler + 12, 18);
  c.fillStyle = "#fff";
  c.fillRect(12, tall - 11, ruler, 2);
  c.font = `7.5px ${FONT}`;
  c.textAlign = "center";
  c.fillText(rulerWords(v, length), 12 + ruler / 2, tall - 14);
  c.save();
  c.translate(barX, tall);
  c.rotate(-Math.PI / 2);
  c.drawImage(bar(v.look.colours), 0, 0, tall, 8);
  c.lineWidth = 0.4;
  c.strokeRect(0, 0, tall, 8);
  c.restore();
  c.fillStyle = "#000";
  c.textAlign = "left";
  c.fillText(number(v.look.high, 3), barX + 11, 7);
  c.fillText(v.image?.unit ?? "", barX + 11, tall / 2 + 3);
  c.fillText(number(v.look.low, 3), barX + 11, tall - 1);
  canvas.toBlob((blob) => blob && download(blob, `${name}.png`), "image/png");
}
