"""
A scan that does not fit
========================

One of six frames is of another place, where the twist differs by 0.004°. Leaving each scan out in turn shows which one it is; it is
named but still used, because leaving out data is your decision.
"""

import shutil

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
mg.simulate(work, "scans", "--scans", 6, "--pixels", 160, "--noise", 0.5)
mg.simulate(work, "other", "--scans", 6, "--pixels", 160, "--noise", 0.5, "--twist", 1.134, "--seed", 5)
shutil.copy(work / "other/scan.003.spm", work / "scans/scan.003.spm")
before = mg.analyze(work, "scans")
after = mg.analyze(work, "scans", "--exclude-outliers", out="out2")
print("caveats before:", ", ".join(mg.codes(before)))
print("caveats after: ", ", ".join(mg.codes(after)))

figure, ax = plt.subplots(figsize=(5.5, 3.2), layout="constrained")
for i, scan in enumerate(before["sets"][0]["scans"]):
    twist = scan["twist_strain"]["drift_corrected"]["twist_deg"]
    left_out = after["sets"][0]["scans"][i]["excluded"]
    ax.errorbar(i, twist["value"], twist["sigma"], fmt="x" if left_out else "o", color=mg.DOWN if left_out else mg.UP)
mean = after["sets"][0]["mean"]["twist_deg"]["value"]
ax.axhline(mean, color=mg.LINE, lw=0.8)
ax.set(xlabel="scan", ylabel="twist (°)", title="cross: left out by --exclude-outliers")
plt.show()
