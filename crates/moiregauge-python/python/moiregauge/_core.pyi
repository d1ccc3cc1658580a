import os
from collections.abc import Callable, Sequence
from typing import Any, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Analysis",
    "ManySamples",
    "Map",
    "SETTINGS",
    "__version__",
    "calculated_by",
    "calibrate",
    "convert",
    "inspect",
    "map",
    "moire",
    "plan",
    "plus_minus",
    "program",
    "read",
    "simulate",
    "tables",
    "validate",
]

__version__: str
SETTINGS: str

_Path = str | os.PathLike[str]
_Progress = Callable[[str, int, int], object] | None

@final
class Analysis:
    def __new__(
        cls,
        paths: Sequence[_Path],
        options: str,
        known: str,
        beside: str,
        held: Sequence[tuple[_Path, bytes | tuple[str, Sequence[Any]]]],
    ) -> Analysis: ...
    def analyse(self, threads: int | None, progress: _Progress) -> list[tuple[str, str]]: ...
    def kept(self) -> str: ...
    def take(self, kept: str) -> None: ...
    def report(
        self,
        folder: _Path,
        force: bool,
        choice: str,
        parquet: bool,
        threads: int | None,
        progress: _Progress,
    ) -> int: ...
    def image(
        self, file: str
    ) -> tuple[NDArray[np.float64], tuple[tuple[float, float], tuple[float, float]], tuple[float, float], str, str]: ...

@final
class Map:
    def report(self, folder: _Path, force: bool, choice: str, threads: int | None, progress: _Progress) -> None: ...

@final
class ManySamples:
    def __new__(cls, root: _Path, table: _Path | None, options: str, known: str, out: _Path) -> ManySamples: ...
    def __len__(self) -> int: ...
    def all(self, threads: int | None, progress: _Progress) -> tuple[int, int, int, int]: ...
    def some(self, places: Sequence[int], threads: int | None) -> tuple[int, int, int, int]: ...
    def sample(self, place: int) -> tuple[str, str, list[_Path]]: ...
    def give_up(self, place: int, why: str) -> None: ...

def calculated_by(file: _Path) -> None: ...
def map(
    analysis: Analysis, asked: str, threads: int | None, progress: _Progress
) -> tuple[Map, str, dict[str, tuple[str, NDArray[np.float64]]]]: ...
def plus_minus(value: float, sigma: float, total: float | None) -> str: ...
def program(arguments: Sequence[str]) -> int: ...
def read(name: _Path, content: bytes | None, known: str) -> tuple[str, list[NDArray[np.float64]]]: ...
def tables(document: str) -> list[tuple[str, str]]: ...
def inspect(paths: Sequence[_Path], known: str) -> str: ...
def moire(given: str, options: str, band_degeneracy: float) -> tuple[str, str]: ...
def plan(request: str, options: str, threads: int | None, progress: _Progress) -> str: ...
def simulate(
    sets: str,
    paper: int | None,
    out: _Path,
    force: bool,
    threads: int | None,
    progress: _Progress,
) -> list[_Path]: ...
def convert(
    paths: Sequence[_Path],
    known: str,
    request: str,
    to: tuple[_Path, bool],
    force: bool,
    threads: int | None,
    progress: _Progress,
) -> tuple[list[_Path], list[tuple[str, str]]]: ...
def calibrate(
    paths: Sequence[_Path],
    known: str,
    lattice: str,
    drift_sigma_nm_per_min: float,
    options: str,
    threads: int | None,
    progress: _Progress,
) -> tuple[str, str, list[tuple[str, str]]]: ...
def validate(request: str, threads: int | None, progress: _Progress) -> str: ...
