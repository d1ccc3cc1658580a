"""Images of moirés, and of none, that the program did not make: see docs/independent.sh. Python 3 with NumPy.

Lengths in nm, angles counter-clockwise, x right, y up, row 0 the lowest line. Layer 2 is layer 1 stretched and then turned: its
deformation is F = R(twist) S, reciprocal vectors follow F^-T, and the moiré has the differences of those of both layers.
"""

import concurrent.futures
import json
import math
import os
import pathlib
import subprocess
import sys
import tempfile

import numpy

LATTICE_CONSTANT, POISSON_RATIO = 0.246, 0.16
FRAMES, COLUMNS, ROWS = 3, 208, 184
# An answer is right within so many standard deviations (statistical: the arrays have exact sizes) and this share.
SIGMAS, SHARE = 5.0, 0.005


def turn(angle):
    return numpy.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def moire(twist, strain, axis, orientation):
    """Two reciprocal vectors of the moiré, a row each."""
    across = turn(axis) @ numpy.diag([1 + strain, 1 - POISSON_RATIO * strain]) @ turn(axis).T
    length = 4 * math.pi / (math.sqrt(3) * LATTICE_CONSTANT)
    layer = length * numpy.array([[math.cos(orientation + a), math.sin(orientation + a)] for a in (0, math.pi / 3)])
    deformed = numpy.linalg.inv(turn(twist) @ across).T
    return layer @ deformed.T - layer


def cosines(phases):
    return sum(numpy.cos(phase) for phase in phases)


