// What the tests of the page share: data, a server of their own, a browser.

import { execFileSync, spawn } from "node:child_process";
import { cpSync, existsSync, mkdirSync, readdirSync, writeFileSync } from "node:fs";
import { createServer } from "node:net";
import { join } from "node:path";
import { chromium, firefox } from "playwright-core";

export const PROGRAM = process.env.PROGRAM ?? "moiregauge";
export const WORK = process.env.WORK ?? "/tmp";
const TOKEN = "c0ffee00c0ffee00c0ffee00c0ffee00";

/**
 * Simulated scans, made once: a folder of `scans` images.
 * @param {string} name
 * @param {string[]} [options] of `moiregauge simulate`
 */
export function simulated(name, options = ["--scans", "4", "--pixels", "256"]) {
  const folder = join(WORK, "data", name);
  if (!existsSync(folder)) execFileSync(PROGRAM, ["simulate", "--out", join(WORK, "data"), "--name", name, "--seed", "3", ...options]);
  return folder;
}

/** The scan files of a folder, in order. @param {string} folder */
export function scansOf(folder) {
  return readdirSync(folder).filter((n) => n.endsWith(".spm")).sort().map((n) => join(folder, n));
}

/** A root with one folder of scans in it. @param {string} name @param {string} from */
export function rootWith(name, from) {
  const root = join(WORK, `root-${name}`);
  mkdirSync(root, { recursive: true });
  cpSync(from, join(root, name), { recursive: true });
  return root;
}

/** Results of a campaign of three samples. */
export function campaign() {
  const [root, out] = [join(WORK, "samples"), join(WORK, "campaign")];
  if (existsSync(out)) return out;
  mkdirSync(root, { recursive: true });
  ["first", "second", "third"].forEach((name, n) => cpSync(simulated(name, ["--scans", "2", "--pixels", "128", "--twist", String(1.1 + 0.2 * n)]), join(root, name), { recursive: true }));
  execFileSync(PROGRAM, ["campaign", root, "--out", out, "-q"]);
  return out;
}

/** @returns {Promise<number>} */
export async function freePort() {
  return new Promise((done) => {
    const server = createServer();
    server.listen(0, "127.0.0.1", () => {
      const { port } = /** @type {import("node:net").AddressInfo} */ (server.address());
      server.close(() => done(port));
    });
  });
}

/**
 * Starts `moiregauge serve`, and waits for its address.
 * @param {string[]} folders
 * @param {{port?: number, keep?: string}} [options]
 */
export async function serve(folders, options = {}) {
  const token = join(WORK, "token");
  writeFileSync(token, TOKEN + "\n", { mode: 0o600 });
  const page = process.env.PAGE ? ["--page", process.env.PAGE] : [];
  const more = [...(options.port ? ["--port", String(options.port)] : []), ...(options.keep ? ["--keep", options.keep] : [])];
  const child = spawn(PROGRAM, ["serve", "--no-browser", "--token-file", token, ...page, ...more, ...folders], { stdio: ["ignore", "pipe", "pipe"] });
  let complaint = "";
  child.stderr.on("data", (text) => (complaint += text));
  const url = await new Promise((done, failed) => {
    child.stdout.on("data", (text) => done(String(text).trim().split("\n")[0]));
    child.on("exit", (code) => failed(new Error(`the server ended with ${code}: ${complaint}`)));
  });
  const { origin, port } = new URL(url);
  const stop = () => new Promise((done) => {
    if (child.exitCode !== null || child.signalCode !== null) return done(undefined);
    child.once("exit", done);
    child.kill("SIGTERM");
  });
  return { url, origin, port: Number(port), child, stop };
}

/** @type {import("playwright-core").Browser | null} */
let browser = null;

export async function theBrowser() {
  // A Firefox as it is, by WebDriver BiDi: the newest playwright-core asks for more than the long-term version of Firefox knows.
  if (process.env.FIREFOX) return (browser ??= await firefox.launch({ channel: "moz-firefox", executablePath: process.env.FIREFOX }));
  browser ??= await chromium.launch({ executablePath: process.env.CHROMIUM, args: ["--no-sandbox", "--disable-dev-shm-usage"] });
  return browser;
}

export async function closeBrowser() {
  await browser?.close();
  browser = null;
}

/**
 * A page of its own, that fails on any error in it and on any address but the server's.
 * @param {string} url
 * @param {{width?: number, height?: number, theme?: "light" | "dark", context?: import("playwright-core").BrowserContext}} [options]
 */
export async function open(url, options = {}) {
  const context = options.context ?? (await (await theBrowser()).newContext({
    viewport: { width: options.width ?? 1440, height: options.height ?? 900 }, colorScheme: options.theme ?? "light", acceptDownloads: true }));
  const page = await context.newPage();
  /** @type {string[]} */
  const wrong = [];
  page.on("pageerror", (error) => wrong.push(`error: ${error.message}`));
  page.on("console", (m) => {
    if (m.type() === "error" && !m.text().startsWith("Failed to load resource") && !m.text().includes("net::ERR")) wrong.push(`console: ${m.text()}`);
  });
  page.on("request", (r) => {
    const to = new URL(r.url());
    if (["http:", "https:"].includes(to.protocol) && to.origin !== new URL(url).origin) wrong.push(`asked ${r.url()}`);
  });
  await page.goto(url);
  await page.waitForSelector("html[data-ready]");
  return Object.assign(page, { wrong, leave: () => (options.context ? page.close() : context.close()) });
}

/** Opens a view. @param {import("playwright-core").Page} page @param {string} name */
export async function view(page, name) {
  await page.getByRole("tab", { name, exact: true }).click();
}

/**
 * Opens folders one in the other, and shows the files in the last.
 * @param {import("playwright-core").Page} page
 * @param {string} folder
 */
export async function openFolder(page, folder) {
  const button = page.getByRole("button", { name: folder, exact: true });
  await button.waitFor();
  if ((await button.getAttribute("aria-expanded")) !== "true") await button.click();
}

/** Chooses all scans of a folder, and analyses them. @param {import("playwright-core").Page} page @param {string} folder */
export async function analyse(page, folder) {
  await view(page, "Look");
  await page.getByRole("checkbox", { name: `Use all scans of ${folder}`, exact: true }).check();
  await page.getByText("scans chosen").first().waitFor();
  await view(page, "Analyse");
  await page.getByRole("button", { name: /^Analyse/ }).click();
  await page.waitForSelector("html[data-result]", { timeout: 60000 });
}

/** Waits for the next result. @param {import("playwright-core").Page} page @param {() => Promise<any>} action */
export async function nextResult(page, action) {
  const before = Number(await page.evaluate(() => document.documentElement.dataset.result ?? "0"));
  await action();
  await page.waitForFunction((n) => Number(document.documentElement.dataset.result ?? "0") > n, before, { timeout: 60000 });
}

/** An answer of the program, asked by the page. @param {import("playwright-core").Page} page @param {string} path */
export function api(page, path) {
  return page.evaluate(async (p) => (await fetch(`/api/${p}`)).json(), path);
}
