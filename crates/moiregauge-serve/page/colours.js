// Colour maps as tables of 256 colours, ready for the pixels of a canvas.

/** @type {Record<string, string>} */
const ANCHORS = {
  viridis: "440154 481a6c 472f7d 414487 39568c 31688e 2a788e 23888e 1f988b 22a884 35b779 54c568 7ad151 a5db36 d2e21b fde725",
  cividis: "00224e 083370 35456c 4f576c 666970 7d7c78 948e77 aea371 c8b866 e5cf52 fee838",
  magma: "000004 0b0924 20114b 3b0f70 57157e 721f81 8c2981 a8327d c43c75 de4968 f1605d fa7f5e fe9f6d febf84 fddea0 fcfdbf",
  grey: "000000 ffffff",
  nanoscope: "000000 4c2006 a0581a dea054 fff4d6",
  "blue-red": "2166ac 67a9cf d1e5f0 f7f7f7 fddbc7 ef8a62 b2182b",
};

/** Names and words, those that are perceptually uniform first. @type {[string, string][]} */
export const COLOUR_MAPS = [
  ["viridis", "Viridis"],
  ["cividis", "Cividis"],
  ["magma", "Magma"],
  ["grey", "Grey"],
  ["nanoscope", "NanoScope brown"],
  ["blue-red", "Blue – white – red"],
];

/** @type {Map<string, Uint8Array>} */
const tables = new Map();

/**
 * 256 colours, three bytes each.
 * @param {string} name
 * @returns {Uint8Array}
 */
export function colourTable(name) {
  const known = tables.get(name);
  if (known) return known;
  const anchors = (ANCHORS[name] ?? ANCHORS.viridis).split(" ")
    .map((hex) => [0, 2, 4].map((i) => parseInt(hex.slice(i, i + 2), 16)));
  const made = new Uint8Array(768);
  for (let i = 0; i < 256; i++) {
    const t = (i / 255) * (anchors.length - 1);
    const k = Math.min(anchors.length - 2, Math.floor(t));
    for (let c = 0; c < 3; c++) made[3 * i + c] = anchors[k][c] + (t - k) * (anchors[k + 1][c] - anchors[k][c]);
  }
  tables.set(name, made);
  return made;
}

/**
 * A canvas with the colours of the numbers; the first row of the numbers is the bottom.
 * @param {ArrayLike<number>} data
 * @param {number} width
 * @param {number} height
 * @param {{low: number, high: number, colours: string}} look
 */
export function paint(data, width, height, look) {
  const canvas = document.createElement("canvas");
  canvas.width = width;
  canvas.height = height;
  const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
  const image = context.createImageData(width, height);
  const pixels = new Uint32Array(image.data.buffer);
  const table = colourTable(look.colours);
  const packed = new Uint32Array(256);
  for (let i = 0; i < 256; i++) packed[i] = 0xff000000 | (table[3 * i + 2] << 16) | (table[3 * i + 1] << 8) | table[3 * i];
  const low = look.low;
  const factor = look.high > low ? 255.99 / (look.high - low) : 0;
  for (let row = 0; row < height; row++) {
    let from = row * width;
    let to = (height - 1 - row) * width;
    for (let column = 0; column < width; column++, from++, to++) {
      const value = (data[from] - low) * factor;
      // What is not a number stays transparent.
      if (value >= 0) pixels[to] = packed[value > 255 ? 255 : value | 0];
      else if (value < 0) pixels[to] = packed[0];
    }
  }
  context.putImageData(image, 0, 0);
  return canvas;
}

/**
 * A bar of the colours, as a canvas.
 * @param {string} name
 * @param {number} [length]
 */
export function bar(name, length = 256) {
  const ramp = Float32Array.from({ length }, (_, i) => i);
  return paint(ramp, length, 1, { low: 0, high: length - 1, colours: name });
}
