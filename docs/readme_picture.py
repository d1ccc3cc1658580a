"""Makes docs/readme.png: two frames as scanned, the same with the drift taken off, and the map of the twist.

MOIREGAUGE_PROGRAM=PROGRAM python3 docs/readme_picture.py      (needs matplotlib)
"""

import json
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from PIL import Image

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "gallery"))
import mg  # noqa: E402

EXTENT = 36


def composite(up, down):
    """Up in orange, down in blue; where both agree, light grey."""
    both = np.isfinite(up) & np.isfinite(down)

    def level(image):
        low, high = np.percentile(image[both], [20, 99.5])
        return np.clip((np.nan_to_num(image, nan=low) - low) / (high - low), 0, 1)

    up, down = level(up), level(down)
    return np.clip(np.stack([up, 0.5 * (up + down), down], axis=-1), 0, 1)


def panel(ax, first, second, title):
    """Two frames of one place on one another."""
    x, y = first["x_nm"], first["y_nm"]
    picture = composite(first["image"], second["image"])
    ax.imshow(picture, origin="lower", extent=[x.min(), x.max(), y.min(), y.max()], interpolation="bilinear")
    ax.set(xlim=(-EXTENT, EXTENT), ylim=(-EXTENT, EXTENT), xlabel="x (nm)", ylabel="y (nm)", title=title)


def main():
    """Simulates, analyses, maps, draws."""
    work = mg.workspace()
    mg.simulate(
        work, "tbg", "--scans", 2, "--pixels", 384, "--rate", 2, "--size", 120, 120, "--twist", 1.1, "--strain", 0.15,
        "--strain-axis", 20, "--lattice-angle", 8, "--drift", 4, -2.5, "--noise", 0.6, "--sharpness", 0.3,
        "--sample", "twist-gradient:change=0.12,angle=35",
    )
    mg.run("analyze", "tbg", "--out", "out", "--export", "corrected.npz", "--quiet", "--no-report", folder=work)
    drift = json.loads((work / "out/results.json").read_text())["sets"][0]["drift"]
    mg.run("map", "tbg", "--out", "maps", "--quiet", "--no-png", "--margin", 1, folder=work)
    figure, axes = plt.subplots(1, 3, figsize=(11, 3.7), layout="constrained")
    raw = [mg.arrays(work, f"tbg/scan.00{i}.spm") for i in (0, 1)]
    for scan in raw:
        scan["image"] = scan["TR_Phase_trace"]
        scan["x_nm"], scan["y_nm"] = scan["Xsensor_trace"].mean(axis=0), scan["Ysensor_trace"].mean(axis=1)
    panel(axes[0], *raw, "as scanned: up (orange) and down (blue)")
    rest = [mg.loaded(next((work / "out/corrected").glob(f"scan.00{i}*-trace.npz"))) for i in (0, 1)]
    # Each frame is put where the sample was at the middle of its time; the second follows 192 s later.
    for name in ("x_nm", "y_nm"):
        rest[1][name] = rest[1][name] - drift[f"{name[0]}_nm_per_min"]["value"] * 192 / 60
    shared = shared_grid(*rest)
    panel(axes[1], *shared, "drift measured and removed")
    found = mg.arrays(work, "maps/map.gwy")
    twist = next(value for name, value in found.items() if name.lower().startswith("twist"))
    x, y = found["x_nm"], found["y_nm"]
    image = axes[2].imshow(twist, origin="lower", extent=[x.min(), x.max(), y.min(), y.max()], cmap="viridis")
    axes[2].contour(x, np.sort(y), twist, 5, colors="white", linewidths=0.6)
    axes[2].set(xlim=(-EXTENT, EXTENT), ylim=(-EXTENT, EXTENT), xlabel="x (nm)", title="map of the twist")
    figure.colorbar(image, ax=axes[2], label="twist (°)")
    figure.savefig(work / "readme.png", dpi=100)
    with Image.open(work / "readme.png") as picture:
        picture.convert("RGB").quantize(255).save(HERE / "readme.png", optimize=True)


def shared_grid(first, second):
    """The second image on the pixels of the first (both are square grids of one pitch)."""
    def take(image):
        col = np.round(np.interp(first["x_nm"], image["x_nm"], np.arange(image["x_nm"].size), -1, -1)).astype(int)
        y = np.sort(image["y_nm"])
        row = np.round(np.interp(np.sort(first["y_nm"]), y, np.arange(y.size), -1, -1)).astype(int)
        values = image["TR_Phase"][np.ix_(row, col)]
        values[row < 0, :] = np.nan
        values[:, col < 0] = np.nan
        return {"x_nm": first["x_nm"], "y_nm": np.sort(first["y_nm"]), "image": values}

    return take(first), take(second)


main()
