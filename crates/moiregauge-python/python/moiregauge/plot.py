"""Plots on axes of matplotlib. Every function draws on `ax`, or on a new figure, and returns the axes.

Nothing is shown, no global setting is changed; keywords go to the artist that draws the data.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from moiregauge.results import Estimate, LatticeVector, MapResults, MeanResult, Results, ScanResult, SetResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["budget", "drift", "map", "scan", "twist_strain", "wavelengths"]

# Okabe and Ito: told apart by the colour-blind, on white and on black.
COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9"]
UNITS = {"degree": "°", "percent": "%", "1": ""}


def _axes(ax: Axes | None) -> Axes:
    if ax is not None:
        return ax
    import matplotlib.pyplot as plt

    return plt.subplots(layout="constrained")[1]


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def _scans(results: Results) -> list[tuple[SetResult, ScanResult]]:
    return [(group, one) for group in results.sets for one in group.scans]


def scan(results: Results, which: int | str = 0, ax: Axes | None = None, *, lattice: bool = True, **image: Any) -> Axes:
    """The image of a scan where the tip was, background removed, with the cell of its moiré lattice in the middle.

    which: number of the scan, in order of sets and time, or the name of its file. Keywords go to `Axes.pcolormesh`.
    """
    run = results._run
    if run is None:
        raise ValueError(
            "these results were pickled or read from a document and have no images: analyze the scans again"
        )
    scans = [one for _, one in _scans(results)]
    if isinstance(which, str):
        found = next((one for one in scans if one.file == which), None)
        if found is None:
            raise ValueError(f"no scan {which!r}; there are {[one.file for one in scans]}")
    else:
        found = scans[which]
    ax = _axes(ax)
    values, matrix, origin, channel, unit = run.image(found.file)
    (xx, xy), (yx, yy) = matrix
    rows, columns = values.shape
    c, r = np.meshgrid(np.arange(columns + 1) - 0.5, np.arange(rows + 1) - 0.5)
    x, y = origin[0] + xx * c + xy * r, origin[1] + yx * c + yy * r
    low, high = np.nanpercentile(values, [0.5, 99.5])
    drawn = ax.pcolormesh(x, y, values, **{"vmin": low, "vmax": high, "cmap": "gray", "rasterized": True, **image})
    bar = ax.figure.colorbar(drawn, ax=ax)
    bar.set_label(f"{channel} ({unit})" if unit else channel)
    ax.set_aspect("equal")
    ax.set_xlabel("x (nm)")
    ax.set_ylabel("y (nm)")
    if lattice:
        middle = np.array([np.mean(x), np.mean(y)])
        _cell(ax, middle, [_best(vector) for vector in found.vectors[:2]])
    return ax


def _best(vector: Any) -> LatticeVector:
    best: LatticeVector = vector.drift_corrected or vector.sensor
    return best


def _cell(ax: Axes, corner: Any, vectors: list[LatticeVector]) -> None:
    a, b = (np.array([_number(v.x_nm), _number(v.y_nm)]) for v in vectors)
    corners = np.array([corner, corner + a, corner + a + b, corner + b, corner])
    # A dark line under a light one is seen on any image.
    ax.plot(corners[:, 0], corners[:, 1], color="black", linewidth=3)
    ax.plot(corners[:, 0], corners[:, 1], color="white", linewidth=1.2)
    for name, end in (("$L_1$", a), ("$L_2$", b)):
        box = {"boxstyle": "round,pad=0.15", "facecolor": "black", "alpha": 0.6, "linewidth": 0}
        ax.annotate(name, corner + end / 2, color="white", ha="center", va="center", bbox=box)


def wavelengths(results: Results, ax: Axes | None = None, **errorbar: Any) -> Axes:
    """The three wavelengths of every scan with their σ; lines are those of all scans of a set together."""
    ax = _axes(ax)
    start = 0
    for group in results.sets:
        places = start + 1 + np.arange(len(group.scans))
        for number in range(3):
            lengths = [_best(one.vectors[number]).wavelength_nm for one in group.scans]
            label = f"$\\lambda_{number + 1}$" if start == 0 else None
            style = {"fmt": "o", "markersize": 4, "capsize": 2, "color": COLOURS[number], **errorbar}
            ax.errorbar(places, _values(lengths), _sigmas(lengths), label=label, **style)
            if group.mean is not None:
                mean = _number(group.mean.vectors[number].wavelength_nm.value)
                ax.plot(places[[0, -1]] + [-0.4, 0.4], [mean, mean], color=COLOURS[number], linewidth=1)
        start += len(group.scans)
        if group is not results.sets[-1]:
            ax.axvline(start + 0.5, color="0.6", linewidth=0.8, linestyle=":")
    _whole_numbers(ax, start)
    ax.set_xlabel("scan")
    ax.set_ylabel("wavelength (nm)")
    ax.legend()
    return ax


def _whole_numbers(ax: Axes, count: int) -> None:
    from matplotlib.ticker import MaxNLocator

    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    ax.set_xlim(0.4, count + 0.6)


def _values(estimates: list[Estimate]) -> list[float]:
    return [_number(one.value) for one in estimates]


def _sigmas(estimates: list[Estimate]) -> list[float]:
    return [_number(one.sigma) for one in estimates]


def drift(results: Results, ax: Axes | None = None, **ellipse: Any) -> Axes:
    """The drift velocity of every set with its 95 % region by statistics."""
    from matplotlib.patches import Ellipse

    ax = _axes(ax)
    drawn = 0
    for number, group in enumerate(results.sets):
        if group.drift is None:
            continue
        x, y = group.drift.x_nm_per_min, group.drift.y_nm_per_min
        colour = COLOURS[number % len(COLOURS)]
        ax.plot([_number(x.value)], [_number(y.value)], "o", color=colour, label=group.name)
        sx, sy, rho = _number(x.sigma), _number(y.sigma), group.drift.correlation or 0.0
        covariance = np.array([[sx * sx, rho * sx * sy], [rho * sx * sy, sy * sy]])
        if np.isfinite(covariance).all():
            lengths, axes = np.linalg.eigh(covariance)
            # χ² of two components at 95 %.
            width, height = 2 * np.sqrt(5.991 * np.maximum(lengths[::-1], 0))
            angle = float(np.degrees(np.arctan2(axes[1, 1], axes[0, 1])))
            place = (_number(x.value), _number(y.value))
            style = {"facecolor": colour, "alpha": 0.25, **ellipse}
            ax.add_patch(Ellipse(place, width, height, angle=angle, **style))
        drawn += 1
    if drawn == 0:
        ax.text(0.5, 0.5, "no drift could be determined", transform=ax.transAxes, ha="center")
    else:
        ax.legend()
    ax.set_aspect("equal", adjustable="datalim")
    ax.autoscale_view()
    ax.set_xlabel("drift to the right (nm/min)")
    ax.set_ylabel("drift up (nm/min)")
    return ax


def twist_strain(results: Results, ax: Axes | None = None, **errorbar: Any) -> Axes:
    """Twist and heterostrain: single scans faintly, sets and all together with their total σ."""
    ax = _axes(ax)
    for number, group in enumerate(results.sets):
        colour = COLOURS[number % len(COLOURS)]
        singles = [one.twist_strain.drift_corrected or one.twist_strain.sensor for one in group.scans]
        known = [one for one in singles if one is not None]
        ax.plot(
            _values([one.twist_deg for one in known]),
            _values([one.heterostrain_percent for one in known]),
            ".",
            color=colour,
            alpha=0.5,
        )
        _cross(ax, group.mean or group.uncorrected, colour, group.name, errorbar)
    if results.combined is not None and len(results.sets) > 1:
        combined = results.combined
        style = {"fmt": "D", "color": "0.3", "capsize": 3, "label": "all", **errorbar}
        ax.errorbar(**_point(combined.twist_deg, combined.heterostrain_percent), **style)
    ax.set_xlabel("twist (°)")
    ax.set_ylabel("heterostrain (%)")
    ax.ticklabel_format(useOffset=False)
    ax.legend()
    return ax


def _cross(ax: Axes, mean: MeanResult | None, colour: str, name: str, errorbar: dict[str, Any]) -> None:
    if mean is not None:
        style = {"fmt": "s", "color": colour, "capsize": 3, "label": name, **errorbar}
        ax.errorbar(**_point(mean.twist_deg, mean.heterostrain_percent), **style)


def _point(twist: Estimate, strain: Estimate) -> dict[str, Any]:
    def sigma(one: Estimate) -> float:
        return _number(one.sigma if one.sigma_total is None else one.sigma_total)

    return {"x": _number(twist.value), "y": _number(strain.value), "xerr": sigma(twist), "yerr": sigma(strain)}


def budget(
    results: Results, quantity: str = "twist_deg", which: int | None = None, ax: Axes | None = None, **bar: Any
) -> Axes:
    """What contributes to the σ of a quantity: `twist_deg`, `heterostrain_percent`, `lattice_angle_deg`,
    `strain_e1_percent`, …; of the set `which`, or of all together.
    """
    if which is None and results.combined is not None:
        found = results.combined.budget
    else:
        group = results.sets[which or 0]
        mean = group.mean or group.uncorrected
        if mean is None:
            raise ValueError(f"{group.name}: there is no mean, and no budget")
        found = mean.budget
    if not hasattr(found, quantity) or not hasattr(getattr(found, quantity), "total"):
        raise ValueError(f"quantity: expected one of those of the budget, as twist_deg, found {quantity!r}")
    parts = getattr(found, quantity).to_dict()
    total = parts.pop("total")
    known = {name: value for name, value in parts.items() if value}
    ax = _axes(ax)
    names = sorted(known, key=lambda name: known[name])
    ax.barh([name.replace("_", " ") for name in names], [known[name] for name in names], **{"color": COLOURS[0], **bar})
    unit = "%" if quantity.endswith("percent") else "°"
    if total is not None:
        ax.axvline(total, color=COLOURS[1], linewidth=1.5, label=f"total {total:.2g}{unit}")
        ax.legend(loc="lower right")
    ax.set_xlabel(f"σ of {quantity.rsplit('_', 1)[0].replace('_', ' ')} ({unit})")
    return ax


def map(  # noqa: A001
    results: MapResults,
    quantity: str = "twist",
    ax: Axes | None = None,
    *,
    sigma: bool = False,
    masked: bool = False,
    **mesh: Any,
) -> Axes:
    """A quantity of a map, or its σ. Nodes that are masked are left out, unless `masked`.

    quantity: one of `results.arrays`: `twist`, `strain`, `wavelength 1`, `displacement x`, … or `mask`.
    """
    name = f"{quantity} sigma" if sigma else quantity
    if name not in results._arrays:
        raise ValueError(f"no quantity {name!r}; there are {list(results._arrays)}")
    unit, values = results._arrays[name]
    x, y = results._arrays["position x"][1], results._arrays["position y"][1]
    good = results._arrays["mask"][1] == 0
    shown = values if masked or quantity == "mask" else np.where(good, values, np.nan)
    ax = _axes(ax)
    style: dict[str, Any] = {"shading": "nearest", "cmap": "viridis", "rasterized": True}
    if quantity == "mask":
        _mask(ax, results, x, y, values)
    else:
        drawn = ax.pcolormesh(x, y, shown, **{**style, **mesh})
        bar = ax.figure.colorbar(drawn, ax=ax)
        words = f"σ of {quantity}" if sigma else quantity
        bar.set_label(f"{words} ({unit})" if unit else words)
    # Grey is where there is no number.
    ax.set_facecolor("0.85")
    ax.set_aspect("equal")
    ax.set_xlabel("x (nm)")
    ax.set_ylabel("y (nm)")
    return ax


def _mask(ax: Axes, results: MapResults, x: Any, y: Any, values: Any) -> None:
    from matplotlib.colors import ListedColormap
    from matplotlib.patches import Patch

    found = sorted(results.masks, key=lambda mask: mask.value)
    colours = ["#ffffff", *COLOURS, "#F0E442", "#000000", "0.5"][: len(found)]
    codes = np.searchsorted([mask.value for mask in found], values)
    ax.pcolormesh(x, y, codes, cmap=ListedColormap(colours), vmin=-0.5, vmax=len(found) - 0.5, shading="nearest")
    handles = [
        Patch(facecolor=colour, edgecolor="0.4", label=f"{mask.name} ({mask.nodes})")
        for colour, mask in zip(colours, found, strict=False)
    ]
    ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.02, 1.0), fontsize="small")
