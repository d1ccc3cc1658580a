"""From scans to results."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Unpack, cast

from moiregauge import _core
from moiregauge._arguments import Asked, Input, asked, words
from moiregauge._errors import CaveatWarning, FailedFileWarning
from moiregauge._progress import Progress, teller
from moiregauge._scan import Scan, scan
from moiregauge._signature import takes_what
from moiregauge.results import Caveat, FailedInput, MapResults, Results, ScanResult

if TYPE_CHECKING:
    from moiregauge._options import Options


def read(file: Input, **told: Unpack[Options]) -> Scan:
    """Reads a scan: a path, or a file opened for bytes.

    `told` is what the file does not say: `size_nm`, `line_rate_hz`, `frame_direction`, `rotation_deg`, `unit`, `crop`.
    Row 0 of `values` is the bottom line.

    Raises `ReadError` for what is no scan or is damaged.
    """
    content = None
    if hasattr(file, "read"):
        from moiregauge._arguments import content_of, name_of

        name, content = name_of(file, 0), content_of(file)
    else:
        name = os.fspath(cast("str", file))
    about, values = _core.read(name, content, words(told))
    return scan(json.loads(about), values)


def run_of(
    found: Asked,
    options: Mapping[str, Any],
    sets: Mapping[str, Any] | None = None,
    atomic: Sequence[Any] | None = None,
    atomic_layer: int = 1,
    survey_image: Any = None,
) -> _core.Analysis:
    """A run of the compiled half."""
    names = [str(path) for path in found.paths] + [name for name, _ in found.held]
    beside = {
        "arguments": ["analyze", *names, *(f"{key}={value!r}" for key, value in options.items())],
        "sets": [{"name": name, "path": os.fspath(path)} for name, path in (sets or {}).items()],
        "atomic": None
        if atomic is None
        else {"files": [os.fspath(path) for path in atomic], "layer": atomic_layer, "channel": None},
        "survey_image": None if survey_image is None else os.fspath(survey_image),
    }
    return _core.Analysis(found.paths, found.options, found.told, json.dumps(beside), found.held)


def results_of(run: _core.Analysis, threads: int | None, progress: Progress) -> list[Results]:
    """Analyses, and makes the results of every moiré."""
    all_of_them = []
    for document, summary in run.analyse(threads, teller(progress)):
        found = Results.from_dict(json.loads(document))
        object.__setattr__(found, "_run", run)
        object.__setattr__(found, "_summary", summary)
        all_of_them.append(found)
    return all_of_them


def warn(caveats: Sequence[Caveat], failed: Sequence[FailedInput]) -> None:
    """One warning for each kind of doubt, at the line of the user's call."""
    inside = (os.path.dirname(__file__),)
    if failed:
        others = f" and {len(failed) - 1} more" if len(failed) > 1 else ""
        text = f"{failed[0].file}: {failed[0].error}{others}"
        _warn(text, FailedFileWarning, inside)
    kinds: dict[str, list[Caveat]] = {}
    for caveat in caveats:
        kinds.setdefault(caveat.code, []).append(caveat)
    for code, same in kinds.items():
        others = f" and {len(same) - 1} more" if len(same) > 1 else ""
        _warn(f"{code} ({same[0].where}{others}): {same[0].message}", CaveatWarning, inside)


def _warn(text: str, category: type[Warning], inside: tuple[str, ...]) -> None:
    # The first frame outside of the package, as `skip_file_prefixes` of Python 3.12 finds it.
    import sys

    level, frame = 1, sys._getframe()
    while frame.f_back is not None and frame.f_code.co_filename.startswith(inside):
        frame, level = frame.f_back, level + 1
    warnings.warn(text, category, stacklevel=level)


def analyze_moires(
    paths: Input | Sequence[Input] | None = None,
    *,
    arrays: Sequence[Any] | None = None,
    pixel_nm: float | tuple[float, float] | None = None,
    names: Sequence[str] | None = None,
    sets: Mapping[str, Any] | None = None,
    atomic: Sequence[Any] | None = None,
    atomic_layer: Literal[1, 2] = 1,
    survey_image: Any = None,
    threads: int | None = None,
    progress: Progress = None,
    **options: Unpack[Options],
) -> list[Results]:
    """As `analyze` with `moires=N`, of images that show several moirés each: the results of all, the largest cell first."""
    found = asked(paths, arrays, pixel_nm, names, options)
    run = run_of(found, options, sets, atomic, atomic_layer, survey_image)
    all_of_them = results_of(run, threads, progress)
    for results in all_of_them:
        warn(results.caveats, results.failed)
    return all_of_them


