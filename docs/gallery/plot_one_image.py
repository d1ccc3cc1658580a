"""
One STM image: its atoms are the ruler
======================================

A scanner without sensors shows lengths 2 % too short along x and 1 % too long along y, and the sample drifts. The atoms of the upper layer, which
the moiré makes brighter and darker, go through the same: the moiré in their coordinates has neither drift nor gains.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
config = mg.run("simulate", "--print-config", folder=work).splitlines()
config = ["gain = [0.98, 1.01]" if line.startswith("gain =") else line for line in config]
(work / "scanner.toml").write_text("\n".join(config))
truth = mg.simulate(
    work, "scans", "--config", "scanner.toml", "--no-sensors", "--scans", 1, "--pixels", 512, "--size", 30, 30, "--rate", 10, "--twist", 3,
    "--strain", 0.3, "--drift", 0.4, 0.3, "--noise", 0.3, "--sample", "atoms:ratio=0.6,change=0.3",
)
found = mg.analyze(work, "scans")["sets"][0]
image = mg.arrays(work, "scans/scan.000.spm")
figure, axes = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
axes[0].imshow(image["TR_Phase_trace"], origin="lower", cmap="viridis")
axes[0].set(title="one frame", xticks=[], yticks=[])
rows = [("by the atoms", found["mean"], mg.UP), ("by the scanner", found["by_scanner"], mg.DOWN)]
for row, (name, mean, color) in enumerate(rows):
    twist = mean["twist_deg"]
    print(f"{name}: twist {twist['value']:.5f} ± {twist['sigma_total']:.5f}°")
    axes[1].errorbar(twist["value"], row, xerr=twist["sigma_total"], fmt="o", color=color, capsize=3)
axes[1].axvline(3, color=mg.LINE, lw=0.8)
axes[1].set(title="line: the truth", xlabel="twist (°)", yticks=[0, 1], yticklabels=[name for name, *_ in rows], ylim=(-0.5, 1.5))
plt.show()
