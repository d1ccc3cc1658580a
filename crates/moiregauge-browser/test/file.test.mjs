// The one HTML file, opened from the disk: what is dropped on it, its numbers beside those of the program, what it asks for.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { after, test } from "node:test";
import { PROGRAM, WORK, closeBrowser, nextResult, open, scansOf, simulated, view } from "./harness.mjs";

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

/** What the program writes. @param {string[]} files @param {string} name */
function byProgram(files, name) {
  const out = join(WORK, `by-program-${name}`);
  execFileSync(PROGRAM, ["analyze", ...files, "--out", out, "--force", "--quiet", "--no-png"], { stdio: ["ignore", "ignore", "inherit"] });
  return JSON.parse(readFileSync(join(out, "results.json"), "utf8"));
}

/** Every uncertain value with its place in the document. @param {any} document @param {string} at @returns {[string, number, number][]} */
function uncertain(document, at = "") {
  if (document === null || typeof document !== "object") return [];
  const own = /** @type {[string, number, number][]} */ (typeof document.value === "number" && typeof document.sigma === "number" ? [[at, document.value, document.sigma]] : []);
  return [...own, ...Object.entries(document).flatMap(([key, inside]) => uncertain(inside, `${at}/${key}`))];
}

/** The same values, within 1e-9 of their errors. @param {any} here @param {any} there */
function same(here, there) {
  const [mine, theirs] = [uncertain(here.sets), uncertain(there.sets)];
  assert.deepEqual(mine.map(([at]) => at), theirs.map(([at]) => at));
  assert.ok(mine.length > 10);
  const off = mine.map(([, value, sigma], i) => Math.max(Math.abs(value - theirs[i][1]), Math.abs(sigma - theirs[i][2])) / (theirs[i][2] || 1));
  const most = Math.max(...off);
  console.log(`${mine.length} values, the most different by ${most.toExponential(1)} of its error`);
  assert.ok(most < 1e-9, mine[off.indexOf(most)][0]);
}

test("scans that are dropped give the program's numbers", async () => {
  const page = await opened();
  const files = scansOf(simulated("plain"));
  await drop(page, files);
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

test("what runs can be stopped, and begun again with what was there", async () => {
  const page = await opened();
  await drop(page, scansOf(simulated("plain")));
  await analyse(page);
  const before = await results(page);
  await drop(page, scansOf(simulated("long", ["--scans", "8", "--pixels", "512"])));
  await view(page, "Analyse");
  await page.getByRole("button", { name: /^Analyse/ }).click();
  await page.getByRole("button", { name: "Cancel" }).waitFor();
  await page.waitForTimeout(500);
  const asked = Date.now();
  await page.getByRole("button", { name: "Cancel" }).click();
  await page.getByRole("button", { name: /^Analyse/ }).waitFor();
  console.log(`stopped after ${Date.now() - asked} ms`);
  const { works } = await answer(page, "state");
  assert.deepEqual((await answer(page, `works/${works[0]}/results.json`)).sets, before.sets);
  await page.leave();
});
