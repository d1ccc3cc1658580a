// Look: every channel of every file, one of them large.

import { floats, query } from "./api.js";
import { COLOUR_MAPS } from "./colours.js";
import { Contrast } from "./contrast.js";
import { empty, field, fill, h, say, select } from "./dom.js";
import { FileTree } from "./files.js";
import { minus } from "./format.js";
import { showing } from "./host.js";
import { background, LEVELLINGS, without } from "./levels.js";
import { Measure } from "./measure.js";
import { savePng, saveSvg } from "./picture.js";
import { Plot } from "./plot.js";
import { store } from "./store.js";
import { Viewer } from "./viewer.js";

/** Images are held whole up to this many samples along a side; larger ones come as blocks and tiles. */
const WHOLE = 2048;

/** Files with fewer bytes are small. */
const EARLY = 16e6;

export class LookView {
  /** @param {(words: string) => void} failed */
  constructor(failed) {
    this.failed = failed;
    this.tree = new FileTree(failed);
    this.viewer = new Viewer("Scan");
    this.viewer.clear("Choose a file, or drop one.");
    this.contrast = new Contrast((range) => this.viewer.setLook(range));
    this.measure = new Measure(this.viewer, (words, profile) => this.measured(words, profile));
    this.levelling = "plane";
    /** @type {import("./api.js").Floats | null} */
    this.raw = null;
    /** What the file says of the image that is shown. @type {any} */
    this.about = null;
    this.channel = 0;
    this.channelName = "";
    /** @type {AbortController | null} */
    this.loading = null;
    this.title = h("h2", { class: "viewer-title", text: "No file" });
    this.thumbs = h("div", { class: "thumbs", role: "group", "aria-label": "Channels" });
    this.reading = h("p", { class: "reading", "aria-live": "polite" });
    this.profile = new Plot({ title: "Profile", x: [], xLabel: "Distance", series: [] });
    this.profile.element.hidden = true;
    this.headerHost = h("div", { class: "header-table" });
    this.element = h("div", { class: "columns look-columns" }, this.tree.element, this.middle(), this.side());
    store.addEventListener("state", () => this.tree.load());
    store.addEventListener("current", () => this.open());
    this.tree.load();
  }

  middle() {
    const tools = h("div", { class: "toolbar", role: "toolbar", "aria-label": "Image" },
      h("button", { type: "button", text: "Fit", title: "Whole frame (0)", onclick: () => this.viewer.fit() }),
      h("button", { type: "button", text: "+", "aria-label": "Zoom in", onclick: () => this.viewer.zoom(1.5) }),
      h("button", { type: "button", text: "−", "aria-label": "Zoom out", onclick: () => this.viewer.zoom(1 / 1.5) }),
      h("span", { class: "divider" }), this.toolButtons(),
      h("span", { class: "divider" }),
      h("button", { type: "button", text: "Save PNG", onclick: () => this.save("png") }),
      h("button", { type: "button", text: "Save SVG", onclick: () => this.save("svg") }));
    return h("section", { class: "middle", "aria-label": "Image" }, h("div", { class: "bar" }, this.title, tools), this.viewer.element, this.thumbs, this.reading, this.profile.element);
  }

  toolButtons() {
    const kinds = /** @type {["none" | "line" | "angle", string][]} */ ([["none", "Move"], ["line", "Line"], ["angle", "Angle"]]);
    const buttons = kinds.map(([kind, words]) => h("button", { type: "button", text: words, "aria-pressed": String(kind === "none"), onclick: () => {
      buttons.forEach((b, i) => b.setAttribute("aria-pressed", String(kinds[i][0] === kind)));
      this.measure.use(kind);
    } }));
    return buttons;
  }

  side() {
    const colours = select(COLOUR_MAPS, localStorage.getItem("colours") ?? "viridis", (name) => this.setColours(name));
    const level = select(LEVELLINGS, this.levelling, (how) => {
      this.levelling = how;
      this.relevel();
    });
    this.setColours(colours.value);
    const search = h("input", { type: "search", placeholder: "Search header", "aria-label": "Search in the header", oninput: () => this.filterHeader(search.value) });
    this.search = search;
    return h("aside", { class: "side", "aria-label": "Display and header" },
      h("h3", { text: "Contrast" }), this.contrast.element,
      h("div", { class: "buttons" },
        h("button", { type: "button", text: "Auto", onclick: () => this.contrast.auto() }),
        h("button", { type: "button", text: "Full range", onclick: () => this.contrast.full() })),
      h("div", { class: "pair" }, field("Colours", colours), field("Level for display", level)),
      h("h3", { text: "Header" }), search, this.headerHost);
  }

