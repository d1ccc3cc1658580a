// Pages of others: they can neither read nor write.

import assert from "node:assert/strict";
import { createServer } from "node:http";
import { after, afterEach, beforeEach, test } from "node:test";
import { api, closeBrowser, open, rootWith, serve, simulated } from "./harness.mjs";

/** @type {Awaited<ReturnType<typeof serve>>} */
let server;

beforeEach(async () => {
  server = await serve([rootWith("plain", simulated("plain"))]);
});
afterEach(() => server.stop());
after(closeBrowser);

test("a page of another origin that posts changes nothing, though the browser has the cookie", async () => {
  const page = await open(server.url);
  const foreign = createServer((_, answer) => answer.writeHead(200, { "content-type": "text/html" }).end("<!doctype html><title>other</title>"));
  await new Promise((done) => foreign.listen(0, "127.0.0.1", () => done(undefined)));
  const { port } = /** @type {import("node:net").AddressInfo} */ (foreign.address());
  const other = await page.context().newPage();
  for (const host of ["localhost", "127.0.0.1"]) {
    await other.goto(`http://${host}:${port}/`);
    const tried = await other.evaluate(async (origin) => {
      const said = [];
      for (const [path, init] of /** @type {[string, RequestInit][]} */ ([
        ["/api/state", { credentials: "include" }],
        ["/api/works", { method: "POST", credentials: "include", headers: { "content-type": "text/plain" }, body: '{"files":[],"settings":{}}' }],
        ["/api/upload?drop=d&name=x.spm", { method: "POST", credentials: "include", mode: "no-cors", body: "x" }],
      ])) {
        try {
          const answer = await fetch(origin + path, init);
          said.push(answer.type === "opaque" ? "opaque" : `${answer.status} ${await answer.text()}`);
        } catch {
          said.push("refused");
        }
      }
      return said;
    }, server.origin);
    assert.ok(tried.every((t) => t === "refused" || t === "opaque"), `${tried}`);
  }
  const state = await api(page, "state");
  assert.deepEqual(state.works, []);
  assert.deepEqual((await api(page, "folder?root=dropped&under=")).files, []);
  assert.deepEqual((await api(page, "folder?root=dropped&under=")).folders, []);
  await page.leave();
  await new Promise((done) => foreign.close(done));
});

test("without the token there is a sentence that says what to do", async () => {
  const context = await (await import("./harness.mjs")).theBrowser().then((b) => b.newContext());
  const page = await context.newPage();
  await page.goto(server.origin);
  await page.getByRole("alert").getByText("not signed in").waitFor();
  await context.close();
});

test("nothing of the address with the token is left in history or referrer", async () => {
  const page = await open(server.url);
  assert.equal(await page.evaluate(() => location.href.includes("token")), false);
  assert.equal(await page.evaluate(() => performance.getEntriesByType("resource").some((r) => r.name.includes("c0ffee"))), false);
  await page.leave();
});
