"""
Pitfall: the strain of an unstrained sample
===========================================

The strain is a vector; its length is never negative. Where there is no strain, the lengths of noisy vectors scatter about 1.25 σ and
look like a result. So the program averages the vectors, removes this bias from the magnitude, and gives an upper limit instead of an
axis.
"""

import matplotlib.pyplot as plt
import mg
import numpy as np

work = mg.workspace()
mg.simulate(work, "scans", "--scans", 16, "--pixels", 128, "--strain", 0, "--noise", 2)
found = mg.analyze(work, "scans")["sets"][0]
vectors = np.array([scan["twist_strain"]["drift_corrected"]["strain_vector_percent"] for scan in found["scans"]])
mean = found["mean"]

figure, axes = plt.subplots(1, 2, figsize=(8, 3.4), layout="constrained")
axes[0].plot(*vectors.T, "o", color=mg.UP, label="single scans")
axes[0].plot(*mean["strain_vector_percent"], "+", ms=14, mew=2, color=mg.DOWN, label="all together")
axes[0].axhline(0, color=mg.FAINT, lw=0.6)
axes[0].axvline(0, color=mg.FAINT, lw=0.6)
axes[0].set(aspect="equal", xlabel="E₁ (%)", ylabel="E₂ (%)")
axes[0].locator_params(nbins=3)
axes[0].legend(frameon=False)
axes[1].hist(np.hypot(*vectors.T), bins=10, color=mg.UP)
low, high = mean["strain_interval_95_percent"]
axes[1].axvspan(low, high, color=mg.DOWN, alpha=0.3)
axes[1].set(xlabel="|E| (%)", yticks=[], title="lengths of single scans; band: 95 % interval of all")
plt.show()
