"""
What more scans improve
=======================

The statistical uncertainty falls with every frame. That of the drift falls fastest, because phases link the frames. The total hardly
changes: it contains the calibration of the scanner, which more scans do not improve.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
mg.simulate(work, "scans", "--scans", 12, "--pixels", 128, "--noise", 1)
numbers = [2, 3, 4, 6, 8, 12]
drift, twist, total = [], [], []
for n in numbers:
    files = [f"scans/scan.{i:03}.spm" for i in range(n)]
    found = mg.analyze(work, *files)["sets"][0]
    drift.append(found["drift"]["x_nm_per_min"]["sigma"])
    twist.append(found["mean"]["twist_deg"]["sigma"])
    total.append(found["mean"]["twist_deg"]["sigma_total"])

figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
axes[0].loglog(numbers, drift, "o-", color=mg.UP)
axes[0].set(xlabel="scans", ylabel="σ of the drift (nm/min)")
axes[1].loglog(numbers, twist, "o-", color=mg.UP, label="statistical")
axes[1].loglog(numbers, total, "s-", color=mg.DOWN, label="total, scanner not calibrated")
axes[1].set(xlabel="scans", ylabel="uncertainty of the twist (°)")
axes[1].legend(frameon=False)
for ax in axes:
    ax.set_xticks(numbers, [str(n) for n in numbers], minor=False)
    ax.minorticks_off()
plt.show()
