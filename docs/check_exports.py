"""What moiregauge writes, seen by independent readers: numpy, gwyfile, tifffile, xarray (zarr), pyarrow, jsonschema.

Called by check_exports.sh with a folder of its making. Every file is compared with the same scan
converted to .npz or with the CSV tables; the .npz itself with the raw counts that the simulator wrote.
"""

import csv
import json
import re
import sys
from pathlib import Path

import gwyfile
import jsonschema
import numpy as np
import pyarrow.parquet as pq
import tifffile
import xarray as xr

folder = Path(sys.argv[1])
checks = 0


def check(condition, words):
    global checks
    checks += 1
    if not condition:
        sys.exit(f"FAILED: {words}")


def close(a, b, relative, words):
    a, b = np.asarray(a, float), np.asarray(b, float)
    check(a.shape == b.shape, f"{words}: shape {a.shape} for {b.shape}")
    check((np.isnan(a) == np.isnan(b)).all(), f"{words}: other samples are missing")
    scale = np.nanmax(np.abs(b)) if b.size else 1.0
    worst = np.nanmax(np.abs(a - b)) if b.size else 0.0
    check(worst <= relative * scale, f"{words}: {worst} apart of {scale}")


def to_si(unit):
    return {"nm": (1e-9, "m"), "°": (1.0, "deg"), "V": (1.0, "V"), "mV": (1e-3, "V")}[unit]


def about(archive, name):
    text = archive[f"{name}.txt"].decode()
    return dict(line.split(" = ", 1) for line in text.splitlines() if " = " in line)


