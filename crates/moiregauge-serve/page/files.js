// The folders of the program's roots as a tree, and the place to drop files.

import { ask, get, query, send } from "./api.js";
import { baseName, fill, h, say } from "./dom.js";
import { size } from "./format.js";
import { store } from "./store.js";

/** The folder of what was dropped. */
export const DROPPED = "dropped";

export class FileTree {
  /** @param {(words: string) => void} failed */
  constructor(failed) {
    this.failed = failed;
    this.list = h("ul", { class: "tree", "aria-label": "Folders and files" });
    this.note = h("p", { class: "hint", role: "status" });
    this.count = h("p", { class: "chosen-count" });
    const pick = (/** @type {string} */ id, /** @type {string} */ label, /** @type {boolean} */ folder) => {
      const picker = h("input", { type: "file", multiple: true, webkitdirectory: folder, class: "away", id, tabindex: -1, "aria-label": label });
      picker.addEventListener("change", () => this.upload([...(picker.files ?? [])].map((file) => ({ file, name: file.webkitRelativePath || file.name }))));
      return picker;
    };
    const [picker, folders] = [pick("pick-files", "Files to open", false), pick("pick-folder", "Folder to open", true)];
    this.drop = h("div", { class: "drop" },
      h("p", {}, "Drop files or folders here"),
      h("button", { type: "button", text: "Choose files…", onclick: () => picker.click() }),
      h("button", { type: "button", text: "Choose a folder…", onclick: () => folders.click() }),
      h("button", { type: "button", class: "link", text: "Try it with simulated scans", onclick: () => this.tryIt() }), picker, folders);
    this.element = h("section", { class: "files", "aria-label": "Files" }, this.drop, this.note, this.list, this.count);
    this.listenToDrops();
    store.addEventListener("chosen", () => this.showChosen());
    store.addEventListener("current", () => this.markCurrent());
    this.showChosen();
  }

  /** The tree anew. */
  async load() {
    const roots = [...store.state.roots];
    if (!roots.some((r) => r.root === DROPPED)) roots.push({ root: DROPPED, name: "Dropped" });
    const shown = [];
    for (const [i, root] of roots.entries()) shown.push(this.folder(root.root, "", root.root === DROPPED ? "Dropped" : baseName(root.name) || root.name, root.root !== DROPPED && i === 0, root.name));
    fill(this.list, shown);
  }

  /**
   * A folder, read when it is opened.
   * @param {string} root
   * @param {string} under
   * @param {string} name
   * @param {boolean} open
   * @param {string} [title]
   */
  folder(root, under, name, open, title = name) {
    const inside = h("ul", { hidden: true });
    const button = h("button", { type: "button", class: "folder", "aria-expanded": "false" }, h("span", { class: "twist", "aria-hidden": "true" }), h("span", { class: "file-name", text: name, title }));
    const all = h("input", { type: "checkbox", "aria-label": `Use all scans of ${name}`, title: "Use all scans of this folder" });
    /** The reading, once for all who wait for it; one that failed is made again. @type {Promise<boolean> | null} */
    let reading = null;
    const toggle = async (/** @type {boolean} */ on) => {
      button.setAttribute("aria-expanded", String(on));
      inside.hidden = !on;
      if (on && !(await (reading ??= this.read(root, under, inside)))) reading = null;
    };
    button.addEventListener("click", () => toggle(button.getAttribute("aria-expanded") !== "true"));
    all.addEventListener("change", async () => {
      await toggle(true);
      const boxes = [...inside.children].map((li) => li.querySelector(":scope > .row > input[data-file]"));
      store.choose(boxes.flatMap((b) => (b instanceof HTMLInputElement ? [b.dataset.file ?? ""] : [])), all.checked);
    });
    const item = h("li", { "data-root": root, "data-under": under }, h("div", { class: "row" }, all, button), inside);
    if (open) toggle(true);
    return item;
  }

