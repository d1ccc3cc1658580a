"""Plots draw on the axes that are given, and change nothing else. MOIREGAUGE_PLOTS=DIR keeps the pictures."""

from __future__ import annotations

import os
from pathlib import Path

import moiregauge as mg
import pytest

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("agg")

pytestmark = pytest.mark.filterwarnings("ignore::moiregauge.CaveatWarning")

OF_RESULTS = ["scan", "wavelengths", "drift", "twist_strain", "budget"]


def keep(figure: object, name: str) -> None:
    if folder := os.environ.get("MOIREGAUGE_PLOTS"):
        figure.savefig(Path(folder) / f"{name}.png", dpi=110)


@pytest.mark.parametrize("name", OF_RESULTS)
def test_results_are_drawn(name: str, results: mg.Results) -> None:
    import matplotlib.pyplot as plt
    from moiregauge import plot

    before = dict(matplotlib.rcParams)
    figure, ax = plt.subplots(layout="constrained")
    assert getattr(plot, name)(results, ax=ax) is ax
    figure.canvas.draw()
    assert ax.get_xlabel() and ax.has_data()
    assert dict(matplotlib.rcParams) == before
    keep(figure, name)
    plt.close(figure)
    assert plt.get_fignums() == []
    own = getattr(plot, name)(results)
    plt.close(own.figure)


@pytest.mark.parametrize(
    ("quantity", "options"),
    [("twist", {}), ("twist", {"sigma": True}), ("mask", {}), ("displacement x", {"masked": True, "cmap": "RdBu"})],
)
def test_maps_are_drawn(quantity: str, options: dict, mapped: mg.MapResults) -> None:
    import matplotlib.pyplot as plt
    from moiregauge import plot

    ax = plot.map(mapped, quantity, **options)
    ax.figure.canvas.draw()
    keep(ax.figure, f"map-{quantity.replace(' ', '-')}{'-sigma' if options.get('sigma') else ''}")
    plt.close(ax.figure)
    with pytest.raises(ValueError, match="twist"):
        plot.map(mapped, "nothing")


def test_images_need_their_scans(results: mg.Results) -> None:
    from moiregauge import plot

    with pytest.raises(ValueError, match="no images"):
        plot.scan(mg.Results.from_dict(results.to_dict()))
    with pytest.raises(ValueError, match="budget"):
        plot.budget(results, "nothing")
