"""What estimates, results and maps can do beside being documents."""

from __future__ import annotations

import types
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from moiregauge import _frames, _html, _report, _words
from moiregauge._document import Document
from moiregauge._progress import Progress

if TYPE_CHECKING:
    import os

    import pandas
    import xarray
    from numpy.typing import NDArray

    from moiregauge import _core


class EstimateBase(Document):
    """A value with its errors."""

    def __str__(self) -> str:
        return _words.estimate(self.to_dict())

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self})"

    def __float__(self) -> float:
        raise TypeError("an estimate is no number: take .value, and with it .sigma or .sigma_total")


class ResultsBase(Document):
    """What an analysis found."""

    if TYPE_CHECKING:
        # The run with its measured scans; no part of the document, and not pickled.
        _run: _core.Analysis | None
        # What the program prints.
        _summary: str
    else:
        _run, _summary = None, ""

    def __getstate__(self) -> dict[str, Any]:
        state = dict(self.__dict__)
        state.pop("_run", None)
        return state

    def _repr_html_(self) -> str:
        return _html.results(self.to_dict())

    def __str__(self) -> str:
        return self._summary or repr(self)

    def __repr__(self) -> str:
        return _words.results(self.to_dict())

    def to_pandas(self, table: Literal["scans", "vectors", "sets", "budget"] = "scans") -> pandas.DataFrame:
        """A table of the report as a `pandas.DataFrame`: one row a scan, or those of `vectors.csv`, `sets.csv` or
        `budget.csv`. Columns have the names and units of these files.
        """
        return _frames.to_pandas(self.to_dict(), table)

    def to_xarray(self) -> xarray.Dataset:
        """The scans as an `xarray.Dataset` along `scan`: twist, strain, wavelengths, each with a variable for its σ,
        `units`, `long_name` and `ancillary_variables` as in the CF conventions; settings and provenance as JSON in the
        attributes.
        """
        return _frames.to_xarray(self.to_dict())

    def report(
        self,
        folder: str | os.PathLike[str],
        *,
        force: bool = False,
        figures: bool = True,
        png: bool = True,
        html: bool = True,
        colormap: Literal["viridis", "grey", "nanoscope", "gwyddion"] = "viridis",
        parquet: bool = False,
        threads: int | None = None,
        progress: Progress = None,
    ) -> Path:
        """Writes what `moiregauge analyze` writes into a folder: documents, tables, figures, `report.html`, the same
        bytes. Returns the page, or `results.json` where none was wanted.

        A folder that holds results is refused unless `force`. Results that were pickled have no scans any more: these
        are measured again, and `ValueError` says where something else came out.
        """
        choice = {"figures": figures, "png": png, "html": html, "colormap": colormap}
        run = self._run or _report.run_again(self.to_dict(), threads, progress)
        return _report.write(run, Path(folder), force, choice, parquet, threads, progress)


class MapBase(Document):
    """A map: the document, and the arrays of all quantities."""

    if TYPE_CHECKING:
        # Name → (unit, values of rows × columns of nodes, row 0 at the bottom). Compared and pickled.
        _arrays: Mapping[str, tuple[str, NDArray[Any]]]
        # What a report needs; not pickled.
        _map: _core.Map | None
    else:
        _arrays, _map = types.MappingProxyType({}), None

    def __getstate__(self) -> dict[str, Any]:
        state = {**self.__dict__, "_arrays": dict(self._arrays)}
        state.pop("_map", None)
        return state

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, MapBase):
            return NotImplemented
        if self.to_dict() != other.to_dict() or self._arrays.keys() != other._arrays.keys():
            return False
        both = ((self._arrays[name], other._arrays[name]) for name in self._arrays)
        return all(a[0] == b[0] and np.array_equal(a[1], b[1], equal_nan=True) for a, b in both)

    __hash__: ClassVar[None]  # type: ignore[assignment]

    @property
    def arrays(self) -> dict[str, NDArray[Any]]:
        """Every quantity by its name: rows × columns of nodes, row 0 at the bottom; °, %, nm as in `quantities`.

        `mask` is 0 at good nodes; `masks` explains the other numbers.
        """
        return {name: values for name, (_, values) in self._arrays.items()}

    def report(
        self,
        folder: str | os.PathLike[str],
        *,
        force: bool = False,
        figures: bool = True,
        png: bool = True,
        html: bool = True,
        colormap: Literal["viridis", "grey", "nanoscope", "gwyddion"] = "viridis",
        threads: int | None = None,
        progress: Progress = None,
    ) -> Path:
        """Writes what `moiregauge map` writes into a folder: the document, `map.zarr`, `map.gwy`, tables, figures,
        `report.html`. Returns the page, or `map.json` where none was wanted. Maps that were pickled cannot be reported.
        """
        if self._map is None:
            raise ValueError("this map was pickled or read from a document: map the scans again to report it")
        choice = {"figures": figures, "png": png, "html": html, "colormap": colormap}
        return _report.write_map(self._map, Path(folder), force, choice, threads, progress)

    def to_xarray(self) -> xarray.Dataset:
        """The map as an `xarray.Dataset` with the dimensions `y` and `x` (nm, row 0 at the bottom): every quantity with
        `units`, `long_name` and, in `ancillary_variables`, the name of its σ; `mask` as CF flags.
        """
        return _frames.map_to_xarray(self.to_dict(), self._arrays)

    def __repr__(self) -> str:
        return _words.map_results(self.to_dict())

    def _repr_html_(self) -> str:
        return _html.map_results(self.to_dict())
