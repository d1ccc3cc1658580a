// Maps: a quantity, its error and the mask side by side, and questions drawn on them.

import { floats, get, query, send } from "./api.js";
import { bar, COLOUR_MAPS } from "./colours.js";
import { Contrast } from "./contrast.js";
import { empty, field, fill, h, s, say, scroll, select } from "./dom.js";
import { onHappening } from "./events.js";
import { number, quantity as withUnit, withError } from "./format.js";
import { histogram } from "./levels.js";
import { Asked } from "./mapask.js";
import { Marker } from "./markers.js";
import { caveatList } from "./result.js";
import { store } from "./store.js";
import { Viewer } from "./viewer.js";
import { work } from "./work.js";

/** @typedef {{name: string, unit: string, sigma?: string | null}} Quantity */

/** In place of one scan. */
const ALL = "all";

/** Colours of the reasons of a mask: good first. */
const REASONS = ["#2f9e6b", "#c9ced3", "#e3a33b", "#c2570c", "#8c4799", "#a61b1b", "#0a6aa8", "#6b5b3e", "#444c54"];

export class MapsView {
  /** @param {(words: string) => void} failed */
  constructor(failed) {
    this.failed = failed;
    /** @type {any} */
    this.map = null;
    /** @type {any} */
    this.document = null;
    /** @type {Quantity | null} */
    this.quantity = null;
    /** @type {import("./api.js").Floats | null} */
    this.values = null;
    /** @type {import("./api.js").Floats | null} */
    this.sigmas = null;
    /** @type {import("./api.js").Floats | null} */
    this.mask = null;
    const make = (/** @type {string} */ label) => new Viewer(label, { readout: false });
    this.main = make("Map");
    this.error = make("Error of the map");
    this.masked = make("Mask of the map");
    this.viewers = [this.main, this.error, this.masked];
    /** @type {{x: number, y: number} | null} */
    this.cursor = null;
    /** The map that is followed, and how often it was asked for. */
    this.following = "";
    this.looks = 0;
    /** How often a quantity was chosen: the last one is shown, whichever comes last. */
    this.chosen = 0;
    /** @type {Marker | null} */
    this.keyCursor = null;
    this.linking = false;
    this.titles = ["Map", "One standard deviation", "Mask"].map((text) => h("figcaption", { text }));
    this.errorBar = h("div", { class: "colourbar" });
    this.legend = h("div", { class: "legend" });
    this.none = empty("The map of twist and strain across a scan appears here. Choose a scan and make the map.");
    this.body = h("div", {});
    this.linkViewers();
    this.contrast = new Contrast((range) => this.main.setLook(range), "colours");
    this.asked = new Asked(this, failed);
    this.file = select([], "", () => undefined);
    this.windowNm = h("input", { type: "number", min: 0, step: "any", placeholder: "automatic" });
    this.stepNm = h("input", { type: "number", min: 0, step: "any", placeholder: "automatic" });
    this.method = select([["demodulation", "phases under a window"], ["tiles", "tiles"]], "demodulation", () => undefined);
    this.run = h("button", { type: "button", class: "main", text: "Make the map", onclick: () => this.start() });
    this.cancel = h("button", { type: "button", text: "Cancel", onclick: () => this.stop() });
    this.state = h("p", { class: "stage-words", role: "status" });
    this.bar = h("div", { role: "progressbar", "aria-label": "Progress of the map" });
    this.barBox = h("div", { class: "progress", hidden: true }, this.bar);
    this.choice = select([], "", (name) => this.showQuantity(name));
    this.readout = h("p", { class: "readout", "aria-live": "polite" });
    this.info = h("div", {});
    this.element = h("div", { class: "columns three" }, this.left(), this.middle(), this.side());
    onHappening("map", (event) => this.happened(event));
    store.addEventListener("chosen", () => this.offerFiles());
    store.addEventListener("current", () => this.offerFiles());
    this.show();
    this.restore();
  }

  linkViewers() {
    for (const viewer of this.viewers) {
      viewer.clear("");
      const cross = s("g", {});
      viewer.drawing.append(cross);
      viewer.addEventListener("cursor", (e) => this.point(/** @type {CustomEvent} */ (e).detail));
      viewer.addEventListener("view", () => {
        this.follow(viewer);
        this.drawCross(viewer, cross);
      });
    }
  }

