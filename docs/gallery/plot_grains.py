"""
Two grains in one frame
=======================

Two lattices lie side by side. Each grain is a set of its own. The caveat ``several-grains`` says how they compare. The map masks the
boundary and what lies beyond it.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
mg.simulate(
    work, "scans", "--scans", 2, "--pixels", 320, "--size", 160, 160, "--noise", 0.5, "--strain", 0.05,
    "--sample", "grains:share=0.65,angle=20,twist=0.12,turn=6",
)
found = mg.analyze(work, "scans")
print("caveats:", ", ".join(mg.codes(found)))
for each in found["sets"]:
    print(each["name"], "twist:", each["mean"]["twist_deg"]["value"])
mg.run("map", "scans", "--out", "maps", "--quiet", folder=work, fails=True)
figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
mg.show(work / "maps/figures/map-image.png", axes[0], "the first scan")
mg.show(work / "maps/figures/map-twist.png", axes[1], "map of the twist")
plt.show()
