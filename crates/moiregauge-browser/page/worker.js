// The program in a worker: requests come as messages, answers and events go as messages.

import { Dropped, Files, Held } from "./wasi.js";

/** @type {Files} */
let files;
/** @type {any} */
let program;
/** Files that changed and that the page keeps, for the next worker. @type {Set<string>} */
const changed = new Set();
/** @type {any[]} */
const waiting = [];
let planned = false;

/** Whether the page keeps a file: works, and scans that were simulated here. @param {string} path */
const isKept = (path) => path.startsWith("kept/") || path.startsWith("dropped/");

/** @param {{module: WebAssembly.Module, held: [string, File][]}} start */
async function begin({ module, held }) {
  files = new Files({
    line: (text) => {
      const [kind, value] = JSON.parse(text);
      postMessage({ event: kind, value });
    },
    changed: (path) => isKept(path) && changed.add(path),
  });
  for (const folder of ["ask", "dropped", "kept", "tmp"]) files.folder(folder);
  for (const [path, what] of held) put(path, what);
  const wasi = files.calls();
  program = (await WebAssembly.instantiate(module, { wasi_snapshot_preview1: wasi })).exports;
  files.memory = program.memory;
  program._initialize?.();
  postMessage({ ready: true });
}

/** @param {string} path @param {File} what */
function put(path, what) {
  files.put(path, new Dropped(what));
}

/** Tells the page which files changed. */
function tell() {
  for (const path of changed) {
    const node = files.find(path);
    postMessage({ kept: path, file: node instanceof Held ? new File([node.whole()], "", { lastModified: node.time }) : null });
  }
  changed.clear();
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
  planned = false;
  const next = waiting.shift();
  let more = true;
  try {
    if (next) answer(next);
    else {
      postMessage({ working: true });
      more = program.turn() === 1;
      postMessage({ working: false });
    }
    tell();
  } catch (error) {
    // It is as it was left: another worker begins anew.
    postMessage({ broken: files.complaint.trim() || String(error), id: next?.id });
    return;
  }
  if (more) soon();
}

function soon() {
  if (!planned) setTimeout(step, 0);
  planned = true;
}

addEventListener("message", ({ data }) => {
  if (data.module) begin(data).catch((error) => postMessage({ broken: String(error) }));
  else if (data.put) put(data.put, data.what);
  else {
    waiting.push(data);
    soon();
  }
});
