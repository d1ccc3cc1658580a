// The one HTML file in Firefox, opened from the disk.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { pathToFileURL } from "node:url";
import { test } from "node:test";
import { setTimeout as rest } from "node:timers/promises";
import { byProgram, same } from "./compare.mjs";
import { WORK, scansOf, simulated } from "./harness.mjs";
import { firefox } from "./marionette.mjs";

const FILE = pathToFileURL(process.env.HTML ?? "").href;
const DOWNLOADS = join(WORK, "firefox");

/** @param {string} folder */
async function opened(folder) {
  const page = await firefox(process.env.FIREFOX_ESR ?? "", FILE, folder);
  await page.until("return document.documentElement.dataset.ready === 'true'");
  const answer = async (/** @type {string} */ path) => JSON.parse(await page.run(`return await (await (window.wrappedJSObject ?? window).moiregaugeWithin.ask(${JSON.stringify(path)}, {})).text()`));
  const results = async () => answer(`works/${(await answer("state")).works.at(-1)}/results.json`);
  const number = async () => Number(await page.run("return document.documentElement.dataset.result ?? 0"));
  /** @param {() => Promise<any>} action */
  const nextResult = async (action) => {
    const before = await number();
    await action();
    await page.until(`return Number(document.documentElement.dataset.result ?? 0) > ${before}`);
  };
  /** @param {string} name */
  const view = (name) => page.until(`const tab = [...document.querySelectorAll("[role=tab]")].find((t) => t.textContent === "${name}"); tab.click();
    return document.getElementById(tab.getAttribute("aria-controls")).childElementCount > 0`);
  /** @param {string[]} files */
  const drop = async (files) => {
    await page.type("#pick-files", files.join("\n"));
    await page.until(`return document.body.textContent.includes("${files.length} of ${files.length} files taken")`);
  };
  const analyse = async () => {
    await view("Analyse");
    await nextResult(() => page.click("Analyse"));
  };
  /** No address but those in the file itself was asked for. */
  const asked = () => page.run("return performance.getEntriesByType('resource').map((e) => e.name).filter((name) => !/^(blob|data|file):/.test(name))");
  return { ...page, answer, results, nextResult, view, drop, analyse, asked };
}

test("in Firefox: numbers, a map, a correction by hand, a zip; what is no scan is named", async () => {
  const page = await opened(DOWNLOADS);
  const files = scansOf(simulated("plain"));
  const [text, broken] = [join(WORK, "unread-notes.txt"), join(WORK, "unread-broken.spm")];
  writeFileSync(text, "A day at the microscope.\n");
  writeFileSync(broken, readFileSync(files[0]).subarray(0, 9000));
  await page.drop([...files, text, broken]);
  await page.analyse();
  const before = await page.results();
  same(before, byProgram(files, "firefox"));
  assert.deepEqual(before.failed.map((/** @type {any} */ f) => f.file).sort(), ["unread-broken.spm", "unread-notes.txt"]);
  await page.view("Correct");
  await page.until("return document.documentElement.dataset.correct !== undefined");
  await page.nextResult(() => page.run(`const handle = document.querySelector("[aria-label='Lattice vector 1']"); handle.focus();
    handle.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }))`));
  assert.notEqual(JSON.stringify((await page.results()).settings.by_hand ?? null), JSON.stringify(before.settings.by_hand ?? null));
  await page.nextResult(() => page.click("Undo"));
  assert.deepEqual((await page.results()).sets, before.sets);
  await page.view("Take away");
  await page.click("Everything as zip");
  const [packed, into] = [join(DOWNLOADS, "moiregauge-result.zip"), join(WORK, "firefox-zip")];
  for (let i = 0; !existsSync(packed) || readFileSync(packed).length === 0; i++) {
    assert.ok(i < 600, "no download");
    await rest(200);
  }
  await rest(1000);
  mkdirSync(into, { recursive: true });
  execFileSync("python3", ["-m", "zipfile", "-e", packed, into]);
  assert.deepEqual(JSON.parse(readFileSync(join(into, "results.json"), "utf8")).sets, before.sets);
  await page.view("Maps");
  await page.click("Make the map");
  await page.until("return document.documentElement.dataset.map !== undefined");
  await page.view("Watch");
  assert.match(await page.run("return document.getElementById('view-watch').textContent"), /This browser cannot hold a folder open/);
  assert.deepEqual(await page.asked(), []);
  await page.leave();
});

for (const set of (process.env.SETS ?? "").split(":").filter((s) => s !== "")) {
  test(`in Firefox: recorded scans, ${set}`, async () => {
    const page = await opened(join(WORK, `firefox-${set.replace(/\W/g, "-")}`));
    const files = scansOf(set);
    await page.drop(files);
    await page.analyse();
    same(await page.results(), byProgram(files, "firefox-recorded"));
    await page.leave();
  });
}

test("in Firefox: the demonstration", async () => {
  const page = await opened(join(WORK, "firefox-demo"));
  await page.click("Try it with simulated scans");
  await page.until("return document.body.textContent.includes('26 scans chosen')");
  await page.analyse();
  const { sets } = await page.results();
  assert.equal(sets.length, 3);
  for (const { mean } of sets) assert.ok(Math.abs(mean.twist_deg.value - 1.13) < 3 * mean.twist_deg.sigma_total);
  assert.deepEqual(await page.asked(), []);
  await page.leave();
});
