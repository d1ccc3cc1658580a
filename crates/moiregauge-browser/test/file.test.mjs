// The one HTML file, opened from the disk: what is dropped on it, its numbers beside those of the program, what it asks for.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { basename, join } from "node:path";
import { pathToFileURL } from "node:url";
import { after, test } from "node:test";
import { byProgram, same } from "./compare.mjs";
import { WORK, campaign, closeBrowser, nextResult, open, scansOf, simulated, theBrowser, view } from "./harness.mjs";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const FILE = pathToFileURL(process.env.HTML ?? "").href;
after(closeBrowser);

/** The file in a page of its own; whatever it asks for stands in `asked`. */
async function opened() {
  const page = await open(FILE);
  /** @type {string[]} */
  const asked = [];
  page.on("request", (r) => /^(blob|data|file):/.test(r.url()) || asked.push(r.url()));
  return Object.assign(page, { asked });
}

/** @typedef {Awaited<ReturnType<typeof opened>>} Page */

/** An answer of the program in the file. @param {Page} page @param {string} path */
const answer = (page, path) => page.evaluate(async (p) => (await /** @type {any} */ (globalThis).moiregaugeWithin.ask(p, {})).json(), path);

/** @param {Page} page @param {string[]} files */
async function drop(page, files) {
  await view(page, "Look");
  await page.locator("#pick-files").setInputFiles(files);
  await page.getByText(`${files.length} of ${files.length} files taken`).waitFor({ timeout: 60000 });
}

/** Files and folders, dropped as from a window of the system. @param {Page} page @param {string[]} files */
async function dragged(page, files) {
  await view(page, "Look");
  const browser = await page.context().newCDPSession(page);
  const data = { items: [], files, dragOperationsMask: 1 };
  for (const type of /** @type {const} */ (["dragEnter", "dragOver", "drop"])) await browser.send("Input.dispatchDragEvent", { type, x: 300, y: 300, data });
  await page.getByText(/^(\d+) of \1 files taken/).waitFor({ timeout: 60000 });
}

/** @param {Page} page */
async function analyse(page) {
  await view(page, "Analyse");
  await nextResult(page, () => page.getByRole("button", { name: /^Analyse/ }).click());
}

/** The results of the last work. @param {Page} page */
async function results(page) {
  const { works } = await answer(page, "state");
  return answer(page, `works/${works.at(-1)}/results.json`);
}

test("scans that are dropped give the program's numbers", async () => {
  const page = await opened();
  const files = scansOf(simulated("plain"));
  await dragged(page, files);
  await analyse(page);
  same(await results(page), byProgram(files, "plain"));
  assert.match((await results(page)).provenance.version, /browser$/);
  assert.deepEqual([page.wrong, page.asked], [[], []]);
  await page.leave();
});

for (const set of (process.env.SETS ?? "").split(":").filter((s) => s !== "")) {
  test(`recorded scans, ${set}`, async () => {
    const page = await opened();
    const files = scansOf(set);
    await drop(page, files);
    await analyse(page);
    same(await results(page), byProgram(files, "recorded"));
    assert.deepEqual([page.wrong, page.asked], [[], []]);
    await page.leave();
  });
}

test("what is no scan is named, and the rest goes on", async () => {
  const page = await opened();
  const [text, broken] = [join(WORK, "notes.txt"), join(WORK, "broken.spm")];
  const [scan, ...others] = scansOf(simulated("plain"));
  writeFileSync(text, "A day at the microscope.\n");
  writeFileSync(broken, readFileSync(scan).subarray(0, 9000));
  await drop(page, [text, broken, scan, ...others]);
  await page.getByText(/notes\.txt/).first().waitFor();
  await analyse(page).catch(() => undefined);
  const { works } = await answer(page, "state");
  const { state, failed } = await answer(page, `works/${works.at(-1)}`);
  const named = state === "failed" ? failed : (await results(page)).failed;
  assert.deepEqual(named.map((/** @type {any} */ f) => f.file).sort(), ["broken.spm", "notes.txt"]);
  await page.leave();
});

