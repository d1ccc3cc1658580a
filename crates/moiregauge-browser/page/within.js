// The program in this file: workers that answer what a server would, and what they need to begin anew.

/** @typedef {{path: string, init: RequestInit, done: (answer: Response) => void, failed: (error: Error) => void}} Asked */

/** What only looks at files: answered by a worker of its own, so that images come while another measures. */
const LOOKS = /^(inspect|thumb|image|spectrum|moire|moire\.svg|plan|caveats|materials|defaults)(\?|$)/;
/** Watches have a worker of their own, which no cancel of something else ends. */
const WATCHES = /^watches(\/|$)/;
const STOPS = /^(works|maps|campaigns)\/([^/]+)\/cancel$/;
/** Between two looks into a folder that is held open, milliseconds. */
const OFTEN = 2000;

/** One worker and what it was asked. */
class Hand {
  /** @param {Within} within */
  constructor(within) {
    this.within = within;
    /** @type {Map<number, Asked>} */
    this.asked = new Map();
    this.working = false;
    this.worker = this.begin();
  }

  begin() {
    const worker = new Worker(this.within.code);
    worker.addEventListener("message", ({ data }) => worker === this.worker && this.heard(data));
    worker.addEventListener("error", (event) => worker === this.worker && this.broken(event.message));
    worker.postMessage({ module: this.within.module, held: [...this.within.held] });
    return worker;
  }

  /** Ends the worker and begins another one, which knows the files and the works; questions are asked again. */
  anew() {
    this.worker.terminate();
    this.working = false;
    this.worker = this.begin();
    for (const [id, asked] of this.asked) this.send(id, asked);
  }

  /** @param {number} id @param {Asked} asked */
  send(id, { path, init }) {
    this.worker.postMessage({ id, path, method: init.method ?? "GET", body: typeof init.body === "string" ? init.body : "" });
  }

  /** @param {any} data */
  heard(data) {
    if (data.event) this.within.tell(data.event, data.value);
    else if (data.kept) this.within.keep(this, data.kept, data.file);
    else if ("working" in data) this.working = data.working;
    else if (data.tick) this.within.look();
    else if (data.broken) this.broken(data.broken, data.id);
    else if ("id" in data) {
      const asked = this.asked.get(data.id);
      this.asked.delete(data.id);
      const { status, headers, body } = data;
      asked?.done(new Response(status === 204 ? null : body, { status, headers }));
    }
  }

  /** @param {string} words @param {number} [id] what it was asked when it broke */
  broken(words, id) {
    const failed = id === undefined ? [...this.asked.keys()] : [id];
    for (const one of failed) {
      this.asked.get(one)?.failed(new Error(`a fault of moiregauge, please report it: ${words}`));
      this.asked.delete(one);
    }
    this.within.broken(this === this.within.hands && this.working ? words : "");
    this.anew();
  }
}

/** A folder of the disk, whose files are put among the dropped ones as they come, change and go. */
class Mirror {
  /** @param {Within} within @param {any} folder @param {string} under */
  constructor(within, folder, under) {
    this.within = within;
    this.folder = folder;
    this.under = under;
    /** @type {Map<string, File>} */
    this.files = new Map();
    this.looking = false;
  }

  async look() {
    if (this.looking) return;
    this.looking = true;
    try {
      const here = new Set();
      for await (const [name, entry] of this.folder.entries()) {
        if (entry.kind !== "file") continue;
        here.add(name);
        // One that goes while it is looked at is gone at the next look.
        const file = await entry.getFile().catch(() => undefined);
        const known = this.files.get(name);
        if (file && !(known?.size === file.size && known?.lastModified === file.lastModified)) this.put(name, file);
      }
      for (const name of this.files.keys()) if (!here.has(name)) this.put(name, null);
    } catch {
      // A stick that was pulled: the program says that the folder is away.
      this.files.clear();
      this.within.put(`dropped/${this.under}`, null);
    }
    this.looking = false;
  }

  /** @param {string} name @param {File | null} file */
  put(name, file) {
    if (file) this.files.set(name, file);
    else this.files.delete(name);
    this.within.put(`dropped/${this.under}/${name}`, file);
  }
}

