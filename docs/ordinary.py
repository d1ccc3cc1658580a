"""Images as ordinary microscopes give them, by a generator of its own: see docs/ordinary.sh. Python 3 with NumPy.

Lengths in nm, angles counter-clockwise, x right, y up, row 0 the lowest line and the first in time. Layer 2 is layer 1 stretched
and then turned by the twist. A pattern is drawn as protrusions on the points of the lattice, each with numbers of its own, or as a
smooth function of its phases. Contrast 1 is that of three cosines of amplitude 1. The scanner is at (X, Y) where it believes to be
at (x, y); where that bends the frame, the truth is the mean lattice: that of the mean slopes of the phases.
"""

import concurrent.futures
import json
import math
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile

import numpy

CONSTANT, POISSON = 0.246, 0.16
LINE_TIME = 0.25
SIGMAS, SHARE = 5.0, 0.003
# Always there with arrays, or about the drift that is given: no doubt about the image.
EXPECTED = {"no-position-sensors", "drift-given"}
OPTIONS = ["--drift", "0", "0", "--drift-sigma", "0", "--line-rate", str(1 / LINE_TIME), "--frame-direction", "up", "--calibration-gain", "0",
           "--calibration-mismatch", "0", "--calibration-orthogonality", "0", "--isotropic-strain", "0", "--no-png", "--no-report", "--force",
           "--threads", "1", "--quiet"]

def turn(angle):
    return numpy.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])

def layer(orientation):
    length = 4 * math.pi / (math.sqrt(3) * CONSTANT)
    return length * numpy.array([[math.cos(orientation + a), math.sin(orientation + a)] for a in (0, math.pi / 3)])

def moire(twist, strain, axis, orientation):
    """Two reciprocal vectors of the moiré, a row each."""
    stretch = turn(axis) @ numpy.diag([1 + strain, 1 - POISSON * strain]) @ turn(axis).T
    return layer(orientation) @ numpy.linalg.inv(turn(twist) @ stretch) - layer(orientation)

def twist_of(vectors, orientation):
    """In degrees: the turn in the polar decomposition of the deformation."""
    inverse = numpy.linalg.solve(layer(orientation), layer(orientation) + vectors)
    left, _, right = numpy.linalg.svd(inverse)
    turned = left @ right
    return abs(math.degrees(math.atan2(turned[0, 1], turned[0, 0])))

