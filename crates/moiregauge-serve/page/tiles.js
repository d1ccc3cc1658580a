// Parts of an image too large to be held at once, at the resolution that the screen can show.

import { paint } from "./colours.js";

/** @typedef {import("./viewer.js").Viewer} Viewer */
/** @typedef {{data: Float32Array, width: number, height: number, picture: HTMLCanvasElement | null, used: number}} Tile */

/** Samples along a side of a tile. */
const SIDE = 512;
/** Tiles that are kept: 64 MB. */
const KEPT = 64;

export class Tiles {
  /** @param {() => void} arrived */
  constructor(arrived) {
    this.arrived = arrived;
    /** @type {Map<string, Tile | "asked">} */
    this.tiles = new Map();
    /** Asks for a part: step, and the corner and size in pixels of the file.
     * @type {null | ((step: number, x: number, y: number, w: number, h: number) =>
     *   Promise<{data: Float32Array, width: number, height: number}>)} */
    this.source = null;
    this.clock = 0;
    this.generation = 0;
  }

  clear() {
    this.tiles.clear();
    this.generation++;
  }

  repaint() {
    for (const tile of this.tiles.values()) if (tile !== "asked") tile.picture = null;
  }

  /**
   * Draws the tiles that are there, and asks for those that are missing.
   * @param {CanvasRenderingContext2D} context
   * @param {Viewer} viewer
   */
  draw(context, viewer) {
    const sx = viewer.pixelX * viewer.view.scale;
    const ratio = window.devicePixelRatio || 1;
    const wanted = 2 ** Math.max(0, Math.floor(Math.log2(1 / (sx * ratio))));
    if (!this.source || wanted >= viewer.step) return;
    const side = SIDE * wanted;
    const low = viewer.toFile(0, viewer.stage.clientHeight);
    const high = viewer.toFile(viewer.stage.clientWidth, 0);
    const range = (/** @type {number} */ a, /** @type {number} */ b, /** @type {number} */ n) =>
      [Math.max(0, Math.floor(a / side)), Math.min(Math.ceil(n / side) - 1, Math.floor(b / side))];
    const [x0, x1] = range(low.x, high.x, viewer.columns);
    const [y0, y1] = range(low.y, high.y, viewer.rows);
    for (let j = y0; j <= y1; j++) {
      for (let i = x0; i <= x1; i++) this.one(context, viewer, wanted, i * side, j * side, side);
    }
  }

  /**
   * @param {CanvasRenderingContext2D} context
   * @param {Viewer} viewer
   * @param {number} step
   * @param {number} x
   * @param {number} y
   * @param {number} side
   */
  one(context, viewer, step, x, y, side) {
    const key = `${step} ${x} ${y}`;
    const tile = this.tiles.get(key);
    if (tile === undefined) this.fetch(key, step, x, y, Math.min(side, viewer.columns - x), Math.min(side, viewer.rows - y));
    if (tile === undefined || tile === "asked") return;
    tile.used = ++this.clock;
    tile.picture ??= paint(tile.data, tile.width, tile.height, viewer.look);
    const corner = viewer.toScreen(x - 0.5, y + tile.height * step - 0.5);
    const scale = viewer.view.scale * step;
    context.drawImage(tile.picture, corner.x, corner.y, tile.width * viewer.pixelX * scale, tile.height * viewer.pixelY * scale);
  }

  /**
   * @param {string} key
   * @param {number} step
   * @param {number} x
   * @param {number} y
   * @param {number} w
   * @param {number} h
   */
  async fetch(key, step, x, y, w, h) {
    const generation = this.generation;
    this.tiles.set(key, "asked");
    try {
      const part = await this.source?.(step, x, y, w, h);
      if (!part || generation !== this.generation) return;
      this.tiles.set(key, { ...part, picture: null, used: ++this.clock });
      this.forget();
      this.arrived();
    } catch {
      // The overview stays; the tile is asked for again when the view moves.
      if (generation === this.generation) this.tiles.delete(key);
    }
  }

  /** Lets go of the tiles that were not drawn for longest. */
  forget() {
    const held = [...this.tiles].filter(([, t]) => t !== "asked");
    if (held.length <= KEPT) return;
    held.sort((a, b) => /** @type {Tile} */ (a[1]).used - /** @type {Tile} */ (b[1]).used);
    for (const [key] of held.slice(0, held.length - KEPT)) this.tiles.delete(key);
  }
}
