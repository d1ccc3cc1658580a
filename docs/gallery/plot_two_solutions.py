"""
Pitfall: one moiré, two solutions
=================================

Graphene on hBN. The layers differ in lattice constant. Then one twist with tension and another twist with compression give exactly the
same moiré. Both solutions fit equally well, and the program prints both.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
strains = [0.05, 0.1, 0.15, 0.2, 0.25, 0.3]
figure, ax = plt.subplots(figsize=(5.5, 3.4), layout="constrained")
for twist, colour in ((0.7, mg.DOWN), (1.1, mg.UP)):
    for strain in strains:
        cell = mg.moire(work, "--layers", "graphene/hBN", "--twist", twist, "--strain", strain, "--strain-axis", 20)["cell"]
        vectors = [",".join(str(c) for c in v) for v in cell["vectors_nm"][:2]]
        back = mg.moire(work, "--layers", "graphene/hBN", "--vectors", *vectors)
        for solution in back["readings"]["solutions"]:
            theta, epsilon = solution["twist_deg"]["value"], solution["strain_percent"]["value"]
            if theta > 0 and abs(epsilon) < 0.5:
                ax.plot(strain, theta, "o" if epsilon > 0 else "s", color=colour, mfc=colour if epsilon > 0 else "none")
ax.set(xlabel="true strain (%)", ylabel="twist of the solution (°)", ylim=(0.3, 1.3))
ax.set_title("full: tension, the true solution; open: compression, same image", fontsize=9)
plt.show()