test("the demonstration is inside", async () => {
  const page = await opened();
  await page.getByRole("button", { name: "Try it with simulated scans" }).click();
  await page.getByText("26 scans chosen").waitFor({ timeout: 120000 });
  await view(page, "Analyse");
  await page.getByRole("button", { name: /^Analyse/ }).click();
  await page.waitForSelector("html[data-result]", { timeout: 240000 });
  const { sets } = await results(page);
  assert.equal(sets.length, 3);
  for (const { mean } of sets) {
    for (const [{ value, sigma_total }, truth] of [[mean.twist_deg, 1.13], [mean.heterostrain_percent, 0.12]]) assert.ok(Math.abs(value - truth) < 3 * sigma_total, `${value} ± ${sigma_total}`);
  }
  assert.deepEqual([page.wrong, page.asked], [[], []]);
  await page.leave();
});

test("a map, a correction by hand, a zip; axe-core finds nothing serious", async () => {
  const page = await opened();
  const files = scansOf(simulated("plain"));
  await drop(page, files);
  await analyse(page);
  const before = await results(page);
  await view(page, "Correct");
  await page.waitForSelector("html[data-correct]");
  const handle = page.getByRole("button", { name: "Lattice vector 1" });
  await handle.focus();
  await nextResult(page, () => page.keyboard.press("ArrowRight"));
  assert.notEqual(JSON.stringify((await results(page)).settings.by_hand ?? null), JSON.stringify(before.settings.by_hand ?? null));
  await nextResult(page, () => page.getByRole("button", { name: "Undo", exact: true }).click());
  assert.deepEqual((await results(page)).sets, before.sets);
  await view(page, "Take away");
  const [zip] = await Promise.all([page.waitForEvent("download", { timeout: 120000 }), page.getByRole("link", { name: "Everything as zip" }).click()]);
  const [packed, into] = [join(WORK, "result.zip"), join(WORK, "from-zip")];
  await zip.saveAs(packed);
  mkdirSync(into, { recursive: true });
  execFileSync("python3", ["-m", "zipfile", "-e", packed, into]);
  assert.deepEqual(JSON.parse(readFileSync(join(into, "results.json"), "utf8")).sets, before.sets);
  assert.ok(readFileSync(join(into, "report.html"), "utf8").includes("<svg"));
  await view(page, "Maps");
  await page.getByRole("button", { name: "Make the map" }).click();
  await page.waitForSelector("html[data-map]", { timeout: 120000 });
  for (const name of ["Look", "Analyse", "Correct", "Maps", "Watch", "Take away"]) {
    await view(page, name);
    await page.waitForTimeout(400);
    if (process.env.SCREENSHOTS) await page.screenshot({ path: join(process.env.SCREENSHOTS, `file-${name}.png`) });
    await page.evaluate(axe);
    const found = await page.evaluate(() => /** @type {any} */ (window).axe.run(document, { resultTypes: ["violations"] }));
    assert.deepEqual(found.violations.filter((/** @type {any} */ v) => ["serious", "critical"].includes(v.impact)).map((/** @type {any} */ v) => `${v.id}: ${v.nodes[0].html.slice(0, 160)}`), [], name);
  }
  assert.deepEqual([page.wrong, page.asked], [[], []]);
  await page.leave();
});

