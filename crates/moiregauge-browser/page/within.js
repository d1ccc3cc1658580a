// The program in this file: workers that answer what a server would, and what they need to begin anew.

/** @typedef {{path: string, init: RequestInit, done: (answer: Response) => void, failed: (error: Error) => void}} Asked */

/** What only looks at files: answered by a worker of its own, so that images come while another measures. */
const LOOKS = /^(inspect|thumb|image|spectrum|moire|moire\.svg|plan|caveats|materials|defaults)(\?|$)/;
const STOPS = /^(works|maps)\/([^/]+)\/cancel$/;

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
    this.within.broken(this.working ? words : "");
    this.anew();
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
      if (stop[1] === "maps") return new Response("null");
    }
    const answer = await this.send(LOOKS.test(path) ? this.eyes : this.hands, path, upload ? { method: "POST" } : init);
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
    this.held.set(place, file);
    for (const hand of [this.hands, this.eyes]) hand.worker.postMessage({ put: place, what: file });
  }

  /** What a worker wrote. @param {Hand} from @param {string} path @param {File | null} file */
  keep(from, path, file) {
    if (from !== this.hands) return;
    if (!file) this.held.delete(path);
    else {
      this.held.set(path, file);
      if (path.startsWith("dropped/")) this.eyes.worker.postMessage({ put: path, what: file });
    }
  }

  /** @param {string} kind @param {any} value */
  tell(kind, value) {
    if (value?.state === "running") this.running = { kind, id: value[kind] };
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
