// Look: load, files, images, contrast, profile, pictures, names that hold script.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { copyFileSync, mkdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { after, before, test } from "node:test";
import { closeBrowser, open, openFolder, PROGRAM, rootWith, scansOf, serve, simulated, WORK } from "./harness.mjs";

/** @type {Awaited<ReturnType<typeof serve>>} */
let server;
const SCRIPT = "<img src=x onerror=window.hit=1> & 'x'.spm";

before(async () => {
  const scans = simulated("plain");
  const root = rootWith("plain", scans);
  mkdirSync(join(root, "a & 'b' &lt;i&gt;"), { recursive: true });
  copyFileSync(scansOf(scans)[0], join(root, "a & 'b' &lt;i&gt;", SCRIPT));
  server = await serve([root]);
});
after(async () => {
  await closeBrowser();
  await server.stop();
});

test("the page is ready within a second and forgets the token", async () => {
  const page = await open(server.url);
  const ready = await page.evaluate(() => performance.getEntriesByName("ready")[0].startTime);
  assert.ok(ready < 1000, `ready after ${ready.toFixed(0)} ms`);
  console.log(`ready after ${ready.toFixed(0)} ms`);
  assert.equal(await page.evaluate(() => location.hash), "");
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("a scan is shown, and contrast, colours and profile follow", async () => {
  const page = await open(server.url);
  await openFolder(page, "plain");
  await page.getByRole("button", { name: /^scan\.001\.spm/ }).click();
  await page.waitForSelector("html[data-picture]");
  assert.ok(await page.locator(".thumb").count() >= 4);
  const colours = () => page.evaluate(() => {
    const canvas = /** @type {HTMLCanvasElement} */ (document.querySelector(".look canvas"));
    const c = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d"));
    return [...c.getImageData(canvas.width >> 1, canvas.height >> 1, 60, 60).data].join();
  });
  await page.waitForTimeout(100);
  const first = await colours();
  const low = page.getByRole("slider", { name: "Lower end of the contrast" });
  await low.focus();
  const was = Number(await low.getAttribute("aria-valuenow"));
  await page.keyboard.press("Shift+ArrowRight");
  assert.ok(Number(await low.getAttribute("aria-valuenow")) > was);
  await page.waitForTimeout(100);
  assert.notEqual(await colours(), first);
  await page.getByRole("button", { name: "Line", exact: true }).click();
  assert.match(await page.locator(".reading").innerText(), /Length 35\.\d+ ?.nm/u);
  const end = page.getByRole("button", { name: "End of the line" });
  await end.focus();
  const reading = await page.locator(".reading").innerText();
  await page.keyboard.press("Shift+ArrowUp");
  assert.notEqual(await page.locator(".reading").innerText(), reading);
  await page.getByRole("button", { name: "Angle", exact: true }).click();
  assert.match(await page.locator(".reading").innerText(), /^Angle \d+.*legs at/);
  await page.getByRole("button", { name: "Line", exact: true }).click();
  // Levelling and colours change the picture, and nothing else.
  for (const [name, value] of [["Level for display", 2], ["Colours", 1]]) {
    const before = await colours();
    await page.getByRole("combobox", { name: String(name) }).selectOption({ index: Number(value) });
    await page.waitForTimeout(100);
    assert.notEqual(await colours(), before, String(name));
  }
  assert.match((await page.locator(".look .ruler text").first().textContent()) ?? "", /\d.*nm/);
  await page.locator(".look .plot summary").click();
  await page.locator(".look .plot tbody tr").nth(50).waitFor();
  await page.getByRole("searchbox").fill("line rate");
  const rows = await page.locator(".header-table tr").allInnerTexts();
  assert.ok(rows.length > 0 && rows.every((r) => /line rate/i.test(r)), `${rows}`);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("pictures are saved as PNG and SVG", async () => {
  const page = await open(server.url);
  await openFolder(page, "plain");
  await page.getByRole("button", { name: /^scan\.000\.spm/ }).click();
  await page.waitForSelector("html[data-picture]");
  for (const [kind, head] of [["PNG", "\x89PNG"], ["SVG", "<?xml"]]) {
    const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("button", { name: `Save ${kind}` }).click()]);
    const path = join(WORK, `saved.${kind}`);
    await download.saveAs(path);
    assert.equal(readFileSync(path).subarray(0, head.length).toString("latin1"), head);
    assert.match(download.suggestedFilename(), /^scan\.000\.spm TR Phase_? trace\.(png|svg)$/);
  }
  await page.leave();
});

test("the first picture of a dropped file comes within six times what the program needs to look at it", async () => {
  const file = scansOf(simulated("full", ["--scans", "1", "--pixels", "512"]))[0];
  const page = await open(server.url);
  const [took, read] = [[], []];
  for (let n = 0; n < 3; n++) {
    const before = performance.now();
    execFileSync(PROGRAM, ["info", file]);
    read.push(performance.now() - before);
    const data = readFileSync(file).toString("base64");
    const transfer = await page.evaluateHandle(async (text) => {
      const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
      const transfer = new DataTransfer();
      transfer.items.add(new File([bytes], "dropped.spm"));
      return transfer;
    }, data);
    await page.evaluate(() => {
      delete document.documentElement.dataset.picture;
      performance.clearMarks("picture");
      performance.mark("drop");
    });
    await page.dispatchEvent(".drop", "drop", { dataTransfer: transfer });
    await page.waitForSelector("html[data-picture]");
    took.push(await page.evaluate(() => performance.getEntriesByName("picture")[0].startTime - performance.getEntriesByName("drop")[0].startTime));
    await page.evaluate(() => performance.clearMarks("drop"));
  }
  const told = [took, read].map((times) => times.map((t) => t.toFixed(0)).join(", "));
  console.log(`first picture after ${told[0]} ms, info after ${told[1]} ms`);
  assert.ok(Math.min(...took) < 6 * Math.min(...read), `${told}`);
  assert.match(await page.locator(".viewer-title").innerText(), /^dropped\.spm/);
  await page.getByText("3 scans chosen").waitFor();
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("script in the name of a file or folder is text", async () => {
  const page = await open(server.url);
  await openFolder(page, "a & 'b' &lt;i&gt;");
  await page.getByRole("button", { name: SCRIPT }).click();
  await page.waitForSelector("html[data-picture]");
  assert.ok((await page.locator(".viewer-title").innerText()).startsWith(SCRIPT));
  assert.equal(await page.evaluate(() => /** @type {any} */ (window).hit), undefined);
  assert.equal(await page.locator("main i:not(.key i), main img[src='x']").count(), 0);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("an image of 4096² stays fluent, and shows its pixels when zoomed", async () => {
  const big = simulated("big", ["--scans", "1", "--pixels", "4096x4096", "--no-retrace", "--no-sensors", "--size", "500", "500"]);
  const other = await serve([big]);
  const page = await open(other.url);
  await page.getByRole("button", { name: /^scan\.000\.spm/ }).click();
  await page.waitForSelector("html[data-picture]", { timeout: 20000 });
  const parts = [];
  page.on("response", (r) => /image\?.*step=1&/.test(r.url()) && parts.push(r.url()));
  await page.getByRole("img", { name: /scan\.000/ }).focus();
  const slowest = await page.evaluate(async () => {
    const canvas = /** @type {HTMLElement} */ (document.activeElement);
    let worst = 0;
    let last = performance.now();
    for (let n = 0; n < 30; n++) {
      canvas.dispatchEvent(new KeyboardEvent("keydown", { key: n < 12 ? "+" : "ArrowLeft", bubbles: true }));
      await new Promise(requestAnimationFrame);
      const now = performance.now();
      if (n > 2) worst = Math.max(worst, now - last);
      last = now;
    }
    return worst;
  });
  console.log(`slowest of 30 frames ${slowest.toFixed(0)} ms`);
  assert.ok(slowest < 250, `${slowest} ms`);
  await page.waitForTimeout(500);
  assert.ok(parts.length > 0, "parts at full resolution are asked for");
  assert.deepEqual(page.wrong, []);
  await page.leave();
  await other.stop();
});
