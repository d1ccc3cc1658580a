// Screenshots of every view, light and dark, 1440 and 800 wide, for the eye: $SCREENSHOTS says where they go.

import { mkdirSync } from "node:fs";
import { join } from "node:path";
import { after, afterEach, beforeEach, test } from "node:test";
import { analyse, campaign, closeBrowser, open, openFolder, rootWith, serve, simulated, view } from "./harness.mjs";

const folder = process.env.SCREENSHOTS;
/** @type {Awaited<ReturnType<typeof serve>>} */
let server;

beforeEach(async () => {
  if (!folder) return;
  mkdirSync(folder, { recursive: true });
  server = await serve([rootWith("plain", simulated("plain")), rootWith("wide", simulated("wide", ["--scans", "1", "--pixels", "512", "--size", "160", "160"])), campaign()]);
});
afterEach(() => server?.stop());
after(closeBrowser);

for (const width of [1440, 800]) {
  for (const theme of /** @type {("light" | "dark")[]} */ (["light", "dark"])) {
    test(`pictures ${width} ${theme}`, { skip: !folder }, async () => {
      const page = await open(server.url, { width, theme, height: width > 1000 ? 900 : 1100 });
      const shoot = async (/** @type {string} */ name) => {
        await page.waitForTimeout(700);
        await page.screenshot({ path: join(folder ?? "", `${name}-${width}-${theme}.png`), fullPage: false });
      };
      await openFolder(page, "root-wide");
      await openFolder(page, "plain");
      await page.getByRole("button", { name: /^scan\.001\.spm/ }).click();
      await page.waitForSelector("html[data-picture]");
      await page.getByRole("button", { name: "Line", exact: true }).click();
      await shoot("look");
      await analyse(page, "plain");
      await shoot("analyse");
      await page.locator("#view-analyse .plot").first().scrollIntoViewIfNeeded();
      await page.locator("#view-analyse .watch-plots").evaluate((e) => e.scrollIntoView());
      await shoot("analyse-plots");
      await view(page, "Correct");
      await page.waitForSelector("html[data-correct]");
      await page.getByRole("button", { name: "Add rectangle" }).click();
      await page.waitForTimeout(2500);
      await shoot("correct");
      await view(page, "Maps");
      await view(page, "Look");
      await page.getByRole("button", { name: "wide", exact: true }).click();
      await page.waitForTimeout(600);
      await page.getByRole("button", { name: /^scan\.000\.spm/ }).last().click();
      await view(page, "Maps");
      await page.getByLabel("Scan", { exact: true }).selectOption({ index: 5 });
      await page.getByRole("button", { name: "Make the map" }).click();
      await page.waitForSelector("html[data-map]", { timeout: 60000 }).catch(() => undefined);
      await page.getByRole("button", { name: "Add region" }).click({ timeout: 3000 }).catch(() => undefined);
      await page.getByRole("button", { name: "Add profile" }).click({ timeout: 3000 }).catch(() => undefined);
      await shoot("maps");
      await view(page, "Watch");
      await page.getByLabel("Folder", { exact: true }).selectOption({ label: "root-plain / plain" });
      await page.getByRole("button", { name: "Watch", exact: true }).click();
      await page.waitForTimeout(9000);
      await shoot("watch");
      await page.getByRole("button", { name: "Stop", exact: true }).click({ timeout: 3000 }).catch(() => undefined);
      await view(page, "Moiré and plan");
      await page.getByRole("button", { name: "Plan", exact: true }).click();
      await page.waitForTimeout(1500);
      await shoot("moire");
      await view(page, "Samples");
      await page.getByLabel("Folder of results").selectOption({ label: "campaign" });
      for (const name of ["first", "second"]) await page.getByRole("checkbox", { name: `Compare ${name}` }).check();
      await shoot("samples");
      await view(page, "Take away");
      await shoot("take");
      await page.leave();
    });
  }
}
