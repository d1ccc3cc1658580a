// Questions to a map: regions, profiles, the most uniform areas for a device, a wanted twist.

import { send } from "./api.js";
import { field, fill, h, s, scroll, table } from "./dom.js";
import { number, total, withError } from "./format.js";
import { Marker } from "./markers.js";
import { Plot } from "./plot.js";

/** @typedef {import("./maps.js").MapsView} MapsView */
/** @typedef {[number, number]} Pair */
/** @typedef {{name: string, corners_nm: Pair[]}} Region */
/** @typedef {{name: string, ends_nm: [Pair, Pair]}} Line */
/** @typedef {"none" | "region" | "profile" | "device"} Mode */

/** What a line tells: its key in the answer, how the quantity of the map begins, the unit. @type {[string, string, string][]} */
const PROFILED = [["twist_deg", "twist", "°"], ["heterostrain_percent", "strain", "%"], ["wavelength_nm", "wavelength", "nm"]];

export class Asked {
  /**
   * @param {MapsView} view
   * @param {(words: string) => void} failed
   */
  constructor(view, failed) {
    this.view = view;
    this.failed = failed;
    /** @type {Region[]} */
    this.regions = [];
    /** @type {Line[]} */
    this.profiles = [];
    /** What the program answers of them. @type {any[]} */
    this.lines = [];
    /** @type {Marker[]} */
    this.markers = [];
    /** @type {ReturnType<typeof setTimeout> | undefined} */
    this.wait = undefined;
    this.count = 0;
    /** How often was asked: of several answers that are under way the last asked for counts. */
    this.times = 0;
    /** The areas that were found. @type {Region[]} */
    this.devices = [];
    /** What is being drawn, nodes, and the words beside it. @type {{x: number, y: number}[] | null} */
    this.draft = null;
    this.draftWords = "";
    this.drawing = s("g", {});
    view.main.overlay.insertBefore(this.drawing, view.main.ruler);
    view.main.addEventListener("view", () => this.draw());
    this.tools = this.makeTools();
    this.list = h("ul", { class: "byhand" });
    this.device = [h("input", { type: "number", min: 0, step: "any", "aria-label": "Width of the device, nm" }), h("input", { type: "number", min: 0, step: "any", "aria-label": "Height of the device, nm" })];
    this.wanted = [h("input", { type: "number", step: "any", "aria-label": "Wanted twist, degrees" }), h("input", { type: "number", min: 0, step: "any", "aria-label": "Within, degrees" })];
    this.table = h("div", {});
    this.profilePlot = new Plot({ title: "Profile", x: [], xLabel: "Distance", series: [] });
    this.profilePlot.element.hidden = true;
    this.answers = h("div", { class: "section", "aria-live": "polite" }, this.table, this.profilePlot.element);
    this.element = h("div", {}, h("h3", { text: "Regions and profiles" }), h("p", { class: "hint", text: "Choose Region or Profile and drag on the map. Corners move with the mouse or the arrow keys." }), this.list,
      h("h3", { text: "Most uniform areas" }), h("p", { class: "hint", text: "Choose Device and drag a rectangle of its size on the map, or type the size." }), h("div", { class: "pair" }, field("Width (nm)", this.device[0]), field("Height (nm)", this.device[1])),
      h("h3", { text: "Area with a twist" }), h("div", { class: "pair" }, field("Twist (°)", this.wanted[0]), field("Within (°)", this.wanted[1])),
      h("div", { class: "buttons" }, h("button", { type: "button", text: "Ask", onclick: () => this.ask() })));
  }

