# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
# ---

# %% [markdown]
# # A first analysis
#
# From a folder of scans to drift, twist and strain with their errors. The scans here are simulated, so that the answer is
# known; your own folder takes their place.

# %%
import tempfile
from pathlib import Path

import moiregauge as mg
from moiregauge import plot

folder = Path(tempfile.mkdtemp())
scans = mg.simulate(folder, name="scans", seed=3, raster={"scans": 4, "pixels": [192, 192]})[0]

# %% [markdown]
# One call does it all. Doubts come as warnings and stay in `results.caveats`.

# %%
results = mg.analyze(scans, seed=1)
results

# %% [markdown]
# Every number is an estimate: `sigma` is what scatters, `sigma_total` has calibration and model in it and may be published.

# %%
twist = results.sets[0].mean.twist_deg
print(f"twist {twist}°: {twist.value:.5f}, σ {twist.sigma:.5f}, with calibration {twist.sigma_total:.5f}")

# %%
ax = plot.scan(results, 0)

# %%
ax = plot.wavelengths(results)

# %%
ax = plot.drift(results)

# %%
ax = plot.budget(results, "twist_deg")

# %% [markdown]
# A table with one row a scan, and the report that the program writes.

# %%
table = results.to_pandas()
print(table[["scan", "twist_deg", "twist_sigma_deg", "heterostrain_percent"]])

# %%
page = results.report(folder / "report", png=False)
print(page.name)
