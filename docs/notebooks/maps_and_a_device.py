# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
# ---

# %% [markdown]
# # Maps, and a place for a device
#
# Where in an image is the twist what it should be, and where does it vary least?

# %%
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import moiregauge as mg
from moiregauge import plot

folder = Path(tempfile.mkdtemp())
scans = mg.simulate(folder, name="scans", seed=5, raster={"scans": 2, "pixels": [256, 256]})[0]

# %%
found = mg.map(scans)
found

# %% [markdown]
# Nodes that are not to be believed are masked, with the reason.

# %%
figure, axes = plt.subplots(1, 3, figsize=(13, 3.6), layout="constrained")
plot.map(found, "twist", ax=axes[0])
plot.map(found, "twist", sigma=True, ax=axes[1])
ax = plot.map(found, "mask", ax=axes[2])

# %% [markdown]
# As an `xarray.Dataset` it has places in nm, units, and the σ of every quantity beside it.

# %%
data = found.to_xarray()
good = data.where(data["mask"] == 0)
print(f"twist {float(good['twist'].mean()):.4f}°, varies by {float(good['twist'].std()):.4f}°")

# %%
data.to_netcdf(folder / "map.nc")
near = np.abs(good["twist"] - 1.13) < 2 * good["twist_sigma"]
print(f"{100 * float(near.sum() / good['twist'].notnull().sum()):.0f} % of the good nodes have 1.13° within 2 σ")