  makeTools() {
    const modes = /** @type {[Mode, string][]} */ ([["none", "Move"], ["region", "Region"], ["profile", "Profile"], ["device", "Device"]]);
    const buttons = modes.map(([mode, words]) => h("button", { type: "button", text: words, "aria-pressed": String(mode === "none"), onclick: () => {
      buttons.forEach((b, i) => b.setAttribute("aria-pressed", String(modes[i][0] === mode)));
      this.use(mode);
    } }));
    return h("div", { class: "toolbar", role: "toolbar", "aria-label": "Draw on the map" }, buttons, h("span", { class: "divider" }),
      h("button", { type: "button", text: "Add region", onclick: () => this.addRegion({ x: 0.3, y: 0.3 }, { x: 0.7, y: 0.7 }, true) }),
      h("button", { type: "button", text: "Add profile", onclick: () => this.addProfile({ x: 0.25, y: 0.5 }, { x: 0.75, y: 0.5 }, true) }));
  }

  /** Another map: the questions are asked anew. */
  fresh() {
    fill(this.table);
    this.devices = [];
    this.place();
    if (this.regions.length + this.profiles.length > 0) this.ask();
  }

  /** @param {Mode} mode */
  use(mode) {
    const viewer = this.view.main;
    /** @type {{x: number, y: number} | null} */
    let from = null;
    viewer.tool = mode === "none" ? null : {
      down: (at) => {
        from = at;
        return true;
      },
      move: (at) => from && this.sketch(mode, from, at),
      up: (at) => {
        if (from && Math.hypot(at.x - from.x, at.y - from.y) > 0.5) {
          if (mode === "region") this.addRegion(from, at, false);
          else if (mode === "profile") this.addProfile(from, at, false);
          else this.sizeDevice(from, at);
        }
        from = null;
        this.draft = null;
        this.draw();
      },
    };
  }

  /** @param {Mode} mode @param {{x: number, y: number}} a @param {{x: number, y: number}} b */
  sketch(mode, a, b) {
    this.draft = mode === "profile" ? [a, b] : rectangle(a, b);
    this.draftWords = mode === "device" ? `${this.size(a, b).join(" × ")} nm` : "";
    this.draw();
  }

  /** Width and height of a rectangle between two nodes, nm, to three digits. @param {{x: number, y: number}} a @param {{x: number, y: number}} b */
  size(a, b) {
    const [along, across] = [{ x: b.x, y: a.y }, { x: a.x, y: b.y }];
    const from = this.view.nm(a.x, a.y);
    return [along, across].map((p) => {
      const to = this.view.nm(p.x, p.y);
      return Number(Math.hypot(to[0] - from[0], to[1] - from[1]).toPrecision(3));
    });
  }

  /** A device of the size of a rectangle: the areas for it are asked for at once. @param {{x: number, y: number}} a @param {{x: number, y: number}} b */
  sizeDevice(a, b) {
    const size = this.size(a, b);
    if (!size.every((side) => side > 0)) return;
    this.device.forEach((input, i) => (input.value = String(size[i])));
    this.ask();
  }

  /** @param {{x: number, y: number}} at @param {boolean} share of the map, or nodes @returns {Pair} */
  nm(at, share) {
    const v = this.view.values;
    const [x, y] = share && v ? [at.x * (v.width - 1), at.y * (v.height - 1)] : [at.x, at.y];
    return /** @type {Pair} */ (this.view.nm(x, y).map((n) => Number(n.toPrecision(6))));
  }

  /** @param {{x: number, y: number}} a @param {{x: number, y: number}} b @param {boolean} share */
  addRegion(a, b, share) {
    this.regions.push({ name: `region ${++this.count}`, corners_nm: rectangle(a, b).map((p) => this.nm(p, share)) });
    this.changed();
  }

  /** @param {{x: number, y: number}} a @param {{x: number, y: number}} b @param {boolean} share */
  addProfile(a, b, share) {
    this.profiles.push({ name: `profile ${++this.count}`, ends_nm: [this.nm(a, share), this.nm(b, share)] });
    this.changed();
  }

  changed() {
    this.place();
    this.ask();
  }

