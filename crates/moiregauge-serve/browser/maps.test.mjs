// Maps: run, linked cursor, region and profile by mouse and keyboard.

import assert from "node:assert/strict";
import { after, afterEach, beforeEach, test } from "node:test";
import { api, closeBrowser, open, openFolder, rootWith, serve, simulated, view } from "./harness.mjs";

/** @type {Awaited<ReturnType<typeof serve>>} */
let server;

beforeEach(async () => {
  server = await serve([rootWith("wide", simulated("wide", ["--scans", "1", "--pixels", "512", "--size", "160", "160"]))]);
});
afterEach(() => server.stop());
after(closeBrowser);

/** Shows a scan, and the view of its maps. @param {import("playwright-core").Page} page */
async function viewMaps(page) {
  await openFolder(page, "wide");
  await page.getByRole("button", { name: /^scan\.000\.spm/ }).click();
  await page.waitForSelector("html[data-picture]");
  await view(page, "Maps");
}

/** Makes the map of a scan. @param {import("playwright-core").Page} page */
async function makeMap(page) {
  await viewMaps(page);
  await page.getByRole("button", { name: "Make the map" }).click();
  await page.waitForSelector("html[data-map]", { timeout: 60000 });
}

test("a map is made, read with the keyboard, and asked about a region", async () => {
  const page = await open(server.url);
  await makeMap(page);
  const cursor = page.getByRole("button", { name: /^Cursor/ });
  await cursor.focus();
  await page.keyboard.press("ArrowRight");
  assert.match(await page.locator("#view-maps .middle > div > .readout").innerText(), /twist .*\d ± .*\d°/);
  // Crosses are drawn with the next frame of the screen.
  await page.locator("#view-maps .overlay .cross").nth(5).waitFor({ state: "attached" });
  assert.equal(await page.locator("#view-maps .overlay .cross").count(), 6);
  await page.getByRole("button", { name: "Region", exact: true }).click();
  const box = await page.locator("#view-maps canvas").first().boundingBox();
  assert.ok(box);
  await page.mouse.move(box.x + box.width * 0.35, box.y + box.height * 0.35);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.65, box.y + box.height * 0.65, { steps: 5 });
  await page.mouse.up();
  const row = page.getByRole("row", { name: /region 1/ });
  await row.waitFor();
  const before = await row.innerText();
  assert.match(before, /\d ± /);
  const corner = page.getByRole("button", { name: "region 1, corner 1" });
  await corner.focus();
  await page.keyboard.press("Shift+ArrowRight");
  await page.waitForFunction((text) => [...document.querySelectorAll("#view-maps tr")].some((r) => /** @type {HTMLElement} */ (r).innerText.startsWith("region 1") && /** @type {HTMLElement} */ (r).innerText !== text), before);
  await page.getByRole("button", { name: "Add profile" }).click();
  await page.getByText("Along profile").waitFor();
  await page.getByLabel("Quantity").selectOption({ index: 1 });
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("a profile is drawn with the mouse, areas for a device are found and drawn, the histogram is that of the map", async () => {
  const page = await open(server.url);
  await makeMap(page);
  const box = await page.locator("#view-maps canvas").first().boundingBox();
  assert.ok(box);
  await page.getByRole("button", { name: "Profile", exact: true }).click();
  await page.mouse.move(box.x + box.width * 0.3, box.y + box.height * 0.4);
  await page.mouse.down();
  await page.mouse.move(box.x + box.width * 0.7, box.y + box.height * 0.6, { steps: 5 });
  await page.mouse.up();
  await page.getByText("Along profile 1").waitFor();
  await page.getByRole("button", { name: "profile 1, end" }).waitFor();
  for (const [name, size] of [["Width of the device, nm", "30"], ["Height of the device, nm", "20"], ["Wanted twist, degrees", "1.13"], ["Within, degrees", "0.01"]]) await page.getByLabel(name).fill(size);
  await page.getByRole("button", { name: "Ask" }).click();
  const areas = page.getByRole("table", { name: "Most uniform areas" });
  await areas.waitFor();
  await page.getByRole("table", { name: "Area with the wanted twist" }).waitFor();
  const ranks = await areas.locator("tbody tr").count();
  assert.ok(ranks > 0);
  assert.equal(await page.locator("#view-maps .overlay polygon.line").count(), ranks, "every area is drawn");
  // Other ends of the colours are another picture.
  const colours = () => page.evaluate(() => {
    const canvas = /** @type {HTMLCanvasElement} */ (document.querySelector("#view-maps canvas"));
    const c = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    return [...c.getImageData(canvas.width >> 1, canvas.height >> 1, 40, 40).data].join();
  });
  const before = await colours();
  const high = page.getByRole("slider", { name: "Upper end of the colours" });
  await high.focus();
  const was = Number(await high.getAttribute("aria-valuenow"));
  await page.keyboard.press("Shift+ArrowLeft");
  assert.ok(Number(await high.getAttribute("aria-valuenow")) < was);
  await page.waitForTimeout(100);
  assert.notEqual(await colours(), before);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("a map that is done while the page asks for it is shown, once", async () => {
  const page = await open(server.url);
  await viewMaps(page);
  // The first answer, "running", comes after the map is done and after the program has said so.
  let [states, documents] = [0, 0];
  await page.route(/\/api\/maps\/[^/]+$/, async (route) => {
    const answer = await route.fetch();
    if (states++ === 0) {
      const id = new URL(route.request().url()).pathname.split("/").at(-1);
      while ((await api(page, `maps/${id}`)).state === "running") await page.waitForTimeout(100);
      await page.waitForTimeout(500);
    }
    await route.fulfill({ response: answer });
  });
  page.on("request", (r) => (documents += Number(r.url().endsWith("/result.json"))));
  await page.getByRole("button", { name: "Make the map" }).click();
  await page.waitForSelector("html[data-map]", { timeout: 60000 });
  await page.unrouteAll({ behavior: "wait" });
  await page.waitForTimeout(300);
  assert.equal(documents, 1);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("a device dragged on the map fills its size and is asked for at once", async () => {
  const page = await open(server.url);
  await makeMap(page);
  const box = await page.locator("#view-maps canvas").first().boundingBox();
  assert.ok(box);
  const [x, y] = [box.x + box.width * 0.35, box.y + box.height * 0.4];
  await page.getByRole("button", { name: "Device", exact: true }).click();
  const [width, height] = [page.getByLabel("Width of the device, nm"), page.getByLabel("Height of the device, nm")];
  await page.mouse.move(x, y);
  await page.mouse.down();
  await page.mouse.move(x + 100, y + 50, { steps: 5 });
  // The rectangle is drawn with its size while it is dragged; nothing is asked yet.
  const words = page.locator("#view-maps .overlay text.words");
  await words.waitFor({ state: "attached" });
  assert.equal(await page.locator("#view-maps .overlay polygon.outline").count(), 1);
  const shown = /^([\d.]+) × ([\d.]+) nm$/.exec((await words.textContent()) ?? "");
  assert.ok(shown, await words.textContent() ?? "");
  assert.equal(await width.inputValue(), "");
  if (process.env.SCREENSHOTS) await page.screenshot({ path: `${process.env.SCREENSHOTS}/device-drag.png` });
  await page.mouse.up();
  const areas = page.getByRole("table", { name: "Most uniform areas" });
  await areas.waitFor();
  assert.deepEqual([await width.inputValue(), await height.inputValue()], [shown[1], shown[2]]);
  // Twice as wide as high on the screen is so on the sample.
  assert.ok(Math.abs(Number(shown[1]) / Number(shown[2]) - 2) < 0.05, shown[0]);
  // Every area is drawn, with the sides of the rectangle on the screen.
  const ranks = await areas.locator("tbody tr").count();
  assert.ok(ranks > 0);
  const drawn = page.locator("#view-maps .overlay polygon.line");
  await drawn.nth(ranks - 1).waitFor({ state: "attached" });
  assert.equal(await drawn.count(), ranks);
  assert.equal(await page.locator("#view-maps .overlay polygon.outline").count(), 0);
  for (const points of await drawn.evaluateAll((all) => all.map((p) => p.getAttribute("points") ?? ""))) {
    const at = points.split(" ").map((p) => p.split(",").map(Number));
    const side = (/** @type {number} */ i) => Math.hypot(at[i + 1][0] - at[i][0], at[i + 1][1] - at[i][1]);
    const [long, short] = [side(0), side(1)].sort((a, b) => b - a);
    assert.ok(Math.abs(long - 100) < 1 && Math.abs(short - 50) < 1, points);
  }
  if (process.env.SCREENSHOTS) await page.screenshot({ path: `${process.env.SCREENSHOTS}/device.png` });
  assert.deepEqual(page.wrong, []);
  await page.leave();
});