  /** @param {string} name */
  setColours(name) {
    localStorage.setItem("colours", name);
    this.viewer.setLook({ colours: name });
    this.contrast.setColours(name);
  }

  async open() {
    const file = store.current;
    if (!file) return;
    // An image of the file before comes too late from now on.
    this.loading?.abort();
    this.title.textContent = store.name(file);
    // The image of a small file is asked for before it is known what else the file holds.
    const guess = this.channel;
    const bytes = store.files.get(file)?.bytes ?? 0;
    const early = bytes > 0 && bytes < EARLY ? floats(`image${query({ file, channel: guess })}`).catch(() => null) : null;
    try {
      const info = await store.inspect(file);
      if (store.current !== file) return;
      this.info = info;
      const names = info.channels.map((/** @type {any} */ c) => channelWords(c));
      const same = names.indexOf(this.channelName);
      this.showHeader(info);
      if (info.channels.length === 0) {
        this.raw = null;
        this.viewer.clear("This file has no channel that can be shown.");
        fill(this.thumbs, (info.unreadable ?? []).map((/** @type {any} */ u) => h("p", { class: "hint", text: typeof u === "string" ? u : JSON.stringify(u) })));
        return;
      }
      const channel = Math.max(0, same);
      const load = this.load(file, channel, channel === guess ? early : null);
      this.showThumbs(file, info);
      await load;
    } catch (error) {
      if (store.current === file) this.fail(error);
    }
  }

  /** @param {string} file @param {any} info */
  showThumbs(file, info) {
    fill(this.thumbs, info.channels.map((/** @type {any} */ c, /** @type {number} */ i) =>
      h("button", { type: "button", class: "thumb", "aria-pressed": String(i === this.channel), "data-channel": i, onclick: () => this.load(file, i) },
        showing(h("img", { alt: "", width: 72, height: 72, loading: "lazy" }), `thumb${query({ file, channel: i, size: 160 })}`),
        h("span", { text: c.name }), h("span", { class: "soft", text: c.line_direction ?? "" }))));
  }

  /**
   * One channel, large.
   * @param {string} file
   * @param {number} channel
   * @param {Promise<import("./api.js").Floats | null> | null} [early] the image, if it was asked for already
   */
  async load(file, channel, early = null) {
    this.loading?.abort();
    const loading = (this.loading = new AbortController());
    const about = this.info.channels[channel];
    this.channel = channel;
    this.channelName = channelWords(about);
    this.filterHeader(this.search?.value ?? "");
    for (const b of this.thumbs.children) b.setAttribute("aria-pressed", String(/** @type {HTMLElement} */ (b).dataset.channel === String(channel)));
    const step = Math.max(1, Math.ceil(Math.max(about.columns, about.rows) / WHOLE));
    this.viewer.canvas.setAttribute("aria-label", `${store.name(file)}, ${this.channelName}`);
    try {
      const asked = step === 1 ? await early : null;
      const image = asked ?? (await floats(`image${query({ file, channel, step: step > 1 ? step : null })}`, loading.signal));
      if (loading.signal.aborted) return;
      image.unit ||= about.unit ?? "";
      this.raw = image;
      this.about = about;
      this.step = step;
      this.relevel(true);
      this.title.textContent = `${store.name(file)} · ${this.channelName}`;
      this.viewer.tiles.source = step > 1 ? (k, x, y, w, hgt) => this.tile(file, channel, k, x, y, w, hgt) : null;
      document.documentElement.dataset.picture = `${file} ${channel}`;
      performance.mark("picture");
    } catch (error) {
      if (!loading.signal.aborted) this.fail(error);
    }
  }

  /** @param {boolean} [other] another image, whose frame is shown whole */
  relevel(other = false) {
    if (!this.raw) return;
    this.level = background(this.raw, this.levelling);
    const shown = this.levelling === "none" ? this.raw.data : without(this.raw, this.level);
    const about = this.about;
    this.viewer.show(this.raw, { step: this.step, shown, keepView: true, full: { columns: about.columns, rows: about.rows } });
    this.contrast.take(shown, this.raw.unit);
    if (other) this.measure.use(this.measure.kind);
    else this.measure.update();
  }

