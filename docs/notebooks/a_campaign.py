# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
# ---

# %% [markdown]
# # A campaign of many samples
#
# Every folder with scans is a sample; all of them become one table. With `client=` of a Dask cluster the same call runs
# there, and goes on where it was when workers or the client are killed.

# %%
import tempfile
from pathlib import Path

import moiregauge as mg

folder = Path(tempfile.mkdtemp())
for number, twist in enumerate([1.05, 1.10, 1.15]):
    mg.simulate(
        folder / "samples",
        name=f"sample-{number}",
        seed=number,
        sample={"twist_deg": twist},
        raster={"scans": 2, "pixels": [128, 128]},
    )

# %%
done = mg.campaign.run(folder / "samples", folder / "all", strain_draws=100)
print(done.ok, "well,", done.doubtful, "doubtful,", done.failed, "failed")

# %%
table = done.to_pandas()
print(table[["sample", "twist_deg", "twist_sigma_total_deg"]])

# %% [markdown]
# At an instrument scans come one by one: a `Campaign` measures each once.

# %%
campaign = mg.Campaign(seed=1, strain_draws=100)
for scan in sorted((folder / "samples" / "sample-0").glob("*.spm")):
    campaign.add(scan)
    results = campaign.analyze()
    mean = results.sets[0].mean or results.sets[0].uncorrected
    print(scan.name, mean.twist_deg)
