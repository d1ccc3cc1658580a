// Samples: the table of a campaign, sorted, two of them side by side; and what needs no files: moirés and plans.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { copyFileSync, existsSync, mkdirSync, mkdtempSync, readFileSync, symlinkSync } from "node:fs";
import { join, resolve } from "node:path";
import { after, afterEach, beforeEach, test } from "node:test";
import { analyse, api, campaign, closeBrowser, nextResult, open, PROGRAM, rootWith, serve, simulated, view, WORK } from "./harness.mjs";

/** Python checks the sums of an archive, tells its names as they stand in it, and takes it apart. */
const UNZIP = `
import json, sys, zipfile
with zipfile.ZipFile(sys.argv[1]) as archive:
    assert archive.testzip() is None
    print(json.dumps([[file.orig_filename, file.file_size, file.external_attr >> 28] for file in archive.infolist()]))
    archive.extractall(sys.argv[2])
`;

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

test("the zip holds what the program says, and its command gives the same result", async () => {
  const page = await open(server.url);
  await analyse(page, "plain");
  await view(page, "Correct");
  await nextResult(page, () => page.locator("#view-correct").getByRole("checkbox", { name: "Use scan.002.spm" }).uncheck());
  await view(page, "Take away");
  await page.getByRole("link", { name: "results.json" }).waitFor();
  const [download] = await Promise.all([page.waitForEvent("download"), page.getByRole("link", { name: "Everything as zip" }).click()]);
  const folder = mkdtempSync(join(WORK, "taken-"));
  const [zip, taken, again] = ["all.zip", "taken", "again"].map((name) => join(folder, name));
  await download.saveAs(zip);
  /** @type {[string, number, number][]} */
  const files = JSON.parse(execFileSync("python3", ["-c", UNZIP, zip, taken], { encoding: "utf8" }));
  const names = files.map(([name]) => name);
  assert.equal(new Set(names.map((name) => name.toLowerCase())).size, names.length, "no two of a name");
  for (const [name, bytes, kind] of files) {
    assert.match(name, /^[\w-][\w.-]*(\/[\w-][\w.-]*)*$/, "a plain name below the folder");
    assert.ok(bytes > 0, `${name} is empty`);
    assert.ok(kind !== 0o12, `${name} is a link`);
  }
  // What the page lists is in it, byte for byte.
  const { works } = await api(page, "state");
  const work = `works/${works.at(-1)}`;
  const listed = (await api(page, `${work}/outputs`)).map((/** @type {any} */ o) => o.name);
  assert.deepEqual([...names].sort(), [...listed].sort());
  for (const kind of [/^results\.json$/, /^report\.html$/, /^command\.txt$/, /^settings\.toml$/, /\.csv$/, /\.svg$/, /\.png$/]) assert.ok(names.some((name) => kind.test(name)), `${kind} of ${names}`);
  const bytes = async (/** @type {string} */ path) => Buffer.from(await page.evaluate(async (p) => [...new Uint8Array(await (await fetch(`/api/${p}`)).arrayBuffer())], path));
  const results = readFileSync(join(taken, "results.json"));
  assert.ok(results.equals(await bytes(`${work}/results.json`)));
  for (const name of names) assert.ok(readFileSync(join(taken, name)).equals(await bytes(`${work}/outputs/${name}`)), name);
  assert.equal(readFileSync(join(taken, "command.txt"), "utf8").trim(), (await api(page, `${work}/command`)).command);
  assert.equal(readFileSync(join(taken, "settings.toml"), "utf8"), (await api(page, `${work}/command`)).settings);
  assert.match(results.toString(), /the user excluded it/);
  // The command, with the settings beside it and nothing else, writes the same files.
  for (const path of [again, join(folder, "bin")]) mkdirSync(path);
  symlinkSync(resolve(PROGRAM), join(folder, "bin", "moiregauge"));
  copyFileSync(join(taken, "settings.toml"), join(again, "settings.toml"));
  execFileSync("sh", ["-c", readFileSync(join(taken, "command.txt"), "utf8")], { cwd: again, stdio: "pipe", env: { ...process.env, PATH: `${join(folder, "bin")}:${process.env.PATH}` } });
  for (const name of names.filter((n) => !["command.txt", "settings.toml"].includes(n))) {
    assert.ok(existsSync(join(again, "results", name)), name);
    assert.ok(readFileSync(join(again, "results", name)).equals(readFileSync(join(taken, name))), `${name} is another one`);
  }
  assert.deepEqual(page.wrong, []);
  await page.leave();
});