  left() {
    return h("section", { "aria-label": "Map to make" }, h("h2", { text: "Map" }), field("Scan", this.file),
      h("div", { class: "pair" }, field("Window σ (nm)", this.windowNm), field("Distance of nodes (nm)", this.stepNm)), field("Method", this.method),
      h("p", { class: "hint", text: "Layers, channel and seed are taken from Analyse." }),
      h("div", { class: "buttons" }, this.run, this.cancel), this.barBox, this.state, this.info);
  }

  middle() {
    const colours = select(COLOUR_MAPS, "viridis", (name) => {
      this.main.setLook({ colours: name });
      this.contrast.setColours(name);
    });
    fill(this.body,
      h("div", { class: "bar" }, h("div", { class: "toolbar" }, field("Quantity", this.choice), field("Colours", colours)), this.asked.tools),
      h("div", { class: "panels three" },
        h("figure", { class: "panel" }, this.titles[0], this.main.element, this.contrast.element),
        h("figure", { class: "panel" }, this.titles[1], this.error.element, this.errorBar),
        h("figure", { class: "panel" }, this.titles[2], this.masked.element, this.legend)),
      this.readout, this.asked.answers);
    return h("section", { class: "middle", "aria-label": "Maps" }, this.none, this.body);
  }

  side() {
    return h("aside", { class: "side", "aria-label": "Questions to the map" }, this.asked.element);
  }

  shown() {
    this.offerFiles();
  }

  refresh() {
    if (this.following) this.take(this.following).catch((e) => this.failed(e.message));
  }

  offerFiles() {
    const files = [...new Set([...(work.is?.files ?? []), ...store.chosen, ...(store.current ? [store.current] : [])])];
    const value = this.file.value || store.current || "";
    const all = work.id && (work.is?.files.length ?? 0) > 1 ? [h("option", { value: ALL, text: `all ${work.is?.files.length} scans of the analysis` })] : [];
    fill(this.file, all, files.map((f) => h("option", { value: f, text: store.name(f) })));
    if (files.includes(value) || (value === ALL && all.length > 0)) this.file.value = value;
    this.run.disabled = files.length === 0 || this.map?.state === "running";
    if (files.length === 0) fill(this.file, h("option", { value: "", text: "choose a scan in Look" }));
  }

  async restore() {
    const maps = /** @type {string[]} */ (store.state.maps ?? []);
    if (maps.length > 0) await this.take(maps[maps.length - 1]).catch(() => undefined);
  }

  async start() {
    const positive = (/** @type {HTMLInputElement} */ input) => (Number(input.value) > 0 ? Number(input.value) : undefined);
    const map = { window_nm: positive(this.windowNm), step_nm: positive(this.stepNm), method: this.method.value === "demodulation" ? undefined : this.method.value };
    const given = Object.fromEntries(Object.entries(map).filter(([, v]) => v !== undefined));
    // What was told by hand of the scans of the analysis holds for these.
    const { by_hand, ...others } = work.is?.settings ?? {};
    const settings = by_hand && work.is?.files.includes(this.file.value) ? { ...others, by_hand } : others;
    try {
      const one = { file: this.file.value, settings: Object.fromEntries(Object.entries(settings).filter(([, v]) => v !== null)) };
      const body = { ...(this.file.value === ALL ? { work: work.id } : one), request: given };
      const { map: id } = await send("POST", "maps", body);
      await this.take(id);
    } catch (error) {
      this.failed(/** @type {Error} */ (error).message);
    }
  }

  async stop() {
    if (this.map) await send("POST", `maps/${this.map.map}/cancel`).catch((e) => this.failed(e.message));
  }

  /** @param {import("./events.js").Happening} event */
  happened(event) {
    if (event.id !== this.following) return;
    if (event.state === "running") {
      if (this.map?.map !== event.id) return;
      this.map.state = "running";
      this.state.textContent = `${event.stage ?? "Running"}${event.of ? `, ${event.done} of ${event.of}` : ""}`;
      this.bar.style.width = `${event.of ? (100 * (event.done ?? 0)) / event.of : 0}%`;
      this.show();
    } else this.refresh();
  }

  /** Follows a map; of several answers that are under way the last asked for counts. @param {string} id */
  async take(id) {
    this.following = id;
    const look = ++this.looks;
    const is = await get(`maps/${id}`);
    if (look !== this.looks) return;
    const before = this.map?.map === id ? this.map.state : "";
    this.map = { map: id, ...is };
    this.show();
    if (is.state === "done" && before !== "done") await this.load();
  }

