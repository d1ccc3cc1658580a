"""Sets of a scanner that bends, and of one that does not, by a generator of its own: see docs/bent.sh. Python 3 with NumPy.

Lengths in nm, times in s, angles counter-clockwise, x right along the lines, y up. The lattice is the same everywhere and nothing drifts. The scanner
is meant to be at (x, y) and is at (X, Y): hysteresis bows lines, trace against retrace, and the slow axis, up against down, and creep
moves both with the logarithm of the time since the frame began. Sensors record (X, Y) with noise of 0.2 nm.
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

CONSTANT, POISSON, LINE_TIME, SENSOR_NOISE, FRAMES = 0.246, 0.16, 0.25, 0.2, 4
OPTIONS = ["--calibration-gain", "0", "--calibration-mismatch", "0", "--calibration-orthogonality", "0", "--isotropic-strain", "0", "--no-png",
           "--no-report", "--force", "--threads", "1", "--quiet"]
CHANGES = ("changes", "changing", "inhomogeneous")


def turn(angle):
    return numpy.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def moire(twist, strain, axis, orientation):
    """Two reciprocal vectors of the moiré, a row each."""
    length = 4 * math.pi / (math.sqrt(3) * CONSTANT)
    layer = length * numpy.array([[math.cos(orientation + a), math.sin(orientation + a)] for a in (0, math.pi / 3)])
    stretch = turn(axis) @ numpy.diag([1 + strain, 1 - POISSON * strain]) @ turn(axis).T
    return layer @ numpy.linalg.inv(turn(twist) @ stretch) - layer


def twist_of(vectors, guess):
    """The twist, degrees, of moiré vectors near those of (twist, strain, axis, orientation), by Newton's method."""
    for _ in range(6):
        here, steps = moire(*guess).ravel(), 1e-7 * numpy.eye(4)
        slopes = numpy.array([(moire(*(guess + step)).ravel() - here) / 1e-7 for step in steps]).T
        guess = guess + numpy.linalg.solve(slopes, vectors.ravel() - here)
    return math.degrees(guess[0])


class Scene:
    """One sample and its scanner; a bent and a straight one differ in the scanner alone."""

    def __init__(self, kind, seed):
        self.random, self.kind, self.seed = numpy.random.default_rng([seed, 40]), kind, seed
        draw = self.random.uniform
        self.twist = draw(0.9, 2.0)
        self.layers = numpy.array([math.radians(self.twist), draw(0, 0.004), draw(0, math.pi), draw(0, math.pi)])
        self.vectors = moire(*self.layers)
        self.start, self.second = draw(0, 2 * math.pi, 2), draw(0, 0.4)
        period = numpy.mean([4 * math.pi / math.sqrt(3) / numpy.hypot(*g) for g in (*self.vectors, self.vectors[1] - self.vectors[0])])
        self.pixels, self.size = int(draw(128, 257)), draw(5, 12) * period
        self.noise = draw(0.1, 0.8)
        sign = lambda: self.random.choice([-1, 1])
        self.bows, self.skews = [draw(0.004, 0.03) * sign() for _ in "xy"], draw(-0.5, 0.5, 2)
        self.creeps, self.first_time = [draw(0.002, 0.015) * sign() for _ in "xy"], draw(0.3, 3)
        if kind.startswith("straight"):
            self.bows, self.creeps = [0, 0], [0, 0]
        if kind.endswith("unrecorded"):  # Up to 0.5 % a decade, and up to 1 % of hysteresis or all of it.
            self.creeps = [creep / 3 for creep in self.creeps]
            self.bows = self.bows if kind.startswith("hysteresis") else [bow / 3 for bow in self.bows]

    def places(self, up, back):
        """(X, Y) of the pixels of a line direction."""
        n = self.pixels
        u, v = numpy.meshgrid(*2 * [numpy.linspace(-1, 1, n)])
        line = numpy.arange(n)[:, None] if up else numpy.arange(n)[::-1, None]
        along = (1 - u if back else 1 + u) / 2
        time = LINE_TIME * (line + along / 2 + (0.5 if back else 0))
        ways = (-1 if back else 1, 1 if up else -1)
        side = self.size * (n - 1) / n / 2
        meant = (u, v)
        decades = numpy.log10(1 + time / self.first_time)
        return [side * w + self.size * (way * bow / 2 * (1 - w ** 2) * (1 + skew * w) + creep * decades)
                for w, way, bow, skew, creep in zip(meant, ways, self.bows, self.skews, self.creeps)]

    def truth(self):
        """The twist of the mean moiré vectors over the area that the pixels of all lines cover: creep moves it."""
        if not self.kind.endswith("changing"):
            return self.twist
        x, y = numpy.mean([numpy.mean(self.places(up, back), axis=(1, 2)) for up in (True, False) for back in (False, True)], axis=0) / (self.size / 2)
        return twist_of(self.vectors @ numpy.array([[1 + 0.024 * x, 0], [-0.008 * y, 1 - 0.008 * x]]), self.layers)

    def image(self, x, y):
        if self.kind.endswith("changing"):  # Moiré vectors that change by 2.4 % from the middle to either side.
            half = self.size / 2
            x, y = x + 0.012 * x ** 2 / half, y - 0.008 * x * y / half
        a, b = (g[0] * x + g[1] * y + s for g, s in zip(self.vectors, self.start))
        first = numpy.cos(a) + numpy.cos(b) + numpy.cos(b - a)
        return first + self.second * (numpy.cos(a + b) + numpy.cos(2 * b - a) + numpy.cos(2 * a - b)) + self.noise * self.random.normal(size=x.shape)

    def frame(self, up):
        """Channels: name, unit, line direction, values."""
        made = []
        for back in (False, True):
            x, y = self.places(up, back)
            noisy = lambda k: k + SENSOR_NOISE * self.random.normal(size=k.shape)
            way = "Retrace" if back else "Trace"
            made.append(("TRPhase", "TR Phase", way, self.image(x, y)))
            if not self.kind.endswith("unrecorded"):
                made += [("Xsensor", "Xsensor", way, noisy(x)), ("Ysensor", "Ysensor", way, noisy(y))]
        return made