@takes_what(analyze_moires)
def analyze(*inputs: Any, **given: Any) -> Results:
    """From scans to drift, moiré lattice, twist and heterostrain, each with its uncertainty.

    Does what `moiregauge analyze` does: scans are grouped into sets by slow axis, line rate, size and channel and
    ordered by time; each set gives its drift (from scans of alternating slow direction), its lattice, twist and strain;
    the sets are compared and combined. The same inputs, options and seed give the same numbers on any number of threads.

    paths: files, folders or names with `*`; files opened for bytes; what `read` returned; arrays, as in `arrays`.
    arrays: 2-D arrays (rows × columns, **row 0 at the bottom**) of any real type; `xarray.DataArray` with places in nm
        (or with `units`); or dictionaries such as `{"phase_trace": a, "phase_retrace": b, "x_sensor": x, "y_sensor": y}`
        with positions in nm (`sensor_unit`). NaN and masked pixels are missing. Each is copied once.
    pixel_nm: distance of neighbouring pixels of arrays, or that along and across the lines, nm.
    names: of the arrays in results.
    sets: sets made by hand, name → folder or file.
    atomic: images of the atoms of layer `atomic_layer` (1: the lower one), which tell its orientation.
    survey_image: an image of a larger area; a figure of the report marks the scans in it.
    threads: at most so many; all processors without.
    progress: `True`, or a function of what is being done, how much is done, and how much there is.
    options: settings of the program and what files do not say, such as `seed`, `channel`, `layers`, `drift`, `size_nm`:
        see `help(moiregauge.Options)`.

    Doubts are in `caveats` and warned of once for each kind (`CaveatWarning`). Raises `ReadError` where nothing can be
    read, `MeasureError` where nothing shows a lattice, `ValueError` for options that make no sense.
    """
    if int(given.get("moires", 1)) != 1:
        raise ValueError("moires: analyze gives the results of one moiré; analyze_moires gives those of all")
    (results,) = analyze_moires(*inputs, **given)
    return results


def measure(
    scan: Input,
    *,
    pixel_nm: float | tuple[float, float] | None = None,
    threads: int | None = None,
    progress: Progress = None,
    **options: Unpack[Options],
) -> ScanResult:
    """The lattice of one scan: lines, vectors with covariances, twist and strain, not corrected for drift unless `drift`
    is given. Takes what `analyze` takes, one of it.
    """
    found = asked(scan, None, pixel_nm, None, options)
    (results,) = results_of(run_of(found, options), threads, progress)
    scans = [one for group in results.sets for one in group.scans]
    if len(scans) != 1:
        raise ValueError(f"expected one scan, found {len(scans)}: analyze takes several")
    warn(results.caveats, results.failed)
    return scans[0]


class Campaign:
    """Scans that come and go: each is measured once, everything else is repeated in milliseconds.

    Options are those of `analyze`. A campaign can be pickled with all that it has measured, unless it holds arrays.
    """

    def __init__(self, **options: Unpack[Options]) -> None:
        self._options: dict[str, Any] = dict(options)
        self._paths: list[Any] = []
        self._kept: str | None = None
        self._run: _core.Analysis | None = None

    def add(self, *paths: Any) -> None:
        """Adds files, folders or arrays. They are read by the next `analyze`."""
        self._paths.extend(paths)

    def remove(self, path: Any) -> None:
        """Removes what was added. What was measured of it is kept."""
        self._paths = [one for one in self._paths if one is not path and not _same(one, path)]

    def set(self, **options: Unpack[Options]) -> None:
        """Changes options. What they do not change is not measured again."""
        self._options.update(options)

    def __len__(self) -> int:
        """How many things were added."""
        return len(self._paths)

    def analyze(
        self,
        *,
        pixel_nm: float | tuple[float, float] | None = None,
        threads: int | None = None,
        progress: Progress = None,
    ) -> Results:
        """Measures what is new, and analyses all. What was measured is kept where it is interrupted."""
        found = asked(self._paths, None, pixel_nm, None, self._options)
        run = run_of(found, self._options)
        if self._run is not None:
            run.take(self._run.kept())
        elif self._kept is not None:
            run.take(self._kept)
        self._run, self._kept = run, None
        (results,) = results_of(run, threads, progress)
        warn(results.caveats, results.failed)
        return results

    def __getstate__(self) -> dict[str, Any]:
        kept = self._run.kept() if self._run is not None else self._kept
        return {**self.__dict__, "_run": None, "_kept": kept}


