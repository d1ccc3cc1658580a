// Analyse: run, numbers, cancel, two tabs, a server that was away.

import assert from "node:assert/strict";
import { after, afterEach, beforeEach, test } from "node:test";
import { analyse, api, closeBrowser, freePort, nextResult, open, openFolder, rootWith, serve, simulated, view } from "./harness.mjs";

/** @type {Awaited<ReturnType<typeof serve>>} */
let server;

beforeEach(async () => {
  server = await serve([rootWith("plain", simulated("plain")), rootWith("many", simulated("many", ["--scans", "12", "--pixels", "512"]))]);
});
afterEach(() => server.stop());
after(closeBrowser);

/** As the page rounds. @param {number} value @param {number} sigma */
function rounded(value, sigma) {
  const digits = Math.max(0, 1 - Math.floor(Math.log10(Number(sigma.toPrecision(2)))));
  return `${value.toFixed(digits)} ± ${sigma.toFixed(digits)}`.replace("-", "\u2212");
}

/** @param {import("playwright-core").Page} page */
async function headline(page) {
  return (await page.locator("#view-analyse .headline").innerText()).replace(/\u202f/g, " ");
}

test("scans are analysed, and the page shows the numbers of results.json", async () => {
  const page = await open(server.url);
  await analyse(page, "plain");
  const { works } = await api(page, "state");
  const results = await api(page, `works/${works.at(-1)}/results.json`);
  const mean = results.sets[0].mean;
  const shown = await headline(page);
  assert.ok(shown.includes(rounded(mean.twist_deg.value, mean.twist_deg.sigma_total)), shown);
  assert.ok(shown.includes(rounded(mean.heterostrain_percent.value, mean.heterostrain_percent.sigma_total)), shown);
  await page.waitForFunction(() => document.querySelectorAll("#view-analyse .overlay .dots circle").length > 20);
  assert.equal(await page.locator("#view-analyse .panel .viewer-message:not(:empty)").count(), 0);
  assert.ok(await page.locator("#view-analyse .uplot").count() >= 4);
  const tables = page.locator("#view-analyse .figure-table summary");
  assert.equal(await tables.count(), await page.locator("#view-analyse figure.plot").count());
  // A point, or its row in the table, leads to its scan.
  await tables.first().click();
  await page.locator("#view-analyse .figure-table tbody button").nth(2).click();
  await page.getByRole("heading", { name: "scan.002.spm" }).waitFor();
  const plot = await page.locator("#view-analyse .u-over").first().boundingBox();
  assert.ok(plot);
  await page.mouse.click(plot.x + 0.98 * plot.width, plot.y + plot.height / 2);
  await page.getByRole("heading", { name: "scan.003.spm" }).waitFor();
  for (const name of [/^Residual, data/, /^Mean moiré cell/]) assert.equal(await page.locator("#view-analyse .panel figcaption").filter({ hasText: name }).count(), 1);
  await page.getByText("Show all figures").click();
  await page.waitForFunction(() => [...document.querySelectorAll(".figures img")].some((i) => /** @type {HTMLImageElement} */ (i).naturalWidth > 0));
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("a run is cancelled, and goes on when it is asked again", async () => {
  const page = await open(server.url);
  await view(page, "Look");
  await openFolder(page, "root-many");
  await page.getByRole("checkbox", { name: "Use all scans of many", exact: true }).check();
  await view(page, "Analyse");
  await page.getByRole("button", { name: /^Analyse/ }).click();
  const cancel = page.getByRole("button", { name: "Cancel" });
  await cancel.click();
  await page.getByText("Cancelled.").waitFor();
  await nextResult(page, () => page.getByRole("button", { name: "Analyse again" }).click());
  assert.match(await headline(page), /Twist/);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("settings change the result, and a scan is left out", async () => {
  const page = await open(server.url);
  await analyse(page, "plain");
  const before = await headline(page);
  await page.getByLabel("Upper layer").selectOption("MoS2");
  await nextResult(page, () => page.getByRole("button", { name: "Analyse again" }).click());
  const after = await headline(page);
  assert.notEqual(after, before);
  await nextResult(page, () => page.getByRole("checkbox", { name: "Use scan.003.spm" }).uncheck());
  await page.getByText("left out").first().waitFor();
  const { works } = await api(page, "state");
  const scans = (await api(page, `works/${works.at(-1)}/results.json`)).sets[0].scans;
  assert.equal(scans.filter((/** @type {any} */ s) => s.excluded).length, 1);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("a second tab shows the same work without the token", async () => {
  const page = await open(server.url);
  await analyse(page, "plain");
  const second = await open(`${server.origin}/`, { context: page.context() });
  await view(second, "Analyse");
  await second.waitForSelector("html[data-result]");
  assert.equal(await headline(second), await headline(page));
  assert.deepEqual(second.wrong, []);
  await second.leave();
  await page.leave();
});

test("the page takes up again after the server was away", async () => {
  const port = await freePort();
  const root = rootWith("plain", simulated("plain"));
  let own = await serve([root], { port });
  const page = await open(own.url);
  await own.stop();
  await page.getByText("The program does not answer").waitFor();
  own = await serve([root], { port });
  await page.waitForFunction(() => document.getElementById("connection")?.textContent === "", undefined, { timeout: 20000 });
  await analyse(page, "plain");
  assert.match(await headline(page), /Twist/);
  await page.leave();
  await own.stop();
});