class Scene:
    """One sample: its numbers come from a seed, its frames differ in noise alone."""

    def __init__(self, name, seed):
        self.random = numpy.random.default_rng([seed, *name.encode()])
        self.name, self.draw = name, self.random.uniform
        self.twist = math.radians(self.draw(1.0, 1.6))
        self.strain, self.axis = self.draw(0.0, 0.003), self.draw(0, math.pi)
        self.orientation = self.draw(0, math.pi)
        self.vectors = moire(self.twist, self.strain, self.axis, self.orientation)
        self.periods = self.draw(7, 11)
        self.side = self.periods * LATTICE_CONSTANT / self.twist
        pitch = self.side / COLUMNS
        self.size = (COLUMNS * pitch, ROWS * pitch)
        self.x, self.y = numpy.meshgrid((numpy.arange(COLUMNS) + 0.5) * pitch, (numpy.arange(ROWS) + 0.5) * pitch)
        # From -1 to 1.
        self.u, self.v = 2 * self.x / self.size[0] - 1, 2 * self.y / self.size[1] - 1
        self.start = self.draw(0, 2 * math.pi, 2)
        self.truths = [math.degrees(self.twist)]
        # A first shell of 3 % is not seen in more noise.
        self.noise = self.draw(0.15, 0.5) if name == "second-shell" else self.draw(0.3, 1.0)
        self.lines = self.draw(0.0, 0.5)
        self.ideal = getattr(self, name.replace("-", "_"))()

    def phases(self, vectors=None):
        """Of the three first waves."""
        first = self.vectors if vectors is None else vectors
        a, b = (g[0] * self.x + g[1] * self.y + start for g, start in zip(first, self.start))
        return [a, b, b - a]

    def frame(self):
        random = self.random
        return self.ideal + self.noise * random.normal(size=self.x.shape) + self.lines * random.normal(size=(ROWS, 1))

    def smooth_noise(self, low, high, exponent=0.0):
        """Isotropic noise of variance 1 of so many periods across the frame, its power a power of the frequency."""
        k = numpy.hypot(numpy.fft.fftfreq(ROWS, 1 / ROWS)[:, None], numpy.fft.fftfreq(COLUMNS, 1 / COLUMNS)[None, :])
        keep = (k >= low) & (k <= high)
        amplitude = numpy.where(keep, numpy.maximum(k, 1) ** (-exponent / 2), 0)
        made = numpy.fft.ifft2(amplitude * numpy.fft.fft2(self.random.normal(size=k.shape))).real
        return made / made.std()

    def disc(self, radius, u, v):
        return (self.u - u) ** 2 + (self.v - v) ** 2 < radius ** 2

    def bump_at(self, u, v, width):
        return numpy.exp(-((self.u - u) ** 2 + (self.v - v) ** 2) / (2 * width ** 2))

    # With a moiré.

    def full(self):
        return cosines(self.phases())

    def half(self):
        """Covered on one side of a straight edge."""
        angle, off = self.draw(0, 2 * math.pi), self.draw(-0.1, 0.3)
        return numpy.where(self.u * math.cos(angle) + self.v * math.sin(angle) < off, cosines(self.phases()), self.draw(-2, 2))

    def holes(self):
        image = cosines(self.phases())
        for _ in range(3):
            image[self.disc(self.draw(0.2, 0.35), *self.draw(-1, 1, 2))] = -2.0
        return image

    def bumps(self):
        """Anywhere, at sides and in corners as well."""
        return cosines(self.phases()) + self.draw(3, 8) * self.bump_at(*self.draw(-1, 1, 2), self.draw(0.15, 0.3))

    def step(self):
        angle, off = self.draw(0, 2 * math.pi), self.draw(-0.5, 0.5)
        return cosines(self.phases()) + self.draw(3, 8) * (self.u * math.cos(angle) + self.v * math.sin(angle) > off)

    def walls(self):
        return numpy.tanh(self.draw(2, 6) * (cosines(self.phases()) + self.draw(-0.3, 0.6)))

    def second_shell(self):
        a, b, c = self.phases()
        return 0.03 * cosines([a, b, c]) + cosines([a + b, b + c, a - c])

    def stripes(self):
        angle, period = self.draw(0, math.pi), self.draw(0.5, 1.6) * self.side / self.periods
        wave = 2 * math.pi / period * (math.cos(angle) * self.x + math.sin(angle) * self.y)
        return cosines(self.phases()) + self.draw(0.5, 2.5) * numpy.cos(wave)

    def terrain(self):
        return cosines(self.phases()) + self.draw(1, 4) * self.smooth_noise(1, 60, self.draw(2.5, 4))

    def grains(self):
        """Two of them, with twists and orientations of their own."""
        other = self.twist * self.draw(1.02, 1.08)
        angle, off = self.draw(0, 2 * math.pi), self.draw(-0.15, 0.15)
        vectors = moire(other, self.strain, self.axis, self.orientation + math.radians(self.draw(2, 6)))
        self.truths.append(math.degrees(other))
        here, there = cosines(self.phases()), cosines(self.phases(vectors))
        return numpy.where(self.u * math.cos(angle) + self.v * math.sin(angle) < off, here, there)

    def twist_wave(self):
        """Turned from place to place by half the curl of a wave of displacement; the mean over the frame is that of the phases' slopes."""
        angle, depth = self.draw(0, math.pi), self.draw(0.005, 0.02)
        k = 2 * math.pi / (self.draw(1.0, 2.0) * self.side)
        along = k * (math.cos(angle) * self.x + math.sin(angle) * self.y) + self.draw(0, 2 * math.pi)
        # Displacement of the pattern across the direction in which it changes: a turn by depth at most.
        moved = 2 * depth / k * numpy.sin(along)
        u, v = -math.sin(angle) * moved, math.cos(angle) * moved
        a, b = (g[0] * (self.x - u) + g[1] * (self.y - v) + s for g, s in zip(self.vectors, self.start))
        mean = numpy.array([[slope.mean() for slope in self.slopes(phase)] for phase in (a, b)])
        self.truths = [twist_of(mean, self.orientation)]
        return cosines([a, b, b - a])

    def slopes(self, phase):
        along, up = numpy.gradient(phase, self.y[:, 0], self.x[0])[::-1]
        return along, up

    # Without.

    def white(self):
        self.truths = []
        return 0 * self.x

    def hum(self):
        self.truths = []
        time = self.x / self.size[0] + numpy.arange(ROWS)[:, None] * self.draw(1.9, 2.1)
        return sum(self.draw(0.3, 2) * numpy.cos(2 * math.pi * (f * time + self.draw())) for f in self.draw(3, 40, 3))

    def scars(self):
        self.truths = []
        image = 0.3 * self.smooth_noise(1, 40, 2.0)
        for _ in range(30):
            row, first = self.random.integers(ROWS), self.random.integers(COLUMNS)
            image[row, first:first + self.random.integers(5, COLUMNS)] += self.draw(-5, 5)
        return image

    def rough(self):
        self.truths = []
        return self.draw(1, 5) * self.smooth_noise(1, 80, self.draw(1.5, 4))

    def ripples(self):
        """Of about one length in all directions."""
        self.truths = []
        middle, width = self.draw(6, 20), self.draw(0.05, 0.3)
        return 2 * self.smooth_noise(middle * (1 - width), middle * (1 + width))

    def only_stripes(self):
        self.truths = []
        angle, k = self.draw(0, math.pi), self.draw(5, 20) * 2 * math.pi / self.side
        wave = k * (math.cos(angle) * self.x + math.sin(angle) * self.y)
        return 2 * numpy.tanh(self.draw(0.5, 4) * numpy.cos(wave))

    def cells(self):
        """Walls between random places."""
        self.truths = []
        places = self.draw(-1.1, 1.1, (self.random.integers(20, 120), 2))
        distances = numpy.sort([(self.u - u) ** 2 + (self.v - v) ** 2 for u, v in places], axis=0)
        return 2 * numpy.tanh(20 * (numpy.sqrt(distances[1]) - numpy.sqrt(distances[0])))

    def lumps(self):
        self.truths = []
        width = self.draw(0.05, 0.12)
        return sum(self.draw(0.5, 3) * self.bump_at(*self.draw(-1, 1, 2), width) for _ in range(self.random.integers(20, 80)))

    def bare_step(self):
        self.truths = []
        angle = self.draw(0, 2 * math.pi)
        return self.draw(3, 8) * (self.u * math.cos(angle) + self.v * math.sin(angle) > self.draw(-0.5, 0.5))


