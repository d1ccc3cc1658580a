// Correct: say by hand which lattice is meant, where it is, and which scans count. The result follows.

import { get, query } from "./api.js";
import { byHandList } from "./handlist.js";
import { cornerNm, cornerPx, reciprocal, someLattice, toNm, withByHand } from "./byhand.js";
import { grainList, grainSets, readingList } from "./choices.js";
import { empty, field, fill, h, s, say } from "./dom.js";
import { total } from "./format.js";
import { maskOf, maskPath, paint, usedOf } from "./mask.js";
import { Marker } from "./markers.js";
import { brightPlace, displacement, drawLattice, drawSpots, firstShell, frameSpots, nearMiddle, pixelOf, spotPlace, waveAt } from "./overlay.js";
import { overlayOf, showScan, showSpectrum } from "./pictures.js";
import { headline, meanOf } from "./result.js";
import { ScanList } from "./scanlist.js";
import { Viewer } from "./viewer.js";
import { work } from "./work.js";

/** @typedef {[number, number]} Pair */

export class CorrectView {
  /** @param {(words: string) => void} failed */
  constructor(failed) {
    this.failed = failed;
    this.picked = "";
    /** @type {import("./overlay.js").Overlay | null} */
    this.overlay = null;
    /** What is drawn while something is moved. @type {import("./overlay.js").Overlay | null} */
    this.draft = null;
    /** Regions while a corner is being moved, px. @type {{x: number, y: number}[][] | null} */
    this.movedRegions = null;
    this.body = h("div", {});
    this.none = empty("Analyse scans first. Then you can correct the lattice here.");
    /** @type {Marker[]} */
    this.markers = [];
    /** Corners of a region that is being drawn, px. @type {{x: number, y: number}[] | null} */
    this.drawing = null;
    /** Pixels that are used, from the first stroke until the program has answered to the last. @type {Uint8Array | null} */
    this.painted = null;
    /** Counts strokes: an answer to one may come while the next is painted. */
    this.strokes = 0;
    /** What the brush does: leave out, use again. @type {0 | 1 | null} */
    this.brush = null;
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.wait = undefined;
    this.before = "";
    this.image = new Viewer("Scan with the lattice, which you can move");
    this.spectrum = new Viewer("Transform with the spots, which you can move", { scaleBar: false });
    this.regions = s("g", {});
    this.image.overlay.insertBefore(this.regions, this.image.ruler);
    this.image.addEventListener("view", () => this.draw());
    this.spectrum.addEventListener("view", () => drawSpots(this.spectrum.drawing, this.spectrum, this.draft ?? this.overlay));
    this.list = new ScanList((file) => this.pick(file), failed);
    this.undo = h("button", { type: "button", text: "Undo", onclick: () => this.guard(work.do("undo")) });
    this.redo = h("button", { type: "button", text: "Redo", onclick: () => this.guard(work.do("redo")) });
    this.hand = h("ul", { class: "byhand" });
    this.near = h("input", { type: "number", min: 0, step: "any", onchange: () => this.tell({ near_nm: Number(this.near.value) > 0 ? Number(this.near.value) : null }, "Mean wavelength set") });
    this.result = h("div", { "aria-live": "polite" });
    this.choices = h("div", {});
    this.brushNm = h("input", { type: "number", min: 0, step: "any", "aria-label": "Width of the brush (nm)" });
    this.state = h("p", { class: "stage-words", role: "status" });
    this.regionTools = h("div", { class: "toolbar", role: "toolbar", "aria-label": "Regions" });
    this.help = h("p", { class: "hint" });
    this.element = h("div", { class: "columns" }, this.left(), this.middle());
    this.element.addEventListener("keydown", (event) => this.keys(event));
    work.addEventListener("state", () => this.showState());
    work.addEventListener("results", () => this.showResult());
    this.showState();
    if (work.results) this.showResult();
  }

