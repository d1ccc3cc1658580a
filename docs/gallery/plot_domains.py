"""
Small angles: nodes and triangles
=================================

At 0.25° the layers relax into triangular domains. The program finds the nodes, joins them to triangles, and gives twist and strain of
each.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
mg.simulate(
    work, "scans", "--scans", 1, "--pixels", 384, "--size", 520, 520, "--twist", 0.25, "--strain", 0.04, "--drift", 0, 0,
    "--noise", 0.4, "--sample", "walls:width=3",
)
said = mg.run(
    "map", "scans", "--out", "maps", "--domains", "on", "--nodes", "bright", "--drift", 0, 0, "--drift-sigma", 0.01, folder=work,
)
print("\n".join(line for line in said.splitlines() if line.startswith(("regime", "domains"))))
figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained")
mg.show(work / "maps/figures/map-image.png", axes[0], "the scan")
mg.show(work / "maps/figures/map-domains.png", axes[1], "twist of the triangles")
plt.show()
