// A notebook in JupyterLab: what cells show, a bar while one works, one that is interrupted, and a session that goes on.

import assert from "node:assert/strict";
import { chromium } from "playwright-core";

const browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: ["--no-sandbox", "--disable-dev-shm-usage"] });
const page = await browser.newPage({ viewport: { width: 1300, height: 1700 } });

/** The address answers when the server is up. */
async function opened() {
  for (let tries = 0; tries < 120; tries++) {
    try {
      return await page.goto(String(process.env.ADDRESS));
    } catch {
      await page.waitForTimeout(500);
    }
  }
  throw new Error("JupyterLab does not begin");
}

const shot = (name = "jupyterlab") => page.screenshot({ path: `${process.env.SHOTS}/${name}.png` });

/** How bright the words of the first table are, and what is behind them, from 0 to 1. */
const brightness = () =>
  page.evaluate(() => {
    const of = (/** @type {string} */ colour) => {
      const [r, g, b] = (colour.match(/[\d.]+/g) ?? []).map(Number);
      return (0.299 * r + 0.587 * g + 0.114 * b) / 255;
    };
    const cell = document.querySelector(".mg-r td");
    let behind = cell;
    while (behind && /^(transparent|rgba\(.*, 0\))$/.test(getComputedStyle(behind).backgroundColor)) behind = behind.parentElement;
    if (!cell || !behind) throw new Error("there is no table");
    return { words: of(getComputedStyle(cell).color), behind: of(getComputedStyle(behind).backgroundColor) };
  });
try {
  await opened();
  const cells = page.locator(".jp-Notebook .jp-CodeCell");
  await cells.nth(4).waitFor({ timeout: 90000 });
  await page.getByText(/\| Idle/).waitFor({ timeout: 90000 });
  const run = async (/** @type {number} */ n) => {
    await cells.nth(n).locator(".cm-content").click();
    await page.keyboard.press("Control+Enter");
  };
  const output = (/** @type {number} */ n) => cells.nth(n).locator(".jp-OutputArea");
  const has = (/** @type {number} */ n, /** @type {RegExp} */ words) => output(n).filter({ hasText: words }).waitFor({ timeout: 90000 });
  await run(0);
  await run(1);
  await has(1, /measuring\s+█+ 4\/4/);
  const table = output(1).locator("table").first();
  await table.waitFor({ timeout: 60000 });
  assert.match(await output(1).innerText(), /1\.1\d+ ± 0\.\d+/);
  await run(2);
  await output(2).locator("img").waitFor({ timeout: 60000 });
  await run(3);
  await has(3, /it begins/);
  await page.waitForTimeout(1500);
  const asked = Date.now();
  await page.locator('[data-command="notebook:interrupt-kernel"]').first().click();
  await has(3, /KeyboardInterrupt/);
  console.log(`interrupted after ${Date.now() - asked} ms`);
  await run(4);
  await has(4, /the session goes on: 1\.1/);
  await shot();
  const light = await brightness();
  assert.ok(light.words < 0.3 && light.behind > 0.9, JSON.stringify(light));
  await page.locator(".lm-MenuBar-itemLabel", { hasText: /^Settings$/ }).click();
  for (const entry of [/^Theme$/, /^JupyterLab Dark$/]) await page.locator(".lm-Menu-itemLabel", { hasText: entry }).click();
  await page.locator('body[data-jp-theme-light="false"]').waitFor({ state: "attached", timeout: 30000 });
  await page.waitForTimeout(1000);
  await shot("jupyterlab-dark");
  const dark = await brightness();
  assert.ok(dark.words > 0.7 && dark.behind < 0.2, JSON.stringify(dark));
} catch (error) {
  await shot();
  console.error(error);
  process.exitCode = 1;
} finally {
  await browser.close();
}
