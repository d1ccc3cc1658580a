// For everybody: axe-core finds nothing serious, and the keyboard alone is enough.

import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { after, afterEach, beforeEach, test } from "node:test";
import { analyse, closeBrowser, open, openFolder, rootWith, serve, simulated, view } from "./harness.mjs";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
/** @type {Awaited<ReturnType<typeof serve>>} */
let server;

beforeEach(async () => {
  server = await serve([rootWith("plain", simulated("plain"))]);
});
afterEach(() => server.stop());
after(closeBrowser);

/** What axe-core calls serious or critical. @param {import("playwright-core").Page} page */
async function serious(page) {
  // The content policy lets the page run no script of somebody else; the debugger may.
  await page.evaluate(axe);
  const found = await page.evaluate(() => /** @type {any} */ (window).axe.run(document, { resultTypes: ["violations"] }));
  return found.violations.filter((/** @type {any} */ v) => ["serious", "critical"].includes(v.impact)).map((/** @type {any} */ v) => `${v.id}: ${v.nodes.map((/** @type {any} */ n) => n.html.slice(0, 160)).join(" | ")}`);
}

for (const theme of /** @type {("light" | "dark")[]} */ (["light", "dark"])) {
  test(`axe-core finds nothing serious, ${theme}`, async () => {
    const page = await open(server.url, { theme });
    await openFolder(page, "plain");
    await page.getByRole("button", { name: /^scan\.000\.spm/ }).click();
    await page.waitForSelector("html[data-picture]");
    await page.getByRole("button", { name: "Line", exact: true }).click();
    assert.deepEqual(await serious(page), [], "Look");
    await analyse(page, "plain");
    for (const name of ["Analyse", "Correct", "Maps", "Watch", "Moiré and plan", "Samples", "Take away"]) {
      await view(page, name);
      await page.waitForTimeout(600);
      assert.deepEqual(await serious(page), [], name);
    }
    await page.leave();
  });
}

test("from a file to a corrected result with the keyboard alone", async () => {
  const page = await open(server.url);
  const focused = () => page.evaluate(() => {
    const e = document.activeElement;
    return e ? e.getAttribute("aria-label") ?? e.textContent?.trim() ?? "" : "";
  });
  /** Tab until something has the focus. @param {RegExp} wanted */
  const tabTo = async (wanted) => {
    for (let n = 0; n < 120; n++) {
      await page.keyboard.press("Tab");
      const now = await focused();
      if (wanted.test(now)) {
        const seen = await page.evaluate(() => {
          const style = getComputedStyle(/** @type {Element} */ (document.activeElement));
          return style.outlineStyle !== "none" || style.boxShadow !== "none";
        });
        assert.ok(seen, `the focus on ${now} cannot be seen`);
        return;
      }
    }
    assert.fail(`Tab does not lead to ${wanted}`);
  };
  /** @param {string} name */
  const tab = async (name) => {
    await page.keyboard.press("Control+Home");
    await page.evaluate(() => /** @type {HTMLElement} */ (document.activeElement)?.blur());
    await tabTo(/^(Look|Analyse|Correct|Maps|Watch|Moiré and plan|Samples|Take away)$/);
    for (let n = 0; n < 8 && (await focused()) !== name; n++) await page.keyboard.press("ArrowRight");
    assert.equal(await focused(), name);
    await page.waitForFunction(() => (document.querySelector("[role=tabpanel]:not([hidden])")?.childElementCount ?? 0) > 0);
  };
  await tabTo(/^plain$/);
  await page.keyboard.press("Enter");
  await tabTo(/^scan\.000\.spm/);
  await page.keyboard.press("Enter");
  await page.waitForSelector("html[data-picture]");
  await tab("Look");
  await tabTo(/^Use all scans of plain/);
  await page.keyboard.press("Space");
  await page.getByText("4 scans chosen").first().waitFor();
  await tab("Analyse");
  await tabTo(/^Analyse$/);
  await page.keyboard.press("Enter");
  await page.waitForSelector("html[data-result]", { timeout: 60000 });
  await tab("Correct");
  await page.waitForSelector("html[data-correct]");
  await tabTo(/^Lattice vector 1/);
  await page.keyboard.press("ArrowUp");
  await page.waitForFunction(() => document.documentElement.dataset.result === "2", undefined, { timeout: 60000 });
  await page.getByText("Lattice about").waitFor();
  // A handle that was moved keeps the focus when the result comes.
  await page.waitForTimeout(500);
  assert.match(await focused(), /^Lattice vector 1/);
  assert.deepEqual(page.wrong, []);
  await page.leave();
});
