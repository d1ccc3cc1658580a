// How the page reaches the program: by HTTP, or by messages where both are in one file. No other module knows which it is.

import { download } from "./dom.js";

/** The program in the file, put there before any module begins.
 * @type {{ask: (path: string, init: RequestInit) => Promise<Response>, happenings: () => EventSource,
 *   holdFolder: () => Promise<{root: string, under: string, name: string}>} | undefined} */
const within = /** @type {any} */ (globalThis).moiregaugeWithin;

/** Whether the program is in the same file. */
export const IN_ONE_FILE = within !== undefined;

/** @param {string} path below /api/ @param {RequestInit} init @returns {Promise<Response>} */
export function reach(path, init) {
  return within ? within.ask(path, init) : fetch(`/api/${path}`, { credentials: "same-origin", cache: "no-store", ...init });
}

/** Whether folders have to be opened by the user, and whether this browser can. */
export const OPENS_FOLDERS = within && "showDirectoryPicker" in globalThis;

/** Lets the user open a folder, whose files the program sees as they come. */
export function holdFolder() {
  if (!within) throw new Error("The program opens folders itself.");
  return within.holdFolder();
}

/** The stream of events. */
export function happenings() {
  return within ? within.happenings() : new EventSource("/api/events");
}

/**
 * Lets an image show an answer.
 * @template {Element} T
 * @param {T} image
 * @param {string} path
 */
export function showing(image, path) {
  if (!within) image.setAttribute("src", `/api/${path}`);
  else {
    place(path).then((url) => {
      image.addEventListener("load", () => URL.revokeObjectURL(url), { once: true });
      image.setAttribute("src", url);
    }, () => undefined);
  }
  return image;
}

/**
 * Lets a link lead to an answer: saved where it has a name for it, else opened.
 * @param {HTMLAnchorElement} link
 * @param {string} path
 */
export function leading(link, path) {
  link.href = within ? "#" : `/api/${path}`;
  if (within) {
    link.addEventListener("click", async (event) => {
      event.preventDefault();
      const blob = await (await within.ask(path, {})).blob();
      if (link.download) download(blob, link.download);
      else window.open(URL.createObjectURL(blob));
    });
  }
  return link;
}

/** @param {string} path */
async function place(path) {
  const answer = await reach(path, {});
  if (!answer.ok) throw new Error(path);
  return URL.createObjectURL(await answer.blob());
}
