"""
A lattice that covers a part of the frame
=========================================

Beyond the edge there is no moiré. The program finds where the lattice is (outline), measures it there, and says so with the caveat
``partly-covered``.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
mg.simulate(
    work, "scans", "--scans", 2, "--pixels", 256, "--size", 100, 100, "--noise", 0.7,
    "--sample", "edge:share=0.6,angle=30",
)
print(mg.run("analyze", "scans", "--out", "out", folder=work))
figure, ax = plt.subplots(figsize=(6, 5), layout="constrained")
mg.show(work / "out/figures/set1-scan.png", ax)
plt.show()
