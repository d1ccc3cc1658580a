"""
Do the errors hold?
===================

``moiregauge validate`` simulates sets, analyses them, and compares with the truth. The pulls (error divided by stated σ) should be
normally distributed with a width of one.
"""

import matplotlib.pyplot as plt
import mg

work = mg.workspace()
print(mg.run("validate", "--sets", 60, "--pixels", 96, "--out", "validation", "--quiet", folder=work))
figure, ax = plt.subplots(figsize=(8, 4), layout="constrained")
picture = next((work / "validation").rglob("*.png"))
mg.show(picture, ax)
plt.show()
