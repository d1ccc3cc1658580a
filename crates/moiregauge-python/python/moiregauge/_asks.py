"""Around an analysis: what files hold, what a moiré means, planning, simulating, converting, calibrating, validating."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias, Unpack

from moiregauge import _core
from moiregauge._analyze import warn
from moiregauge._arguments import PathLike, listed, words
from moiregauge._options import TOLD
from moiregauge._progress import Progress, teller
from moiregauge._record import Record
from moiregauge.results import Caveat, FailedInput

if TYPE_CHECKING:
    from moiregauge._options import Options

Paths: TypeAlias = "PathLike | Sequence[PathLike]"


def _paths(paths: Paths) -> list[str]:
    return [os.fspath(path) for path in listed(paths)]


def _split(options: Mapping[str, Any]) -> tuple[str, str]:
    """Settings, and what files do not say."""
    given = {name: value for name, value in options.items() if value is not None}
    told = {name: given.pop(name) for name in TOLD if name in given}
    return words(given), words(told)


def _lost(failed: Sequence[tuple[str, str]]) -> None:
    warn([], [FailedInput(file=file, error=error) for file, error in failed])


def inspect(paths: Paths, **told: Unpack[Options]) -> list[Record]:
    """What files hold: channels with units, sizes and values in short, directions, times, and what an analysis misses.

    As `moiregauge info`. A damaged file has an `error` beside what could be read of it. Here rows are counted from the top,
    as on a screen. Raises `ReadError` where there is no scan.
    """
    return [Record(one) for one in json.loads(_core.inspect(_paths(paths), words(told)))]


class Moire(Record):
    """The cell of a moiré and what it means; in a notebook it is drawn."""

    def __init__(self, document: Mapping[str, Any], svg: str = "") -> None:
        super().__init__(document)
        self.__dict__["_svg"] = svg

    def __reduce__(self) -> Any:
        return Moire, (self.to_dict(), self._svg)

    def _repr_svg_(self) -> str:
        svg: str = self._svg
        return svg

    def __getattr__(self, name: str) -> Any:
        return self.__dict__["_svg"] if name == "_svg" else super().__getattr__(name)


def moire(
    twist_deg: float | None = None,
    *,
    strain_percent: float | None = None,
    strain_axis_deg: float | None = None,
    biaxial_percent: float | None = None,
    lattice_angle_deg: float | None = None,
    wavelengths_nm: Sequence[float] | None = None,
    vectors_nm: Sequence[Sequence[float]] | None = None,
    sigma_nm: float = 0.0,
    k_space: bool = False,
    band_degeneracy: float = 4.0,
    **options: Unpack[Options],
) -> Moire:
    """The moiré of layers, or the layers behind a moiré, as `moiregauge moire`.

    Either `twist_deg` of layer 2 against layer 1, with uniaxial strain of layer 2 along an axis counted from the reciprocal
    vectors of layer 1, and isotropic strain; or three `wavelengths_nm` (lengths between
    neighbouring spots, or of wave vectors where `k_space`); or two `vectors_nm`. `layers` and other settings are options.
    `band_degeneracy` is the number of electrons per cell at full filling.

    The equations: moiré wave vectors are differences of the reciprocal vectors of both layers; of equal layers without
    strain λ = a / (2 sin θ/2). arXiv 2406.08681 has the strained case.
    """
    given: dict[str, Any]
    several = [name for name in (twist_deg, wavelengths_nm, vectors_nm) if name is not None]
    if len(several) != 1:
        raise ValueError(f"expected one of twist_deg, wavelengths_nm and vectors_nm, found {len(several)}")
    if twist_deg is not None:
        layers: dict[str, Any] = {
            "twist_deg": twist_deg,
            "strain_percent": strain_percent,
            "strain_axis_deg": strain_axis_deg,
            "biaxial_percent": biaxial_percent,
        }
        if lattice_angle_deg is not None:
            layers["lattice_angle"] = {"angle_deg": lattice_angle_deg, "of": "reciprocal"}
        given = {"layers": layers}
    elif wavelengths_nm is not None:
        given = {"wavelengths": {"lengths_nm": list(wavelengths_nm), "sigma_nm": sigma_nm, "k_space": k_space}}
    else:
        given = {"vectors": {"vectors_nm": [list(one) for one in vectors_nm or []], "sigma_nm": sigma_nm}}
    document, svg = _core.moire(words(given), _split(options)[0], band_degeneracy)
    return Moire(json.loads(document), svg)


def plan(
    *,
    twist_deg: float | None = None,
    strain_percent: float | None = None,
    drift_nm_per_min: float | None = None,
    conditions: Mapping[str, Any] | None = None,
    max_size_nm: float | None = None,
    max_rate_hz: float | None = None,
    noise_per_pixel: bool = False,
    threads: int | None = None,
    progress: Progress = None,
    **options: Unpack[Options],
) -> Record:
    """How many scans, how large, how fast, for wanted standard errors of twist, strain and drift, as `moiregauge plan`.

    conditions: instrument and sample as in `simulate`; the number, size and rate of the scans are searched for.
    max_size_nm, max_rate_hz: without them twice those of the conditions.
    noise_per_pixel: the noise of a pixel does not depend on the time spent on it.

    `plans` has the best first, with the errors to expect and what limits them, from the Cramér–Rao bound.
    """
    request = {
        "wishes": {"twist_deg": twist_deg, "strain_percent": strain_percent, "drift_nm_per_min": drift_nm_per_min},
        "conditions": conditions or {},
        "max_size_nm": max_size_nm,
        "max_rate_hz": max_rate_hz,
        "noise_per_pixel": noise_per_pixel,
    }
    return Record(json.loads(_core.plan(words(request), _split(options)[0], threads, teller(progress))))


def simulate(
    out: PathLike,
    *,
    sets: Sequence[Mapping[str, Any]] | None = None,
    paper: int | None = None,
    force: bool = False,
    threads: int | None = None,
    progress: Progress = None,
    **conditions: Any,
) -> list[Path]:
    """Writes simulated NanoScope scans into `out/NAME`, with `truth.json` beside them; returns the folders.

    conditions: those of one set, any part of what `moiregauge simulate --print-config` shows: `name`, `seed` and the tables
        `sample` (`twist_deg`, `layers`, …), `drift`, `raster` (`scans`, `pixels`, `line_rate_hz`, …), `window`, `noise`,
        `features`; the rest has its defaults, the conditions of arXiv 2406.08681.
    sets: the conditions of several sets.
    paper: the three sets of arXiv 2406.08681, with this seed.
    force: replaces sets of the same names.
    """
    if sum([bool(sets), paper is not None, bool(conditions)]) > 1:
        raise ValueError("expected conditions of one set, sets, or paper; found several of them")
    asked = words({"sets": list(sets) if sets is not None else [{"name": "simulated", **conditions}]})
    written = _core.simulate(
        json.dumps(json.loads(asked)["sets"]), paper, os.fspath(out), force, threads, teller(progress)
    )
    return [Path(folder) for folder in written]


def convert(
    paths: Paths,
    to: PathLike,
    *,
    format: str | None = None,  # noqa: A002
    channels: Sequence[str] = (),
    rotate_to_lab: bool = False,
    force: bool = False,
    threads: int | None = None,
    progress: Progress = None,
    **told: Unpack[Options],
) -> list[Path]:
    """Writes scans in another format, as `moiregauge convert`; returns the files.

    to: a file such as `scan.gwy`, or, with a `format` (`gwy`, `gsf`, `npz`, `zarr`, `tiff`, `csv`, `gxyzf`), a folder.
    channels: only these, by name.
    rotate_to_lab: turns images into laboratory axes.

    Raises `ReadError` where nothing could be converted; warns of single files that were not.
    """
    target = Path(to)
    request = {
        "format": format or target.suffix.lstrip("."),
        "channels": list(channels),
        "rotate_to_lab": rotate_to_lab,
    }
    written, failed = _core.convert(
        _paths(paths), words(told), words(request), (target, format is None), force, threads, teller(progress)
    )
    _lost(failed)
    return [Path(file) for file in written]


def calibrate(
    paths: Paths,
    *,
    lattice: str = "graphite",
    drift_sigma_nm_per_min: float = 1.0,
    out: PathLike | None = None,
    threads: int | None = None,
    progress: Progress = None,
    **options: Unpack[Options],
) -> Record:
    """The gains of a scanner and the angle of its axes, from images of a known lattice, as `moiregauge calibrate`.

    lattice: the surface or layer by name.
    drift_sigma_nm_per_min: of a drift that the frames cannot tell; those of both directions do.
    out: a TOML file for `scanner=`, here and in the program. `scanner=answer.calibration` does as well.
    """
    settings, told = _split(options)
    document, toml, failed = _core.calibrate(
        _paths(paths), told, lattice, drift_sigma_nm_per_min, settings, threads, teller(progress)
    )
    answer = json.loads(document)
    if out is not None:
        with open(out, "x", encoding="utf-8", newline="") as file:
            file.write(toml)
    warn([Caveat.from_dict(caveat) for caveat in answer["caveats"]], [])
    _lost(failed)
    return Record(answer)


def validate(
    *,
    sets: int = 200,
    method: Literal["lattice", "autocorrelation", "fourier", "paper"] = "lattice",
    seed: int = 1,
    conditions: Mapping[str, Any] | None = None,
    threads: int | None = None,
    progress: Progress = None,
) -> Record:
    """Simulates sets, analyses them and compares drift, twist and strain with what was put in, as `moiregauge validate`:
    bias, efficiency against the Cramér–Rao bound, and coverage of the stated errors, in `quantities`.

    conditions: as in `simulate`; by default four small frames.
    """
    request = {"sets": sets, "method": method, "seed": seed, "conditions": conditions or {}}
    return Record(json.loads(_core.validate(words(request), threads, teller(progress))))
