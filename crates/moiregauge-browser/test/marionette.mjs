// A Firefox as it is, driven by Marionette, the protocol that every Firefox has inside: its scripts run where the content policy of
// the page does not reach.

import { spawn } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { connect } from "node:net";
import { join } from "node:path";
import { setTimeout as rest } from "node:timers/promises";

const ELEMENT = "element-6066-11e4-a52e-4f735466cecf";

/**
 * Opens an address in a Firefox of its own.
 * @param {string} program
 * @param {string} url
 * @param {string} folder for its profile and for what it downloads
 */
export async function firefox(program, url, folder) {
  mkdirSync(folder, { recursive: true });
  // Downloads are saved without a question.
  const prefs = { "marionette.port": 0, "browser.download.folderList": 2, "browser.download.dir": folder, "browser.shell.checkDefaultBrowser": false,
    "datareporting.policy.dataSubmissionEnabled": false, "browser.download.alwaysOpenPanel": false };
  writeFileSync(join(folder, "user.js"), Object.entries(prefs).map(([k, v]) => `user_pref(${JSON.stringify(k)}, ${JSON.stringify(v)});\n`).join(""));
  const child = spawn(program, ["--headless", "--marionette", "--no-remote", "--profile", folder], { stdio: "ignore" });
  // A test that fails leaves none behind.
  process.on("exit", () => child.kill());
  const port = join(folder, "MarionetteActivePort");
  for (let i = 0; !existsSync(port) || readFileSync(port, "utf8") === ""; i++) {
    if (i > 600) throw new Error("Firefox does not begin");
    await rest(100);
  }
  const socket = connect(Number(readFileSync(port, "utf8")), "127.0.0.1");
  /** @type {Map<number, {done: (value: any) => void, failed: (error: Error) => void}>} */
  const asked = new Map();
  let [bytes, last] = [Buffer.alloc(0), 0];
  socket.on("data", (more) => {
    bytes = Buffer.concat([bytes, more]);
    for (let colon; (colon = bytes.indexOf(":")) > 0; ) {
      const end = colon + 1 + Number(bytes.subarray(0, colon));
      if (bytes.length < end) return;
      const said = JSON.parse(bytes.subarray(colon + 1, end).toString());
      bytes = bytes.subarray(end);
      if (!Array.isArray(said)) continue;
      const [, id, error, value] = said;
      if (error) asked.get(id)?.failed(new Error(`${error.error}: ${error.message}`));
      else asked.get(id)?.done(value);
      asked.delete(id);
    }
  });
  /** @param {string} name @param {any} [values] @returns {Promise<any>} */
  const send = (name, values = {}) => new Promise((done, failed) => {
    asked.set(++last, { done, failed });
    const text = JSON.stringify([0, last, name, values]);
    socket.write(`${Buffer.byteLength(text)}:${text}`);
  });
  await send("WebDriver:NewSession", { capabilities: { alwaysMatch: { timeouts: { script: 300000 } } } });
  await send("WebDriver:Navigate", { url });
  /** What a script in the page returns, or what its promise holds. @param {string} script @param {any[]} args @returns {Promise<any>} */
  const run = async (script, ...args) => {
    const body = `const [done] = [...arguments].slice(-1); (async () => { ${script} })().then((v) => done({ v }), (e) => done({ e: String(e) }));`;
    const { value } = await send("WebDriver:ExecuteAsyncScript", { script: body, args });
    if (value.e) throw new Error(value.e);
    return value.v;
  };
  /** Waits until a script says yes. @param {string} script @param {any[]} args */
  const until = async (script, ...args) => {
    for (let i = 0; !(await run(script, ...args)); i++) {
      if (i > 1200) throw new Error(`never: ${script}`);
      await rest(200);
    }
  };
  /** @param {string} selector */
  const element = async (selector) => (await send("WebDriver:FindElement", { using: "css selector", value: selector })).value[ELEMENT];
  return {
    run,
    until,
    /** Clicks on what bears this name, as soon as it can be. @param {string} name */
    click: (name) => until(`const all = [...document.querySelectorAll("button:not([role=tab]), a")].filter((e) => (e.getAttribute("aria-label") ?? e.textContent).startsWith(NAME) && e.checkVisibility() && !e.disabled);
      all[0]?.click(); return all.length > 0;`.replace("NAME", JSON.stringify(name))),
    /** @param {string} selector @param {string} text */
    type: async (selector, text) => send("WebDriver:ElementSendKeys", { id: await element(selector), text }),
    leave: async () => {
      const ended = new Promise((done) => child.once("exit", done));
      // It may end before it answers.
      send("Marionette:Quit", { flags: ["eForceQuit"] }).catch(() => undefined);
      await ended;
      socket.destroy();
    },
  };
}
