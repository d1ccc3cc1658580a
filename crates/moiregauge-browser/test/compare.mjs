// The numbers of the file beside those of the program.

import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import { PROGRAM, WORK } from "./harness.mjs";

/** What the program writes. @param {string[]} files @param {string} name */
export function byProgram(files, name) {
  const out = join(WORK, `by-program-${name}`);
  execFileSync(PROGRAM, ["analyze", ...files, "--out", out, "--force", "--quiet", "--no-png"], { stdio: ["ignore", "ignore", "inherit"] });
  return JSON.parse(readFileSync(join(out, "results.json"), "utf8"));
}

/** Every uncertain value with its place in the document. @param {any} document @param {string} at @returns {[string, number, number][]} */
function uncertain(document, at = "") {
  if (document === null || typeof document !== "object") return [];
  const own = /** @type {[string, number, number][]} */ (typeof document.value === "number" && typeof document.sigma === "number" ? [[at, document.value, document.sigma]] : []);
  return [...own, ...Object.entries(document).flatMap(([key, inside]) => uncertain(inside, `${at}/${key}`))];
}

/** The same values, within 1e-9 of their errors. @param {any} here @param {any} there */
export function same(here, there) {
  const [mine, theirs] = [uncertain(here.sets), uncertain(there.sets)];
  assert.deepEqual(mine.map(([at]) => at), theirs.map(([at]) => at));
  assert.ok(mine.length > 10);
  const off = mine.map(([, value, sigma], i) => Math.max(Math.abs(value - theirs[i][1]), Math.abs(sigma - theirs[i][2])) / (theirs[i][2] || 1));
  const most = Math.max(...off);
  console.log(`${mine.length} values, the most different by ${most.toExponential(1)} of its error`);
  assert.ok(most < 1e-9, mine[off.indexOf(most)][0]);
}
