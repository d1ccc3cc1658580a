"""
Window, noise and blur
======================

A narrow window follows the sample but also the noise; a wide one smooths both. Halving the width costs a factor of four in noise.
Nodes where the window blurs the lattice too much are masked. Without ``--window`` the program takes the widest one whose blur stays
near a quarter of the noise.
"""

import matplotlib.pyplot as plt
import mg
import numpy as np

work = mg.workspace()
mg.simulate(
    work, "scans", "--scans", 1, "--pixels", 320, "--size", 200, 200, "--twist", 1.2, "--strain", 0, "--drift", 0, 0,
    "--noise", 1.5, "--sample", "twist-wave:amplitude=0.03,wavelength=90,angle=0",
)
figure, axes = plt.subplots(1, 3, figsize=(9.5, 3.2), layout="constrained", sharey=True)
for ax, window in zip(axes, (7, 8.5, 10)):
    mg.run("map", "scans", "--out", f"w{window}", "--window", window, "--margin", 1, "--drift", 0, 0, "--drift-sigma", 0.01, "--no-png",
           "--quiet", folder=work)
    found = mg.arrays(work, f"w{window}/map.gwy")
    x, y = found["x_nm"], np.sort(found["y_nm"])
    drawn = ax.imshow(np.where(found["mask"] == 0, found["twist"], np.nan), origin="lower", extent=[x.min(), x.max(), y.min(), y.max()], vmin=1.16, vmax=1.24)
    ax.set(title=f"window {window} nm", xlabel="x (nm)")
axes[0].set_ylabel("y (nm)")
figure.colorbar(drawn, ax=axes, label="twist (°)")
plt.show()
