"""Results as tables of pandas and arrays of xarray. Both are imported only here, where they are asked for."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from moiregauge import _core

if TYPE_CHECKING:
    import pandas
    import xarray

Found: TypeAlias = Mapping[str, Any]

WORDS = {
    "set",
    "file",
    "acquired",
    "frame_direction",
    "slow_axis",
    "coordinates",
    "excluded",
    "channel",
    "vector",
    "quantity",
    "source",
}
UNITS = {
    "_nm_per_min": "nm min-1",
    "_nm_per_s": "nm s-1",
    "_nm2": "nm2",
    "_percent2": "1e-4",
    "_percent": "percent",
    "_deg": "degree",
    "_nm": "nm",
    "_hz": "Hz",
}


def _tables(found: Found) -> dict[str, str]:
    return dict(_core.tables(json.dumps(found)))


def _rows(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text.lstrip("\ufeff"))))


def _value(name: str, text: str) -> Any:
    if name in WORDS:
        # Tables have an apostrophe before what a spreadsheet would run.
        return text.removeprefix("'")
    if text in ("true", "false"):
        return text == "true"
    try:
        return float(text) if text else float("nan")
    except ValueError:
        return text


def scans(found: Found) -> list[dict[str, Any]]:
    """One row a scan: free of drift where that is known, and the wavelengths beside it."""
    tables = _tables(found)
    best: dict[tuple[str, str], dict[str, str]] = {}
    for row in _rows(tables["scans.csv"]):
        key = (row["set"], row["scan"])
        if key not in best or row["twist_deg"]:
            best[key] = row
    for row in _rows(tables["vectors.csv"]):
        scan = best[row["set"], row["scan"]]
        if row["coordinates"] == scan["coordinates"]:
            name = row["vector"].lower()
            scan[f"{name}_nm"] = row["wavelength_nm"]
            scan[f"{name}_sigma_nm"] = row["wavelength_sigma_nm"]
    return [{name: _value(name, text) for name, text in row.items()} for row in best.values()]


def to_pandas(found: Found, table: str) -> pandas.DataFrame:
    import pandas

    if table not in ("scans", "vectors", "sets", "budget"):
        raise ValueError(f'table: expected "scans", "vectors", "sets" or "budget", found {table!r}')
    if table == "scans":
        frame = pandas.DataFrame(scans(found))
    else:
        rows = _rows(_tables(found)[f"{table}.csv"])
        frame = pandas.DataFrame([{name: _value(name, text) for name, text in row.items()} for row in rows])
    for name in ("scan", "scans"):
        if name in frame:
            frame[name] = frame[name].astype(int)
    if "acquired" in frame:
        frame["acquired"] = pandas.to_datetime(frame["acquired"].replace("", None))
    return frame


def _meaning(columns: str) -> dict[str, str]:
    """What `columns.md` says of each column."""
    return dict(reversed(re.findall(r"^\| `(\w+)` \| (.+) \|$", columns, flags=re.MULTILINE)))


def _unit(name: str) -> str:
    return next((unit for end, unit in UNITS.items() if name.endswith(end)), "1")


def to_xarray(found: Found) -> xarray.Dataset:
    import xarray

    rows = scans(found)
    meaning = _meaning(_tables(found)["columns.md"])
    data = xarray.Dataset()
    names = list(dict.fromkeys(name for row in rows for name in row))
    for name in names:
        if name == "scan":
            continue
        values = [row.get(name, "" if name in WORDS else float("nan")) for row in rows]
        attrs = {"long_name": meaning.get(name, name.replace("_", " "))}
        if name in WORDS:
            data[name] = ("scan", np.array(values, dtype=str), attrs)
            continue
        attrs["units"] = _unit(name)
        data[name] = ("scan", np.array(values, dtype=float), attrs)
    for name in names:
        for sigma in (_sigma_of(name), _sigma_of(name).replace("_sigma", "_spread")):
            if sigma != name and sigma in data and name in data:
                data[name].attrs["ancillary_variables"] = sigma
    data.coords["scan"] = (
        "scan",
        np.arange(1, len(rows) + 1),
        {"long_name": "number of the scan, in order of sets and time"},
    )
    data.attrs = {
        "Conventions": "CF-1.11",
        "title": "Twist and strain of a moiré superlattice, scan by scan",
        "source": f"moiregauge {found['provenance']['version']}",
        **{
            name: json.dumps(found[name], ensure_ascii=False)
            for name in ("settings", "provenance", "conventions", "caveats")
        },
    }
    return data


def _sigma_of(name: str) -> str:
    """`twist_deg` → `twist_sigma_deg`."""
    end = next((end for end in UNITS if name.endswith(end)), "")
    stem = name[: len(name) - len(end)]
    return f"{stem.removesuffix('_ccw_from_x')}_sigma{end}"


def map_to_xarray(found: Found, arrays: Mapping[str, tuple[str, NDArray[Any]]]) -> xarray.Dataset:
    import xarray

    columns, rows = found["nodes"]
    along, across = np.array(found["step_nm"][0]), np.array(found["step_nm"][1])
    origin = np.array(found["origin_nm"])
    # Exact where the axes of the map are those of the laboratory; `position_x` and `position_y` hold always.
    straight = abs(along[1]) < 1e-9 and abs(across[0]) < 1e-9
    x = np.arange(columns) * (along[0] if straight else np.hypot(*along)) + (origin[0] if straight else 0.0)
    y = np.arange(rows) * (across[1] if straight else np.hypot(*across)) + (origin[1] if straight else 0.0)
    where = "from the left" if straight else "along the rows of nodes, from the first"
    data = xarray.Dataset(
        coords={
            "y": (
                "y",
                y,
                {
                    "units": "nm",
                    "long_name": f"place, {where.replace('left', 'bottom').replace('rows', 'columns')}",
                    "axis": "Y",
                },
            ),
            "x": ("x", x, {"units": "nm", "long_name": f"place, {where}", "axis": "X"}),
        }
    )
    units = {"°": "degree", "%": "percent", "nm": "nm", "%²": "1e-4", "rad/nm²": "rad nm-2", "": "1"}
    for name, (unit, values) in arrays.items():
        key = name.replace(" ", "_")
        attrs: dict[str, Any] = {"long_name": name, "units": units.get(unit, unit)}
        if key == "mask":
            names = {mask["value"]: mask["name"] for mask in found["masks"]}
            attrs = {
                "long_name": "why a node is not to be believed",
                "flag_values": sorted(names),
                "flag_meanings": " ".join(names[value].replace(" ", "_") for value in sorted(names)),
            }
            values = values.astype("uint8")
        elif f"{name} sigma" in arrays:
            attrs["ancillary_variables"] = f"{key}_sigma mask"
        data[key] = (("y", "x"), values, attrs)
    for axis in ("x", "y"):
        if f"position_{axis}" in data:
            data = data.set_coords(f"position_{axis}")
    kept = ("settings", "provenance", "conventions", "caveats", "quantities", "method")
    data.attrs = {
        "Conventions": "CF-1.11",
        "title": "Map of twist and strain of a moiré superlattice",
        "source": f"moiregauge {found['provenance']['version']}",
        "errors": found["errors"],
        "window_nm": found["window_nm"],
        "resolution_nm": found["resolution_nm"],
        **{name: json.dumps(found[name], ensure_ascii=False) for name in kept},
    }
    return data