/** What the page asks in place of a server. */
export class Within {
  /** @param {WebAssembly.Module} module @param {string} code the address of the worker's code */
  constructor(module, code) {
    this.module = module;
    this.code = code;
    /** What a worker finds when it begins: dropped files, kept works. @type {Map<string, File>} */
    this.held = new Map();
    /** @type {EventTarget & {onopen?: Function, onerror?: Function, readyState: number, close: () => void}} */
    this.stream = Object.assign(new EventTarget(), { readyState: 1, close: () => undefined });
    this.last = 0;
    /** The work or map that runs. @type {any} */
    this.running = null;
    this.hands = new Hand(this);
    this.eyes = new Hand(this);
    /** Begins with the first folder. @type {Hand | null} */
    this.watcher = null;
    /** Folders that are held open. @type {Mirror[]} */
    this.mirrors = [];
  }

  /** @param {string} path @param {RequestInit} init @returns {Promise<Response>} */
  async ask(path, init) {
    if (init.body instanceof File) this.hold(path, init.body);
    const upload = path.startsWith("upload?");
    // Both have to know the file.
    if (upload) await this.send(this.eyes, path, { method: "POST" });
    const stop = STOPS.exec(path);
    if (stop && this.hands.working) {
      const { running } = this;
      this.hands.anew();
      if (running) this.tell(running.kind, { [running.kind]: running.id, state: "cancelled" });
      this.tell("reset", null);
      // Works are kept, other things are not: the next worker does not know them.
      if (stop[1] !== "works") return new Response("null");
    }
    const hand = LOOKS.test(path) ? this.eyes : WATCHES.test(path) ? (this.watcher ??= new Hand(this)) : this.hands;
    const answer = await this.send(hand, path, upload ? { method: "POST" } : init);
    init.signal?.throwIfAborted();
    return answer;
  }

  /** @param {Hand} hand @param {string} path @param {RequestInit} init @returns {Promise<Response>} */
  send(hand, path, init) {
    return new Promise((done, failed) => {
      const asked = { path, init, done, failed };
      hand.asked.set(++this.last, asked);
      hand.send(this.last, asked);
    });
  }

  /** A dropped file, where the program looks for it. @param {string} path @param {File} file */
  hold(path, file) {
    const given = new URLSearchParams(path.slice(path.indexOf("?")));
    const place = `dropped/${given.get("drop")}/${given.get("name")}`;
    this.put(place, file);
  }

  /** A file of the user, or none, in all workers. @param {string} place @param {File | null} file */
  put(place, file) {
    if (file) this.held.set(place, file);
    else for (const held of [...this.held.keys()]) if (held === place || held.startsWith(`${place}/`)) this.held.delete(held);
    for (const hand of [this.hands, this.eyes, this.watcher]) hand?.worker.postMessage({ put: place, what: file });
  }

  /**
   * Lets the user open a folder, and holds it open: what lies in it lies among the dropped files, too, as long as this page lives.
   * @returns {Promise<{root: string, under: string, name: string}>}
   */
  async holdFolder() {
    const folder = await /** @type {any} */ (globalThis).showDirectoryPicker({ mode: "read" });
    const mirror = new Mirror(this, folder, `w${++this.last}/${folder.name}`);
    if (!this.watcher) this.watcher = new Hand(this);
    // Timers of workers go on where the page is out of sight.
    if (this.mirrors.push(mirror) === 1) this.watcher.worker.postMessage({ tick: OFTEN });
    await mirror.look();
    return { root: "dropped", under: mirror.under, name: folder.name };
  }

  look() {
    for (const mirror of this.mirrors) mirror.look();
  }

  /** What a worker wrote. @param {Hand} from @param {string} path @param {File | null} file */
  keep(from, path, file) {
    if (from !== this.hands) return;
    if (file) this.held.set(path, file);
    else this.held.delete(path);
    if (path.startsWith("dropped/")) this.eyes.worker.postMessage({ put: path, what: file });
  }

  /** @param {string} kind @param {any} value */
  tell(kind, value) {
    if (value?.state === "running" && kind !== "watch") this.running = { kind, id: value[kind] };
    this.stream.dispatchEvent(new MessageEvent(kind, { data: JSON.stringify(value) }));
  }

  /** A worker ended by a fault. @param {string} words what it did not bring to an end */
  broken(words) {
    if (words && this.running) this.tell(this.running.kind, { [this.running.kind]: this.running.id, state: "failed", error: words });
    this.tell("reset", null);
  }

  /** Events, as an `EventSource` gives them. */
  happenings() {
    setTimeout(() => this.stream.onopen?.(), 0);
    return this.stream;
  }
}