  place() {
    for (const m of this.markers) m.remove();
    this.markers = [];
    const corner = (/** @type {string} */ label, /** @type {Pair[]} */ list, /** @type {number} */ i) =>
      this.markers.push(new Marker(this.view.main, { label, kind: "corner", at: this.view.node(list[i]), moved: (to) => {
        list[i] = this.nm(to, false);
        this.draw();
      }, done: () => this.later() }));
    for (const r of this.regions) r.corners_nm.forEach((_, i) => corner(`${r.name}, corner ${i + 1}`, r.corners_nm, i));
    for (const l of this.profiles) l.ends_nm.forEach((_, i) => corner(`${l.name}, ${i === 0 ? "start" : "end"}`, l.ends_nm, i));
    const row = (/** @type {{name: string}} */ item, /** @type {() => void} */ drop) => {
      const name = h("input", { value: item.name, "aria-label": `Name of ${item.name}`, onchange: () => {
        item.name = name.value || item.name;
        this.changed();
      } });
      return h("li", {}, name, h("button", { type: "button", class: "link", text: "Remove", "aria-label": `Remove ${item.name}`, onclick: drop }));
    };
    fill(this.list, this.regions.map((r) => row(r, () => {
      this.regions = this.regions.filter((x) => x !== r);
      this.changed();
    })), this.profiles.map((l) => row(l, () => {
      this.profiles = this.profiles.filter((x) => x !== l);
      this.changed();
    })));
    this.draw();
  }

  draw() {
    fill(this.drawing);
    const v = this.view.main;
    if (!v.image) return;
    const points = (/** @type {{x: number, y: number}[]} */ list) => list.map((p) => v.toScreen(p.x, p.y)).map((p) => `${p.x},${p.y}`).join(" ");
    const words = (/** @type {string} */ name, /** @type {{x: number, y: number}} */ p) => {
      const at = v.toScreen(p.x, p.y);
      return s("text", { x: at.x + 8, y: at.y - 8, class: "words" }, name);
    };
    for (const r of this.regions) {
      const at = r.corners_nm.map((c) => this.view.node(c));
      this.drawing.append(s("polygon", { points: points(at), class: "region" }), words(r.name, at[0]));
    }
    for (const l of this.profiles) {
      const at = l.ends_nm.map((c) => this.view.node(c));
      this.drawing.append(s("polyline", { points: points(at), class: "halo" }), s("polyline", { points: points(at), class: "line" }), words(l.name, at[0]));
    }
    for (const d of this.devices) {
      const at = d.corners_nm.map((c) => this.view.node(c));
      this.drawing.append(s("polygon", { points: points(at), class: "halo" }), s("polygon", { points: points(at), class: "line" }), words(d.name, at[0]));
    }
    if (this.draft) {
      this.drawing.append(s("polygon", { points: points(this.draft), class: "outline" }));
      const [from, , to] = this.draft.map((p) => v.toScreen(p.x, p.y));
      if (this.draftWords) this.drawing.append(s("text", { x: clamped((from.x + to.x) / 2, 60, v.stage.clientWidth - 60), y: (from.y + to.y) / 2 + 4, class: "words", "text-anchor": "middle" }, this.draftWords));
    }
  }

  later() {
    clearTimeout(this.wait);
    this.wait = setTimeout(() => this.ask(), 200);
  }

  async ask() {
    const [w, t] = this.device.map((i) => Number(i.value));
    const [twist, within] = this.wanted.map((i) => Number(i.value));
    /** @type {any} */
    const questions = { regions: this.regions, profiles: this.profiles };
    if (w > 0 && t > 0) questions.device = { size_nm: [w, t] };
    if (twist !== 0 && within > 0) questions.wanted = { twist_deg: twist, within_deg: within };
    const time = ++this.times;
    if (this.regions.length + this.profiles.length === 0 && Object.keys(questions).length === 2) return this.show({});
    try {
      const answer = await send("POST", `maps/${this.view.map.map}/ask`, questions);
      if (time === this.times) this.show(answer);
    } catch (error) {
      this.failed(/** @type {Error} */ (error).message);
    }
  }

