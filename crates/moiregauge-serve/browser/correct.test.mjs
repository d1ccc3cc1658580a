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

test("a mask is painted out and back, stands in the settings, and is removed", async () => {
  const page = await start();
  const whole = await twistSigma(page);
  await page.getByRole("button", { name: "Paint a mask" }).click();
  const box = await page.locator("#view-correct canvas").first().boundingBox();
  assert.ok(box);
  await page.getByLabel("Width of the brush (nm)").fill("25");
  const stroke = async (/** @type {number} */ y) => {
    await page.mouse.move(box.x + 0.1 * box.width, box.y + y * box.height);
    await page.mouse.down();
    await page.mouse.move(box.x + 0.9 * box.width, box.y + y * box.height, { steps: 8 });
    await page.mouse.up();
  };
  await nextResult(page, () => stroke(0.3));
  const { mask } = (await settings(page)).by_hand;
  assert.deepEqual([mask.columns, mask.rows], [256, 256]);
  // A stroke below the top: the runs begin with what is used at the bottom, and add up.
  assert.equal(mask.runs.reduce((/** @type {number} */ a, /** @type {number} */ b) => a + b, 0), 256 * 256);
  assert.ok(mask.runs[0] === 0 && mask.runs[1] > 256 * 100, `${mask.runs.slice(0, 3)}`);
  assert.ok((await twistSigma(page)) > 1.02 * whole, "the error grows with less area");
  const { works } = await api(page, "state");
  assert.ok((await api(page, `works/${works.at(-1)}/results.json`)).settings.by_hand.mask, "it stands in the results");
  assert.match((await api(page, `works/${works.at(-1)}/command`)).settings, /mask/);
  if (process.env.SCREENSHOTS) await page.screenshot({ path: `${process.env.SCREENSHOTS}/mask.png` });
  await page.getByRole("button", { name: "Paint back" }).click();
  await nextResult(page, () => stroke(0.3));
  const back = (await settings(page)).by_hand?.mask;
  assert.ok(!back, "all is painted back");
  await page.getByRole("button", { name: "Paint out" }).click();
  await nextResult(page, () => stroke(0.3));
  await page.getByRole("button", { name: "Stop painting" }).click();
  await nextResult(page, () => page.getByRole("button", { name: /^Remove: Mask, / }).click());
  assert.equal((await settings(page)).by_hand, undefined);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("a stroke is painted while the result of the one before comes, and both count", async () => {
  const page = await start();
  await page.getByRole("button", { name: "Paint a mask" }).click();
  const box = await page.locator("#view-correct canvas").first().boundingBox();
  assert.ok(box);
  await page.getByLabel("Width of the brush (nm)").fill("6");
  const at = (/** @type {number} */ x, /** @type {number} */ y) => page.mouse.move(box.x + x * box.width, box.y + y * box.height, { steps: 4 });
  const begin = async (/** @type {number} */ y) => {
    await at(0.1, y);
    await page.mouse.down();
    await at(0.9, y);
  };
  const leftOut = async () => {
    const { mask } = (await settings(page)).by_hand;
    return mask.runs.filter((/** @type {number} */ _, /** @type {number} */ i) => i % 2 === 0).reduce((/** @type {number} */ a, /** @type {number} */ b) => a + b, 0);
  };
  await begin(0.2);
  // The next stroke is under way when the result comes, and ends after it.
  await nextResult(page, async () => {
    await page.mouse.up();
    await begin(0.5);
  });
  const one = await leftOut();
  await nextResult(page, () => page.mouse.up());
  const two = await leftOut();
  assert.ok(one > 0 && two > 1.7 * one, `${one}, then ${two} pixels`);
  // At once: the third is told before the program has answered to the second.
  await nextResult(page, async () => {
    for (const y of [0.7, 0.85]) {
      await begin(y);
      await page.mouse.up();
    }
  });
  await page.waitForFunction(() => document.querySelector("#view-correct .stage-words")?.textContent === "");
  const four = await leftOut();
  assert.ok(four > 1.7 * two, `${two}, then ${four} pixels`);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("another solution of the lattice is chosen and dropped", async () => {
  await server.stop();
  server = await serve([rootWith("strained", simulated("strained", ["--scans", "2", "--pixels", "192", "--size", "200", "200", "--twist", "0.5", "--strain", "0.9"]))]);
  const page = await open(server.url);
  await analyse(page, "strained");
  await view(page, "Correct");
  await page.waitForSelector("html[data-correct]");
  const numbers = page.locator("#view-correct .headline").first();
  const before = await numbers.innerText();
  await page.getByText(/solutions of this lattice/).click();
  await nextResult(page, () => page.getByRole("button", { name: /^Use the solution with twist/ }).first().click());
  assert.equal((await settings(page)).moire_waves.length, 2);
  await page.waitForFunction((text) => /** @type {HTMLElement | null} */ (document.querySelector("#view-correct .headline"))?.innerText !== text, before);
  if (process.env.SCREENSHOTS) await page.screenshot({ path: `${process.env.SCREENSHOTS}/solution.png` });
  await nextResult(page, () => page.getByRole("button", { name: "Drop: Solution chosen" }).click());
  assert.equal((await settings(page)).moire_waves, undefined);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("another grain of a frame is chosen", async () => {
  await server.stop();
  server = await serve([rootWith("grains", simulated("grains", ["--scans", "2", "--pixels", "256", "--size", "160", "160", "--sample", "grains:share=0.6,turn=8"]))]);
  const page = await open(server.url);
  await analyse(page, "grains");
  await view(page, "Correct");
  await page.waitForSelector("html[data-correct]");
  const { works } = await api(page, "state");
  const lattice = async () => (await api(page, `works/${works.at(-1)}/overlay?file=${(await api(page, `works/${works.at(-1)}`)).files[0]}`)).lines[0].lattice_px;
  const before = await lattice();
  await nextResult(page, () => page.getByRole("button", { name: "Use grain 2 alone" }).click());
  assert.equal((await settings(page)).grain, 2);
  await page.waitForFunction(() => document.querySelectorAll("#view-correct .headline").length > 0);
  const { sets } = await api(page, `works/${works.at(-1)}/results.json`);
  assert.match(sets.map((/** @type {any} */ s) => s.name).join(), /^[^,]*(, [^,]*)*grain 2$/);
  await nextResult(page, () => page.getByRole("button", { name: "Use all: Grain 2 alone" }).click());
  assert.equal((await settings(page)).grain, undefined);
  if (process.env.SCREENSHOTS) await page.screenshot({ path: `${process.env.SCREENSHOTS}/grains.png` });
  await page.getByRole("button", { name: /^Draw a region around it/ }).first().click();
  const box = await page.locator("#view-correct canvas").first().boundingBox();
  assert.ok(box);
  // The other grain lies to the right.
  for (const [x, y] of [[0.72, 0.03], [0.97, 0.03], [0.97, 0.97], [0.72, 0.97]]) await page.mouse.click(box.x + x * box.width, box.y + y * box.height);
  await nextResult(page, () => page.getByRole("button", { name: "Finish region" }).click());
  const turned = (/** @type {number[][]} */ v) => (Math.atan2(v[0][1], v[0][0]) * 180) / Math.PI;
  const angle = Math.abs(((((turned(await lattice()) - turned(before) + 30) % 60) + 60) % 60) - 30);
  assert.ok(angle > 5, `turned by ${angle}°`);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});
