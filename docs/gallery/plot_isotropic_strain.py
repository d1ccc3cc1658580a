"""
Pitfall: a strain that the moiré does not show
==============================================

With an isotropic strain and a slightly different twist the moiré stays the same. For equal layers the change of the twist is of second
order, for different layers of first order. So a twist to 0.001° holds only for a known isotropic strain. The orientation of one layer
determines both.
"""

import matplotlib.pyplot as plt
import mg
import numpy as np

work = mg.workspace()
strains = np.linspace(-0.3, 0.3, 13)
figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
for ax, layers in zip(axes, ("graphene", "graphene/hBN")):
    found = []
    for strain in strains:
        cell = mg.moire(work, "--layers", layers, "--twist", 1.1, "--biaxial", strain)["cell"]
        vectors = [",".join(str(c) for c in v) for v in cell["vectors_nm"][:2]]
        back = mg.moire(work, "--layers", layers, "--vectors", *vectors)
        found.append(back["twist_strain"]["twist_deg"]["value"])
    ax.plot(strains, np.array(found) - 1.1, "o-", color=mg.UP)
    ax.axhline(0, color=mg.LINE, lw=0.8)
    ax.set(title=layers, xlabel="true isotropic strain (%)", ylabel="twist found − true twist (°)")
plt.show()
