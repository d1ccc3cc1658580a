"""What the scripts of the gallery share: they run the program, read what it writes, and draw."""

import atexit
import json
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

PROGRAM = os.environ.get("MOIREGAUGE_PROGRAM", "moiregauge")
UP, DOWN, LINE, FAINT = "#0072b2", "#d55e00", "#222222", "#999999"
plt.rcParams.update({"figure.dpi": 110, "font.size": 9, "axes.spines.top": False, "axes.spines.right": False})


def workspace():
    """A folder that vanishes when the script has ended."""
    path = Path(tempfile.mkdtemp(prefix="moiregauge-"))
    atexit.register(shutil.rmtree, path, ignore_errors=True)
    return path


def run(*words, folder, fails=False):
    """`moiregauge WORDS` in a folder; what it printed."""
    done = subprocess.run([PROGRAM, *map(str, words)], cwd=folder, capture_output=True, text=True)
    if done.returncode != 0 and not fails:
        raise RuntimeError(f"{words}: {done.stderr}")
    return done.stdout + (done.stderr if fails else "")


def simulate(folder, name, *options):
    """A simulated set in `folder/name`, and its truth."""
    run("simulate", "--out", ".", "--name", name, "--force", *options, folder=folder)
    return json.loads((folder / name / "truth.json").read_text())


def analyze(folder, *words, out="out"):
    """`results.json` of an analysis."""
    run("analyze", *words, "--out", out, "--no-report", "--quiet", "--force", folder=folder, fails=True)
    return json.loads((folder / out / "results.json").read_text())


def codes(document):
    """The codes of all caveats in a document."""
    return sorted({c["code"] for c in document["caveats"]})


def moire(folder, *words):
    """`moiregauge moire --json`."""
    return json.loads(run("moire", "--json", *words, folder=folder))


def arrays(folder, scan):
    """The channels of a file as arrays by name, bottom line first, with `x_nm` and `y_nm`."""
    out = folder / (Path(scan).stem + "-read.npz")
    run("convert", scan, out.name, "--force", "--quiet", folder=folder)
    return loaded(out)


def loaded(path):
    """The arrays of an `.npz` that the program wrote, bottom line first."""
    with np.load(path) as found:
        names = [name for name in found.files if not name.endswith(".txt")]
        return {name: found[name][::-1] if found[name].ndim == 2 else found[name] for name in names}


def show(path, ax=None, title=None):
    """A figure that the program drew."""
    ax = ax or plt.gca()
    ax.imshow(plt.imread(path), interpolation="lanczos")
    ax.axis("off")
    if title:
        ax.set_title(title)
    return ax
