// Distance, profile and angle on an image.

import { s, fill } from "./dom.js";
import { Marker } from "./markers.js";
import { quantity } from "./format.js";

/** @typedef {import("./viewer.js").Viewer} Viewer */
/** @typedef {import("./viewer.js").Point} Point */

/** @typedef {{distance: number[], value: number[], unit: string, lengthUnit: string}} Profile */

export class Measure {
  /**
   * @param {Viewer} viewer
   * @param {(words: string, profile: Profile | null) => void} told
   */
  constructor(viewer, told) {
    this.viewer = viewer;
    this.told = told;
    /** @type {"none" | "line" | "angle"} */
    this.kind = "none";
    /** @type {Point[]} */
    this.points = [];
    /** @type {Marker[]} */
    this.markers = [];
    this.path = s("g", { class: "measure" });
    viewer.drawing.append(this.path);
    viewer.addEventListener("view", () => this.draw());
  }

  /** @param {"none" | "line" | "angle"} kind */
  use(kind) {
    this.kind = kind;
    this.clear();
    if (kind === "none" || !this.viewer.image) {
      this.told("", null);
      return;
    }
    const { columns: w, rows: hgt } = this.viewer;
    const third = [{ x: w * 0.25, y: hgt * 0.5 }, { x: w * 0.75, y: hgt * 0.5 }];
    this.points = kind === "line" ? third : [{ x: w * 0.75, y: hgt * 0.4 }, { x: w * 0.3, y: hgt * 0.4 }, { x: w * 0.6, y: hgt * 0.75 }];
    const labels = kind === "line" ? ["Start of the line", "End of the line"] : ["First leg", "Corner of the angle", "Second leg"];
    this.markers = this.points.map((at, i) => new Marker(this.viewer, {
      label: labels[i], at, kind: "measure",
      moved: (to) => {
        this.points[i] = to;
        this.update();
      },
    }));
    // A drag on the image draws a new line.
    if (kind === "line") {
      this.viewer.tool = {
        down: (at) => {
          this.setPoint(0, at);
          this.setPoint(1, at);
          return true;
        },
        move: (at) => {
          this.setPoint(1, at);
          this.update();
        },
      };
    }
    this.update();
  }

  /** @param {number} i @param {Point} at */
  setPoint(i, at) {
    this.points[i] = at;
    this.markers[i].move(at);
  }

  clear() {
    for (const marker of this.markers) marker.remove();
    this.markers = [];
    this.points = [];
    this.viewer.tool = null;
    fill(this.path);
  }

  update() {
    this.draw();
    const v = this.viewer;
    const unit = v.hasSize ? "nm" : "px";
    const leg = (/** @type {Point} */ a, /** @type {Point} */ b) => ({ x: (b.x - a.x) * v.pixelX, y: (b.y - a.y) * v.pixelY });
    const degrees = (/** @type {{x: number, y: number}} */ d) => (Math.atan2(d.y, d.x) * 180) / Math.PI;
    if (this.kind === "line") {
      const d = leg(this.points[0], this.points[1]);
      const words = `Length ${quantity(Math.hypot(d.x, d.y), unit)}, angle ${quantity(degrees(d), "°")} to x, Δx ${quantity(d.x, unit)}, Δy ${quantity(d.y, unit)}`;
      this.told(words, this.profile(Math.hypot(d.x, d.y), unit));
    } else if (this.kind === "angle") {
      const [a, b] = [degrees(leg(this.points[1], this.points[0])), degrees(leg(this.points[1], this.points[2]))];
      let between = Math.abs(b - a) % 360;
      if (between > 180) between = 360 - between;
      this.told(`Angle ${quantity(between, "°")}; legs at ${quantity(a, "°")} and ${quantity(b, "°")} to x`, null);
    }
  }

  /**
   * The values along the line, between pixels by straight lines.
   * @param {number} length
   * @param {string} lengthUnit
   * @returns {Profile}
   */
  profile(length, lengthUnit) {
    const [a, b] = this.points;
    const v = this.viewer;
    const n = Math.max(2, Math.min(1500, Math.ceil(Math.hypot(b.x - a.x, b.y - a.y) / v.step) + 1));
    const distance = [];
    const value = [];
    for (let i = 0; i < n; i++) {
      const t = i / (n - 1);
      distance.push(length * t);
      value.push(between(v, a.x + t * (b.x - a.x), a.y + t * (b.y - a.y)));
    }
    return { distance, value, unit: v.image?.unit ?? "", lengthUnit };
  }

  draw() {
    fill(this.path);
    if (this.points.length < 2) return;
    const at = this.points.map((p) => this.viewer.toScreen(p.x, p.y));
    const points = at.map((p) => `${p.x},${p.y}`).join(" ");
    this.path.append(s("polyline", { points, class: "halo" }), s("polyline", { points, class: "line" }));
  }
}

/** @param {Viewer} v @param {number} px @param {number} py */
function between(v, px, py) {
  const step = v.step;
  const [x, y] = [(px + 0.5) / step - 0.5, (py + 0.5) / step - 0.5];
  const [i, j] = [Math.floor(x), Math.floor(y)];
  const at = (/** @type {number} */ a, /** @type {number} */ b) => v.valueAt(a * step + (step - 1) / 2, b * step + (step - 1) / 2);
  const [u, w] = [x - i, y - j];
  const corners = [at(i, j), at(i + 1, j), at(i, j + 1), at(i + 1, j + 1)];
  if (corners.some(Number.isNaN)) return v.valueAt(px, py);
  return (corners[0] * (1 - u) + corners[1] * u) * (1 - w) + (corners[2] * (1 - u) + corners[3] * u) * w;
}
