# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
# ---

# %% [markdown]
# # Your own array, from your own pipeline
#
# Whatever made an image, a 2-D array is enough: how large a pixel is, and, for the drift, when and in which direction lines
# were taken. **Row 0 is the bottom line.**

# %%
import numpy as np

import moiregauge as mg
from moiregauge import plot

rng = np.random.default_rng(1)
y, x = np.mgrid[:200, :200] * 0.4
period, angle = 11.0, np.radians(12.0)
image = rng.normal(0.0, 0.5, x.shape)
for turn in np.radians([0, 60, 120]):
    k = 4 * np.pi / np.sqrt(3) / period
    image += np.cos(k * (x * np.cos(angle + turn) + y * np.sin(angle + turn)))

# %%
results = mg.analyze(arrays=[image], pixel_nm=0.4, names=["mine"])
vector = results.sets[0].scans[0].vectors[0].sensor
print(vector.wavelength_nm, "nm")

# %%
ax = plot.scan(results)

# %% [markdown]
# Masked pixels and NaN are missing. With `xarray` the places and what else is known travel with the array.

# %%
import xarray as xr

labelled = xr.DataArray(
    image,
    dims=("y", "x"),
    coords={"y": ("y", y[:, 0], {"units": "nm"}), "x": ("x", x[0], {"units": "nm"})},
    attrs={"frame_direction": "up", "line_rate_hz": 2.0},
)
again = mg.measure(labelled)
print(again.frame_direction, again.vectors[0].sensor.wavelength_nm)
