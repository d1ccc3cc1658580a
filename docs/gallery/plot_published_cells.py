"""
Published cells
===============

Periods and densities that the literature quotes, calculated from its own twists: magic-angle graphene (2.7·10¹² /cm² at 1.08°,
arXiv:1802.00553), 12.8 nm at 1.1°, 13.4 nm at 1.05° and 17.8 nm at 0.79° for twisted graphene, 13.9 nm for aligned graphene on hBN
with a mismatch of 1.8 %.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
twists = [0.4, 0.5, 0.6, 0.79, 0.9, 1.05, 1.1, 1.3, 1.6, 2.0]
cells = [mg.moire(work, "--twist", twist)["cell"] for twist in twists]
figure, axes = plt.subplots(1, 2, figsize=(8, 3.2), layout="constrained")
axes[0].plot(twists, [cell["wavelengths_nm"][0] for cell in cells], color=mg.UP)
for twist, period in ((1.1, 12.8), (1.05, 13.4), (0.79, 17.8)):
    axes[0].plot(twist, period, "o", color=mg.DOWN)
axes[0].set(xlabel="twist (°)", ylabel="wavelength (nm)", title="circles: as published")
axes[1].plot(twists, [cell["density_full_cm2"] / 1e12 for cell in cells], color=mg.UP)
axes[1].plot(1.08, 2.7, "o", color=mg.DOWN)
axes[1].set(xlabel="twist (°)", ylabel="carriers at full filling (10¹² /cm²)")
plt.show()
