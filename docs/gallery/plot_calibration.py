"""
A scanner that is wrong, calibrated
===================================

This scanner has no position sensors. Its frames are 3.1 % wider than it says, 1.2 % less high, and 6 mrad from a right angle, so
lengths appear too short along x and too long along y. An image of graphite from the same scanner gives the distortion.
"""

import re

import matplotlib.pyplot as plt
import mg

work = mg.workspace()


def distorted(name, *options):
    """A simulated set without position sensors: only the nominal coordinates are there, and they are wrong."""
    settings = mg.run("simulate", "--print-config", folder=work)
    settings = re.sub(r"gain = .*", "gain = [1.031, 0.988]", settings).replace("shear_mrad = 2.0", "shear_mrad = 6.0")
    (work / "wrong.toml").write_text(settings)
    mg.simulate(work, name, "--config", "wrong.toml", "--no-sensors", *options)


distorted("moire", "--scans", 4, "--pixels", 192, "--size", 60, 60)
distorted("hopg", "--atoms", 1, "--size", 5, 5, "--scans", 2, "--pixels", 192)
said = mg.run("calibrate", "hopg", "--material", "graphite", "--out", "scanner.toml", folder=work)
print("\n".join(line for line in said.splitlines() if re.match("  (gain|mismatch|orthogonality)", line)))
wrong = mg.analyze(work, "moire")["sets"][0]["mean"]
right = mg.analyze(work, "moire", "--calibration", "scanner.toml", out="out2")["sets"][0]["mean"]

figure, axes = plt.subplots(1, 2, figsize=(7, 3), layout="constrained")
for ax, key, truth, label in zip(axes, ("twist_deg", "heterostrain_percent"), (1.13, 0.12), ("twist (°)", "heterostrain (%)")):
    for i, (mean, colour) in enumerate(((wrong, mg.DOWN), (right, mg.UP))):
        ax.errorbar(i, mean[key]["value"], mean[key]["sigma_total"], fmt="o", capsize=4, color=colour)
    ax.axhline(truth, color=mg.LINE, lw=0.8)
    ax.set(xticks=[0, 1], xticklabels=["as shown", "calibrated"], xlim=(-0.5, 1.5), ylabel=label)
plt.show()