class Scene:
    """One sample and its microscope: all numbers come from kind and seed."""
    def __init__(self, kind, seed):
        self.random = numpy.random.default_rng([seed, 77, *kind.encode()])
        self.draw, self.kind = self.random.uniform, kind
        self.faults, self.truths, self.other, self.has_lattice = [], [], None, True
        self.frames, self.noise, self.offsets, self.jump, self.cover = 1, self.draw(0.1, 0.8), 0.0, 0.0, None
        self.before, self.on_sample, self.by_tip, self.in_data = [], [], [], []
        self.lattice(self.draw(0.9, 2.1), self.draw(0, 0.004))
        self.pixels(int(self.draw(128, 320)), self.draw(5, 11), self.draw(0.75, 1))
        self.pattern = self.any_pattern
        getattr(self, kind.replace("-", "_"))()
    def lattice(self, twist, strain):
        self.orientation, axis = self.draw(0, math.pi), self.draw(0, math.pi)
        self.vectors, self.start = moire(math.radians(twist), strain, axis, self.orientation), self.draw(0, 2 * math.pi, 2)
        self.style = self.random.choice(["spots", "exponential", "skewed", "holes"])
        self.sharp, self.skew, self.spread = self.draw(0.2, 1.2), self.draw(-math.pi, math.pi, 2), (0.0, 0.0, 0.0)
    def pixels(self, columns, periods, aspect=1.0):  # A frame of so many periods (mean of the three) across.
        self.period = numpy.mean([2 * math.pi / numpy.hypot(*g) for g in (*self.vectors, self.vectors[1] - self.vectors[0])])
        self.columns, self.rows, self.pitch = columns, max(int(columns * aspect), 32), periods * self.period / columns
        self.size = (self.columns * self.pitch, self.rows * self.pitch)
        self.x, self.y = numpy.meshgrid((numpy.arange(self.columns) + 0.5) * self.pitch, (numpy.arange(self.rows) + 0.5) * self.pitch)
        self.u, self.v = 2 * self.x / self.size[0] - 1, 2 * self.y / self.size[1] - 1

    # Patterns, of positions.
    def phases(self, x, y, vectors=None):
        a, b = (g[0] * x + g[1] * y + s for g, s in zip(self.vectors if vectors is None else vectors, self.start))
        return a, b, b - a
    def any_pattern(self, x, y):
        if self.style == "spots":
            return self.protrusions(x, y)
        a, b, c = self.phases(x, y)
        if self.style == "skewed":
            return (numpy.cos(a) + numpy.cos(b) + numpy.cos(c) + 0.3 * (numpy.cos(a + b + self.skew[0]) + numpy.cos(a + self.skew[1]))) / 1.06
        image = numpy.exp(self.sharp * (numpy.cos(a) + numpy.cos(b) + numpy.cos(c)))
        return (image if self.style == "exponential" else -image) * math.sqrt(1.5) / image.std()
    def protrusions(self, x, y):  # Gaussians on the points of the lattice, each with a height, place and width of its own.
        if not hasattr(self, "sites"):
            real = 2 * math.pi * numpy.linalg.inv(self.vectors).T
            n, m = (k.ravel() for k in numpy.meshgrid(*2 * [numpy.arange(-80, 81)]))
            places = numpy.linalg.solve(self.vectors, -self.start) + n[:, None] * real[0] + m[:, None] * real[1]
            near = (numpy.abs(places - numpy.array(self.size) / 2) < numpy.array(self.size) / 2 + (2 + 4 * self.jump) * self.period).all(axis=1)
            (heights, moved, widths), normal = self.spread, self.random.normal
            places = places[near] + moved * self.period * normal(size=(near.sum(), 2)) / math.sqrt(2)
            width = self.draw(0.16, 0.3) * self.period
            self.sites = [(p, 1 + heights * normal(), max(width * (1 + widths * normal()), 0.3 * width)) for p in places]
        image = 0 * x
        for (px, py), height, width in self.sites:
            image += height * numpy.exp(-((x - px) ** 2 + (y - py) ** 2) / (2 * width ** 2))
        return (image - image.mean()) * math.sqrt(1.5) / image.std()
    def smooth(self, low, high, exponent=0.0):
        """Isotropic noise of variance 1 of so many periods across the frame, its power a power of the frequency."""
        k = numpy.hypot(numpy.fft.fftfreq(self.rows, 1 / self.rows)[:, None], numpy.fft.fftfreq(self.columns, 1 / self.columns)[None, :])
        amplitude = numpy.where((k >= low) & (k <= high), numpy.maximum(k, 1) ** (-exponent / 2), 0)
        made = numpy.fft.ifft2(amplitude * numpy.fft.fft2(self.random.normal(size=k.shape))).real
        return made / made.std()
    def slow(self, exponent, count):  # Noise in time, its power a power of the frequency.
        f = numpy.maximum(numpy.fft.rfftfreq(count, 1 / count), 1)
        made = numpy.fft.irfft(f ** (-exponent / 2) * numpy.fft.rfft(self.random.normal(size=count)), count)
        return made / made.std()
    def edge(self, low, high):  # True beyond a straight edge.
        angle, off = self.draw(0, 2 * math.pi), self.draw(low, high)
        return lambda x, y: (2 * x / self.size[0] - 1) * math.cos(angle) + (2 * y / self.size[1] - 1) * math.sin(angle) > off
    def distance(self, unit):  # Squared, from a random place.
        px, py = self.draw(0, 1, 2) * self.size
        return lambda x, y: ((x - px) ** 2 + (y - py) ** 2) / unit ** 2

    # From scene to frames.
    def make(self):  # The frames, and with the first the truths.
        made = []
        for frame in range(self.frames):
            moved = self.jump * self.period * self.random.normal(size=2) * (frame > 0)
            x, y = (at + far + sum(bend[i] for bend in self.before) for i, (at, far) in enumerate(zip((self.x, self.y), moved)))
            image = self.pattern(x, y)
            for change in self.on_sample:
                image = change(image, x, y)
            if frame == 0 and self.has_lattice:
                self.find_truths(image, x, y)
            for change in [*self.by_tip, self.noisy, *self.in_data]:
                image = change(image)
            made.append(image)
        return made
    def noisy(self, image):
        return image + self.noise * self.random.normal(size=image.shape) + self.offsets * self.random.normal(size=(self.rows, 1))
    def strength(self, image, x, y, vectors):
        """Mean amplitude of the three first waves of a moiré in an image, under a Hann window."""
        window = numpy.outer(*(numpy.hanning(count + 2)[1:-1] for count in image.shape))
        window /= window.sum()
        image = image - (window * image).sum()
        return numpy.mean([abs((window * image * numpy.exp(1j * k)).sum()) for k in self.phases(x, y, vectors)])
    def find_truths(self, image, x, y):
        where = numpy.ones(x.shape, bool) if self.cover is None else self.cover(x, y)
        bent = numpy.array([[numpy.gradient(k, self.pitch, axis=axis)[where].mean() for axis in (1, 0)] for k in (x, y)])
        self.vectors_seen = self.vectors @ bent
        self.truths = [twist_of(self.vectors_seen, self.orientation)]
        if self.other is not None:
            vectors, orientation, accepted = self.other
            if accepted is None:  # The stronger of two moirés may be meant.
                accepted = self.strength(image, x, y, vectors) > self.strength(image, x, y, self.vectors)
            self.other = twist_of(vectors @ bent, orientation)
            self.truths += [self.other] if accepted else []

    # Kinds with a moiré.
    def few_spots(self):  # A single frame of a few spots, each with its own height, place and width, hardly any noise.
        self.lattice(self.draw(0.8, 1.7), self.draw(0, 0.006))
        self.pixels(int(self.draw(150, 513)), self.draw(2.6, 5))
        self.style, self.spread = "spots", (self.draw(0.05, 0.3), self.draw(0, 0.02), self.draw(0, 0.1))
        self.noise = numpy.ptp(self.protrusions(self.x, self.y)) * self.draw(0, 0.05)
        self.in_data += [self.grey(256)] * self.random.integers(2)
    def line_gain(self):  # Three to five frames whose lines have a gain of their own; some with jumps of the sample between frames.
        self.frames, self.noise, self.jump = int(self.random.integers(3, 6)), self.draw(0.2, 0.6), self.random.choice([0, 1])
        self.pixels(self.columns, self.draw(6, 11), self.draw(0.75, 1))
        self.by_tip.append(self.gain(self.draw(0.25, 0.45)))
    def second_moire(self):  # A weaker moiré of another cell, unrelated or near (not on) the √3 cell, straight or bent by up to 6 %.
        self.noise = self.draw(0.05, 0.5)
        self.second(near=self.random.integers(3) == 0)
        self.maybe_bent()
    def half_order(self):  # One more wave at half of one wave vector, straight or bent.
        self.noise, depth, start = self.draw(0.05, 0.5), self.draw(0.3, 0.8), self.draw(0, 2 * math.pi)
        self.on_sample.append(lambda image, x, y: image + depth * numpy.cos(self.phases(x, y)[0] / 2 + start))
        self.maybe_bent()
    def maybe_bent(self):
        if self.random.integers(2):
            self.bow(self.draw(0.005, 0.06))
    def nested(self):  # A superlattice, √3 or 2 times larger than that of its strongest waves, whose own first waves are weak.
        self.lattice(self.draw(0.5, 1.2), self.draw(0, 0.003))
        self.pixels(self.columns, self.draw(4, 9), self.draw(0.75, 1))
        self.noise, share, twice = self.draw(0.05, 0.3), self.draw(0.03, 0.3), self.random.integers(2)
        self.faults = ["2" if twice else "√3", f"{share:.3f}"]
        def pattern(x, y):
            a, b, c = self.phases(x, y)
            strong = (2 * a, 2 * b, 2 * c) if twice else (a + b, b + c, a - c)
            return sum(map(numpy.cos, strong)) + share * sum(map(numpy.cos, (a, b, c))) + 0.2 * numpy.cos(strong[0] + strong[1])
        self.pattern = pattern
        mixed = self.vectors * 2 if twice else numpy.array([[1, 1], [-1, 2]]) @ self.vectors
        self.other = (mixed, self.orientation + (0 if twice else math.pi / 6), share < 0.05)

    # Troubles, one line each: what the microscope or the sample did.
    def troubles(self):  # One to four frames with one to four troubles at random.
        self.frames = int(self.random.integers(1, 5))
        self.pixels(self.columns, self.draw(4, 12), self.draw(0.75, 1))
        self.offsets, self.jump = self.draw(0, 0.2), self.random.choice([0, 0, 1])
        for name in self.random.choice(sorted(TROUBLES), size=self.random.integers(1, 5), replace=False):
            self.faults.append(str(name))
            getattr(self, name)()
    def bow(self, depth=None):  # The scanner bends lines and columns.
        depth = self.draw(0.003, 0.04) if depth is None else depth
        part = self.draw(-1, 1, (2, 2))
        part *= depth / numpy.abs(part).max() / 4
        self.before.append([side * (p * w ** 2 + q * self.u * self.v) for side, (p, q), w in zip(self.size, part, (self.v, self.u))])
    def hysteresis(self):  # Lines run unevenly: fast in the middle, slow at the end.
        depth, skew = self.draw(0.003, 0.04), self.draw(-1, 1)
        self.before.append([depth * self.size[0] / 4 * (1 - self.u ** 2) * (1 + 0.5 * skew * self.u), 0])
    def creep(self):  # The frame relaxes along the slow axis.
        depth, time, angle = self.draw(0.003, 0.04), self.draw(0.1, 0.5), self.draw(0, 2 * math.pi)
        along = numpy.exp(-(self.v + 1) / 2 / time) * time * depth * self.size[1]
        self.before.append([along * math.cos(angle), along * math.sin(angle)])
    def double_tip(self):  # A second, weaker image beside the first.
        share, far = self.draw(0.2, 0.7), self.draw(-0.6, 0.6, 2) * self.period
        self.on_sample.append(lambda image, x, y: image + share * self.pattern(x + far[0], y + far[1]))
    def tip_change(self):  # Part of the way up the contrast changes or turns around.
        row, factor, off = int(self.rows * self.draw(0.25, 0.75)), self.draw(-1, 0.6), self.draw(-2, 2)
        self.by_tip.append(lambda image: numpy.where(numpy.arange(self.rows)[:, None] < row, image, factor * image + off))
    def blunt_tip(self):  # Blurred by a good part of a period.
        width = self.draw(0.1, 0.3) * self.period / self.pitch
        far = int(4 * width) + 1
        kernel = numpy.exp(-numpy.arange(-far, far + 1) ** 2 / (2 * width ** 2))
        def blur(line):
            return numpy.convolve(numpy.pad(line, far, "edge"), kernel / kernel.sum(), "valid")
        self.by_tip.append(lambda image: numpy.apply_along_axis(blur, 0, numpy.apply_along_axis(blur, 1, image)))
    def gain(self, depth):
        return lambda image: image * (1 + depth * self.random.normal(size=(self.rows, 1)))
    def gains(self):  # Each line has its gain.
        self.by_tip.append(self.gain(self.draw(0.1, 0.45)))
    def line_offsets(self):  # Each line has its offset, which wanders too.
        depth, drift = self.draw(0.3, 2), self.draw(0, 3)
        self.by_tip.append(lambda image: image + (depth * self.random.normal(size=self.rows) + drift * self.slow(2, self.rows))[:, None])
    def scars(self):  # Parts of lines are too high or too low.
        def scar(image):
            first = self.random.integers(self.columns)
            image[self.random.integers(self.rows), first:first + self.random.integers(5, self.columns)] += self.draw(-6, 6)
            return image
        self.by_tip += [scar] * self.random.integers(5, 50)
    def ringing(self):  # The feedback overshoots along the lines.
        length, depth, decay = self.draw(4, 20), self.draw(0.3, 1.2), self.draw(3, 20)
        answer = depth * numpy.exp(-numpy.arange(60) / decay) * numpy.sin(2 * math.pi * numpy.arange(60) / length)
        def ring(line):
            return line + numpy.convolve(numpy.diff(line, prepend=line[:1]), answer)[:line.size]
        self.by_tip.append(lambda image: numpy.apply_along_axis(ring, 1, image))
    def half_covered(self):  # Flat beyond an edge.
        beyond, height = self.edge(-0.1, 0.4), self.draw(-3, 3)
        self.cover = lambda x, y: ~beyond(x, y)
        self.on_sample.append(lambda image, x, y: numpy.where(beyond(x, y), height, image))
    def holes(self):  # Three round holes.
        for _ in range(3):
            inside = self.distance(self.draw(0.08, 0.2) * self.size[0])
            self.on_sample.append(lambda image, x, y, inside=inside: numpy.where(inside(x, y) < 1, -3.0, image))
    def step(self):  # A step of the ground under the moiré.
        beyond, height = self.edge(-0.5, 0.5), self.draw(2, 10)
        self.on_sample.append(lambda image, x, y: image + height * beyond(x, y))
    def terrain(self):  # Rough ground under the moiré.
        ground = self.draw(1, 5) * self.smooth(1, 60, self.draw(2.5, 4))
        at = [lambda k, count=count: (k / self.pitch).astype(int) % count for count in (self.rows, self.columns)]
        self.on_sample.append(lambda image, x, y: image + ground[at[0](y), at[1](x)])
    def walls(self):  # Flat domains between narrow walls.
        sharp, off = self.draw(1, 5), self.draw(-0.5, 0.8)
        def pattern(x, y):
            image = self.any_pattern(x, y)
            return 1.2 * numpy.tanh(sharp * (image - image.mean() + off))
        self.pattern = pattern
    def atoms(self):  # The atoms are seen, or what the pixels make of them.
        depth, vectors = self.draw(0.1, 0.5), layer(self.orientation)
        self.on_sample.append(lambda image, x, y: image + depth * sum(map(numpy.cos, self.phases(x, y, vectors))))
    def particles(self):  # Bright dirt.
        for _ in range(self.random.integers(2, 15)):
            away, h = self.distance(self.draw(0.1, 0.8) * self.period), self.draw(3, 20)
            self.on_sample.append(lambda image, x, y, away=away, h=h: image + h * numpy.exp(-away(x, y) / 2))
    def fading(self):  # The contrast of the moiré fades from one side to the other.
        angle, depth = self.draw(0, 2 * math.pi), self.draw(0.4, 0.95)
        fade = 1 - depth * (1 + (self.u * math.cos(angle) + self.v * math.sin(angle)) / math.sqrt(2)) / 2
        self.on_sample.insert(0, lambda image, x, y: image * fade)
    def disorder(self):  # Spots with heights, places and widths of their own.
        self.style, self.spread = "spots", (self.draw(0.1, 0.4), self.draw(0, 0.06), self.draw(0, 0.15))
    def second(self, near=False):  # A second moiré.
        depth, angle, scale = self.draw(0.3, 0.9), self.draw(0, math.pi / 3), self.draw(0.4, 1.6)
        while not near and min(abs(scale * s - 1) for s in (1, 2, 3 ** 0.5, 0.5, 3 ** -0.5)) < 0.08:
            scale = self.draw(0.4, 1.6)
        if near:
            sign = self.random.choice([-1, 1], 2)
            scale, angle = (1 + sign[0] * self.draw(0.01, 0.05)) / math.sqrt(3), math.pi / 6 + sign[1] * math.radians(self.draw(1, 4))
        self.faults.append(f"second {depth:.2f}, cell {1 / scale:.2f}, {math.degrees(angle):.0f}°")
        vectors = scale * self.vectors @ turn(angle).T
        self.on_sample.append(lambda image, x, y: image + depth * sum(map(numpy.cos, self.phases(x, y, vectors))))
        self.other = (vectors, self.orientation + angle, None)
    def grey(self, levels):
        return lambda image: numpy.round((image - numpy.nanmin(image)) / (numpy.nanmax(image) - numpy.nanmin(image)) * (levels - 1))
    def few_levels(self):  # Eight or twelve grey levels, over a slope.
        slope, levels = self.draw(-3, 3, 2), int(self.random.choice([8, 12]))
        self.in_data += [lambda image: image + slope[0] * self.u + slope[1] * self.v, self.grey(levels)]
    def saturation(self):  # Cut off above and below.
        self.in_data.append(lambda image, cut=[self.draw(0, 25), self.draw(70, 95)]: numpy.clip(image, *numpy.nanpercentile(image, cut)))
    def missing_lines(self):  # Some lines, or the last of the frame, are empty: no number or a constant.
        value, last, count = self.random.choice([math.nan, 0.0, -5.0]), self.random.integers(2), int(self.rows * self.draw(0.03, 0.3))
        def change(image):
            image[slice(self.rows - count, None) if last else self.random.choice(self.rows, count // 3 + 1)] = value
            return image
        self.in_data.append(change)
    def spikes(self):  # Single pixels far off.
        share, height = self.draw(0.001, 0.02), self.draw(10, 100)
        self.in_data.append(lambda image: image + height * self.random.choice([-1, 1]) * (self.draw(size=image.shape) < share))
    def time(self):  # Of each pixel, in s: half of a line is the way back.
        return LINE_TIME * (numpy.arange(self.rows)[:, None] + (self.u + 1) / 4)
    def mains(self):  # Hum of the mains and its overtones.
        base, depth, starts = self.draw(49.9, 50.1), self.draw(0.3, 2) / numpy.arange(1, 4), self.draw(0, 2 * math.pi, 3)
        wave = 2 * math.pi * base * self.time()
        self.in_data.append(lambda image: image + sum(d * numpy.cos(n * wave + s) for n, d, s in zip((1, 2, 3), depth, starts)))
    def flicker(self):  # 1/f noise in time.
        depth, power = self.draw(0.5, 4), self.draw(0.8, 1.6)
        self.in_data.append(lambda image: image + depth * self.slow(power, 2 * image.size).reshape(self.rows, -1)[:, :self.columns])

    # Kinds without a lattice.
    def nothing(self, image, low=0.05, high=1.0):
        self.has_lattice, self.pattern, self.noise = False, lambda x, y: image, self.draw(low, high)
        self.frames, self.offsets = int(self.random.integers(1, 4)), self.draw(0, 0.3)
    def bare_step(self):  # One to three steps, straight or curved.
        image = 0
        for _ in range(self.random.integers(1, 4)):
            angle, bent, off = self.draw(0, 2 * math.pi), self.draw(-0.6, 0.6) * self.random.integers(2), self.draw(-0.7, 0.7)
            along, across = turn(angle).T.dot(numpy.array([self.u, self.v]).reshape(2, -1)).reshape(2, *self.u.shape)
            image = image + self.draw(1, 8) * (1 + numpy.tanh((along + bent * across ** 2 - off) / self.draw(0.002, 0.03))) / 2
        self.nothing(image)
    def wave_packet(self):  # Waves in a small part of the frame, of one direction or of three unrelated ones.
        share, (pu, pv), soft = self.draw(0.05, 0.19), self.draw(-0.7, 0.7, 2), self.random.integers(2)
        away = ((self.u - pu) ** 2 + (self.v - pv) ** 2) / (share * 4 / math.pi)
        patch, waves = numpy.exp(-away) if soft else away < 1, 0 * self.u
        for _ in range(self.random.choice([1, 3])):
            angle, k = self.draw(0, math.pi), 2 * math.pi / self.period * self.draw(0.5, 2)
            waves = waves + numpy.cos(k * (math.cos(angle) * self.x + math.sin(angle) * self.y) + self.draw(0, 2 * math.pi))
        self.nothing(self.draw(1, 3) * patch * waves)
    def rough(self):  # Rough ground, its power a power of the frequency.
        self.nothing(self.draw(1, 5) * self.smooth(1, 80, self.draw(1, 4)), 0, 0.5)
    def ripples(self):  # Ripples of about one length in all directions.
        middle, width = self.draw(5, 20), self.draw(0.05, 0.3)
        self.nothing(1.5 * self.smooth(middle * (1 - width), middle * (1 + width)))
    def stripes(self):  # One family of lines with overtones, wobbling.
        angle, k, wobble = self.draw(0, math.pi), 2 * math.pi / self.period, self.draw(0, 1.5) * self.smooth(1, 4)
        phase = k * (math.cos(angle) * self.x + math.sin(angle) * self.y) + wobble
        self.nothing(sum(self.draw(0, 1) ** n * numpy.cos((n + 1) * phase + self.draw(0, 6)) for n in range(5)))
    def hum(self):  # Hum of three frequencies over an empty ground.
        tones = [(self.draw(10, 160), self.draw(0.3, 2), self.draw(0, 6)) for _ in range(3)]
        self.nothing(sum(d * numpy.cos(2 * math.pi * f * self.time() + s) for f, d, s in tones))
    def lumps(self):  # Random protrusions.
        width, image = self.draw(0.03, 0.12), 0 * self.u
        for _ in range(self.random.integers(20, 150)):
            pu, pv = self.draw(-1.1, 1.1, 2)
            image = image + self.draw(0.5, 3) * numpy.exp(-((self.u - pu) ** 2 + (self.v - pv) ** 2) / (2 * width ** 2))
        self.nothing(image)
    def cells(self):  # Walls of cells around random places.
        two = numpy.full((2, *self.u.shape), numpy.inf)
        for pu, pv in self.draw(-1.1, 1.1, (self.random.integers(20, 150), 2)):
            two = numpy.sort([*two, numpy.hypot(self.u - pu, self.v - pv)], axis=0)[:2]
        self.nothing(2 * numpy.tanh(self.draw(10, 40) * (two[1] - two[0])))
    def terraces(self):  # A staircase of terraces of uneven width, with wavy edges.
        angle, count = self.draw(0, 2 * math.pi), self.random.integers(3, 12)
        slope = (self.u * math.cos(angle) + self.v * math.sin(angle)) * count / 2 + self.draw(0, 0.5) * self.smooth(1, 10, 2)
        self.nothing(self.draw(0.5, 4) * (slope > numpy.sort(self.draw(-count / 2, count / 2, count))[:, None, None]).sum(axis=0))

TROUBLES = ("bow hysteresis creep double_tip tip_change blunt_tip gains line_offsets scars ringing half_covered holes step terrain walls atoms "
            "particles fading disorder second few_levels saturation missing_lines spikes mains flicker").split()
WITH = ["few-spots", "line-gain", "troubles", "second-moire", "half-order", "nested"]
WITHOUT = ["bare-step", "wave-packet", "rough", "ripples", "stripes", "hum", "lumps", "cells", "terraces"]

def peer(scene, image):
    """Twist by a plain least-squares fit of two shells of waves and a quadratic ground, from the truth off by 1 %."""
    step = max(scene.columns // 128, 1)
    x, y, z = (k[::step, ::step].ravel() for k in (scene.u, scene.v, image))
    orders = numpy.array([[1, 0], [0, 1], [1, -1], [1, 1], [2, -1], [1, -2]])
    g = scene.vectors_seen * (1 + 0.01 * numpy.random.default_rng(1).choice([-1, 1], (2, 2))) * scene.size / 2
    for _ in range(12):
        phases = numpy.outer(x, orders @ g[:, 0]) + numpy.outer(y, orders @ g[:, 1])
        cos, sin = numpy.cos(phases), numpy.sin(phases)
        basis = numpy.column_stack([numpy.ones(x.size), x, y, x * x, x * y, y * y, cos, sin])
        fitted = numpy.linalg.solve(basis.T @ basis, basis.T @ z)
        slopes = cos * fitted[12:] - sin * fitted[6:12]
        full = numpy.column_stack([*((slopes @ orders[:, i]) * place for i in (0, 1) for place in (x, y)), basis])
        g = g + numpy.linalg.solve(full.T @ full, full.T @ (z - basis @ fitted))[:4].reshape(2, 2)
    return twist_of(g * 2 / scene.size, scene.orientation)

def analyse(program, kind, seed, folder):
    scene, made = Scene(kind, seed), folder / f"{kind}-{seed}"
    made.mkdir(parents=True, exist_ok=True)
    images = scene.make()
    names = [made / f"frame{i}.npy" for i in range(len(images))]
    shutil.rmtree(made / "results", ignore_errors=True)
    list(map(numpy.save, names, images))
    size, out = "{:.6f}nm×{:.6f}nm".format(*scene.size), made / "results"
    line = {"kind": kind, "seed": seed, "troubles": scene.faults, "truths": scene.truths, "other": scene.other if scene.truths else None,
            "frames": len(images), "size": size, "answers": [], "caveats": []}
    line |= {"peer": peer(scene, images[0])} if kind == "few-spots" else {}
    (made / "truth.json").write_text(json.dumps(line, ensure_ascii=False))
    with open(made / "errors.txt", "w") as errors:
        child = subprocess.Popen([program, "analyze", *map(str, names), "--size", size, *OPTIONS, "--out", str(out)], stdout=errors, stderr=errors)
        _, status, used = os.wait4(child.pid, 0)
    child.returncode = os.waitstatus_to_exitcode(status)
    line |= {"exit": child.returncode, "cpu": round(used.ru_utime + used.ru_stime, 3)}
    line["refused"] = " ".join((made / "errors.txt").read_text().replace(str(made) + os.sep, "").split())[-600:]
    for path in sorted(out.glob("**/results.json")):
        results = json.loads(path.read_text())
        line["caveats"] += [[c["code"], c["message"]] for c in results.get("caveats", [])]
        together = (results.get("combined") or {}).get("twist_deg")
        of_sets = [(s.get("mean") or s.get("uncorrected") or {}).get("twist_deg") for s in results["sets"]]
        for twist in [together] if together else filter(None, of_sets):
            line["answers"].append([twist["value"], twist["sigma"], twist.get("sigma_total") or twist["sigma"]])
    return line

def grades(program):
    """Of each caveat, as the program explains it."""
    lines = subprocess.run([program, "explain", "--markdown"], capture_output=True, text=True, check=True).stdout.splitlines()
    cells = [[c.strip(" `") for c in line.split("|")] for line in lines if line.startswith("| `")]
    return {c[1]: c[2] for c in cells}

def run(program, first, last, written, *kinds):
    grade = grades(program := str(pathlib.Path(program).resolve()))
    tasks = [(kind, seed) for kind in kinds or WITH + WITHOUT for seed in range(int(first), int(last) + 1)]
    with tempfile.TemporaryDirectory() as scratch, open(written, "a") as lines:
        folder = pathlib.Path(os.environ.get("KEEP", scratch)).resolve()
        with concurrent.futures.ThreadPoolExecutor(int(os.environ.get("JOBS", 1))) as pool:
            for line in pool.map(lambda task: analyse(program, *task, folder), tasks):
                line["caveats"] = sorted({(code, grade.get(code, "?"), message) for code, message in line["caveats"]})
                print(json.dumps(line, ensure_ascii=False), file=lines, flush=True)

def judge(line):
    """Of each answer: error, statistical and total σ, right or not; then whether there is a warning and a serious caveat."""
    judged = []
    for value, sigma, total in line["answers"]:
        error = min((value - truth for truth in line["truths"]), key=abs, default=math.inf)
        judged.append((error, sigma, total, abs(error) <= max(SIGMAS * total, SHARE * value) and math.isfinite(error)))
    found = {level for code, level, message in line["caveats"] if code not in EXPECTED}
    return judged, bool(found & {"warning", "serious"}), "serious" in found

def table(*files):
    by_kind = {}
    for line in (json.loads(text) for file in files for text in open(file)):
        by_kind.setdefault(line["kind"], []).append(line)
    median = lambda values, form: form.format(float(numpy.median(values))) if values else "–"
    heads = "kind|sets|right|refused|wrong, not said|wrong, serious caveat|rms pull|median error (%)|right, warned|off, warned|CPU (s)".split("|")
    print("| " + " | ".join(heads) + " |\n|" + " --- |" * len(heads))
    for kind in sorted(by_kind, key=(WITH + WITHOUT).index):
        lines = by_kind[kind]
        good, wrong, serious, errors, pulls, warned, off = 0, 0, 0, [], [], [], []
        for line in lines:
            judged, warning, grave = judge(line)
            right = bool(judged) and all(ok for *_, ok in judged)
            bad = bool(judged) and not right
            good, wrong, serious, warned = good + right, wrong + (bad and not grave), serious + (bad and grave), warned + [warning] * right
            for (error, sigma, _, _), (value, *_) in zip(judged, line["answers"]):
                if math.isfinite(error):
                    errors.append(100 * abs(error) / value)
                    pulls.append(error / max(sigma, 1e-12))
                off += [warning] * (abs(error) > min(3 * sigma, 0.01 * value))
        rms = f"{numpy.sqrt(numpy.mean(numpy.square(pulls))):.1f}" if pulls else "–"
        cells = [kind, len(lines), good, sum(not line["answers"] for line in lines), wrong, serious, rms, median(errors, "{:.3f}"),
                 *(f"{sum(k)}/{len(k)}" for k in (warned, off)), median([line["cpu"] for line in lines], "{:.2f}")]
        print("| " + " | ".join(map(str, cells)) + " |")
    peers = [line for line in by_kind.get("few-spots", []) if "peer" in line]
    if peers:
        off = [100 * abs(line["peer"] / line["truths"][0] - 1) for line in peers]
        ours = [100 * abs(line["answers"][0][0] / line["truths"][0] - 1) for line in peers if line["answers"]]
        print(f"\nfew-spots: a plain fit of two shells from near the truth: median error {median(off, '{:.3f}')} %, largest {max(off):.3f} %"
              f" ({len(off)} sets); the program: {median(ours, '{:.3f}')} %, {max(ours, default=math.nan):.3f} % ({len(ours)}).")

if __name__ == "__main__":
    table(*sys.argv[2:]) if sys.argv[1:2] == ["table"] else run(*sys.argv[1:])
