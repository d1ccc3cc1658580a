"""Recorded images as they are, mirrored, upside down, transposed, and with noise of a tenth of their contrast: the same lattice?

  python3 docs/mirrored.py PROGRAM FILE[:CHANNEL]…        (a table; needs NumPy)

Each image is written by `moiregauge convert` as arrays, changed, and analysed with its size. A row has the three shortest vectors, shortest first, and their
largest statistical error, nm, or what the program says where it refuses.
"""

import json
import pathlib
import subprocess
import sys
import tempfile

import numpy

NOISE = 0.1
VARIANTS = {
    "as it is": lambda image, noise: image,
    "mirrored": lambda image, noise: image[:, ::-1],
    "upside down": lambda image, noise: image[::-1],
    "transposed": lambda image, noise: image.T,
    "with noise": lambda image, noise: image + NOISE * numpy.nanstd(image) * noise.standard_normal(image.shape),
}


def image_of(program, file, channel, folder):
    """The channel of that name, or the first, and its width and height, nm."""
    arrays = folder / "arrays.npz"
    subprocess.run([program, "convert", file, str(arrays), "--force", "--quiet"], check=True)
    with numpy.load(arrays) as data:
        names = [name for name in data.files if not name.endswith(".txt") and data[name].ndim == 2 and channel in name]
        image = numpy.asarray(data[names[0]], float)
        extent = lambda places: float(numpy.ptp(places)) * places.size / (places.size - 1)
        return image, extent(data["x_nm"]), extent(data["y_nm"])


def vectors(program, image, width, height, folder):
    array, out = folder / "image.npy", folder / "out"
    numpy.save(array, numpy.ascontiguousarray(image))
    done = subprocess.run([program, "analyze", str(array), "--size", f"{width}nm×{height}nm", "--out", str(out), "--no-png", "--no-report", "--quiet", "--force"],
                          capture_output=True, text=True)
    if done.returncode != 0:
        return (done.stderr.strip().splitlines() or ["refused"])[-1]
    lengths = [vector["sensor"]["wavelength_nm"] for vector in json.loads((out / "results.json").read_text())["sets"][0]["scans"][0]["vectors"]]
    shown = ", ".join(f"{length:.4g}" for length in sorted(length["value"] for length in lengths))
    return f"{shown} ± {max(length['sigma'] or 0 for length in lengths):.2g}"


def main(program, *files):
    print("| image | " + " | ".join(VARIANTS) + " |\n|" + " --- |" * (1 + len(VARIANTS)))
    for file, _, channel in (name.partition(":") for name in files):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            image, width, height = image_of(program, file, channel, folder)
            cells = [pathlib.Path(file).name]
            for name, variant in VARIANTS.items():
                size = (height, width) if name == "transposed" else (width, height)
                cells.append(vectors(program, variant(image, numpy.random.default_rng(1)), *size, folder))
            print("| " + " | ".join(cells) + " |", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
