"""Maps of many samples: a folder of Zarr stores, written whole or not at all, opened when they are looked at."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypedDict
from urllib.parse import quote

from moiregauge import _core
from moiregauge._analyze import map as map_of

if TYPE_CHECKING:
    import xarray

# What a store depends on, as an attribute of it; the last one to be written.
KEY = "moiregauge_key"


class MapOptions(TypedDict, total=False):
    """Keywords of `moiregauge.map`; see there."""

    map_method: Literal["demodulation", "tiles"]
    window_nm: float
    step_nm: float
    margin: float
    in_bands: bool
    regions: Mapping[str, Sequence[tuple[float, float]]]
    profiles: Mapping[str, tuple[tuple[float, float], tuple[float, float]]]
    device_nm: tuple[float, float]
    device_angles: int
    device_count: int
    wanted_deg: tuple[float, float]
    domains: Literal["auto", "on", "off"]
    nodes: Literal["auto", "bright", "dark"]


class Maps(Mapping[str, "xarray.Dataset"]):
    """The maps of a campaign by the names of their samples. Numbers are read where they are asked for."""

    def __init__(self, out: Path, samples: Sequence[str]) -> None:
        self._folder = out / "maps"
        self._samples = [name for name in samples if self._store(name).is_dir()]
        self.failed: dict[str, str] = {}
        """Samples without a map, and why."""
        for name in samples:
            why = self._store(name).with_suffix(".failed.json")
            if name not in self._samples and why.is_file():
                self.failed[name] = str(json.loads(why.read_text(encoding="utf-8"))["why"])

    def _store(self, sample: str) -> Path:
        return self._folder / f"{quoted(sample)}.zarr"

    def __getitem__(self, sample: str) -> xarray.Dataset:
        import xarray

        if sample not in self._samples:
            raise KeyError(f"{sample}: {self.failed.get(sample, 'no such sample')}")
        # Without chunks nothing but coordinates is read, and dask is not needed; `.chunk()` makes it parallel.
        found: xarray.Dataset = xarray.open_zarr(self._store(sample), chunks=None, consolidated=False)
        return found

    def __iter__(self) -> Iterator[str]:
        return iter(self._samples)

    def __len__(self) -> int:
        return len(self._samples)

    def __repr__(self) -> str:
        return f"<Maps: {len(self)} samples in {self._folder}, {len(self.failed)} without a map>"


def quoted(sample: str) -> str:
    """The name of a sample as that of a file."""
    return quote(sample, safe=" ")


def made(many: _core.ManySamples, out: str, wanted: tuple[Any, ...], place: int, threads: int | None) -> None:
    """Maps a sample, unless that was done; a sample without a map leaves the reason."""
    sample, key, files = many.sample(place)
    folder, key = Path(out) / "maps", _key(key, wanted)
    store = folder / f"{quoted(sample)}.zarr"
    if _is_there(store, key):
        return
    of_map, options = wanted
    try:
        with warnings.catch_warnings():
            # They stand in the store.
            warnings.simplefilter("ignore")
            data = map_of([os.fspath(file) for file in files], threads=threads, **of_map, **options).to_xarray()
    except ValueError as error:
        failures(many, out, wanted, place, str(error))
        return
    data.attrs[KEY] = key
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix=".part-", dir=folder) as part:
        whole = Path(part) / "map.zarr"
        with warnings.catch_warnings():
            # Text of variable length: zarr calls its own form of it unstable.
            warnings.simplefilter("ignore")
            data.to_zarr(whole, mode="w", consolidated=False)
        shutil.rmtree(store, ignore_errors=True)
        try:
            os.replace(whole, store)
        except OSError:
            # Another worker was faster; both wrote the same.
            if not _is_there(store, key):
                raise
    store.with_suffix(".failed.json").unlink(missing_ok=True)


def failures(many: _core.ManySamples, out: str, wanted: tuple[Any, ...], place: int, why: str) -> None:
    """Writes why a sample has no map."""
    sample, _, _ = many.sample(place)
    store = Path(out) / "maps" / f"{quoted(sample)}.zarr"
    store.parent.mkdir(parents=True, exist_ok=True)
    shutil.rmtree(store, ignore_errors=True)
    part = store.with_suffix(f".{os.getpid()}.part")
    part.write_text(json.dumps({"sample": sample, "why": why}, ensure_ascii=False) + "\n", encoding="utf-8")
    os.replace(part, store.with_suffix(".failed.json"))


def _key(key: str, wanted: tuple[Any, ...]) -> str:
    asked = json.dumps([_core.__version__, key, wanted], sort_keys=True, default=repr)
    return hashlib.sha256(asked.encode()).hexdigest()


def _is_there(store: Path, key: str) -> bool:
    try:
        about = json.loads((store / "zarr.json").read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return False
    return bool(about.get("attributes", {}).get(KEY) == key)