  /**
   * @param {string} root
   * @param {string} under
   * @param {Element} inside
   */
  async read(root, under, inside) {
    try {
      const found = await get(`folder${query({ root, under })}`);
      const below = (/** @type {string} */ name) => (under ? `${under}/${name}` : name);
      const folders = found.folders.map((/** @type {string} */ name) => this.folder(root, below(name), name, false));
      const files = found.files.map((/** @type {any} */ f) => (f.file ? this.file({ ...f, folder: `${root}/${under}` }) : unreadable(f)));
      fill(inside, folders, files);
      if (folders.length + files.length === 0) fill(inside, h("li", { class: "hint", text: root === DROPPED ? "No files were dropped yet." : "No files." }));
      this.showChosen();
      return true;
    } catch (error) {
      fill(inside, h("li", { class: "hint", text: String(/** @type {Error} */ (error).message) }));
      return false;
    }
  }

  /** @param {import("./store.js").FileEntry} entry */
  file(entry) {
    store.learn(entry);
    const box = h("input", { type: "checkbox", "data-file": entry.file, "aria-label": `Use ${entry.name}` });
    box.addEventListener("change", () => store.choose([entry.file], box.checked));
    const button = h("button", { type: "button", class: "file", "data-file": entry.file, onclick: () => store.open(entry.file) },
      h("span", { class: "file-name", text: entry.name, title: entry.name }), h("span", { class: "soft", text: size(entry.bytes) }));
    return h("li", {}, h("div", { class: "row" }, box, button));
  }

  showChosen() {
    for (const box of this.list.querySelectorAll("input[data-file]")) {
      const input = /** @type {HTMLInputElement} */ (box);
      input.checked = store.chosen.has(input.dataset.file ?? "");
    }
    const n = store.chosen.size;
    fill(this.count, n === 0 ? "Tick scans to analyse them." : `${n} ${n === 1 ? "scan" : "scans"} chosen `,
      n > 0 && h("button", { type: "button", class: "link", text: "none", "aria-label": "Choose none", onclick: () => store.choose([...store.chosen], false) }));
  }

  markCurrent() {
    for (const button of this.list.querySelectorAll("button[data-file]")) {
      const on = /** @type {HTMLElement} */ (button).dataset.file === store.current;
      if (on) button.setAttribute("aria-current", "true");
      else button.removeAttribute("aria-current");
    }
  }

  listenToDrops() {
    let depth = 0;
    const over = (/** @type {number} */ d) => {
      depth = Math.max(0, depth + d);
      this.drop.classList.toggle("over", depth > 0);
    };
    window.addEventListener("dragenter", () => over(1));
    window.addEventListener("dragleave", () => over(-1));
    window.addEventListener("dragover", (event) => event.preventDefault());
    window.addEventListener("drop", async (event) => {
      event.preventDefault();
      over(-100);
      if (event.dataTransfer) this.upload(await filesOf(event.dataTransfer));
    });
  }

  /**
   * Sends files to the program and opens the first of them.
   * @param {{file: File, name: string}[]} files
   */
  async upload(files) {
    if (files.length === 0) return;
    const drop = `d${Date.now().toString(36)}`;
    const taken = [];
    for (const [i, { file, name }] of files.entries()) {
      this.note.textContent = files.length > 1 ? `Reading ${i + 1} of ${files.length}: ${name}` : `Reading ${name}`;
      try {
        const answer = await ask(`upload${query({ drop, name })}`, { method: "POST", body: file });
        const entry = { ...(await answer.json()), folder: DROPPED };
        store.learn(entry);
        taken.push(entry.file);
        if (taken.length === 1) store.open(entry.file);
      } catch (error) {
        this.failed(`${name}: ${/** @type {Error} */ (error).message}`);
      }
    }
    this.note.textContent = "";
    say(`${taken.length} of ${files.length} files taken`);
    store.choose(taken, true);
    await this.openDropped();
  }

