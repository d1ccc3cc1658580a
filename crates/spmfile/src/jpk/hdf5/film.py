"""Writes film.h5-jpk and single.h5-jpk, which the tests read, with h5py: film.py FOLDER

Arrays and attributes are those that public readers of the format ask for. A count is 100 × line + column, line 0 at the bottom, plus
10000 for each channel and 1000000 for each frame.
"""

import sys
from pathlib import Path

import h5py
import numpy as np

COLUMNS, ROWS = 5, 3
CHANNELS = [("height", False, 1.5e-11, 2e-7, "m"), ("height", True, 1.5e-11, 2e-7, "m"), ("phase", False, 0.01, -180.0, "deg")]


def write(path: Path, frames: int, kind: str, text, **packed) -> None:
    with h5py.File(path, "w", libver=kind) as file:
        measurement = file.create_group("Measurement_000")
        grid = {"ilength": np.int32(COLUMNS), "jlength": np.int32(ROWS), "ulength": 100e-9, "vlength": 60e-9, "theta": 0.5}
        for key, value in grid.items():
            measurement.attrs[f"position-pattern.grid.{key}"] = value
        measurement.attrs["timing-settings.scanRate"] = 4.0
        for number, (name, retrace, multiplier, offset, unit) in enumerate(CHANNELS):
            channel = measurement.create_group(f"Channel_{number:03d}")
            channel.attrs["channel.name"] = text(name)
            channel.attrs["retrace"] = text("true" if retrace else "false")
            channel.attrs["net-encoder.scaling.multiplier"] = multiplier
            channel.attrs["net-encoder.scaling.offset"] = offset
            channel.attrs["net-encoder.scaling.unit.unit"] = text(unit)
            line, column = np.mgrid[:ROWS, :COLUMNS]
            counts = [(100 * line + column + 10000 * number + 1000000 * frame).ravel() for frame in range(frames)]
            data = np.stack(counts, axis=1).astype("<i4" if unit == "m" else "<f4")
            channel.create_dataset(name.capitalize(), data=data, **packed)


folder = Path(sys.argv[1])
write(folder / "film.h5-jpk", 2, "earliest", np.bytes_, chunks=(7, 1), compression="gzip", shuffle=True)
write(folder / "single.h5-jpk", 1, "latest", str)