  show() {
    const state = this.map?.state;
    const e = this.map?.error;
    this.barBox.hidden = state !== "running";
    this.cancel.disabled = state !== "running";
    this.offerFiles();
    if (state === "failed") this.state.textContent = `No map: ${(this.map.failed ?? []).map((/** @type {any} */ f) => f.error).join(" ") || e}`;
    else if (state !== "running") this.state.textContent = state === "cancelled" ? "Cancelled." : "";
    else if (!this.state.textContent) this.state.textContent = "Running";
    const there = !!this.document && this.document.of === this.map?.map;
    this.none.hidden = there;
    this.body.hidden = !there;
    this.asked.element.hidden = !there;
  }

  async load() {
    const id = this.map.map;
    try {
      const found = await get(`maps/${id}/result.json`);
      if (id !== this.map.map) return;
      this.document = { ...found, of: id };
      this.show();
      const all = /** @type {Quantity[]} */ (this.map.quantities ?? []);
      const quantities = all.filter((q) => !q.name.endsWith(" sigma") && !/^(mask|position)/.test(q.name));
      fill(this.choice, quantities.map((q) => h("option", { value: q.name, text: q.name.replace(/_/g, " ") })));
      await this.showMask(id);
      if (id !== this.map.map) return;
      await this.showQuantity(quantities[0]?.name ?? "");
      if (id !== this.map.map) return;
      await this.showInfo();
      this.asked.fresh();
      say("The map is ready.");
      document.documentElement.dataset.map = id;
    } catch (error) {
      this.failed(/** @type {Error} */ (error).message);
    }
  }

  /** Places of nodes, nm. @param {number} i @param {number} j @returns {[number, number]} */
  nm(i, j) {
    const d = this.document ?? {};
    const o = d.origin_nm ?? [0, 0];
    const [a, b] = d.step_nm ?? [[this.values?.pixelX ?? 1, 0], [0, this.values?.pixelY ?? 1]];
    return [o[0] + i * a[0] + j * b[0], o[1] + i * a[1] + j * b[1]];
  }

  /** The node of a place, not rounded. @param {[number, number]} at nm */
  node(at) {
    const d = this.document ?? {};
    const o = d.origin_nm ?? [0, 0];
    const [a, b] = d.step_nm ?? [[this.values?.pixelX ?? 1, 0], [0, this.values?.pixelY ?? 1]];
    const det = a[0] * b[1] - a[1] * b[0];
    const [x, y] = [at[0] - o[0], at[1] - o[1]];
    return { x: (x * b[1] - y * b[0]) / det, y: (a[0] * y - a[1] * x) / det };
  }

  /** The place of a node, in words of the surface. @param {string} name */
  async grid(name) {
    const image = await floats(`maps/${this.map.map}/quantity${query({ name })}`);
    const [a, b] = this.document?.step_nm ?? [];
    if (a) [image.pixelX, image.pixelY] = [Math.hypot(a[0], a[1]), Math.hypot(b[0], b[1])];
    return image;
  }

  /** @param {string} id */
  async showMask(id) {
    /** @type {import("./api.js").Floats | null} */
    const mask = await this.grid("mask").catch(() => null);
    if (id !== this.map.map) return;
    this.mask = mask;
    if (!this.mask) {
      this.masked.clear("No mask");
      return;
    }
    this.paintMask(this.mask);
    const masks = this.document?.masks ?? [];
    fill(this.legend, masks.map((/** @type {any} */ m) => h("span", {}, h("i", { css: { background: REASONS[m.value % REASONS.length] } }), `${m.name}, ${m.nodes}`)));
  }

  /** The mask has colours of its own. @param {import("./api.js").Floats} mask */
  paintMask(mask) {
    this.masked.show(mask);
    const canvas = h("canvas", { width: mask.width, height: mask.height });
    const context = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    mask.data.forEach((value, n) => {
      context.fillStyle = REASONS[(value | 0) % REASONS.length];
      context.fillRect(n % mask.width, mask.height - 1 - Math.floor(n / mask.width), 1, 1);
    });
    this.masked.picture = canvas;
  }