  /** @param {any} answer */
  show(answer) {
    const regions = answer.regions ?? [];
    const devices = answer.devices ?? [];
    const rows = regions.map((/** @type {any} */ r) => [r.name, total(r.mean?.twist_deg ?? estimate(r.twist_deg)), total(r.mean?.heterostrain_percent),
      number(r.twist_deg?.spread_corrected, 2), withError(r.wavelength_nm?.mean, r.wavelength_nm?.sigma), number(r.area_nm2, 4), `${number(r.masked_percent, 3)} %`]);
    fill(this.table,
      regions.length > 0 ? scroll("Regions", table("Regions", ["Region", "Twist (°)", "Heterostrain (%)", "Spread of twist (°)", "Wavelength (nm)", "Area (nm²)", "Masked"], rows, { numbers: [1, 2, 3, 4, 5, 6], shown: true })) : null,
      devices.length > 0 ? scroll("Most uniform areas", this.deviceTable(devices)) : null,
      answer.wanted ? scroll("Area with the wanted twist", table("Area with the wanted twist", ["Number", "Value"], Object.entries(answer.wanted).filter(([, v]) => typeof v === "number").map(([k, v]) => [k.replace(/_percent$/, " (%)").replace(/_deg$/, " (°)").replace(/_/g, " "), number(/** @type {number} */ (v))]), { shown: true })) : null,
      (answer.caveats ?? []).map((/** @type {any} */ c) => h("p", { class: "caveat warning" }, `${c.message}. `, h("span", { class: "where", text: c.where }))));
    this.lines = answer.profiles ?? [];
    this.showProfile();
    this.devices = devices.map((/** @type {any} */ d) => ({ name: String(d.rank), corners_nm: d.area.corners_nm }));
    this.draw();
  }

  /** @param {any[]} devices */
  deviceTable(devices) {
    const rows = devices.map((d) => [String(d.rank), d.centre_nm.map((/** @type {number} */ x) => number(x, 4)).join(", "), number(d.angle_deg, 3),
      total(d.area.mean?.twist_deg ?? estimate(d.area.twist_deg)), number(d.area.twist_deg?.spread_below_95, 2), `${number(d.area.masked_percent, 3)} %`]);
    return table("Most uniform areas", ["Rank", "Middle (nm)", "Angle (°)", "Twist (°)", "Spread below, 95 % (°)", "Masked"], rows, { numbers: [2, 3, 4, 5], shown: true });
  }

  /** The last line, as the program tells it: between nodes, and empty where one of them is masked. */
  showProfile() {
    const line = this.lines.at(-1);
    this.profilePlot.element.hidden = !line;
    if (!line) return;
    const { name } = this.view.quantity ?? { name: "" };
    const [key, label, unit] = PROFILED.find(([, words]) => name.startsWith(words)) ?? PROFILED[0];
    const of = (/** @type {"value" | "sigma"} */ part) => line.points.map((/** @type {any} */ p) => p[key]?.[part] ?? null);
    this.profilePlot.set({ title: `Along ${line.name}: ${label}`, x: line.points.map((/** @type {any} */ p) => p.distance_nm), xLabel: "Distance", xUnit: "nm",
      series: [{ label, unit, y: of("value"), sigma: of("sigma") }] });
  }
}

/** @param {{x: number, y: number}} a @param {{x: number, y: number}} b */
function rectangle(a, b) {
  return [{ x: a.x, y: a.y }, { x: b.x, y: a.y }, { x: b.x, y: b.y }, { x: a.x, y: b.y }];
}

/** @param {number} value @param {number} low @param {number} high */
function clamped(value, low, high) {
  return Math.max(low, Math.min(high, value));
}

/** @param {any} statistic */
function estimate(statistic) {
  return statistic ? { value: statistic.mean, sigma: statistic.sigma } : null;
}