WITH = ["full", "half", "holes", "bumps", "step", "walls", "second-shell", "stripes", "terrain", "grains", "twist-wave"]
WITHOUT = ["white", "hum", "scars", "rough", "ripples", "only-stripes", "cells", "lumps", "bare-step"]


def twist_of(vectors, orientation):
    """The twist of a moiré over a layer of known orientation, in degrees: the turn in the polar decomposition of F."""
    length = 4 * math.pi / (math.sqrt(3) * LATTICE_CONSTANT)
    layer = length * numpy.array([[math.cos(orientation + a), math.sin(orientation + a)] for a in (0, math.pi / 3)])
    deformed = numpy.linalg.solve(layer, layer + vectors).T
    left, _, right = numpy.linalg.svd(numpy.linalg.inv(deformed).T)
    turned = left @ right
    return math.degrees(math.atan2(turned[1, 0], turned[0, 0]))


def one_set(program, name, seed, folder):
    scene = Scene(name, seed)
    made = folder / f"{name}-{seed}"
    made.mkdir(parents=True, exist_ok=True)
    frames = [made / f"frame{i}.npy" for i in range(FRAMES)]
    for frame in frames:
        numpy.save(frame, scene.frame())
    size = "{:.6f}nm×{:.6f}nm".format(*scene.size)
    out = made / "results"
    ran = subprocess.run([program, "analyze", *map(str, frames), "--size", size, "--drift", "0", "0", "--drift-sigma", "0", "--line-rate", "4",
                          "--frame-direction", "up", "--out", str(out),
                          "--no-png", "--force", "--threads", "1", "--quiet"], capture_output=True, text=True)
    answers = []
    for path in sorted(out.glob("**/results.json")):
        results = json.loads(path.read_text())
        together = (results.get("combined") or {}).get("twist_deg")
        means = [together] if together else [s["mean"]["twist_deg"] for s in results["sets"] if s.get("mean")]
        answers += means
    judged = []
    for twist in answers:
        error = min((twist["value"] - truth for truth in scene.truths), key=abs, default=math.inf)
        nearest = twist["value"] - error if scene.truths else math.inf
        judged.append((error, twist["sigma"], abs(error) <= SIGMAS * twist["sigma"] and abs(error) <= SHARE * nearest))
    return seed, judged, ran.stderr.strip().splitlines()[-1:]


HEAD = """# Images of another generator

`docs/independent.py` makes images with physics of its own, in NumPy: sets of {frames} frames of {columns} × {rows} pixels with a twist of 1.0 to
1.6°, up to 0.3 % of strain, 7 to 11 periods across, white noise of 0.3 to 1.0 of the amplitude of a wave (0.15 to 0.5 where the first shell has 3 % of the
second), and offsets of lines. They are arrays: no sensors, no drift, and their size is exact, so that the statistical error is all there is.
Each is analysed by `moiregauge analyze FRAMES --size … --drift 0 0`; `docs/independent.sh` makes this page.

*right*: within {sigmas:.0f} statistical σ and {share} %. The classes from white on have no moiré: every answer is wrong.

| class | sets | answered | right | refused | wrong | rms pull | median error (°) |
| --- | --- | --- | --- | --- | --- | --- | --- |"""


def main(program, sets=20, *names):
    program = str(pathlib.Path(program).resolve())
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(os.environ.get("KEEP", scratch))
        print(HEAD.format(frames=FRAMES, columns=COLUMNS, rows=ROWS, sigmas=SIGMAS, share=100 * SHARE))
        with concurrent.futures.ThreadPoolExecutor(int(os.environ.get("JOBS", os.cpu_count() or 1))) as pool:
            for name in names or WITH + WITHOUT:
                done = list(pool.map(lambda seed: one_set(program, name, seed, folder), range(1, int(sets) + 1)))
                answered = [judged for _, judged, _ in done if judged]
                right = sum(all(ok for *_, ok in judged) for judged in answered)
                pulls = [error / sigma for judged in answered for error, sigma, _ in judged if math.isfinite(error)]
                rms = f"{math.sqrt(sum(p * p for p in pulls) / len(pulls)):.2f}" if pulls else "–"
                errors = sorted(abs(error) for judged in answered for error, *_ in judged)
                median = f"{errors[len(errors) // 2]:.5f}" if errors else "–"
                cells = [name.replace("-", " "), len(done), len(answered), right, len(done) - len(answered), len(answered) - right, rms, median]
                print("| " + " | ".join(map(str, cells)) + " |", flush=True)
                for seed, judged, _ in done:
                    if not all(ok for *_, ok in judged):
                        print(f"{name} {seed}: {judged}", file=sys.stderr)


if __name__ == "__main__":
    main(*sys.argv[1:])
