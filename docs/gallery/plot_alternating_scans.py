"""
Frames up and down show the drift
=================================

A drift stretches frames scanned upwards and compresses those scanned downwards. Before it is removed, twist and strain jump from frame
to frame; after, they agree.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
mg.simulate(work, "scans", "--scans", 8, "--pixels", 160, "--drift", 0.8, -0.3, "--noise", 0.5)
found = mg.analyze(work, "scans")["sets"][0]

figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
for ax, key, label in zip(axes, ("twist_deg", "heterostrain_percent"), ("twist (°)", "heterostrain (%)")):
    for i, scan in enumerate(found["scans"], start=1):
        colour = mg.UP if scan["frame_direction"] == "up" else mg.DOWN
        for kind, marker in (("sensor", "x"), ("drift_corrected", "o")):
            estimate = scan["twist_strain"][kind][key]
            ax.errorbar(i, estimate["value"], estimate["sigma"], fmt=marker, color=colour)
    ax.axhline(found["mean"][key]["value"], color=mg.LINE, lw=0.8)
    ax.set(xlabel="scan", ylabel=label)
axes[0].set_title("crosses: as scanned, circles: drift removed")
axes[1].set_title("blue: up, orange: down")
plt.show()
