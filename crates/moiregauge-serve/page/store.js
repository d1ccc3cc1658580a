// What the views share: files by name, those chosen for an analysis, the one that is looked at.

import { get, query } from "./api.js";
import { baseName } from "./dom.js";

/** @typedef {{file: string, name: string, bytes: number, folder: string}} FileEntry */

class Store extends EventTarget {
  constructor() {
    super();
    /** @type {Map<string, FileEntry>} */
    this.files = new Map();
    /** What the program calls a file in its results. @type {Map<string, string>} */
    this.paths = new Map();
    /** Chosen for an analysis, in the order of their names. @type {Set<string>} */
    this.chosen = new Set();
    /** @type {string | null} */
    this.current = null;
    /** @type {any} */
    this.state = { roots: [] };
    /** @type {Map<string, Promise<any>>} */
    this.inspected = new Map();
  }

  /** @param {string} what */
  tell(what) {
    this.dispatchEvent(new Event(what));
  }

  /** @param {FileEntry} entry */
  learn(entry) {
    this.files.set(entry.file, entry);
  }

  /** @param {string} file */
  name(file) {
    return this.files.get(file)?.name ?? file;
  }

  /** @param {string[]} files @param {boolean} on */
  choose(files, on) {
    for (const file of files) {
      if (on) this.chosen.add(file);
      else this.chosen.delete(file);
    }
    this.tell("chosen");
  }

  /** @param {string} file */
  open(file) {
    this.current = file;
    this.tell("current");
  }

  /** What the program calls a file. @param {string} file @param {string} path */
  call(file, path) {
    this.paths.set(file, path);
    if (!this.files.has(file)) this.learn({ file, name: baseName(path), bytes: 0, folder: "" });
  }

  /**
   * What a file holds, asked once.
   * @param {string} file
   * @returns {Promise<any>}
   */
  inspect(file) {
    let known = this.inspected.get(file);
    if (!known) {
      known = get(`inspect${query({ file })}`).then((found) => (Array.isArray(found) ? found[0] : found));
      known.catch(() => this.inspected.delete(file));
      this.inspected.set(file, known);
    }
    return known;
  }
}

export const store = new Store();