def raw_channels(path):
    """The counts of a NanoScope file, by its header and nothing else: bottom line first, turned."""
    data = path.read_bytes()
    header = data.split(b"\x1a", 1)[0].decode("latin-1")
    blocks = re.split(r"\\\*Ciao image list", header)[1:]
    for block in blocks:
        field = lambda key: re.search(rf"\\{key}: *(\S+)", block).group(1)
        rows, columns = int(field("Number of lines")), int(field("Samps/line"))
        offset, length = int(field("Data offset")), int(field("Data length"))
        kind = {2: "<i2", 4: "<i4"}[length // (rows * columns)]
        counts = np.frombuffer(data, kind, rows * columns, offset).reshape(rows, columns)
        yield counts[::-1].astype(float)


scan = next(folder.glob("scans/*/*.0_00000.spm"), None) or sorted(folder.glob("scans/**/*.spm"))[0]
out = folder / "converted"
archive = np.load(out / "scan.npz")
names = [n for n in archive.files if not n.endswith(".txt") and n not in ("x_nm", "y_nm")]
told = {name: about(archive, name) for name in names}
x, y = archive["x_nm"], archive["y_nm"]
check(len(names) >= 4, f"numpy: {names}")
check(np.all(np.diff(x) > 0) and np.all(np.diff(y) < 0), "numpy: x rises, y falls from the top")

# numpy against the counts of the instrument's file: values are counts times a scale.
raw = list(raw_channels(scan))
check(len(raw) == len(names), f"numpy: {len(names)} arrays for {len(raw)} channels")
for name, counts in zip(names, raw):
    values = archive[name]
    check(values.shape == counts.shape, f"numpy: {name} has shape {values.shape}")
    scale = (values * counts).sum() / (counts * counts).sum()
    close(values, scale * counts, 1e-9, f"numpy: {name} is no multiple of its counts")

# Gwyddion containers.
container = gwyfile.load(str(out / "scan.gwy"))
fields = gwyfile.util.get_datafields(container)
titles = [container[f"/{i}/data/title"] for i in range(len(names))]
check(len(titles) == len(names), "gwyfile: number of channels")
for i, name in enumerate(names):
    field = container[f"/{i}/data"]
    factor, unit = to_si(told[name]["spmfile unit"])
    close(field.data, archive[name] * factor, 1e-12, f"gwyfile: {name}")
    check(field.si_unit_z["unitstr"] == unit, f"gwyfile: {name} is in {field.si_unit_z}")
    check(field.si_unit_xy["unitstr"] == "m", "gwyfile: lengths in m")
    check(titles[i] == told[name]["spmfile name"], f"gwyfile: {titles[i]}")
    close(field.xreal / field.data.shape[1], (x[1] - x[0]) * 1e-9, 1e-9, "gwyfile: pitch along x")
    close(field.yreal / field.data.shape[0], (y[0] - y[1]) * 1e-9, 1e-9, "gwyfile: pitch along y")
    middle = (x[0] + x[-1]) / 2 * 1e-9
    close(field.xoff + field.xreal / 2, middle, 1e-9, "gwyfile: centre")

# TIFF, single precision.
with tifffile.TiffFile(out / "scan.tiff") as tiff:
    check(len(tiff.pages) == len(names), "tifffile: number of pages")
    for page, name in zip(tiff.pages, names):
        check(page.dtype == np.float32, f"tifffile: {page.dtype}")
        close(page.asarray(), archive[name], 1e-6, f"tifffile: {name}")
        n, d = page.tags["XResolution"].value
        close(d / n, x[1] - x[0], 1e-6, "tifffile: pitch")
        shape = f"spmfile shape = {page.shape[0]} {page.shape[1]}"
        check(shape in page.description, "tifffile: description")

# Text.
for name in names:
    matrix = np.loadtxt(out / f"scan-{name}.csv", delimiter=",")
    close(matrix, archive[name], 0.0, f"loadtxt: {name}")

# Zarr through xarray; y upwards.
group = xr.open_zarr(out / "scan.zarr", consolidated=False)
check(group.attrs["spmfile format"].startswith("NanoScope"), "xarray: attributes of the group")
for name in names:
    array = group[name]
    check(array.dims == ("y", "x"), f"xarray: {array.dims}")
    check(array.attrs["units"] == told[name]["spmfile unit"], f"xarray: {array.attrs}")
    check(array.attrs["long_name"] == told[name]["spmfile name"], "xarray: long_name")
    close(array.values[::-1], archive[name], 0.0, f"xarray: {name}")
close(group["x"].values, x, 0.0, "xarray: x")
close(group["y"].values[::-1], y, 0.0, "xarray: y")
check(group["x"].attrs["units"] == "nm", "xarray: unit of x")

# Point clouds: the layout by Gwyddion's description, read with numpy alone.
for line in ("trace", "retrace"):
    data = (out / f"scan-{line}.gxyzf").read_bytes()
    end = data.index(b"\0")
    header = dict(l.split(" = ", 1) for l in data[:end].decode().splitlines()[1:])
    channels, points = int(header["NChannels"]), int(header["NPoints"])
    start = (end // 8 + 1) * 8
    cloud = np.frombuffer(data, "<f8", points * (channels + 2), start).reshape(points, -1)
    check(len(data) == start + 8 * cloud.size, "gxyzf: length")
    sensor = next(n for n in names if re.match(rf"x_?sensor_{line}", n, re.I))
    # The bottom line comes first.
    close(cloud[:, 0] * 1e9, archive[sensor][::-1].ravel(), 1e-12, f"gxyzf: {sensor}")

# Corrected images: one grid in every format, y upwards, positions absolute.
results = json.loads((folder / "results" / "results.json").read_text())
images = sorted((folder / "results" / "corrected").glob("*.npz"))
scans = sum(len(s["scans"]) for s in results["sets"])
check(len(images) == 2 * scans, f"{len(images)} corrected images of {scans} scans")
for path in images:
    image = np.load(path)
    (name,) = [n for n in image.files if not n.endswith(".txt") and n not in ("x_nm", "y_nm")]
    lines = about(image, name)
    check("moiregauge drift (nm/min)" in lines, f"{path.name}: {lines}")
    check(lines["spmfile rotation (rad)"] == "0", f"{path.name}: turned")
    check("spmfile line rate (Hz)" not in lines, f"{path.name}: has times")
    field = gwyfile.load(str(path.with_suffix(".gwy")))["/0/data"]
    close(field.data, image[name] * to_si(lines["spmfile unit"])[0], 1e-12, path.name)
    close(field.xreal / field.data.shape[1], field.yreal / field.data.shape[0], 1e-12, f"{path.name}: square")
    array = xr.open_zarr(path.with_suffix(".zarr"), consolidated=False)[name]
    close(array.values[::-1], image[name], 0.0, path.name)
    share = np.isfinite(image[name]).mean()
    check(0.8 < share <= 1.0, f"{path.name}: {share} of the samples are there")

# Tables.
for table in ("vectors", "scans", "sets", "budget"):
    parquet = pq.read_table(folder / "results" / f"{table}.parquet")
    with open(folder / "results" / f"{table}.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    check(parquet.num_rows == len(rows), f"pyarrow: {table} has {parquet.num_rows} rows")
    check(parquet.column_names == list(rows[0]), f"pyarrow: columns of {table}")
    for name in parquet.column_names:
        for cell, row in zip(parquet[name].to_pylist(), rows):
            text = row[name]
            same = {
                type(None): lambda: text == "",
                bool: lambda: text == str(cell).lower(),
                int: lambda: int(text) == cell,
                float: lambda: float(text) == cell,
                str: lambda: text == cell,
            }[type(cell)]()
            check(same, f"pyarrow: {table}.{name}: {cell!r} for {text!r}")

# Maps: tables against arrays, the undistorted image in two formats, the registry against its own definition.
maps = folder / "maps"
whole = xr.open_zarr(maps / "map.zarr", consolidated=False)
shown = xr.open_zarr(maps / "map.zarr", group="undistorted", consolidated=False)["image"]
cell = xr.open_zarr(maps / "map.zarr", group="cell", consolidated=False)
details = json.loads((maps / "map.json").read_text())["details"]
field = gwyfile.load(str(maps / "undistorted.gwy"))["/0/data"]
close(field.data, shown.values[::-1] * to_si(shown.attrs["units"])[0], 1e-12, "undistorted image")
pitch = details["pattern"]["undistorted"]["pitch_nm"]
step = np.diff(shown["x"].values)
close(step, np.full(step.shape, pitch), 1e-9, "undistorted image: x")
close(shown["y"].values[0], details["pattern"]["undistorted"]["origin_nm"][1], 1e-9, "undistorted image: y")

table = np.genfromtxt(maps / "cell.csv", delimiter=",", names=True)
for column, array in (("mean", "mean"), ("sigma", "sigma"), ("pixels", "pixels"), ("x_nm", "position_x")):
    close(table[column], cell[array].values.ravel(), 0.0, f"cell.csv: {column}")

table = np.genfromtxt(maps / "displacement.csv", delimiter=",", names=True)
for column, array in (("x_nm", "position_x"), ("mask", "mask")):
    close(table[column], whole[array].values.ravel(), 0.0, f"displacement.csv: {column}")
known = np.isfinite(table["registry_x_nm"])
check(known.sum() > 20 and not table["mask"][known].any(), "displacement.csv: known nodes")
for axis in "xy":
    for what in ("displacement", "registry"):
        close(table[f"{what}_{axis}_nm"][known], whole[f"{what}_{axis}"].values.ravel()[known], 1e-6, f"{what} {axis}")
place = np.column_stack([table[f"{axis}_nm"] - table[f"displacement_{axis}_nm"] for axis in "xy"])
told = details["registry"]
shares = np.linalg.solve(np.transpose(told["moire_vectors_nm"]), (place - told["zero_nm"]).T)
registry = -np.transpose(told["layer_1_vectors_nm"]) @ shares
for n, axis in enumerate("xy"):
    miss = np.abs(registry[n] - table[f"registry_{axis}_nm"])[known].max()
    check(miss < 1e-6, f"registry {axis} by its definition: {miss} nm")

schemas = Path(__file__).resolve().parent.parent / "crates/moiregauge-report/schema"
for name, document in (("results", folder / "results/results.json"), ("map", maps / "map.json")):
    schema = json.loads((schemas / f"{name}-1.schema.json").read_text())
    validator = jsonschema.validators.validator_for(schema)
    validator.check_schema(schema)
    wrong = [error.message for error in validator(schema).iter_errors(json.loads(document.read_text()))]
    check(not wrong, f"{document.name} by its schema: {wrong[:3]}")

print(f"{checks} comparisons agree")
