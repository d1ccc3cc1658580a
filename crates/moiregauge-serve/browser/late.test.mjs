// Answers that come late: the last question counts, whatever is answered last.

import assert from "node:assert/strict";
import { after, afterEach, beforeEach, test } from "node:test";
import { analyse, api, campaign, closeBrowser, open, openFolder, rootWith, serve, simulated, view } from "./harness.mjs";

/** @typedef {import("playwright-core").Page} Page */

/** @type {Awaited<ReturnType<typeof serve>>} */
let server;

beforeEach(async () => {
  server = await serve([rootWith("plain", simulated("plain")), campaign()]);
});
afterEach(() => server.stop());
after(closeBrowser);

/**
 * Holds the first answer to an address back until it is let go.
 * @param {Page} page
 * @param {RegExp} address
 * @param {any} [json] what is answered in the end, in place of the program's answer
 * @returns {Promise<{asked: Promise<void>, release: () => Promise<void>}>}
 */
async function held(page, address, json) {
  const [asked, free, there] = [later(), later(), later()];
  let first = true;
  await page.route(address, async (route) => {
    if (!first) return route.fallback();
    first = false;
    const answer = await route.fetch();
    asked.done();
    await free.wait;
    await route.fulfill({ response: answer, json });
    there.done();
  });
  const release = async () => {
    free.done();
    await there.wait;
    await page.waitForTimeout(300);
  };
  return { asked: asked.wait, release };
}

function later() {
  /** @type {() => void} */
  let done = () => undefined;
  /** @type {Promise<void>} */
  const wait = new Promise((resolve) => (done = () => resolve()));
  return { done, wait };
}

/** @param {Page} page @param {string} path @param {any} [body] */
function post(page, path, body = {}) {
  return page.evaluate(async ([p, b]) => (await fetch(`/api/${p}`, { method: "POST", headers: { "content-type": "application/json" }, body: b })).json(), [path, JSON.stringify(body)]);
}

test("a late answer about the work before does not replace a new one", async () => {
  const page = await open(server.url);
  await analyse(page, "plain");
  const [before] = (await api(page, "state")).works;
  // The page is loaded anew and asks for the work that it had.
  const late = await held(page, new RegExp(`/api/works/${before}$`));
  await page.reload();
  await late.asked;
  await view(page, "Look");
  await openFolder(page, "plain");
  for (const n of [0, 1, 2]) await page.getByRole("checkbox", { name: `Use scan.00${n}.spm`, exact: true }).check();
  await view(page, "Analyse");
  await page.getByRole("button", { name: /^Analyse/ }).click();
  await page.waitForTimeout(1500);
  await late.release();
  await page.waitForSelector("html[data-result]", { timeout: 60000 });
  await page.waitForTimeout(1000);
  const now = await page.evaluate(() => sessionStorage.getItem("work"));
  assert.notEqual(now, before);
  assert.equal((await api(page, `works/${now}`)).files.length, 3);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("a late answer to Cancel does not bring the run back", async () => {
  const page = await open(server.url);
  await analyse(page, "plain");
  const [work] = (await api(page, "state")).works;
  // The program is busy as the answer is written, and done long before it arrives.
  let first = true;
  await page.route(/\/cancel$/, async (route) => {
    if (!first) return route.fallback();
    first = false;
    const answer = await route.fetch();
    const running = { ...(await answer.json()), state: "running" };
    await page.waitForTimeout(800);
    await route.fulfill({ response: answer, json: running });
  });
  await page.locator("#view-analyse").getByRole("button", { name: "Cancel" }).evaluate((b) => b.removeAttribute("disabled"));
  await page.locator("#view-analyse").getByRole("button", { name: "Cancel" }).click();
  await page.waitForTimeout(1500);
  assert.notEqual((await api(page, `works/${work}`)).state, "running");
  assert.ok(await page.getByRole("button", { name: /^Analyse/ }).isEnabled(), "the page knows that nothing runs");
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("a file that fails late does not take the place of the one that is looked at", async () => {
  const page = await open(server.url);
  await openFolder(page, "plain");
  const failed = later();
  const button = (/** @type {number} */ n) => page.getByRole("button", { name: new RegExp(`^scan\\.00${n}\\.spm`) });
  await page.route(`**/api/inspect?file=${await button(0).getAttribute("data-file")}`, async (route) => {
    await page.waitForTimeout(1000);
    await route.fulfill({ status: 422, json: { error: "cut off" } });
    failed.done();
  });
  await button(0).click();
  await button(1).click();
  await page.waitForSelector("html[data-picture]");
  await failed.wait;
  await page.waitForTimeout(300);
  assert.equal(await page.locator("#view-look .viewer-message").innerText(), "");
  assert.ok((await page.locator("#view-look .thumbs button").count()) > 0);
  await page.leave();
});

test("the table of the folder that was chosen last is shown", async () => {
  const page = await open(server.url);
  await view(page, "Samples");
  const folder = page.getByLabel("Folder of results");
  const late = await held(page, /\/api\/samples\?/);
  await folder.selectOption({ label: "campaign" });
  await late.asked;
  await folder.selectOption({ label: "root-plain" });
  const words = () => page.locator("#view-samples .middle").innerText();
  await page.waitForFunction(() => !/** @type {HTMLElement} */ (document.querySelector("#view-samples .middle")).innerText.startsWith("Choose"));
  const before = await words();
  await late.release();
  assert.equal(await words(), before);
  assert.equal(await page.locator("#view-samples table").count(), 0);
  await page.leave();
});

test("the plan that was asked for last is shown", async () => {
  const page = await open(server.url);
  await view(page, "Moiré and plan");
  // The first answer would be shown as what it is.
  const late = await held(page, /\/api\/plan$/, { plans: [] });
  const plan = page.getByRole("button", { name: "Plan", exact: true });
  await plan.click();
  await late.asked;
  await plan.click();
  await page.getByRole("row", { name: /^recommended/ }).waitFor({ timeout: 60000 });
  await late.release();
  assert.equal(await page.getByRole("row", { name: /^recommended/ }).count(), 1);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});

test("the quantity that was chosen last is shown", async () => {
  const page = await open(server.url);
  await openFolder(page, "plain");
  await page.getByRole("button", { name: /^scan\.000\.spm/ }).click();
  await page.waitForSelector("html[data-picture]");
  await view(page, "Maps");
  await page.getByRole("button", { name: "Make the map" }).click();
  await page.waitForSelector("html[data-map]", { timeout: 60000 });
  const choice = page.getByLabel("Quantity");
  const names = await choice.locator("option").evaluateAll((all) => all.map((o) => /** @type {HTMLOptionElement} */ (o).value));
  const late = await held(page, new RegExp(`/quantity\\?name=${encodeURIComponent(names[1])}$`));
  await choice.selectOption(names[1]);
  await late.asked;
  await choice.selectOption(names[2]);
  const title = page.locator("#view-maps figcaption").first();
  await page.waitForFunction((name) => document.querySelector("#view-maps figcaption")?.textContent?.startsWith(name), names[2].replace(/_/g, " "));
  await late.release();
  assert.ok((await title.innerText()).startsWith(names[2].replace(/_/g, " ")), await title.innerText());
  assert.equal(await choice.inputValue(), names[2]);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});
