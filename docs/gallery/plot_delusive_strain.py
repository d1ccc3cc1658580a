"""
Pitfall: atoms and moiré in one image
=====================================

STM images show the atoms and the moiré. Phase analysis of the atoms can then show a strain that does not exist ("delusive" strain,
arXiv:2309.01584). Here the layers are rigid and perfect, with atoms as strong as the moiré: the map of the moiré must be flat.
"""

import matplotlib.pyplot as plt
import mg
import numpy as np

work = mg.workspace()
mg.simulate(
    work, "scans", "--scans", 1, "--pixels", 512, "--size", 45, 45, "--twist", 3, "--strain", 0, "--drift", 0, 0,
    "--noise", 0.3, "--sample", "atoms:ratio=1",
)
said = mg.run("map", "scans", "--out", "maps", "--drift", 0, 0, "--drift-sigma", 0.01, "--no-png", folder=work, fails=True)
print("\n".join(line for line in said.splitlines() if line.startswith(("  good", "  twist            3", "  strain           "))))
image = mg.arrays(work, "scans/scan.000.spm")
found = mg.arrays(work, "maps/map.gwy")
figure, axes = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
axes[0].imshow(image["TR_Phase_trace"][200:300, 200:300], origin="lower", cmap="viridis")
axes[0].set(title="atoms and moiré (part of the frame)", xticks=[], yticks=[])
twist = found["twist"][found["mask"] == 0]
axes[1].hist(twist[np.isfinite(twist)] - 3, bins=30, color=mg.UP)
axes[1].axvline(0, color=mg.LINE, lw=0.8)
axes[1].set(title="map: twist of the nodes", xlabel="twist of a node − true twist (°)", yticks=[])
plt.show()
