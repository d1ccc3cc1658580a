// Watch: frames that arrive one after the other, half written, in the wrong order.

import assert from "node:assert/strict";
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { basename, join } from "node:path";
import { after, before, test } from "node:test";
import { closeBrowser, open, scansOf, serve, simulated, view, WORK } from "./harness.mjs";

/** @type {Awaited<ReturnType<typeof serve>>} */
let server;
const root = join(WORK, "root-live");
const live = join(root, "live");

before(async () => {
  mkdirSync(live, { recursive: true });
  server = await serve([root]);
});
after(async () => {
  await closeBrowser();
  await server.stop();
});

test("frames that arrive are shown with their errors", async () => {
  const scans = scansOf(simulated("plain"));
  copyFileSync(scans[0], join(live, basename(scans[0])));
  const page = await open(server.url);
  await view(page, "Watch");
  await page.getByLabel("Folder", { exact: true }).selectOption({ label: "root-live / live" });
  await page.getByRole("button", { name: "Watch", exact: true }).click();
  const results = (/** @type {number} */ n) => page.waitForFunction((k) => Number(document.documentElement.dataset.watched ?? 0) >= k, n, { timeout: 60000 });
  await results(1);
  // Half of a file is none.
  const bytes = readFileSync(scans[2]);
  const half = join(live, basename(scans[2]));
  writeFileSync(half, bytes.subarray(0, bytes.length / 2));
  await page.waitForTimeout(5000);
  assert.equal(await page.evaluate(() => document.documentElement.dataset.watched), "1");
  writeFileSync(half, bytes);
  await results(2);
  copyFileSync(scans[1], join(live, basename(scans[1])));
  await results(3);
  const shown = await page.locator("#view-watch .headline").innerText();
  assert.match(shown, /\d ± .*°/);
  assert.match(shown, /after 3 frames/);
  assert.ok(await page.locator("#view-watch .uplot").count() === 3);
  // Earlier frames keep their numbers, and their doubts by name.
  const rows = await page.getByRole("table", { name: "Results, newest first" }).locator("tbody tr").allInnerTexts();
  assert.equal(rows.length, 3);
  assert.match(rows[0], /\d ± /);
  for (const row of rows.slice(1)) assert.match(row, /drift-undetermined/);
  await page.getByRole("button", { name: "Stop", exact: true }).click();
  await page.getByText("Ended.").waitFor();
  assert.deepEqual(page.wrong, []);
  await page.leave();
});
