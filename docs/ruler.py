"""Single frames that show a moiré and the atoms of a layer, by a generator of its own: see docs/ruler.sh. Python 3 with NumPy.

Lengths in nm, angles counter-clockwise, x right, y up, row 0 the lowest line. Layer 1 is a lattice with a small strain of its own, layer 2 =
F × layer 1 in the laboratory. The scanner shows (1 + d) r for r, with gain, mismatch and skew in d, and the sample drifts while the lines follow each
other. Truth: the turn in the polar decomposition of F and half the trace of its stretch, less that of the two free layers.
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

HEX = {"graphene": 0.246, "hBN": 0.2504, "WSe2": 0.3282, "WS2": 0.3153}
LINE_TIME = 0.1
DRIFT = 0.3  # nm/min, where it is in nm/min.
NO_ATOMS = ("none", "harmonics", "grid", "root3", "adsorbate")

def turn(angle):
    return numpy.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])

def waves(constant, deformation):
    """Three first waves, a row each, of a hexagonal lattice that was deformed."""
    length = 4 * math.pi / (math.sqrt(3) * constant)
    free = length * numpy.array([[math.cos(a), math.sin(a)] for a in (0, math.pi / 3, 2 * math.pi / 3)])
    return free @ numpy.linalg.inv(deformation)

class Frame:
    def __init__(self, kind, seed):
        self.kind, self.random = kind, numpy.random.default_rng([seed, 41, *kind.encode()])
        draw = self.random.uniform
        upper, lower = {"gbn": ("graphene", "hBN"), "tmd": ("WSe2", "WS2")}.get(kind.split("-")[0], ("graphene", "graphene"))
        self.layers, self.seen = (upper, lower), 1 if kind.endswith("-1") else 2
        twist = {"gbn": draw(0, 2), "tmd": draw(0.5, 4)}.get(kind.split("-")[0], draw(1.4, 4.5))
        if kind == "harmonics":  # They reach the waves of the atoms where cells are small.
            twist *= 2
        normal = lambda sigma: sigma * self.random.normal()
        own = numpy.eye(2) + numpy.array([[normal(0.001), 0], [0, normal(0.001)]])
        own[0, 1] = own[1, 0] = normal(0.0007)
        axis, uniaxial, isotropic = draw(0, math.pi), draw(0, 0.004), normal(0.001)
        stretch = (1 + isotropic) * turn(axis) @ numpy.diag([1 + uniaxial, 1 - 0.16 * uniaxial]) @ turn(axis).T
        between = turn(math.radians(twist)) @ stretch
        orientation = draw(0, math.pi)
        first = own @ turn(orientation)
        b = [waves(HEX[lower], first), waves(HEX[upper], between @ first)]
        left, s, right = numpy.linalg.svd(between)
        turned = left @ right
        self.truth = {"twist": math.degrees(math.atan2(turned[1, 0], turned[0, 0])), "mean": 100 * (s.mean() - 1), "shear": 100 * (s[0] - s[1]) / 2}
        moire = b[1] - b[0]
        period = 2 * math.pi / numpy.hypot(*moire.T).mean() * 2 / math.sqrt(3)
        d_spacing = 2 * math.pi / numpy.hypot(*b[0].T).mean()
        self.columns = int(self.random.choice([384, 512, 768]))
        most = self.columns * d_spacing / 2.5
        if kind == "from":
            self.columns, most = 256, 8 * period
        self.size = min(draw(3, 7) * period, most)
        pitch = self.size / self.columns
        n = (numpy.arange(self.columns) + 0.5) * pitch
        x, y = numpy.meshgrid(n, n)
        # Where the tip is over the sample, for where the scanner says that it is.
        gain, mismatch, skew = normal(0.02), normal(0.01), normal(0.005)
        d = numpy.array([[gain + mismatch / 2, skew / 2], [skew / 2, gain - mismatch / 2]])
        # Per time of the frame, 1 % of its slow speed; or the same drift in nm/min as in the frame of the atoms.
        share = DRIFT / 60 * LINE_TIME * self.columns / self.size if kind == "from" else 0.01
        drift = share * self.random.normal(size=2)
        true = numpy.linalg.inv(numpy.eye(2) + d) @ numpy.array([x.ravel(), y.ravel()])
        true -= numpy.outer(drift, y.ravel())
        phase = lambda q: (q @ true).reshape(x.shape)
        m = sum(numpy.cos(phase(q) + c) for q, c in zip(moire, self.at(moire, draw)))
        sharp = draw(1, 3) if kind == "harmonics" else draw(0, 0.5)
        image = (numpy.exp(sharp * m) - 1) / sharp if sharp > 0.05 else m
        image = image / image.std() * math.sqrt(1.5) if kind == "harmonics" else image
        if kind not in (*NO_ATOMS, "from"):
            of = b[self.seen - 1]
            atoms = sum(numpy.cos(phase(q) + c) for q, c in zip(of, self.at(of, draw)))
            if self.random.random() < 0.5:
                atoms = 0.6 * atoms + 0.2 * atoms ** 2
            image = image + draw(0.25, 1.2) * (1 + draw(0, 0.3) * m) * atoms
            if self.random.random() < 0.3:  # The other layer shines through.
                of = b[2 - self.seen]
                image = image + draw(0.05, 0.2) * sum(numpy.cos(phase(q) + c) for q, c in zip(of, self.at(of, draw)))
        image = image + draw(0, 0.8) * self.random.normal(size=image.shape) + draw(0, 0.3) * self.random.normal(size=(len(n), 1))
        image = image + draw(-2, 2) * x / self.size + draw(-2, 2) * y / self.size
        if kind == "grid":  # Of the electronics: at rest in the pixels, of a rectangle of about the atoms.
            a, b = (2 * math.pi / draw(0.19, 0.30, 2)) if self.random.random() < 0.5 else [2 * math.pi / draw(0.19, 0.30)] * 2
            image = image + draw(0.1, 0.6) * (numpy.cos(a * x + draw(0, 6)) + numpy.cos(b * y + draw(0, 6)))
        if kind == "root3":  # √3 × √3 R30° on the upper layer, in half of the frames with second harmonics.
            q = waves(math.sqrt(3) * HEX[upper], between @ own @ turn(orientation + math.pi / 6))
            at = self.at(q, draw)
            second = draw(0.1, 0.4) if self.random.random() < 0.5 else 0
            image = image + draw(0.1, 0.8) * sum(numpy.cos(phase(k) + c) + second * numpy.cos(2 * (phase(k) + c)) for k, c in zip(q, at))
        if kind == "adsorbate":  # Hexagonal, of 1.2 to 3 times the constant of the layer.
            q = waves(HEX[upper] * draw(1.2, 3), turn(draw(0, 3)))
            image = image + draw(0.1, 0.8) * sum(numpy.cos(phase(k)) for k in q)
        self.image = 1e-10 * image
        self.atoms = None
        if kind == "from":
            # The atoms of another frame: 10 nm, its own drift, gains that differ by 0.5 % along either axis.
            n = (numpy.arange(256) + 0.5) * 10 / 256
            x, y = numpy.meshgrid(n, n)
            true = numpy.linalg.inv(numpy.eye(2) + d + numpy.diag([normal(0.005), normal(0.005)])) @ numpy.array([x.ravel(), y.ravel()])
            true -= numpy.outer(DRIFT * self.random.normal(size=2) / 60 * LINE_TIME * 256 / 10, y.ravel())
            of = b[self.seen - 1]
            atoms = sum(numpy.cos(phase(q) + c) for q, c in zip(of, self.at(of, draw)))
            self.atoms = atoms + draw(0, 0.6) * self.random.normal(size=x.shape)
    @staticmethod
    def at(q, draw):
        """Phases of three waves that meet: the third is the second less the first."""
        a, b = draw(0, 2 * math.pi, 2)
        return a, b, b - a

def write_gsf(path, image, size):
    """A square image of this size in nm, row 0 the lowest line."""
    metres, (rows, columns) = size * 1e-9, image.shape
    head = f"Gwyddion Simple Field 1.0\nXRes = {columns}\nYRes = {rows}\nXReal = {metres:e}\nYReal = {metres:e}\nXYUnits = m\nZUnits = m\n".encode()
    path.write_bytes(head + b"\0" * (4 - len(head) % 4) + (1e-10 * image[::-1]).astype("<f4").tobytes())

def measure(job):
    kind, seed, program, ruler = job
    # Nothing but the sense of the twist tells the layers of equal kind apart.
    ruler = ruler or (["--ruler=1"] if kind == "tbg-1" else [])
    frame = Frame(kind, seed)
    made = pathlib.Path(os.environ["KEEP"]) / f"{kind}-{seed}" if "KEEP" in os.environ else pathlib.Path(tempfile.mkdtemp())
    made.mkdir(parents=True, exist_ok=True)
    numpy.save(made / "frame.npy", frame.image[::-1])
    if frame.atoms is not None:
        write_gsf(made / "atoms.gsf", frame.atoms, 10)
        ruler = ["--ruler-from", str(made / "atoms.gsf"), "--drift-prior", str(DRIFT)]
    upper, lower = frame.layers
    layers = ["--layers", upper if upper == lower else f"{upper}/{lower}"]
    command = [program, "analyze", str(made / "frame.npy"), "--size", f"{frame.size:.7f}nm", "--line-rate", str(1 / LINE_TIME), "--frame-direction", "up",
               *layers, *ruler, "--no-png", "--no-report", "--force", "--threads", "1", "--quiet", "--out", str(made / "results")]
    child = subprocess.run(command, capture_output=True, text=True)
    line = {"kind": kind, "seed": seed, "truth": frame.truth, "layers": frame.layers, "seen": frame.seen, "code": child.returncode, "said": child.stderr[-300:]}
    try:
        found = json.load(open(made / "results" / "results.json"))
        line["sets"] = [{k: s.get(k) for k in ("mean", "uncorrected", "ruler", "by_scanner")} for s in found["sets"]]
        line["caveats"] = [[c.get("severity"), c["code"]] for c in found["caveats"]]
    except OSError:
        pass
    if "KEEP" not in os.environ:
        shutil.rmtree(made)
    return line

def run(program, first, last, written, *rest):
    kinds = [k for k in rest if not k.startswith("--")] or ["tbg"]
    ruler = [k for k in rest if k.startswith("--")]
    jobs = [(kind, seed, program, ruler) for kind in kinds for seed in range(int(first), int(last) + 1)]
    with concurrent.futures.ProcessPoolExecutor(int(os.environ.get("JOBS", "1"))) as pool, open(written, "w") as out:
        for line in pool.map(measure, jobs):
            out.write(json.dumps(line) + "\n")
            out.flush()

def table(*files):
    lines = [json.loads(line) for file in files for line in open(file)]
    print("| kind | frames | by the atoms | by the scanner | no twist | median error (%) | largest (%) | median total (%) | rms error / total | sign of the mean strain | by the scanner: rms error / total | truth among the readings (3 σ) |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |")
    for kind in dict.fromkeys(line["kind"] for line in lines):
        of, found, signs = [l for l in lines if l["kind"] == kind], {True: [], False: []}, []
        listed = []
        for line in of:
            of_set = (line.get("sets") or [{}])[0]
            mean = of_set.get("mean")
            if mean is None or mean.get("twist_deg") is None:
                continue
            ruler = of_set.get("ruler") or {}
            ruled = ruler.get("used", False)
            truth, twist = line["truth"]["twist"], mean["twist_deg"]
            if twist.get("sigma_total") is None:
                continue
            if ruler and not ruled:
                tensor = ruler["mean"]["readings"]["strain_tensor"]
                offs = [(r["twist_deg"]["value"] - truth) / r["twist_deg"]["sigma_total"] for r in [tensor, *tensor["alternatives"]]]
                listed.append([min(offs, key=abs), 1])
            found[ruled].append([100 * abs(twist["value"] - truth) / truth, 100 * twist["sigma_total"] / truth])
            if ruled and abs(line["truth"]["mean"]) > 0.03:
                signs.append((mean["readings"]["strain_tensor"]["mean_strain_percent"]["value"] > 0) == (line["truth"]["mean"] > 0))
        rms = lambda some: f"{math.sqrt(numpy.mean([(e / t) ** 2 for e, t in some])):.2f}" if some else "–"
        by = found[True]
        e, t = numpy.array(by).T if by else (numpy.zeros(1), numpy.zeros(1))
        numbers = f"{numpy.median(e):.3f} | {e.max():.3f} | {numpy.median(t):.3f} | {rms(by)} | {sum(signs)}/{len(signs)}" if by else "– | – | – | – | –"
        none = len(of) - len(by) - len(found[False])
        inside = sum(abs(off) < 3 for off, _ in listed)
        among = f"{inside}/{len(listed)}" if listed else "–"
        print(f"| {kind} | {len(of)} | {len(by)} | {len(found[False])} | {none} | {numbers} | {rms(found[False])} | {among} |")

if __name__ == "__main__":
    table(*sys.argv[2:]) if sys.argv[1] == "table" else run(*sys.argv[1:])
