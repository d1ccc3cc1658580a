// The frame of the page: session, tabs, light and dark, what is wrong.

import { ApiError, get, openSession } from "./api.js";
import { h } from "./dom.js";
import { listen, onConnection, onStranger } from "./events.js";
import { recolour } from "./plot.js";
import { store } from "./store.js";
import { LookView } from "./look.js";

/** @typedef {{element: HTMLElement, shown?: () => void, refresh?: () => void}} View */

/** Views other than the first come when they are opened. @type {[string, string, () => Promise<View>][]} */
const VIEWS = [
  ["look", "Look", async () => new LookView(complain)],
  ["analyse", "Analyse", async () => new (await import("./analyse.js")).AnalyseView(complain, show)],
  ["correct", "Correct", async () => new (await import("./correct.js")).CorrectView(complain)],
  ["maps", "Maps", async () => new (await import("./maps.js")).MapsView(complain)],
  ["watch", "Watch", async () => new (await import("./watch.js")).WatchView(complain)],
  ["moire", "Moiré and plan", async () => new (await import("./moire.js")).MoireView()],
  ["samples", "Samples", async () => new (await import("./samples.js")).SamplesView(complain)],
  ["take", "Take away", async () => new (await import("./take.js")).TakeView(complain)],
];

/** @type {Map<string, View>} */
const made = new Map();
let current = "";

/** Says what went wrong, where it can be seen. @param {string} words */
function complain(words) {
  const notice = /** @type {HTMLElement} */ (document.getElementById("notice"));
  notice.replaceChildren(h("span", { text: words }), h("button", { type: "button", text: "Close", onclick: () => (notice.hidden = true) }));
  notice.hidden = words === "";
}

function makeTabs() {
  const tabs = /** @type {HTMLElement} */ (document.getElementById("tabs"));
  const views = /** @type {HTMLElement} */ (document.getElementById("views"));
  for (const [name, words] of VIEWS) {
    tabs.append(h("button", { type: "button", role: "tab", id: `tab-${name}`, "aria-controls": `view-${name}`, "aria-selected": "false", tabindex: -1, text: words, onclick: () => show(name) }));
    views.append(h("section", { role: "tabpanel", id: `view-${name}`, "aria-labelledby": `tab-${name}`, class: `view ${name}`, hidden: true }));
  }
  tabs.addEventListener("keydown", (event) => {
    const n = VIEWS.findIndex(([name]) => name === current);
    const to = { ArrowRight: n + 1, ArrowLeft: n - 1, Home: 0, End: VIEWS.length - 1 }[event.key];
    if (to === undefined) return;
    event.preventDefault();
    const name = VIEWS[(to + VIEWS.length) % VIEWS.length][0];
    show(name);
    document.getElementById(`tab-${name}`)?.focus();
  });
}

/** Opens a view. @param {string} name */
async function show(name) {
  current = name;
  for (const [other] of VIEWS) {
    const tab = /** @type {HTMLElement} */ (document.getElementById(`tab-${other}`));
    tab.setAttribute("aria-selected", String(other === name));
    tab.tabIndex = other === name ? 0 : -1;
    /** @type {HTMLElement} */ (document.getElementById(`view-${other}`)).hidden = other !== name;
  }
  sessionStorage.setItem("view", name);
  let view = made.get(name);
  if (!view) {
    const found = VIEWS.find(([n]) => n === name);
    if (!found) return;
    view = await found[2]();
    if (made.has(name)) return;
    made.set(name, view);
    document.getElementById(`view-${name}`)?.append(view.element);
  }
  if (current === name) view.shown?.();
}

function makeTheme() {
  const button = /** @type {HTMLElement} */ (document.getElementById("theme"));
  const system = matchMedia("(prefers-color-scheme: dark)");
  const use = (/** @type {string | null} */ theme) => {
    const dark = theme ? theme === "dark" : system.matches;
    document.documentElement.dataset.theme = dark ? "dark" : "light";
    button.textContent = dark ? "Light" : "Dark";
    button.setAttribute("aria-label", dark ? "Light colours" : "Dark colours");
    recolour();
  };
  use(localStorage.getItem("theme"));
  system.addEventListener("change", () => use(localStorage.getItem("theme")));
  button.addEventListener("click", () => {
    const theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    localStorage.setItem("theme", theme);
    use(theme);
  });
}

async function loadState() {
  store.state = await get("state");
  store.tell("state");
}

function followConnection() {
  const shown = /** @type {HTMLElement} */ (document.getElementById("connection"));
  let was = false;
  onConnection(async (up) => {
    if (up) complain("");
    shown.textContent = up ? "" : "The program does not answer; trying again …";
    shown.classList.toggle("down", !up);
    if (up && was) {
      try {
        await loadState();
        for (const view of made.values()) view.refresh?.();
      } catch (error) {
        explain(error);
      }
    }
    was = was || up;
  });
  onStranger(() => complain("The program was started again. Open the new address that it printed, with everything after the #."));
}

/** @param {unknown} error */
function explain(error) {
  if (error instanceof ApiError && error.stranger) {
    complain("This page is not signed in to the program. Open the address that moiregauge serve printed, with everything after the #.");
  } else complain(error instanceof Error ? error.message : String(error));
}

async function start() {
  makeTheme();
  makeTabs();
  try {
    await openSession();
    await loadState();
  } catch (error) {
    explain(error);
    return;
  }
  followConnection();
  listen();
  // The page of `moiregauge watch --serve` begins with what is watched.
  const last = sessionStorage.getItem("view") ?? (store.state.watches?.length > 0 ? "watch" : "look");
  await show(VIEWS.some(([name]) => name === last) ? last : "look");
  document.documentElement.dataset.ready = "true";
  performance.mark("ready");
}

start();