  left() {
    return h("section", { "aria-label": "Choices made by hand" },
      h("h2", { text: "Scans" }), this.list.element,
      h("h3", { text: "Done by hand" }), this.hand,
      h("div", { class: "buttons" }, this.undo, this.redo),
      field("Mean wavelength about (nm)", this.near), this.state);
  }

  middle() {
    const panel = (/** @type {string} */ title, /** @type {Viewer} */ viewer) => h("figure", { class: "panel" }, h("figcaption", { text: title }), viewer.element);
    fill(this.body,
      h("div", { class: "bar" }, h("h2", { text: "Lattice and regions" }), this.regionTools),
      h("div", { class: "panels" }, panel("Drag the yellow ends of the two vectors", this.image),
        panel("Or the spots of the transform", this.spectrum), h("div", { class: "outcome" }, this.result, this.choices, this.help)));
    return h("section", { class: "middle", "aria-label": "Corrections" }, this.none, this.body);
  }

  shown() {
    this.showState();
    if (work.id && !this.picked) this.pick(work.is?.files[0] ?? "");
  }

  /** @param {Promise<any>} promise */
  guard(promise) {
    promise.catch((error) => this.failed(error.message));
  }

  /** @param {KeyboardEvent} event */
  keys(event) {
    if (!(event.ctrlKey || event.metaKey) || event.target instanceof HTMLInputElement) return;
    const key = event.key.toLowerCase();
    if (key !== "z" && key !== "y") return;
    event.preventDefault();
    const redo = key === "y" || event.shiftKey;
    if (redo ? work.is?.can_redo : work.is?.can_undo) this.guard(work.do(redo ? "redo" : "undo"));
  }

  /** @param {string} file */
  async pick(file) {
    if (!file) return;
    this.picked = file;
    this.list.show(file);
    await this.load(false);
  }

  /** @param {boolean} keep the view of the image */
  async load(keep) {
    const file = this.picked;
    try {
      this.overlay = await overlayOf(file);
      this.draft = null;
      if (!keep) {
        const entry = work.scans().find((x) => x.file === file);
        const channel = await showScan(this.image, file, entry?.set?.channel ?? work.is?.settings?.channel, this.overlay);
        await showSpectrum(this.spectrum, file, channel);
        this.frame();
      }
      if (file !== this.picked) return;
      if (this.overlay && !this.overlay.origin_px) this.overlay.origin_px = brightPlace(this.image, this.overlay);
      this.place();
      this.showChoices();
      document.documentElement.dataset.correct = `${file} ${work.version}`;
    } catch (error) {
      this.image.clear(/** @type {Error} */ (error).message);
    }
  }

  frame() {
    frameSpots(this.spectrum, this.overlay ?? someLattice(this.image));
  }

  showState() {
    const is = work.is;
    this.none.hidden = !!is;
    this.body.hidden = !is;
    this.list.element.hidden = !is;
    this.undo.disabled = !is?.can_undo;
    this.redo.disabled = !is?.can_redo;
    this.state.textContent = is?.state === "running" ? `${work.progress?.stage ?? "Calculating"} …` : is?.state === "failed" ? `No result with these choices: ${is.error ?? ""}` : "";
    if (!is) return;
    this.list.show(this.picked);
    if (document.activeElement !== this.near) this.near.value = String(is.settings?.by_hand?.near_nm ?? "");
    fill(this.hand, byHandList(is, (change, words) => this.tell(change, words), (excluded) => this.guard(work.change({ excluded })), () => this.chooseReading(null), () => this.chooseGrain(null)));
    this.showRegionTools();
    this.draw();
  }

  showResult() {
    const found = work.results ? meanOf(work.results) : null;
    const now = found ? `twist ${total(found.mean?.twist_deg, "°")}, heterostrain ${total(found.mean?.heterostrain_percent, "%")}` : "";
    fill(this.result, found ? headline(found) : null, this.before && this.before !== now ? h("p", { class: "change", text: `Before: ${this.before}` }) : null);
    if (now) this.before = now;
    this.showChoices();
    // A handle that is being moved stays under the hand.
    if (this.picked && !this.wait) this.load(true);
  }

