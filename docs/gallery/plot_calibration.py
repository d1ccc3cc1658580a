"""
A scanner that is wrong, calibrated
===================================

The position sensors of this scanner show lengths along x 3 % too short, along y 1.2 % too long, and axes 6 mrad from a right angle. The
moiré of a perfect sample then looks strained. Graphite, scanned with the same scanner, tells the distortion.
"""

import re

import matplotlib.pyplot as plt
import mg
import numpy as np

DISTORTION = np.array([[0.97, 0.003], [0.003, 1.012]])
work = mg.workspace()


def distorted(name, *options):
    """A simulated set whose sensors are passed through the distortion, as arrays."""
    mg.simulate(work, name, *options)
    folder = work / f"{name}-wrong"
    folder.mkdir()
    for scan in sorted((work / name).glob("*.spm")):
        held = mg.arrays(work, scan)
        x, y = held["Xsensor_trace"], held["Ysensor_trace"]
        wrong = np.tensordot(DISTORTION, np.stack([x, y]), axes=1)
        arrays = {"phase": held["TR_Phase_trace"], "xs": wrong[0], "ys": wrong[1]}
        np.savez(folder / f"{scan.stem}.npz", **{key: value[::-1] for key, value in arrays.items()})
    return sorted(folder.glob("*.npz"))


told = ("--x-sensor", "xs", "--y-sensor", "ys", "--sensor-unit", "nm", "--line-rate", 8, "--channel", "phase",
        "--frame-direction", "alternating-up")
moire = distorted("moire", "--scans", 4, "--pixels", 160)
hopg = distorted("hopg", "--atoms", 1, "--size", 5, 5, "--scans", 2, "--pixels", 160)
said = mg.run("calibrate", *hopg, "--material", "graphite", "--out", "scanner.toml", *told, "--size", "5nm×5nm", folder=work)
print("\n".join(line for line in said.splitlines() if re.match("  (gain|mismatch|orthogonality)", line)))
wrong = mg.analyze(work, *moire, *told, "--size", "70nm×70nm")["sets"][0]["mean"]
right = mg.analyze(work, *moire, *told, "--size", "70nm×70nm", "--calibration", "scanner.toml", out="out2")["sets"][0]["mean"]

figure, axes = plt.subplots(1, 2, figsize=(7, 3), layout="constrained")
for ax, key, truth, label in zip(axes, ("twist_deg", "heterostrain_percent"), (1.13, 0.12), ("twist (°)", "heterostrain (%)")):
    for i, (mean, colour) in enumerate(((wrong, mg.DOWN), (right, mg.UP))):
        ax.errorbar(i, mean[key]["value"], mean[key]["sigma_total"], fmt="o", capsize=4, color=colour)
    ax.axhline(truth, color=mg.LINE, lw=0.8)
    ax.set(xticks=[0, 1], xticklabels=["as shown", "calibrated"], xlim=(-0.5, 1.5), ylabel=label)
plt.show()
