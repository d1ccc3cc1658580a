"""
Where to put a device
=====================

``map --device`` tries a box at every node and in all orientations. The boxes are ranked by the upper limit of the spread of the twist.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
mg.simulate(
    work, "scans", "--scans", 2, "--pixels", 320, "--size", 200, 200, "--twist", 1.1, "--drift", 0.5, 0.2, "--noise", 0.7,
    "--sample", "twist-wave:amplitude=0.03,wavelength=200,angle=60",
)
mg.run("map", "scans", "--out", "maps", "--device", "50nm×25nm", "--quiet", folder=work)
figure, ax = plt.subplots(figsize=(6, 5), layout="constrained")
mg.show(work / "maps/figures/map-overlays.png", ax)
plt.show()