  /** Other solutions of the lattice, and other grains of the scan. */
  async showChoices() {
    const [file, version] = [this.picked, work.version];
    const names = work.id ? await get(`works/${work.id}/names${work.moire > 1 ? query({ moire: work.moire }) : ""}`).catch(() => []) : [];
    const grains = this.overlay?.grains ?? [];
    if (file !== this.picked || version !== work.version) return;
    const open = this.choices.querySelector("details")?.open ?? false;
    fill(this.choices, grainSets(work.results?.sets ?? [], (grain) => this.chooseGrain(grain)), grainList(grains, () => this.startDrawing()), readingList(names, (waves) => this.chooseReading(waves)));
    const list = this.choices.querySelector("details");
    if (list) list.open = open;
  }

  /** @param {number[][] | null} waves */
  chooseReading(waves) {
    say(waves ? "Solution chosen" : "Solution left to the program");
    this.choose("moire_waves", waves);
  }

  /** @param {number | null} grain */
  chooseGrain(grain) {
    say(grain ? `Grain ${grain} alone` : "All grains");
    this.choose("grain", grain);
  }

  /** A setting that is chosen, or left to the program. @param {string} key @param {any} value */
  choose(key, value) {
    this.guard(work.change((/** @type {any} */ settings) => {
      const { [key]: _, ...rest } = settings ?? {};
      return { settings: value === null ? rest : { ...rest, [key]: value } };
    }));
  }

  draw() {
    drawLattice(this.image.drawing, this.image, this.draft ?? this.overlay);
    fill(this.regions);
    const size = this.size();
    const mask = work.is?.settings?.by_hand?.mask;
    if (this.image.image && (mask || this.painted)) this.regions.append(s("path", { d: maskPath(this.image, this.painted ?? usedOf(mask, ...size), size), class: "left-out" }));
    const rings = this.regionsPx();
    const at = (/** @type {{x: number, y: number}} */ p) => {
      const q = this.image.toScreen(p.x, p.y);
      return `${q.x},${q.y}`;
    };
    for (const ring of rings) this.regions.append(s("polygon", { points: ring.map(at).join(" "), class: "region" }));
    if (this.drawing) this.regions.append(s("polyline", { points: this.drawing.map(at).join(" "), class: "outline" }));
  }

  /** Columns and rows of the scan. @returns {[number, number]} */
  size() {
    return [this.image.columns, this.image.rows];
  }

  /** Regions as they stand, with those corners that are being moved. @returns {{x: number, y: number}[][]} */
  regionsPx() {
    return this.movedRegions ?? (work.is?.settings?.by_hand?.regions_nm ?? []).map((/** @type {Pair[]} */ ring) => ring.map((c) => cornerPx(this.image, c)));
  }

  /** Handles where the lattice and the regions are now. */
  place() {
    const focused = document.activeElement instanceof HTMLElement ? document.activeElement.getAttribute("aria-label") : null;
    for (const m of this.markers) m.remove();
    this.markers = [];
    this.movedRegions = null;
    const lattice = this.overlay?.lattice_px ? this.overlay : someLattice(this.image);
    if (!this.overlay?.lattice_px) this.draft = lattice;
    this.placeVectors(lattice);
    this.placeSpots(lattice);
    this.placeCorners();
    this.draw();
    this.spectrum.redraw();
    if (focused) this.markers.find((m) => m.is.label === focused)?.button.focus();
  }

  /** @param {import("./overlay.js").Overlay} lattice */
  placeVectors(lattice) {
    const o = nearMiddle(this.image, lattice);
    const vectors = /** @type {[Pair, Pair]} */ (lattice.lattice_px.map((v) => [...v]));
    vectors.forEach((v, i) => {
      const [x, y] = pixelOf(this.image, lattice, [o[0] + v[0], o[1] + v[1]]);
      this.markers.push(new Marker(this.image, {
        label: `Lattice vector ${i + 1}`, kind: "vector", at: { x, y },
        moved: (to) => {
          const off = displacement(this.image, lattice, [to.x, to.y]);
          vectors[i] = [to.x + off[0] - o[0], to.y + off[1] - o[1]];
          this.preview({ ...lattice, origin_px: o, lattice_px: vectors });
        },
        done: () => this.tellLattice(vectors),
      }));
    });
  }

