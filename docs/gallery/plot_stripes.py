"""
Stripes have a wavelength and no twist
======================================

One wave vector is not enough for twist and strain. The map gives wavelength and direction of the stripes, and the caveat
``stripes-only``.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
mg.simulate(
    work, "scans", "--scans", 1, "--pixels", 256, "--size", 100, 100, "--noise", 0.5,
    "--sample", "bare+stripes:wavelength=6.3,angle=35",
)
said = mg.run("map", "scans", "--out", "maps", folder=work)
print("\n".join(said.splitlines()[:6]))
figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
axes[0].imshow(mg.arrays(work, "scans/scan.000.spm")["TR_Phase_trace"], origin="lower", cmap="viridis")
axes[0].set(title="the scan", xticks=[], yticks=[])
figures = sorted(path for path in (work / "maps/figures").glob("*.png") if "stripe" in path.name or "wavelength" in path.name)
mg.show(figures[0], axes[1])
plt.show()
