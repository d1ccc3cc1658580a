"""
What strain does to a cell
==========================

``moiregauge moire --figure`` draws the cell of a twist and a strain. A heterostrain of 0.3 % at 1.1° makes the three wavelengths
differ by a quarter: the moiré magnifies strain by one over the twist.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
figure, axes = plt.subplots(2, 1, figsize=(8, 7), layout="constrained")
for ax, strain in zip(axes, (0, 0.3)):
    mg.run("moire", "--twist", 1.1, "--strain", strain, "--strain-axis", 20, "--figure", f"cell{strain}.png", folder=work)
    mg.show(work / f"cell{strain}.png", ax, f"1.1°, {strain} %")
plt.show()
