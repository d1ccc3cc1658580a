"""Sets of real samples through the program, and the table of docs/samples.md: see docs/samples.sh. Plain Python 3."""

import collections
import concurrent.futures
import hashlib
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

# One of each class, and images without any lattice.
SAMPLES = [
    "clean", "edge", "fade", "hole", "hole:count=8", "bump", "island", "grains", "twist-wave", "strain-wave", "twist-gradient",
    "strain-gradient", "walls", "second-shell", "atoms", "step", "terrain", "stripes", "hum", "scars", "glitches", "lag",
    "bare", "bare+terrain", "bare+ripples", "bare+stripes", "bare+hum+scars",
]
# An answer is right within so many total σ and this share, wrong beyond so many.
RIGHT_SIGMAS, RIGHT_SHARE, WRONG_SIGMAS = 3.0, 0.005, 5.0


def number(name, otherwise):
    return int(os.environ.get(name, otherwise))


def means(results):
    """All twists that the results give as answers: of all sets together, else of each."""
    together = results.get("combined")
    if together and together.get("twist_deg"):
        return [together["twist_deg"]]
    each = [one.get("mean") for one in results.get("sets", [])]
    return [mean["twist_deg"] for mean in each if mean]


def documents(folder):
    """The results of a run: one document, or one for each lattice in folders of their own."""
    return [json.loads(path.read_text()) for path in sorted(folder.glob("**/results.json"))]


def one_set(program, sample, seed, work):
    """Simulates and analyses a set; what came of it, from the store if it is there."""
    pixels, scans = number("PIXELS", 192), number("SCANS", 4)
    name = f"{sample}-{pixels}-{scans}-{seed}".translate(str.maketrans(":=,+", "____"))
    kept = work / "done" / f"{name}.json"
    if kept.exists():
        return json.loads(kept.read_text())
    made, out = work / "sets" / name, work / "out" / name
    simulate = [program, "simulate", "--out", str(work / "sets"), "--name", name, "--force", "--vary", "--seed", str(seed),
                "--sample", sample, "--pixels", str(pixels), "--scans", str(scans)]
    subprocess.run(simulate, check=True, capture_output=True)
    shutil.rmtree(out, ignore_errors=True)
    analyze = [program, "analyze", str(made), "--out", str(out), "--no-png", "--threads", "1", "--quiet"]
    ran = subprocess.run(analyze, capture_output=True, text=True)
    found = compared(json.loads((made / "truth.json").read_text()), documents(out), ran)
    if not (os.environ.get("KEEP") and found["wrong"]):
        shutil.rmtree(made, ignore_errors=True)
        shutil.rmtree(out, ignore_errors=True)
    kept.parent.mkdir(parents=True, exist_ok=True)
    part = kept.with_suffix(".part")
    part.write_text(json.dumps(found))
    part.rename(kept)
    return found


def true_twists(truth):
    """Those that an answer may be: of each grain the mean over its area; none without moiré."""
    sample = truth.get("sample")
    if not sample:
        return [truth["twist_deg"]]
    return [grain["mean"]["twist_deg"] for grain in sample["grains"] if grain["mean"]]


def compared(truth, found, ran):
    answers, codes = [], set()
    for results in found:
        codes |= {caveat["code"] for caveat in results.get("caveats", [])}
        answers += means(results)
    right_ones = true_twists(truth)
    judged = []
    for twist in answers:
        nearest = min(right_ones, key=lambda t: abs(t - twist["value"]), default=None)
        error = None if nearest is None else twist["value"] - nearest
        judged.append({"error": error, "truth": nearest, "sigma": twist["sigma"], "total": twist["sigma_total"]})
    beyond = lambda one, sigma: one["error"] is None or abs(one["error"]) > WRONG_SIGMAS * (one[sigma] or math.inf)
    is_right = lambda one: one["error"] is not None and abs(one["error"]) <= min(
        RIGHT_SIGMAS * (one["total"] or math.inf), RIGHT_SHARE * abs(one["truth"]))
    return {
        "answers": judged,
        "right": bool(judged) and all(is_right(one) for one in judged),
        "wrong": any(beyond(one, "total") for one in judged),
        "wrong_by_statistics": any(beyond(one, "sigma") for one in judged),
        "caveats": sorted(codes),
        "exit": ran.returncode,
        "said": ran.stderr.strip().splitlines()[-1:],
    }


def row(sample, sets):
    answered = [one for one in sets if one["answers"]]
    errors = [a for one in answered for a in one["answers"] if a["error"] is not None]
    pulls = [a["error"] / a["sigma"] for a in errors if a["sigma"]]
    rms = math.sqrt(sum(p * p for p in pulls) / len(pulls)) if pulls else None
    sizes = sorted(abs(a["error"]) for a in errors)
    median = sizes[len(sizes) // 2] if sizes else None
    codes = collections.Counter(code for one in answered for code in one["caveats"])
    shown = ", ".join(f"{code} {count}" for code, count in codes.most_common(4)) or "–"
    plain = sum(not one["caveats"] for one in answered)
    as_text = lambda value, digits: "–" if value is None else f"{value:.{digits}f}"
    count = lambda key: sum(one[key] for one in answered)
    cells = [f"`{sample}`", len(sets), len(answered), count("right"), len(sets) - len(answered), count("wrong"),
             count("wrong_by_statistics"), as_text(rms, 2), as_text(median, 5), plain, shown]
    return "| " + " | ".join(str(cell) for cell in cells) + " |"


HEAD = """# Real samples

Simulated sets of {scans} frames of {pixels} × {pixels} pixels of each class, as many as the table says (`moiregauge simulate --list-samples` says what
they are), every set with a twist of 1.0 to 1.6°, strain, orientation, drift, noise and numbers of its own (`--vary --seed`),
each analysed by `moiregauge analyze FOLDER` and compared with its truth. `docs/samples.sh` makes this page.

*right*: within 3 total σ and 0.5 %; *beyond 5 σ*: of the total and of the statistical uncertainty. Where the lattice changes
across the frame the truth is the mean over the part with moiré, of grains that of the nearest one. Without moiré (`bare`)
every answer is wrong. *rms pull* is of the statistical σ; true errors give 1. The last columns say how many answers came without
any caveat, and which caveats came how often.

| class | sets | answered | right | refused | beyond 5 σ (total) | beyond 5 σ (stat.) | rms pull | median error (°) | no caveat | caveats |
| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |"""


def main(program, sets=20, *samples):
    program = str(pathlib.Path(program).resolve())
    digest = hashlib.sha256(pathlib.Path(program).read_bytes()).hexdigest()[:16]
    store = os.environ.get("WORK", os.path.join(tempfile.gettempdir(), "moiregauge-samples"))
    work = pathlib.Path(store) / digest
    samples, sets, first = list(samples) or SAMPLES, int(sets), number("FIRST", 1)
    print(HEAD.format(scans=number("SCANS", 4), pixels=number("PIXELS", 192)))
    with concurrent.futures.ThreadPoolExecutor(number("JOBS", os.cpu_count() or 1)) as pool:
        for sample in samples:
            seeds = range(first, first + sets)
            done = list(pool.map(lambda seed: one_set(program, sample, seed, work), seeds))
            print(row(sample, done), flush=True)
            wrong = [str(seed) for seed, one in zip(seeds, done) if one["wrong"]]
            if wrong:
                print(f"{sample}: wrong with the seeds {' '.join(wrong)}", file=sys.stderr)


if __name__ == "__main__":
    main(*sys.argv[1:])
