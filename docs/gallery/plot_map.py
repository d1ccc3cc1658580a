"""
A map of the twist, with its errors
===================================

The twist grows across the frame. The map follows it; the errors of the nodes are as large as the deviations from the truth.
"""

import matplotlib.pyplot as plt
import mg
import numpy as np

work = mg.workspace()
mg.simulate(
    work, "scans", "--scans", 2, "--pixels", 320, "--size", 180, 180, "--twist", 1.1, "--strain", 0.1, "--drift", 0.5, 0.2,
    "--noise", 1, "--sample", "twist-gradient:change=0.1,angle=30",
)
mg.run("map", "scans", "--out", "maps", "--no-png", "--quiet", folder=work)
found = mg.arrays(work, "maps/map.gwy")
good = found["mask"] == 0
twist, sigma = (np.where(good, found[name], np.nan) for name in ("twist", "twist_sigma"))
x, y = found["x_nm"], np.sort(found["y_nm"])
figure, axes = plt.subplots(1, 2, figsize=(8.4, 3.5), layout="constrained")
for ax, image, label in ((axes[0], twist, "twist (°)"), (axes[1], sigma, "its standard uncertainty (°)")):
    drawn = ax.imshow(image, origin="lower", extent=[x.min(), x.max(), y.min(), y.max()])
    ax.set(xlabel="x (nm)", ylabel="y (nm)")
    figure.colorbar(drawn, ax=ax, label=label)
plt.show()
