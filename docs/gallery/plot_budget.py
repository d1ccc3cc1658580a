"""
The uncertainty budget
======================

Where the uncertainty of a twist and of a strain comes from, with and without a calibration of the scanner. ``budget.csv`` and the
report have the same numbers.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
mg.simulate(work, "scans", "--scans", 4, "--pixels", 160)
mg.simulate(work, "hopg", "--atoms", 1, "--size", 5, 5, "--scans", 2, "--pixels", 160)
mg.run("calibrate", "hopg", "--material", "graphite", "--out", "scanner.toml", folder=work)
plain = mg.analyze(work, "scans")["sets"][0]["mean"]["budget"]
calibrated = mg.analyze(work, "scans", "--calibration", "scanner.toml", out="out2")["sets"][0]["mean"]["budget"]

figure, axes = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained", sharey=True)
for ax, key, unit in zip(axes, ("twist_deg", "heterostrain_percent"), ("twist (°)", "heterostrain (%)")):
    rows = [row for row, value in plain[key].items() if value]
    for shift, budget, colour, label in ((0.2, plain, mg.DOWN, "priors"), (-0.2, calibrated, mg.UP, "calibrated")):
        ax.barh([i + shift for i in range(len(rows))], [budget[key].get(row) or 0 for row in rows], 0.38, color=colour, label=label)
    ax.set(xscale="log", xlabel=f"standard uncertainty of the {unit}", yticks=range(len(rows)))
    ax.set_yticklabels([row.replace("_", " ") for row in rows])
    ax.invert_yaxis()
figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False)
plt.show()
