// What happens in the program, as it happens: one stream of events for the page, taken up again by itself.

import { ApiError, get, openSession } from "./api.js";
import { happenings } from "./host.js";

/** @typedef {{kind: string, id: string, state?: string, stage?: string, done?: number, of?: number, line?: any}} Happening */

const target = new EventTarget();
/** @type {EventSource | null} */
let stream = null;
let connected = false;
/** @type {ReturnType<typeof setTimeout> | undefined} */
let retry;
let waits = 500;

/**
 * Calls back for events of a kind: "work", "map", "watch", "campaign".
 * @param {string} kind
 * @param {(event: Happening) => void} callback
 */
export function onHappening(kind, callback) {
  target.addEventListener(kind, (e) => callback(/** @type {CustomEvent} */ (e).detail));
}

/**
 * Calls back when the program answers again after it was away (views ask anew), and when it goes away.
 * @param {(up: boolean) => void} callback
 */
export function onConnection(callback) {
  target.addEventListener("connection", (e) => callback(/** @type {CustomEvent} */ (e).detail));
}

/** Calls back when the program is another one than that which this page was opened with. @param {() => void} callback */
export function onStranger(callback) {
  target.addEventListener("stranger", callback);
}

/** @param {boolean} up */
function tell(up) {
  if (up === connected) return;
  connected = up;
  target.dispatchEvent(new CustomEvent("connection", { detail: up }));
}

/** Opens the stream. Browsers give up on some failures; then it is opened anew. */
export function listen() {
  stream?.close();
  stream = happenings();
  stream.onopen = () => {
    waits = 500;
    tell(true);
  };
  stream.onerror = () => {
    tell(false);
    if (stream?.readyState === EventSource.CLOSED) again();
  };
  // The program was started anew, or too much was missed: views ask for everything again.
  stream.addEventListener("reset", () => {
    tell(false);
    tell(true);
  });
  for (const kind of ["work", "map", "watch", "campaign"]) {
    stream.addEventListener(kind, (event) => {
      const said = JSON.parse(/** @type {MessageEvent} */ (event).data);
      const detail = { ...said, kind, id: said[kind] ?? said.id };
      target.dispatchEvent(new CustomEvent(kind, { detail }));
    });
  }
}

/** Waits until the program answers, then opens the stream. */
function again() {
  clearTimeout(retry);
  retry = setTimeout(async () => {
    try {
      await get("state");
      listen();
    } catch (error) {
      if (error instanceof ApiError && error.stranger) await openSession().catch(() => target.dispatchEvent(new CustomEvent("stranger")));
      waits = Math.min(5000, waits * 1.5);
      again();
    }
  }, waits);
}
