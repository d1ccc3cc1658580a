// The program in a worker: requests come as messages, answers and events go as messages.

import { Dropped, Files, Held } from "./wasi.js";

/** @type {Files} */
let files;
/** @type {any} */
let program;
/** @type {any[]} */
const waiting = [];
/** The next step. @type {ReturnType<typeof setTimeout> | undefined} */
let planned;

/** Whether the page keeps a file: works, and scans that were simulated here. @param {string} path */
const isKept = (path) => path.startsWith("kept/") || path.startsWith("dropped/");

/** @param {{module: WebAssembly.Module, held: [string, File][]}} start */
async function begin({ module, held }) {
  files = new Files({
    line: (text) => {
      const [kind, value] = JSON.parse(text);
      postMessage({ event: kind, value });
    },
    changed: (path) => isKept(path) && tell(path),
  });
  for (const folder of ["ask", "dropped", "kept", "tmp"]) files.folder(folder);
  for (const [path, what] of held) put(path, what);
  const wasi = files.calls();
  program = (await WebAssembly.instantiate(module, { wasi_snapshot_preview1: wasi })).exports;
  files.memory = program.memory;
  program._initialize?.();
  after(0);
}

/** @param {string} path @param {File | null} what */
function put(path, what) {
  if (what) files.put(path, new Dropped(what));
  else files.take(path);
}

/** Gives the page a file for the next worker, or tells it that there is none: at once, since this worker may be ended at any time.
 * @param {string} path */
function tell(path) {
  const node = files.find(path);
  if (node instanceof Held) postMessage({ kept: path, file: new File([node.whole()], "", { lastModified: node.time }) });
  else if (!node) postMessage({ kept: path, file: null });
}

/** @param {{id: number, method: string, path: string, body: string}} asked */
function answer({ id, method, path, body }) {
  files.complaint = "";
  const head = JSON.stringify({ method, path: `/api/${path}` });
  files.put("ask/request", new Held(new TextEncoder().encode(`${head}\n${body}`)));
  if (program.answer() !== 0) throw new Error(files.complaint);
  const bytes = /** @type {Held} */ (files.find("ask/answer")).whole();
  files.put("ask/answer", new Held());
  const end = bytes.indexOf(10);
  const { status, headers } = JSON.parse(new TextDecoder().decode(bytes.subarray(0, end)));
  const rest = bytes.slice(end + 1);
  postMessage({ id, status, headers, body: rest.buffer }, { transfer: [rest.buffer] });
}

/** Does one thing, requests before work that takes its time; what came meanwhile has its turn in between. */
function step() {
  const next = waiting.shift();
  let rest = 0;
  try {
    if (next) answer(next);
    else {
      postMessage({ working: true });
      rest = program.turn();
      postMessage({ working: false });
    }
  } catch (error) {
    // It is as it was left: another worker begins anew.
    postMessage({ broken: files.complaint.trim() || String(error), id: next?.id });
    return;
  }
  if (rest >= 0) after(rest);
}

/** @param {number} rest milliseconds without work, unless somebody asks */
function after(rest) {
  if (!program) return;
  clearTimeout(planned);
  planned = setTimeout(step, waiting.length > 0 ? 0 : rest);
}

addEventListener("message", ({ data }) => {
  if (data.module) begin(data).catch((error) => postMessage({ broken: String(error) }));
  else if (data.put) put(data.put, data.what);
  else if (data.tick) setInterval(() => postMessage({ tick: true }), data.tick);
  else {
    waiting.push(data);
    after(0);
  }
});