  /** @param {string} name */
  async showQuantity(name) {
    const found = /** @type {Quantity[]} */ (this.map?.quantities ?? []).find((q) => q.name === name);
    if (!found) return;
    const mine = ++this.chosen;
    this.choice.value = name;
    try {
      const [values, sigmas] = await Promise.all([this.grid(name), found.sigma ? this.grid(found.sigma) : null]);
      if (mine !== this.chosen) return;
      [this.quantity, this.values, this.sigmas] = [found, values, sigmas];
      this.values.unit = found.unit;
    } catch (error) {
      if (mine === this.chosen) this.failed(/** @type {Error} */ (error).message);
      return;
    }
    this.main.show(this.values, { keepView: true });
    this.contrast.take(this.values.data, found.unit);
    this.titles[0].textContent = `${found.name.replace(/_/g, " ")}${found.unit ? ` (${found.unit})` : ""}`;
    if (this.sigmas) {
      // The few nodes at the rim with errors beyond all others do not decide the colours.
      const { low, to: high } = histogram(this.sigmas.data);
      this.error.setLook({ low: 0, high, colours: "cividis" });
      this.error.show(this.sigmas, { keepView: true });
      fill(this.errorBar, number(0), bar("cividis"), withUnit(high, found.unit, 2));
      if (low === high) this.error.setLook({ low: low - 1, high: high + 1 });
    } else {
      this.error.clear("This quantity has no error");
      fill(this.errorBar);
    }
    this.placeCursor();
    this.asked.showProfile();
  }

  async showInfo() {
    const d = this.document;
    const q = (d.quantities ?? []).map((/** @type {any} */ x) => h("tr", {}, h("th", { scope: "row", text: x.name }), h("td", { class: "number", text: withError(x.mean, x.mean_sigma, x.unit) })));
    fill(this.info, h("h3", { text: "Means of the good nodes" }), scroll("Means of the good nodes", h("table", {}, h("caption", { class: "away", text: "Means over the good nodes, noise of the images only" }), h("tbody", {}, q))),
      h("p", { class: "hint", text: `Window σ ${number(d.window_nm, 3)} nm, resolution ${number(d.resolution_nm, 3)} nm, ${d.nodes?.join(" × ") ?? ""} nodes.` }),
      d.caveats?.length ? h("h3", { text: `${d.caveats.length} caveats` }) : null, d.caveats?.length ? await caveatList(d.caveats) : null);
  }

  /** The views of the three pictures are one. @param {Viewer} leader */
  follow(leader) {
    if (this.linking || !leader.image) return;
    this.linking = true;
    for (const viewer of this.viewers) {
      if (viewer === leader || !viewer.image) continue;
      const { scale, x, y } = leader.view;
      if (viewer.view.scale === scale && viewer.view.x === x && viewer.view.y === y) continue;
      viewer.view = { scale, x, y };
      viewer.fitted = leader.fitted;
      viewer.redraw();
    }
    this.linking = false;
  }

  /** A cursor for those who use no mouse. */
  placeCursor() {
    this.keyCursor?.remove();
    if (!this.values) return;
    const at = this.cursor ?? { x: (this.values.width - 1) / 2, y: (this.values.height - 1) / 2 };
    this.keyCursor = new Marker(this.main, { label: "Cursor: arrow keys read the map", at, kind: "cursor", moved: (to) => this.point(to) });
  }

  /** The same place in all three. @param {{x: number, y: number} | null} at */
  point(at) {
    this.cursor = at;
    for (const viewer of this.viewers) viewer.redraw();
    if (!at || !this.values || !this.quantity) {
      this.readout.textContent = "";
      return;
    }
    const [i, j] = [Math.round(at.x), Math.round(at.y)];
    const inside = i >= 0 && j >= 0 && i < this.values.width && j < this.values.height;
    if (!inside) {
      this.readout.textContent = "";
      return;
    }
    const n = j * this.values.width + i;
    const [x, y] = this.nm(i, j);
    const masks = this.document?.masks ?? [];
    const reason = this.mask ? masks.find((/** @type {any} */ m) => m.value === this.mask?.data[n])?.name ?? "" : "";
    const value = this.values.data[n];
    const words = Number.isNaN(value) ? "masked" : withError(value, this.sigmas?.data[n], this.quantity.unit);
    this.readout.textContent = `x ${withUnit(x, "nm")}   y ${withUnit(y, "nm")}   ${this.quantity.name.replace(/_/g, " ")} ${words}   ${reason}`;
  }

  /** @param {Viewer} viewer @param {SVGGElement} group */
  drawCross(viewer, group) {
    fill(group);
    if (!this.cursor || !viewer.image) return;
    const { x, y } = viewer.toScreen(this.cursor.x, this.cursor.y);
    for (const kind of ["cross-halo", "cross"]) {
      group.append(s("line", { x1: x - 12, x2: x + 12, y1: y, y2: y, class: kind }), s("line", { x1: x, x2: x, y1: y - 12, y2: y + 12, class: kind }));
    }
  }
}
