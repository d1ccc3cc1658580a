// Samples: the table of a campaign, sorted, two of them side by side; and what needs no files: moirés and plans.

import assert from "node:assert/strict";
import { after, afterEach, beforeEach, test } from "node:test";
import { analyse, campaign, closeBrowser, open, rootWith, serve, simulated, view } from "./harness.mjs";

/** @type {Awaited<ReturnType<typeof serve>>} */
let server;

beforeEach(async () => {
  server = await serve([rootWith("plain", simulated("plain")), campaign()]);
});
afterEach(() => server.stop());
after(closeBrowser);

test("the table of samples is sorted, and two stand side by side", async () => {
  const page = await open(server.url);
  await view(page, "Samples");
  await page.getByLabel("Folder of results").selectOption({ label: "campaign" });
  const names = () => page.locator("#view-samples table").first().locator("tbody th").allInnerTexts();
  await page.getByRole("button", { name: /^Twist/ }).click();
  assert.deepEqual(await names(), ["first", "second", "third"]);
  await page.getByRole("button", { name: /^Twist/ }).click();
  assert.deepEqual(await names(), ["third", "second", "first"]);
  await page.waitForFunction(() => [...document.querySelectorAll("#view-samples img")].some((i) => /** @type {HTMLImageElement} */ (i).naturalWidth > 0));
  for (const name of ["first", "third"]) await page.getByRole("checkbox", { name: `Compare ${name}` }).check();
  assert.equal(await page.locator("#view-samples .compare h2").count(), 2);
  assert.equal(await page.locator("#view-samples .uplot").count(), 1);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("sliders give the moiré, and wishes a plan", async () => {
  const page = await open(server.url);
  await view(page, "Moiré and plan");
  const area = () => page.getByRole("row", { name: /^Area of the cell/ }).innerText();
  await page.getByRole("row", { name: /^Area of the cell/ }).waitFor();
  const before = await area();
  await page.getByRole("slider", { name: /^Twist/ }).focus();
  await page.keyboard.press("ArrowRight");
  await page.waitForFunction((text) => [...document.querySelectorAll("#view-moire tr")].some((r) => /** @type {HTMLElement} */ (r).innerText.startsWith("Area") && /** @type {HTMLElement} */ (r).innerText !== text), before);
  await page.getByRole("button", { name: "Plan", exact: true }).click();
  await page.getByRole("row", { name: /^recommended/ }).waitFor({ timeout: 60000 });
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("the result is taken away as zip, command and settings", async () => {
  const page = await open(server.url);
  await analyse(page, "plain");
  await view(page, "Take away");
  await page.getByText(/^moiregauge analyze/).waitFor();
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("link", { name: "Everything as zip" }).click()]);
  assert.match(download.suggestedFilename(), /\.zip$/);
  await page.getByRole("link", { name: "results.json" }).waitFor();
  assert.deepEqual(page.wrong, []);
  await page.leave();
});