  /** Scans of the program, as if they were dropped. */
  async tryIt() {
    this.note.textContent = "Simulating three sets of scans …";
    try {
      const { files } = await send("POST", "demo");
      for (const entry of files) store.learn({ ...entry, folder: DROPPED });
      const ids = files.map((/** @type {any} */ entry) => entry.file);
      store.open(ids[0]);
      store.choose(ids, true);
      await this.openDropped();
    } catch (error) {
      this.failed(/** @type {Error} */ (error).message);
    }
    this.note.textContent = "";
  }

  /** The folder of what was dropped, read anew and opened. */
  async openDropped() {
    const old = [...this.list.children].find((li) => /** @type {HTMLElement} */ (li).dataset.root === DROPPED);
    const fresh = this.folder(DROPPED, "", "Dropped", false);
    old?.replaceWith(fresh);
    const inside = /** @type {HTMLElement} */ (fresh.querySelector("ul"));
    await this.read(DROPPED, "", inside);
    inside.hidden = false;
    const button = /** @type {HTMLElement} */ (fresh.querySelector("button.folder"));
    button.setAttribute("aria-expanded", "true");
    // Folders come one for each drop; the newest is of interest.
    const folders = inside.querySelectorAll(":scope > li > .row > button.folder");
    if (folders.length > 0) /** @type {HTMLElement} */ (folders[folders.length - 1]).click();
    this.showChosen();
    this.markCurrent();
  }
}

/** A file that should be a scan and cannot be read. @param {{name: string, error?: string}} entry */
function unreadable(entry) {
  return h("li", { class: "unreadable" }, h("details", {}, h("summary", { text: `${entry.name}: cannot be read` }), String(entry.error ?? "")));
}

/**
 * The files of a drop, those in folders with their places in them. Chromium reads folders by handles, and not by entries where the
 * page was opened from a disk; other browsers know entries only.
 * @param {DataTransfer} transfer
 * @returns {Promise<{file: File, name: string}[]>}
 */
async function filesOf(transfer) {
  // All has to be asked for before the event is over.
  const items = [...transfer.items].filter((item) => item.kind === "file").map((item) => {
    const entry = item.webkitGetAsEntry?.();
    return { entry, file: item.getAsFile(), handle: entry?.isDirectory ? /** @type {any} */ (item).getAsFileSystemHandle?.() : null };
  });
  /** @type {{file: File, name: string}[]} */
  const found = [];
  for (const { entry, file, handle } of items) {
    if (handle) await walkHandle(await handle, entry?.name ?? "", found);
    else if (entry?.isDirectory) await walk(entry, "", found);
    else if (file) found.push({ file, name: file.name });
  }
  return found.sort((a, b) => a.name.localeCompare(b.name, "en", { numeric: true }));
}

/**
 * @param {any} folder
 * @param {string} under
 * @param {{file: File, name: string}[]} found
 */
async function walkHandle(folder, under, found) {
  for await (const [name, inside] of folder.entries()) {
    if (inside.kind === "directory") await walkHandle(inside, `${under}/${name}`, found);
    else found.push({ file: await inside.getFile(), name: `${under}/${name}` });
  }
}

/**
 * @param {FileSystemEntry} entry
 * @param {string} under
 * @param {{file: File, name: string}[]} found
 */
async function walk(entry, under, found) {
  const name = under + entry.name;
  if (entry.isFile) {
    const file = await new Promise((done, failed) => /** @type {FileSystemFileEntry} */ (entry).file(done, failed));
    found.push({ file: /** @type {File} */ (file), name });
    return;
  }
  const reader = /** @type {FileSystemDirectoryEntry} */ (entry).createReader();
  for (;;) {
    const part = /** @type {FileSystemEntry[]} */ (await new Promise((done, failed) => reader.readEntries(done, failed)));
    if (part.length === 0) return;
    for (const inside of part) await walk(inside, `${name}/`, found);
  }
}