  /** @param {import("./overlay.js").Overlay} lattice */
  placeSpots(lattice) {
    const image = this.spectrum.image;
    if (!image || !(image.steps[0] > 0)) return;
    const waves = firstShell(lattice.lattice_px).slice(0, 2);
    waves.forEach((k, i) => this.markers.push(new Marker(this.spectrum, {
      label: `Spot ${i + 1} of the transform`, kind: "spot", at: spotPlace(image, k),
      moved: (to) => {
        waves[i] = waveAt(image, to);
        this.preview({ ...lattice, lattice_px: reciprocal([waves[0], waves[1]]) });
      },
      done: () => this.tellLattice(reciprocal([waves[0], waves[1]])),
    })));
  }

  /** @param {import("./overlay.js").Overlay} draft */
  preview(draft) {
    this.draft = draft;
    this.draw();
    this.spectrum.redraw();
  }

  /** Waits for the last of several key strokes. @param {[Pair, Pair]} vectors px */
  tellLattice(vectors) {
    const lattice_nm = vectors.map((v) => toNm(this.image, this.overlay, v).map((x) => Number(x.toPrecision(7))));
    this.later(() => this.tell({ lattice_nm }, "Lattice given by hand"));
  }

  /** @param {() => void} action */
  later(action) {
    clearTimeout(this.wait);
    this.wait = setTimeout(() => {
      this.wait = undefined;
      action();
    }, 150);
  }

  /**
   * Tells the program; it calculates anew.
   * @param {any} change
   * @param {string} words
   */
  tell(change, words) {
    say(words);
    this.guard(work.change((/** @type {any} */ settings) => ({ settings: withByHand(settings, change) })));
  }

  placeCorners() {
    const rings = this.regionsPx();
    rings.forEach((ring, r) => ring.forEach((corner, c) => this.markers.push(new Marker(this.image, {
      label: `Region ${r + 1}, corner ${c + 1}`, kind: "corner", at: corner,
      moved: (to) => {
        rings[r][c] = to;
        this.movedRegions = rings;
        this.draw();
      },
      done: () => this.later(() => this.tellRegions(rings)),
      removed: () => ring.length > 3 && this.tellRegions(rings.map((x, k) => (k === r ? x.filter((_, n) => n !== c) : x))),
    }))));
  }

  /** @param {{x: number, y: number}[][]} rings */
  tellRegions(rings) {
    this.movedRegions = null;
    const regions_nm = rings.map((ring) => ring.map((p) => cornerNm(this.image, p).map((x) => Number(x.toPrecision(6)))));
    this.tell({ regions_nm }, `${rings.length} ${rings.length === 1 ? "region" : "regions"}`);
  }

  showRegionTools() {
    const n = (work.is?.settings?.by_hand?.regions_nm ?? []).length;
    if (this.drawing) {
      const ready = this.drawing.length > 2;
      const finish = h("button", { type: "button", text: "Finish region", onclick: () => this.finish() });
      finish.disabled = !ready;
      fill(this.regionTools, finish, h("button", { type: "button", text: "Stop", onclick: () => this.stopDrawing() }));
      this.help.textContent = "Click the corners of the region; the first corner again, or Enter, closes it.";
      return;
    }
    if (this.brush !== null) {
      const other = /** @type {0 | 1} */ (1 - this.brush);
      fill(this.regionTools, h("span", { class: "soft", text: this.brush === 0 ? "Painting out" : "Painting back" }), this.brushNm,
        h("button", { type: "button", text: other === 0 ? "Paint out" : "Paint back", onclick: () => this.startPainting(other) }), h("button", { type: "button", text: "Stop painting", onclick: () => this.stopDrawing() }));
      this.help.textContent = "Drag over what is not to be used; the field is the width of the brush in nm. Every stroke is told to the program. Without a mouse, a rectangle says what to use.";
      return;
    }
    fill(this.regionTools,
      h("button", { type: "button", text: "Paint a mask", onclick: () => this.startPainting(0) }),
      h("button", { type: "button", text: "Draw region", onclick: () => this.startDrawing() }),
      h("button", { type: "button", text: "Add rectangle", onclick: () => this.addRectangle() }),
      n > 0 ? h("button", { type: "button", text: "Remove regions", onclick: () => this.tell({ regions_nm: null }, "Regions removed") }) : null);
    this.help.textContent = "Move handles with the mouse, or select one and use the arrow keys (Shift: ten times as far). Delete removes a corner. Ctrl+Z undoes the last step.";
  }