test("what runs can be stopped, and what was measured is not measured again", async () => {
  const page = await opened();
  await drop(page, scansOf(simulated("plain")));
  await analyse(page);
  const before = await results(page);
  const files = scansOf(simulated("long", ["--scans", "6", "--pixels", "512"]));
  await view(page, "Look");
  await page.getByRole("button", { name: "Choose none" }).click();
  await drop(page, files);
  // Scans that were kept each for itself, as soon as they were measured.
  await page.evaluate(() => {
    const { keep } = /** @type {any} */ (globalThis).moiregaugeWithin;
    const kept = (/** @type {any} */ (globalThis).keptScans = []);
    /** @type {any} */ (globalThis).moiregaugeWithin.keep = function (/** @type {any[]} */ ...of) {
      if (of[2] && /begun-/.test(of[1])) kept.push(of[1]);
      keep.apply(this, of);
    };
  });
  const measured = () => page.evaluate(() => /** @type {string[]} */ (/** @type {any} */ (globalThis).keptScans));
  await view(page, "Analyse");
  await page.getByRole("button", { name: /^Analyse/ }).click();
  await page.waitForFunction(() => /** @type {any} */ (globalThis).keptScans.length >= 2, null, { timeout: 120000 });
  const took = await page.evaluate(async () => {
    const begun = performance.now();
    const cancel = /** @type {HTMLElement} */ ([...document.querySelectorAll("#view-analyse button")].find((b) => b.textContent === "Cancel"));
    cancel.click();
    const again = /** @type {HTMLButtonElement} */ (document.querySelector("#view-analyse button.main"));
    while (again.disabled) await new Promise((next) => setTimeout(next, 5));
    return performance.now() - begun;
  });
  console.log(`stopped after ${Math.round(took)} ms`);
  const first = (await measured()).length;
  const { works } = await answer(page, "state");
  assert.deepEqual((await answer(page, `works/${works[0]}/results.json`)).sets, before.sets);
  await nextResult(page, () => page.getByRole("button", { name: /^Analyse/ }).click());
  const all = await measured();
  assert.equal(new Set(all).size, files.length);
  assert.equal(all.length, files.length, `${first} scans were measured before`);
  same(await results(page), byProgram(files, "long"));
  await page.leave();
});

test("a campaign over a dropped folder gives the program's table", async () => {
  const page = await opened();
  const [table, samples] = [join(campaign(), "samples.csv"), join(WORK, "samples")];
  await dragged(page, [samples]);
  await view(page, "Samples");
  const folder = page.getByLabel("Folder of results");
  await page.waitForFunction(() => [...document.querySelectorAll("#view-samples option")].some((o) => o.textContent?.endsWith(" / samples")));
  const label = (await folder.locator("option").allTextContents()).find((text) => text.endsWith(" / samples"));
  await folder.selectOption({ label });
  await page.getByRole("button", { name: "Analyse the samples in it" }).click();
  await page.locator("#view-samples tbody tr").nth(2).waitFor({ timeout: 120000 });
  const [zip] = await Promise.all([page.waitForEvent("download"), page.getByRole("link", { name: "Table and page as zip" }).click()]);
  const [packed, into] = [join(WORK, "campaign.zip"), join(WORK, "campaign-from-zip")];
  await zip.saveAs(packed);
  execFileSync("python3", ["-m", "zipfile", "-e", packed, into]);
  sameTables(readFileSync(join(into, "samples.csv"), "utf8"), readFileSync(table, "utf8"));
  assert.ok(readFileSync(join(into, "campaign.html"), "utf8").includes("second"));
  assert.deepEqual([page.wrong, page.asked], [[], []]);
  await page.leave();
});

/** The same table: words are the same, numbers to nine digits. @param {string} here @param {string} there */
function sameTables(here, there) {
  const [mine, theirs] = [here, there].map((text) => text.trim().split("\n").map((line) => line.split(",")));
  assert.equal(mine.length, 4);
  assert.deepEqual(mine.map((line) => line.length), theirs.map((line) => line.length));
  for (const [i, line] of mine.entries()) {
    for (const [k, field] of line.entries()) {
      const [a, b] = [Number(field), Number(theirs[i][k])];
      assert.ok(field === theirs[i][k] || Math.abs(a - b) <= 1e-9 * Math.abs(b), `${mine[0][k]}: ${field}, ${theirs[i][k]}`);
    }
  }
}

