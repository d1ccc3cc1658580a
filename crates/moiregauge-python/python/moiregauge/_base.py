"""What documents can do: dictionaries, tables, arrays, words, HTML."""

from __future__ import annotations

import dataclasses
import functools
import json
import types
import typing
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal, TypeAlias, TypeVar, Union, cast

import numpy as np

if TYPE_CHECKING:
    import os

    import pandas
    import xarray
    from numpy.typing import NDArray

    from moiregauge import _core
    from moiregauge._arguments import Progress
    from moiregauge.results import Estimate, MapResults, Results

T = TypeVar("T", bound="Document")


def _encoded(value: Any) -> Any:
    if isinstance(value, Document):
        return value.to_dict()
    if isinstance(value, tuple):
        return [_encoded(one) for one in value]
    return value


# What makes a value of a document one of ours; `None` where it stays as it is.
Decoder: TypeAlias = "Callable[[Any], Any] | None"


@functools.cache
def _decoders(of: type[Any]) -> dict[str, Decoder]:
    """Those of the fields of a class, made once."""
    return {name: _decoder(wanted) for name, wanted in typing.get_type_hints(of).items()}


@functools.cache
def _decoder(wanted: Any) -> Decoder:
    origin = typing.get_origin(wanted)
    if origin in (Union, types.UnionType):
        return _decoder(next(one for one in typing.get_args(wanted) if one is not type(None)))
    if origin is tuple:
        inner = typing.get_args(wanted)
        if inner[-1] is Ellipsis:
            return functools.partial(_tuple, _decoder(inner[0]))
        return functools.partial(_tuple_of, [_decoder(of) for of in inner])
    if isinstance(wanted, type) and issubclass(wanted, Document):
        return wanted.from_dict
    return float if wanted is float else None


def _tuple(decoder: Decoder, values: list[Any]) -> tuple[Any, ...]:
    if decoder is None:
        return tuple(values)
    return tuple([None if value is None else decoder(value) for value in values])


def _tuple_of(decoders: list[Decoder], values: list[Any]) -> tuple[Any, ...]:
    both = zip(decoders, values, strict=True)
    return tuple([value if value is None or decoder is None else decoder(value) for decoder, value in both])


class Document:
    """A part of a published document. Frozen; compared by value; no reference to a file or an image."""

    @classmethod
    def from_dict(cls: type[T], document: Mapping[str, Any]) -> T:
        """That of a document, as `results.json` holds it.

        Raises `ValueError` for names that this version does not know.
        """
        decoders = _decoders(cast(Any, cls))
        if not document.keys() <= decoders.keys():
            known = {field.name for field in dataclasses.fields(cast(Any, cls))}
            raise ValueError(f"{cls.__name__}: expected {sorted(known)}, found also {sorted(document.keys() - known)}")
        given = {}
        for name, value in document.items():
            decoder = decoders[name]
            given[name] = value if value is None or decoder is None else decoder(value)
        return cls(**given)

    def to_dict(self) -> dict[str, Any]:
        """The document as plain dictionaries, lists, numbers and words: that of `results.json` or `map.json`."""
        document = {}
        for field in dataclasses.fields(cast(Any, self)):
            value = getattr(self, field.name)
            # What a document may leave out is left out where there is none.
            if field.default is not dataclasses.MISSING and value == field.default:
                continue
            document[field.name] = _encoded(value)
        return document


class EstimateBase(Document):
    """A value with its errors."""

    def __str__(self) -> str:
        from moiregauge import _core

        def known(value: float | None) -> float:
            return float("nan") if value is None else value

        own = cast("Estimate", self)
        return _core.plus_minus(known(own.value), known(own.sigma), own.sigma_total)

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
        from moiregauge._html import results

        return results(cast("Results", self))

    def __str__(self) -> str:
        return self._summary or repr(self)

    def __repr__(self) -> str:
        from moiregauge._html import in_a_line

        return in_a_line(cast("Results", self))

    def to_pandas(self, table: Literal["scans", "vectors", "sets", "budget"] = "scans") -> pandas.DataFrame:
        """A table of the report as a `pandas.DataFrame`: one row a scan, or those of `vectors.csv`, `sets.csv` or
        `budget.csv`. Columns have the names and units of these files.
        """
        from moiregauge._frames import to_pandas

        return to_pandas(cast("Results", self), table)

    def to_xarray(self) -> xarray.Dataset:
        """The scans as an `xarray.Dataset` along `scan`: twist, strain, wavelengths, each with a variable for its σ,
        `units`, `long_name` and `ancillary_variables` as in the CF conventions; settings and provenance as JSON in the
        attributes.
        """
        from moiregauge._frames import to_xarray

        return to_xarray(cast("Results", self))

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
        from moiregauge._analyze import write_report

        choice = {"figures": figures, "png": png, "html": html, "colormap": colormap}
        return write_report(cast("Results", self), Path(folder), force, choice, parquet, threads, progress)


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
        from moiregauge._progress import teller

        if self._map is None:
            raise ValueError("this map was pickled or read from a document: map the scans again to report it")
        choice = {"figures": figures, "png": png, "html": html, "colormap": colormap}
        self._map.report(folder, force, json.dumps(choice), threads, teller(progress))
        return Path(folder) / ("report.html" if html else "map.json")

    def to_xarray(self) -> xarray.Dataset:
        """The map as an `xarray.Dataset` with the dimensions `y` and `x` (nm, row 0 at the bottom): every quantity with
        `units`, `long_name` and, in `ancillary_variables`, the name of its σ; `mask` as CF flags.
        """
        from moiregauge._frames import map_to_xarray

        return map_to_xarray(cast("MapResults", self))

    def __repr__(self) -> str:
        from moiregauge._html import map_in_a_line

        return map_in_a_line(cast("MapResults", self))

    def _repr_html_(self) -> str:
        from moiregauge._html import map_results

        return map_results(cast("MapResults", self))