  /** A region for those who use no mouse: the middle of the frame, whose corners move with the arrow keys. */
  addRectangle() {
    const [w, t] = [this.image.columns, this.image.rows];
    const ring = [[0.2, 0.2], [0.8, 0.2], [0.8, 0.8], [0.2, 0.8]].map(([x, y]) => ({ x: x * w, y: y * t }));
    this.tellRegions([...this.regionsPx(), ring]);
  }

  /** @param {0 | 1} value */
  startPainting(value) {
    this.brush = value;
    const size = this.size();
    if (!(Number(this.brushNm.value) > 0)) this.brushNm.value = String(Number(((size[0] * this.image.pixelX) / 12).toPrecision(2)));
    /** @type {{x: number, y: number}} */
    let last = { x: 0, y: 0 };
    const dab = (/** @type {{x: number, y: number}} */ at) => {
      const used = (this.painted ??= usedOf(work.is?.settings?.by_hand?.mask, ...size));
      paint(used, size, last, at, Math.max(0.5, Number(this.brushNm.value) / this.image.pixelX / 2), value);
      last = at;
      this.draw();
    };
    this.image.tool = {
      down: (at) => {
        this.strokes++;
        last = at;
        dab(at);
        return true;
      },
      move: (at) => dab(at),
      up: () => this.tellMask(size, value === 0 ? "Painted out" : "Painted back"),
    };
    this.showRegionTools();
    this.image.canvas.focus();
  }

  /**
   * Tells what is painted. It stays until the answer is there, unless the next stroke goes on with it.
   * @param {[number, number]} size columns and rows
   * @param {string} words
   */
  tellMask(size, words) {
    if (!this.painted) return;
    const [mask, stroke] = [maskOf(this.painted, ...size), this.strokes];
    say(words);
    const told = work.change((/** @type {any} */ settings) => ({ settings: withByHand(settings, { mask }) }));
    this.guard(told.finally(() => {
      if (stroke !== this.strokes) return;
      this.painted = null;
      this.draw();
    }));
  }

  startDrawing() {
    this.drawing = [];
    this.image.tool = {
      down: (at) => {
        const corners = this.drawing ?? [];
        const first = corners[0] && this.image.toScreen(corners[0].x, corners[0].y);
        const here = this.image.toScreen(at.x, at.y);
        if (first && corners.length > 2 && Math.hypot(first.x - here.x, first.y - here.y) < 10) this.finish();
        else this.drawing = [...corners, at];
        this.showRegionTools();
        this.draw();
        return true;
      },
    };
    this.image.canvas.onkeydown = (event) => {
      if (event.key === "Enter") this.finish();
      if (event.key === "Escape") this.stopDrawing();
    };
    this.showRegionTools();
    this.image.canvas.focus();
  }

  finish() {
    const ring = this.drawing ?? [];
    if (ring.length < 3) return;
    const rings = [...this.regionsPx(), ring];
    this.stopDrawing();
    this.tellRegions(rings);
  }

  stopDrawing() {
    this.drawing = null;
    this.brush = null;
    this.image.tool = null;
    this.image.canvas.onkeydown = null;
    this.showRegionTools();
    this.draw();
  }
}
