// The analysis that the views share: its scans and settings, its run, its results.

import { get, query, send } from "./api.js";
import { onConnection, onHappening } from "./events.js";
import { store } from "./store.js";

/** @typedef {{work: string, files: string[], names?: Record<string, string>, excluded: string[], settings: any, known?: any,
 *   state: string, can_undo: boolean, can_redo: boolean, error?: string | null, failed?: any[],
 *   result?: {moires: number, current: boolean, saved: boolean, unsaved?: string | null} | null}} WorkState */

class Work extends EventTarget {
  constructor() {
    super();
    /** @type {WorkState | null} */
    this.is = null;
    /** @type {any} */
    this.results = null;
    /** Counts results, so that pictures of them are asked anew. */
    this.version = 0;
    /** Which of several moirés, the largest cell first. */
    this.moire = 1;
    /** @type {{stage?: string, done?: number, of?: number} | null} */
    this.progress = null;
    this.busy = Promise.resolve();
    /** How often results were asked for: of several answers that are under way the last asked for counts. */
    this.loads = 0;
    onHappening("work", (event) => this.happened(event));
    onConnection((up) => up && this.is && this.refresh());
  }

  get id() {
    return this.is?.work ?? null;
  }

  get running() {
    return this.is?.state === "running";
  }

  /** Path below this work. @param {string} path */
  path(path) {
    return `works/${this.id}/${path}`;
  }

  /** @param {string} name */
  tell(name) {
    this.dispatchEvent(new Event(name));
  }

  /**
   * One request after the other, so that answers come in order.
   * @template T
   * @param {() => Promise<T>} request
   * @returns {Promise<T>}
   */
  inTurn(request) {
    const answer = this.busy.then(request);
    this.busy = answer.then(() => undefined, () => undefined);
    return answer;
  }

  /** Takes up the newest work that the program knows, after the page was loaded anew. */
  restore() {
    return this.inTurn(async () => {
      if (this.is) return;
      const known = /** @type {string[]} */ (store.state.works ?? []);
      const last = sessionStorage.getItem("work");
      const id = last && known.includes(last) ? last : known[known.length - 1];
      if (id) await this.take(await get(`works/${id}`));
    });
  }

  /**
   * A new work; in turn, lest an answer about the one before takes its place.
   * @param {string[]} files
   * @param {any} settings
   * @param {any} known
   */
  create(files, settings, known) {
    return this.inTurn(async () => {
      const { work } = await send("POST", "works", { files, settings, known });
      this.results = null;
      await this.take(await get(`works/${work}`));
    });
  }

  /**
   * Tells a change; one that is made from the settings is a function of them, since a change before it may be under way.
   * @param {any | ((settings: any) => any)} change
   */
  change(change) {
    return this.inTurn(async () => {
      const told = typeof change === "function" ? change(this.is?.settings) : change;
      await this.take(await send("PATCH", `works/${this.id}`, { run: true, ...told }));
    });
  }

  /** @param {"run" | "cancel" | "undo" | "redo"} what */
  async do(what) {
    if (what !== "cancel") return this.inTurn(async () => this.take(await send("POST", this.path(what))));
    // It waits for nothing; its answer may come after what it led to.
    await send("POST", this.path(what));
    return this.refresh();
  }

  /** In turn, lest an answer to a change that was made before comes later. */
  refresh() {
    return this.inTurn(async () => {
      if (this.id) await this.take(await get(`works/${this.id}`));
    });
  }

  /** @param {WorkState} state */
  async take(state) {
    const other = this.is?.work !== state.work;
    const was = this.is?.state;
    this.is = state;
    for (const [file, path] of Object.entries(state.names ?? {})) store.call(file, path);
    sessionStorage.setItem("work", state.work);
    if (state.state !== "running") this.progress = null;
    this.tell("state");
    if (state.state === "done" && (other || was !== "done" || !this.results)) await this.load();
  }

  async load() {
    const [id, load] = [this.id, ++this.loads];
    const most = this.is?.result?.moires ?? 1;
    this.moire = Math.min(this.moire, most);
    const results = await get(this.path(`results.json${this.moire > 1 ? query({ moire: this.moire }) : ""}`));
    if (id !== this.id || load !== this.loads) return;
    this.results = results;
    this.version++;
    this.tell("results");
  }

  /** @param {import("./events.js").Happening} event */
  async happened(event) {
    if (event.id !== this.id || !this.is) return;
    if (event.state === "running") {
      this.progress = event;
      if (this.is.state !== "running") this.is = { ...this.is, state: "running" };
      this.tell("state");
      return;
    }
    try {
      await this.refresh();
    } catch {
      // The connection says so itself.
    }
  }

  /** Scans in the order of the work, each with its set in the results. */
  scans() {
    /** @type {{file: string, name: string, scan: any, set: any}[]} */
    const found = [];
    const measured = (this.results?.sets ?? []).flatMap((/** @type {any} */ set) => set.scans.map((/** @type {any} */ scan) => ({ set, scan })));
    for (const file of this.is?.files ?? []) {
      const path = store.paths.get(file);
      const hit = measured.find((/** @type {any} */ m) => (path ? m.scan.file === path : m.scan.file.endsWith(store.name(file))));
      found.push({ file, name: store.name(file), scan: hit?.scan ?? null, set: hit?.set ?? null });
    }
    return found;
  }

  /** The place of a picture of this work's results. @param {string} what @param {string} file */
  picture(what, file) {
    return `${this.path(what)}${query({ file, moire: this.moire > 1 ? this.moire : null })}`;
  }
}

export const work = new Work();
