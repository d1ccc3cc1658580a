"""
Pitfall: the autocorrelation that is not divided by the overlap
===============================================================

A summed autocorrelation weighs its peaks with the overlap of the image with itself, which moves them towards the middle. Lengths come
out too short and the twist too large; comparing frames up and down does not show it, because all have the same bias. The error bars of
the published protocol (``--method paper``) do not include it. The default method has no such bias.
"""

import matplotlib.pyplot as plt
import mg

TRUTH = 1.13
work = mg.workspace()
sizes, found = [70, 90, 120, 150], {"paper": [], "lattice": []}
for size in sizes:
    name = f"s{size}"
    mg.simulate(work, name, "--scans", 2, "--pixels", 256, "--size", size, size, "--twist", TRUTH, "--noise", 0.3, "--strain", 0)
    for method, values in found.items():
        result = mg.analyze(work, name, "--method", method, "--drift-draws", 200, "--strain-draws", 200, out=f"{name}-{method}")
        values.append(result["sets"][0]["mean"]["twist_deg"])

figure, ax = plt.subplots(figsize=(5.5, 3.4), layout="constrained")
for method, colour, label in (("paper", mg.DOWN, "summed autocorrelation"), ("lattice", mg.UP, "default")):
    error = [estimate["value"] - TRUTH for estimate in found[method]]
    sigma = [estimate["sigma"] for estimate in found[method]]
    ax.errorbar([0.8 * s for s in sizes], error, sigma, fmt="o-", color=colour, capsize=3, label=label)
ax.axhline(0, color=mg.LINE, lw=0.8)
ax.set(xlabel="side of the frame (nm)", ylabel="measured − true twist (°)")
ax.legend(frameon=False)
plt.show()
