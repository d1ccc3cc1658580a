"""Documents in a line, as terminals show them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from moiregauge import _core


def estimate(found: Mapping[str, Any]) -> str:
    """A value with its error, as the program prints it."""

    def known(value: float | None) -> float:
        return float("nan") if value is None else value

    return _core.plus_minus(known(found["value"]), known(found["sigma"]), found.get("sigma_total"))


def results(found: Mapping[str, Any]) -> str:
    sets = found["sets"]
    scans = sum(len(one["scans"]) for one in sets)
    mean = found["combined"] or next((one["mean"] or one["uncorrected"] for one in sets), None)
    twist = f", twist {estimate(mean['twist_deg'])}°" if mean is not None else ""
    return f"<Results: {scans} scans in {len(sets)} sets{twist}, {len(found['caveats'])} caveats>"


def map_results(found: Mapping[str, Any]) -> str:
    columns, lines = found["nodes"]
    caveats = len(found["caveats"])
    return f"<MapResults: {columns} × {lines} nodes, resolution {found['resolution_nm']:.3g} nm, {caveats} caveats>"
