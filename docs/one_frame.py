"""Single frames that drift, by a generator of its own: how often the total of a twist holds where nothing tells the drift.

    docs/one_frame.py PROGRAM FIRST LAST [KIND…]      (seeds FIRST to LAST; a Markdown table)

Each frame is one image of twisted graphene with a heterostrain, in NumPy. Its drift is drawn from a normal distribution of 1 nm/min along each axis, which is what the
program assumes; its rate from 0.5 to 10 Hz with all octaves alike. Kinds: `told` (rate and direction are given), `no-direction`, `no-rate`. Calibration
and model are exact, and their errors set to zero: what is left of the total is noise and drift.
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy

A = 0.246
POISSON = 0.16
PIXELS = 128
KINDS = ("told", "no-direction", "no-rate")
EXACT = ["--calibration-gain", "0", "--calibration-mismatch", "0", "--calibration-orthogonality", "0", "--isotropic-strain", "0",
         "--lattice-constant-sigma", "0", "--poisson-ratio-sigma", "0", "--material", "graphene", "--drift-draws", "0", "--strain-draws", "0", "--no-report"]


def turn(angle):
    return numpy.array([[numpy.cos(angle), -numpy.sin(angle)], [numpy.sin(angle), numpy.cos(angle)]])


def waves(twist, strain, axis, orientation):
    """Wave vectors of the moiré, rad/nm: M = R(α) [R(θ) S⁻¹ − I] G⁰, in the axes of layer 1."""
    first = 4 * numpy.pi / (numpy.sqrt(3) * A) * numpy.array([[1, -0.5], [0, numpy.sqrt(3) / 2]])
    stretch = turn(axis) @ numpy.diag([1 + strain, 1 - POISSON * strain]) @ turn(-axis)
    return turn(orientation) @ (turn(twist) @ numpy.linalg.inv(stretch) - numpy.eye(2)) @ first


def frame(seed):
    random = numpy.random.default_rng([seed, 41])
    truth = {"twist": random.uniform(0.8, 3.0), "strain": random.uniform(0, 0.003)}
    vectors = waves(numpy.radians(truth["twist"]), truth["strain"], *random.uniform(0, numpy.pi, 2))
    period = 2 * numpy.pi / numpy.linalg.norm(vectors[:, 0])
    truth["size"] = round(period * random.uniform(6, 12), 3)
    truth["rate"] = round(0.5 * 20 ** random.uniform(), 4)
    truth["up"] = bool(random.integers(2))
    drift = random.normal(size=2) / 60
    truth["drift"] = (60 * drift).tolist()
    step = truth["size"] / PIXELS
    columns, rows = numpy.meshgrid(numpy.arange(PIXELS), numpy.arange(PIXELS))
    line = rows if truth["up"] else PIXELS - 1 - rows
    time = (line + columns / (2 * PIXELS)) / truth["rate"]
    x, y = columns * step - drift[0] * time, rows * step - drift[1] * time
    image = random.normal(size=x.shape) * 0.5
    for wave in (vectors[:, 0], vectors[:, 1], vectors[:, 0] + vectors[:, 1]):
        image += numpy.cos(wave[0] * x + wave[1] * y + random.uniform(0, 2 * numpy.pi))
    # The first row of an array is the top line.
    return image[::-1], truth


def run(program, seed, kind):
    image, truth = frame(seed)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frame.npy"
        numpy.save(path, image)
        told = ["--size", f"{truth['size']}nm"]
        if kind != "no-rate":
            told += ["--line-rate", str(truth["rate"])]
        if kind == "told":
            told += ["--frame-direction", "up" if truth["up"] else "down"]
        out = Path(folder) / "out"
        subprocess.run([program, "analyze", str(path), "--out", str(out), *told, *EXACT], check=False, capture_output=True)
        try:
            mean = json.loads((out / "results.json").read_text())["sets"][0]["mean"]
        except (OSError, IndexError):
            mean = None
    if mean is None or mean["twist_deg"]["sigma_total"] is None:
        return None
    found = mean["twist_deg"]
    return (found["value"] - truth["twist"]) / found["sigma_total"], found["sigma_total"] / truth["twist"]


def main():
    program, first, last, *kinds = sys.argv[1:]
    seeds = range(int(first), int(last) + 1)
    print("| kind | frames | with a total | rms of error over total | beyond 2 totals | median total (% of the twist) |\n| --- | --- | --- | --- | --- | --- |")
    for kind in kinds or KINDS:
        found = [one for one in (run(program, seed, kind) for seed in seeds) if one]
        pulls, totals = numpy.array(found).T
        rms, beyond = numpy.sqrt(numpy.mean(pulls**2)), numpy.sum(abs(pulls) > 2)
        print(f"| {kind} | {len(seeds)} | {len(found)} | {rms:.2f} | {beyond} | {100 * numpy.median(totals):.2f} |")


if __name__ == "__main__":
    main()