test("a folder that is held open is watched", async () => {
  const page = await opened();
  const scans = scansOf(simulated("plain"));
  // A window of the system cannot be clicked on: a folder of the page stands for the one that is chosen there.
  const put = (/** @type {string} */ from, /** @type {number} */ share) => page.evaluate(([name, bytes, part]) => {
    const all = Uint8Array.from(atob(/** @type {string} */ (bytes)), (c) => c.charCodeAt(0));
    /** @type {any} */ (globalThis).onDisk.set(name, new File([all.subarray(0, all.length * Number(part))], String(name), { lastModified: Date.now() }));
  }, [basename(from), readFileSync(from).toString("base64"), share]);
  await page.evaluate(() => {
    const files = new Map();
    const entries = async function* () {
      for (const [name, file] of files) yield [name, { kind: "file", getFile: async () => file }];
    };
    Object.assign(globalThis, { onDisk: files, showDirectoryPicker: async () => ({ name: "live", entries }) });
  });
  await put(scans[0], 1);
  await view(page, "Watch");
  await page.getByRole("button", { name: "Open a folder…" }).click();
  await page.waitForFunction(() => document.querySelector("#view-watch select")?.textContent?.includes("live"));
  await page.getByRole("button", { name: "Watch", exact: true }).click();
  const frames = (/** @type {number} */ n) => page.waitForFunction((k) => Number(document.documentElement.dataset.watched ?? 0) === k, n, { timeout: 60000 });
  await frames(1);
  await put(scans[1], 0.5);
  await page.waitForTimeout(6000);
  await frames(1);
  await put(scans[1], 1);
  await frames(2);
  // An analysis goes on beside it, and its cancel does not end it.
  await drop(page, scansOf(simulated("long", ["--scans", "6", "--pixels", "512"])));
  await view(page, "Analyse");
  await page.getByRole("button", { name: /^Analyse/ }).click();
  await page.getByRole("button", { name: "Cancel" }).click();
  await put(scans[2], 1);
  await frames(3);
  await page.evaluate((name) => /** @type {any} */ (globalThis).onDisk.delete(name), basename(scans[2]));
  await frames(2);
  await view(page, "Watch");
  await page.getByRole("button", { name: "Stop", exact: true }).click();
  await page.getByText("Ended.").waitFor();
  assert.deepEqual([page.wrong, page.asked], [[], []]);
  await page.leave();
});

test("the command says what was told of files", async () => {
  const page = await opened();
  await drop(page, scansOf(simulated("plain")));
  await page.getByText("4 scans chosen").waitFor();
  const files = await page.locator("input[data-file]").evaluateAll((all) => all.map((one) => /** @type {HTMLElement} */ (one).dataset.file));
  const asked = { method: "POST", body: JSON.stringify({ files, known: { size_nm: [70, 35], line_rate_hz: 5, frame_direction: "up" } }) };
  const work = await page.evaluate(async (init) => (await (await /** @type {any} */ (globalThis).moiregaugeWithin.ask("works", init)).json()).work, asked);
  assert.match((await answer(page, `works/${work}/command`)).command, /--size 70nm×35nm --line-rate 5 --frame-direction up --out results$/);
  await page.leave();
});

test("a browser without what is needed is told so", async () => {
  const whole = { executablePath: process.env.CHROMIUM };
  for (const [flag, lacks] of [["--no-enable-sse4-1", "it lacks the SIMD instructions of WebAssembly"], ["--jitless", "it lacks WebAssembly"]]) {
    const browser = await (await theBrowser()).browserType().launch({ ...whole, args: ["--no-sandbox", `--js-flags=${flag}`] });
    const page = await browser.newPage();
    await page.goto(FILE);
    const words = await page.getByRole("alert").filter({ hasText: "cannot open" }).innerText();
    assert.ok(words.startsWith(`This browser cannot open moiregauge: ${lacks}. Needed: Chromium, Chrome or Edge 103, Firefox 113`), words);
    await browser.close();
  }
});