def nanoscope(path, scene, number):
    """A NanoScope file with the fields of a Dimension Icon."""
    up, n, size = number % 2 == 0, scene.pixels, scene.size
    if scene.kind.endswith("unrecorded"):  # From the first pixel to the last.
        size *= (n - 1) / n
    direction, data, start = "Up" if up else "Down", [], 40960
    minute, second = divmod(round((number + 1) * n * LINE_TIME), 60)
    head = ["\\*File list", "\\Version: 0x09700105", f"\\Date: 10:{minute:02}:{second:02} AM Fri Mar 15 2024", "\\Start context: OL2",
            f"\\Data length: {start}", "\\*Scanner list", "\\@Sens. Xsensor: V 3000.000 nm/V", "\\@Sens. Ysensor: V 3000.000 nm/V", "\\*Ciao scan list",
            f"\\Scan Size: {size:.6f} nm", "\\X Offset: 0 nm", "\\Y Offset: 0 nm", "\\Rotate Ang.: 0", "\\X round: 0", f"\\Samps/line: {n}", f"\\Lines: {n}",
            "\\Aspect Ratio: 1:1", f"\\Scan Rate: {1 / LINE_TIME:g}", f"\\Capture direction: {direction}", "\\@Sens. TR Phase: V 1.000000 "]
    for name, shown, way, values in scene.frame(up):
        unit, full, scale = ("V", 24.576, 3000.0) if "sensor" in name else ("\xba", 360.0, 1.0)
        counts = numpy.round(values / scale / (full / 2 ** 32)).astype("<i4").tobytes()
        offset = start + sum(map(len, data))
        head += ["\\*Ciao image list", f"\\Data offset: {offset}", f"\\Data length: {len(counts)}", "\\Bytes/pixel: 4", "\\Start context: OL", "\\Data type: AFM",
                 f"\\Frame direction: {direction}", "\\Capture start line: 0", f"\\Samps/line: {n}", f"\\Number of lines: {n}", "\\Aspect Ratio: 1:1",
                 f"\\Scan Size: {size:.6f} {size:.6f} nm", f"\\Line Direction: {way}", "\\Realtime Planefit: None", "\\Offline Planefit: None",
                 f'\\@2:Image Data: S [{name}] "{shown}"', "\\@Z magnify: C [2:Z scale] 0.01",
                 f"\\@2:Z scale: V [Sens. {shown}] ({full / 2 ** 32:.20f} {unit}/LSB) {full:.5f} {unit}",
                 f"\\@2:Z offset: V [Sens. {shown}] ({full / 2 ** 32:.20f} {unit}/LSB) 0 {unit}"]
        data.append(counts)
    head = "\r\n".join([*head, "\\*File list end", ""]).encode("latin-1") + b"\x1a"
    path.write_bytes(head.ljust(start, b"\0") + b"".join(data))