def _same(one: Any, other: Any) -> bool:
    plain = (str, os.PathLike)
    return isinstance(one, plain) and isinstance(other, plain) and Path(one) == Path(other)


def map(  # noqa: A001
    paths: Input | Sequence[Input] | None = None,
    *,
    arrays: Sequence[Any] | None = None,
    pixel_nm: float | tuple[float, float] | None = None,
    names: Sequence[str] | None = None,
    sets: Mapping[str, Any] | None = None,
    map_method: Literal["demodulation", "tiles"] = "demodulation",
    window_nm: float | None = None,
    step_nm: float | None = None,
    margin: float | None = None,
    in_bands: bool = False,
    regions: Mapping[str, Sequence[tuple[float, float]]] | None = None,
    profiles: Mapping[str, tuple[tuple[float, float], tuple[float, float]]] | None = None,
    device_nm: tuple[float, float] | None = None,
    device_angles: int = 1,
    device_count: int = 10,
    wanted_deg: tuple[float, float] | None = None,
    domains: Literal["auto", "on", "off"] = "auto",
    nodes: Literal["auto", "bright", "dark"] = "auto",
    threads: int | None = None,
    progress: Progress = None,
    **options: Unpack[Options],
) -> MapResults:
    """Maps of twist, strain, wavelength and orientation across an image, with the error of every node.

    Does what `moiregauge map` does: scans are analysed first, their drift and sensors correct the maps; local wave
    vectors of all harmonics come from the phases under a Gaussian window; maps of scans of one place are averaged.
    Bad nodes are masked, with the reason. Places are x to the right, y up, nm.

    paths, arrays, pixel_nm, names, sets, threads, progress, options: as in `analyze`.
    map_method: phases under a window, or fits on overlapping tiles.
    window_nm: standard deviation of the window, nm; a point becomes 2.35 of it wide. By itself as wide as the lattice stays
        straight, at least 0.6 periods.
    step_nm: distance of the nodes, nm; by itself a third of the window.
    margin: at the edges, in windows; by itself 2, or a quarter of the frame where that is less.
    in_bands: map in bands, as images of more than 20 million pixels are.
    regions: mean, spread and errors within polygons: name → corners (x, y), nm. In `details.regions`.
    profiles: names → two ends (x, y) of a line, nm; `profiles.csv` of the report has them.
    device_nm: the most uniform areas of this width and height, at so many `device_angles`, so many of them: `details.devices`.
    wanted_deg: how much of the map has this twist, within so much, degrees: `details.wanted`.
    domains, nodes: whether triangles between nodes are looked for at small angles, and how nodes look.

    Raises as `analyze`, and `MeasureError` where no image gives a map.
    """
    found = asked(paths, arrays, pixel_nm, names, options)
    run = run_of(found, options, sets)
    questions: dict[str, Any] = {
        "regions": [{"name": name, "corners_nm": list(corners)} for name, corners in (regions or {}).items()],
        "profiles": [{"name": name, "ends_nm": list(ends)} for name, ends in (profiles or {}).items()],
    }
    if device_nm is not None:
        questions["device"] = {"size_nm": list(device_nm), "orientations": device_angles, "most": device_count}
    if wanted_deg is not None:
        questions["wanted"] = {"twist_deg": wanted_deg[0], "within_deg": wanted_deg[1]}
    request = {
        "method": map_method,
        "window_nm": window_nm,
        "step_nm": step_nm,
        "margin": margin,
        "in_bands": in_bands,
        "questions": questions,
        "domains": {"when": domains, "nodes": nodes},
    }
    made, document, planes = _core.map(run, words(request), threads, teller(progress))
    results = MapResults.from_dict(json.loads(document))
    object.__setattr__(results, "_arrays", planes)
    object.__setattr__(results, "_map", made)
    warn(results.caveats, results.provenance.failed)
    return results
