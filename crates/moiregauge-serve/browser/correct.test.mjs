// Correct: the lattice by drag and by keyboard, regions, scans left out, steps back.

import assert from "node:assert/strict";
import { after, afterEach, beforeEach, test } from "node:test";
import { analyse, api, closeBrowser, nextResult, open, rootWith, serve, simulated, view } from "./harness.mjs";

/** @type {Awaited<ReturnType<typeof serve>>} */
let server;

beforeEach(async () => {
  server = await serve([rootWith("plain", simulated("plain"))]);
});
afterEach(() => server.stop());
after(closeBrowser);

async function start() {
  const page = await open(server.url);
  await analyse(page, "plain");
  await view(page, "Correct");
  await page.waitForSelector("html[data-correct]");
  return page;
}

/** @param {import("playwright-core").Page} page */
async function settings(page) {
  const { works } = await api(page, "state");
  return (await api(page, `works/${works.at(-1)}`)).settings;
}

/** Its statistical error. @param {import("playwright-core").Page} page */
async function twistSigma(page) {
  const { works } = await api(page, "state");
  return (await api(page, `works/${works.at(-1)}/results.json`)).sets[0].mean.twist_deg.sigma;
}

test("a lattice vector that is dragged is told by hand, and undone", async () => {
  const page = await start();
  const handle = page.getByRole("button", { name: "Lattice vector 1" });
  const box = await handle.boundingBox();
  assert.ok(box);
  const [x, y] = [box.x + box.width / 2, box.y + box.height / 2];
  const asked = Date.now();
  await nextResult(page, async () => {
    await page.mouse.move(x, y);
    await page.mouse.down();
    await page.mouse.move(x + 4, y + 3, { steps: 4 });
    await page.mouse.up();
  });
  console.log(`result ${Date.now() - asked} ms after the drag began`);
  const told = (await settings(page)).by_hand.lattice_nm;
  assert.equal(told.length, 2);
  assert.ok(Math.hypot(...told[0]) > 5 && Math.hypot(...told[0]) < 30, `${told}`);
  await page.getByText("Lattice about").waitFor();
  await nextResult(page, () => page.getByRole("button", { name: "Undo", exact: true }).click());
  assert.equal((await settings(page)).by_hand, undefined);
  await nextResult(page, () => page.getByRole("button", { name: "Redo", exact: true }).click());
  assert.deepEqual((await settings(page)).by_hand.lattice_nm, told);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("vectors and spots move with the arrow keys", async () => {
  const page = await start();
  for (const name of ["Lattice vector 2", "Spot 1 of the transform"]) {
    const before = (await settings(page)).by_hand?.lattice_nm;
    await page.getByRole("button", { name }).focus();
    await nextResult(page, async () => {
      await page.keyboard.press("ArrowRight");
      await page.keyboard.press("ArrowUp");
    });
    assert.notDeepEqual((await settings(page)).by_hand.lattice_nm, before);
  }
  await nextResult(page, () => page.keyboard.press("Control+z"));
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("a region is drawn with the mouse and moved with the keyboard", async () => {
  const page = await start();
  const whole = await twistSigma(page);
  await page.getByRole("button", { name: "Draw region" }).click();
  const box = await page.locator("#view-correct canvas").first().boundingBox();
  assert.ok(box);
  const corners = [[0.15, 0.15], [0.85, 0.15], [0.85, 0.85], [0.15, 0.85]];
  for (const [x, y] of corners) await page.mouse.click(box.x + x * box.width, box.y + y * box.height);
  await nextResult(page, () => page.getByRole("button", { name: "Finish region" }).click());
  const regions = (await settings(page)).by_hand.regions_nm;
  // Less of the frame tells less: the result is of the region and not of what was measured before.
  assert.ok((await twistSigma(page)) > 1.05 * whole, "the error grows with less area");
  assert.equal(regions.length, 1);
  assert.equal(regions[0].length, 4);
  const corner = page.getByRole("button", { name: "Region 1, corner 1" });
  await corner.focus();
  await nextResult(page, () => page.keyboard.press("Shift+ArrowDown"));
  assert.notDeepEqual((await settings(page)).by_hand.regions_nm, regions);
  await nextResult(page, () => page.getByRole("button", { name: "Remove: Region 1" }).click());
  assert.equal((await settings(page)).by_hand, undefined);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("a scan is left out and used again", async () => {
  const page = await start();
  await nextResult(page, () => page.locator("#view-correct").getByRole("checkbox", { name: "Use scan.002.spm" }).uncheck());
  await nextResult(page, () => page.getByRole("button", { name: "Use again: scan.002.spm" }).click());
  await page.getByText("Nothing.").waitFor();
  assert.deepEqual(page.wrong, []);
  await page.leave();
});