def value(results):
    found = results["sets"][0]
    return ((results.get("combined") or {}).get("twist_deg")) or (found.get("mean") or found.get("uncorrected") or {}).get("twist_deg")


def ran(program, command, files, out, extra=()):
    done = subprocess.run([program, command, *map(str, files), *extra, *OPTIONS, "--out", str(out)], capture_output=True, text=True)
    return done.stderr.strip()[-400:] if done.returncode else ""


def analyse(program, kind, seed, folder):
    scene, made = Scene(kind, seed), folder / f"{kind}-{seed}"
    shutil.rmtree(made, ignore_errors=True)
    made.mkdir(parents=True)
    files = [made / f"frame.0_{i:05}.spm" for i in range(FRAMES)]
    for number, path in enumerate(files):
        nanoscope(path, scene, number)
    line = {"kind": kind, "seed": seed, "truth": scene.truth(), "noise": scene.noise, "periods": scene.size, "bows": list(map(float, scene.bows)), "creeps": list(map(float, scene.creeps))}
    line["refused"] = ran(program, "analyze", files, made / "results")
    for path in sorted((made / "results").glob("**/results.json")):
        results = json.loads(path.read_text())
        line["caveats"] = sorted({c["code"] for c in results.get("caveats", [])})
        line["changes"] = [c["message"] for c in results.get("caveats", []) if c["code"] == "inhomogeneous-lattice"]
        line["twist"] = value(results) and [value(results)[k] for k in ("value", "sigma")]
        line["total"] = value(results) and value(results)["sigma_total"]
    if os.environ.get("MAPS"):
        line["map refused"] = ran(program, "map", files, made / "map")
        for path in sorted((made / "map").glob("**/map.json")):
            mapped = {q["name"]: q for q in json.loads(path.read_text())["quantities"]}
            line["map"] = [mapped["twist"].get(k) for k in ("mean", "mean_sigma", "spread_corrected", "bends")]
            line["along"] = mapped["displacement x"]["spread"]
    if not os.environ.get("KEEP"):
        shutil.rmtree(made)
    return line


def run(program, first, last, written, *kinds):
    program = str(pathlib.Path(program).resolve())
    tasks = [(kind, seed) for seed in range(int(first), int(last) + 1) for kind in kinds or ("straight", "bent")]
    with tempfile.TemporaryDirectory() as scratch, open(written, "a") as lines:
        folder = pathlib.Path(os.environ.get("KEEP", scratch)).resolve()
        with concurrent.futures.ThreadPoolExecutor(int(os.environ.get("JOBS", 1))) as pool:
            for line in pool.map(lambda task: analyse(program, *task, folder), tasks):
                print(json.dumps(line, ensure_ascii=False), file=lines, flush=True)


def table(*files):
    by_kind = {}
    for line in (json.loads(text) for file in files for text in open(file)):
        by_kind.setdefault(line["kind"], []).append(line)
    print("| scanner | sets | answered | median error (%) | rms pull | the lattice is said to change | rms pull of the mean of maps | largest spread without noise (°) | displacement along the lines (nm) |")
    print("|" + " --- |" * 9)
    for kind, lines in by_kind.items():
        told = [line for line in lines if line.get("twist")]
        errors = [line["twist"][0] - line["truth"] for line in told]
        pulls = [error / line["twist"][1] for error, line in zip(errors, told)]
        changing = sum(any(word in code for code in line.get("caveats", []) for word in CHANGES) for line in lines)
        median = 100 * numpy.median([abs(error) / line["truth"] for error, line in zip(errors, told)]) if told else math.nan
        rms = lambda values: f"{numpy.sqrt(numpy.mean(numpy.square(values))):.2f}" if values else "–"
        mapped = [line for line in lines if line.get("map")]
        off = [(line["map"][0] - line["truth"]) / line["map"][1] for line in mapped]
        spread = f"{max(line['map'][2] for line in mapped):.4f}" if mapped else "–"
        along = f"{numpy.median([line['along'] for line in mapped]):.3f}" if mapped else "–"
        print(f"| {kind} | {len(lines)} | {len(told)} | {median:.4f} | {rms(pulls)} | {changing} of {len(lines)} | {rms(off)} | {spread} | {along} |")


if __name__ == "__main__":
    table(*sys.argv[2:]) if sys.argv[1:2] == ["table"] else run(*sys.argv[1:])
