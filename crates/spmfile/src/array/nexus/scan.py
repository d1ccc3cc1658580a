"""Writes scan.nxs and array.h5, which the tests read, with h5py: scan.py FOLDER

Groups and attributes are those of the NeXus manual. A sample is 100 × line + column, line 0 at the bottom, plus 10000 for each bias.
"""

import sys
from pathlib import Path

import h5py
import numpy as np

COLUMNS, ROWS = 5, 3
line, column = np.mgrid[:ROWS, :COLUMNS]
SAMPLES = 100.0 * line + column


def data(entry, name: str, signal: str, samples, axes: dict, unit: str, **packed):
    group = entry.create_group(name)
    group.attrs["NX_class"] = "NXdata"
    group.attrs["signal"] = signal
    group.attrs["axes"] = list(axes)
    array = group.create_dataset(signal, data=samples, **packed)
    array.attrs["units"] = unit
    for key, (positions, unit) in axes.items():
        group[key] = positions
        group[key].attrs["units"] = unit


folder = Path(sys.argv[1])
x, y, bias = 2e-9 * np.arange(COLUMNS), 30.0 * np.arange(ROWS), np.array([-0.5, 0.1])
with h5py.File(folder / "scan.nxs", "w") as file:
    entry = file.create_group("entry")
    entry.attrs["NX_class"] = "NXentry"
    # From the top down, compressed.
    data(entry, "topography", "data", SAMPLES[::-1].astype("<f4"), {"y": (y[::-1], "angstrom"), "x": (x, "m")}, "m", chunks=(2, 5), compression="gzip")
    # The first dimension is x.
    data(entry, "map", "current", SAMPLES.T[::-1].astype(">i2"), {"x": (x[::-1], "m"), "y": (y, "angstrom")}, "A")
    stack = SAMPLES[:, :, np.newaxis] + 10000.0 * np.arange(2)
    data(entry, "spectra", "didv", stack, {"y": (y, "angstrom"), "x": (x, "m"), "bias": (bias, "V")}, "S")
    data(entry, "spectrum", "curve", np.arange(4.0), {"bias": (np.arange(4.0), "V")}, "A")
    entry["topography/again"] = h5py.SoftLink("/entry/map/current")
with h5py.File(folder / "array.h5", "w", libver="latest") as file:
    file.create_dataset("results/height", data=SAMPLES[::-1])
    file.create_dataset("results/times", data=np.arange(3.0))
with h5py.File(folder / "two.h5", "w") as file:
    file.create_dataset("height", data=SAMPLES)
    file.create_dataset("phase", data=SAMPLES)
