// The only place that speaks with the program.

import { reach } from "./host.js";

export class ApiError extends Error {
  /**
   * @param {number} status 0: no answer
   * @param {string} message
   * @param {string} [what]
   * @param {string} [where]
   */
  constructor(status, message, what, where) {
    super(message);
    this.status = status;
    this.what = what;
    this.where = where;
  }

  /** Whether the program does not know this page. */
  get stranger() {
    return this.status === 401 || this.status === 403;
  }

  /** Whether this program does not have the route at all. */
  get missing() {
    return this.status === 404 || this.status === 405 || this.status === 501;
  }
}

/**
 * An answer of the program, or an `ApiError`.
 * @param {string} path below /api/
 * @param {RequestInit} [init]
 */
export async function ask(path, init = {}) {
  let answer;
  try {
    answer = await reach(path, init);
  } catch (error) {
    if (error instanceof DOMException && error.name === "AbortError") throw error;
    throw new ApiError(0, "The program does not answer.");
  }
  if (!answer.ok) throw await refusal(answer);
  return answer;
}

/** @param {Response} answer */
async function refusal(answer) {
  /** @type {any} */
  let body = {};
  try {
    body = await answer.json();
  } catch {
    // No JSON: the status says what there is to say.
  }
  return new ApiError(answer.status, body.error ?? `The program answers ${answer.status}.`, body.what, body.where);
}

/** @param {string} path @returns {Promise<any>} */
export async function get(path) {
  return (await ask(path)).json();
}

/**
 * @param {string} method
 * @param {string} path
 * @param {any} [body]
 * @returns {Promise<any>}
 */
export async function send(method, path, body) {
  const init = { method, headers: { "content-type": "application/json" }, body: JSON.stringify(body ?? {}) };
  const answer = await ask(path, init);
  const text = await answer.text();
  return text === "" ? null : JSON.parse(text);
}

/** @typedef {{data: Float32Array, width: number, height: number, unit: string, pixelX: number, pixelY: number,
 *   steps: [number, number]}} Floats row 0 is the bottom; pixelX and pixelY are those of the samples sent, nm; steps of
 *   a transform in periods per pixel of the image */

/**
 * Numbers of an image.
 * @param {string} path
 * @param {AbortSignal} [signal]
 * @returns {Promise<Floats>}
 */
export async function floats(path, signal) {
  const answer = await ask(path, { signal });
  const head = (/** @type {string} */ name) => Number(answer.headers.get(name) ?? NaN);
  const data = new Float32Array(await answer.arrayBuffer());
  const steps = (answer.headers.get("x-step-per-px") ?? "").split(" ").filter((text) => text !== "");
  const unit = unitOf(answer.headers.get("x-unit") ?? "");
  return {
    data,
    width: head("x-width"),
    height: head("x-height"),
    unit,
    pixelX: head("x-pixel-nm-x"),
    pixelY: head("x-pixel-nm-y"),
    steps: [Number(steps[0] ?? NaN), Number(steps[1] ?? steps[0] ?? NaN)],
  };
}

/**
 * Headers carry bytes: a unit such as "°" comes percent-encoded or as UTF-8 read byte by byte.
 * @param {string} header
 */
function unitOf(header) {
  try {
    if (header.includes("%") && header.length > 1) return decodeURIComponent(header);
    return new TextDecoder("utf-8", { fatal: true }).decode(Uint8Array.from(header, (c) => c.charCodeAt(0)));
  } catch {
    return header;
  }
}

/**
 * A query string of what is given.
 * @param {Record<string, string | number | null | undefined>} values
 */
export function query(values) {
  const given = Object.entries(values).filter(([, v]) => v !== null && v !== undefined);
  return "?" + given.map(([k, v]) => `${k}=${encodeURIComponent(String(v))}`).join("&");
}

/** As long as the page lives: a program that was started anew with the same token asks for it again. */
let token = "";

/**
 * Exchanges the token in the address for a cookie, and takes it out of the address.
 * @returns {Promise<void>}
 */
export async function openSession() {
  const found = /(?:^#|&)token=([0-9a-zA-Z]+)/.exec(location.hash)?.[1];
  if (found) {
    token = found;
    history.replaceState(null, "", location.pathname);
  }
  if (token) await send("POST", "session", { token });
}