  /**
   * A part at a finer step, levelled as the whole.
   * @param {string} file
   * @param {number} channel
   * @param {number} step
   * @param {number} x
   * @param {number} y
   * @param {number} w
   * @param {number} hgt
   */
  async tile(file, channel, step, x, y, w, hgt) {
    const part = await floats(`image${query({ file, channel, step, x, y, w, h: hgt })}`);
    const coarse = this.step ?? 1;
    const at = (/** @type {number} */ p, /** @type {number} */ i) => (p + i * step + (step - 1) / 2 - (coarse - 1) / 2) / coarse;
    const level = this.level ?? (() => 0);
    return { ...part, data: without(part, (i, j) => level(at(x, i), at(y, j))) };
  }

  /** @param {string} words @param {import("./measure.js").Profile | null} profile */
  measured(words, profile) {
    this.reading.textContent = words;
    this.profile.element.hidden = !profile;
    if (!profile) return;
    this.profile.set({ title: "Profile along the line", x: profile.distance, xLabel: "Distance", xUnit: profile.lengthUnit, fine: true, height: 150,
      series: [{ label: this.channelName, unit: profile.unit, y: profile.value.map((v) => (Number.isNaN(v) ? null : v)) }] });
  }

  /** @param {any} info */
  showHeader(info) {
    /** @type {[string, string][]} */
    this.header = [];
    const { channels, header, ...rest } = info;
    flatten(rest, "", this.header);
    channels.forEach((/** @type {any} */ c) => {
      const { name, line_direction: _, ...about } = c;
      flatten(about, channelWords({ ...c, name }), this.header ?? []);
    });
    // What the file itself says comes last.
    for (const pair of header ?? []) if (Array.isArray(pair)) this.header.push([String(pair[0]), pair.slice(1).map(String).join(", ")]);
    this.filterHeader(this.search?.value ?? "");
  }

  /** @param {string} wanted */
  filterHeader(wanted) {
    const low = wanted.toLowerCase();
    // Without a question the other channels are left out.
    const others = (this.info?.channels ?? []).map(channelWords).filter((/** @type {string} */ w) => w !== this.channelName);
    const here = (/** @type {string} */ k) => !others.some((/** @type {string} */ w) => k.startsWith(`${w} · `));
    const rows = (this.header ?? []).filter(([k, v]) => (low === "" ? here(k) : `${k} ${v}`.toLowerCase().includes(low)));
    if (rows.length === 0) fill(this.headerHost, empty(this.header ? "Nothing found." : "The header of the file appears here."));
    else fill(this.headerHost, h("table", {}, h("caption", { class: "away", text: "Header" }),
      h("tbody", {}, rows.map(([k, v]) => h("tr", {}, h("th", { scope: "row", text: k }), h("td", { text: v }))))));
  }

  /** @param {"png" | "svg"} kind */
  save(kind) {
    if (!this.viewer.image) return;
    const name = `${store.name(store.current ?? "scan")} ${this.channelName}`.replace(/[^\p{L}\p{N}. _-]+/gu, "_");
    if (kind === "png") savePng(this.viewer, name);
    else saveSvg(this.viewer, name);
    say(`${name}.${kind} saved`);
  }

  /** @param {unknown} error */
  fail(error) {
    const e = /** @type {import("./api.js").ApiError} */ (error);
    this.raw = null;
    this.viewer.clear([e.message, e.what].filter(Boolean).join(" "));
    fill(this.thumbs);
  }
}

/** @param {any} channel */
function channelWords(channel) {
  return channel.line_direction ? `${channel.name}, ${channel.line_direction}` : channel.name;
}

/**
 * A tree of values as rows of a table.
 * @param {any} value
 * @param {string} name
 * @param {[string, string][]} rows
 */
function flatten(value, name, rows) {
  if (value === null || value === undefined || value === "") return;
  if (Array.isArray(value) && value.every((v) => typeof v !== "object")) {
    if (value.length > 0) rows.push([name, value.map((v) => String(v)).join(", ")]);
  } else if (Array.isArray(value)) value.forEach((v, i) => flatten(v, `${name} ${i + 1}`, rows));
  else if (typeof value === "object") {
    for (const [k, v] of Object.entries(value)) flatten(v, name ? `${name} · ${k.replace(/_/g, " ")}` : k.replace(/_/g, " "), rows);
  } else rows.push([name, typeof value === "number" ? minus(String(Number(value.toPrecision(7)))) : String(value)]);
}
