"""Arrays with labels: what they tell of their own frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

NM_PER = {"nm": 1.0, "um": 1e3, "µm": 1e3, "μm": 1e3, "mm": 1e6, "m": 1e9, "pm": 1e-3, "Å": 0.1, "angstrom": 0.1}


@dataclass
class Frame:
    """What is told of an array."""

    size_nm: tuple[float, float] | None
    pixel_nm: tuple[float, float] | None = None
    offset_nm: tuple[float, float] = (0.0, 0.0)
    line_rate_hz: float | None = None
    frame_direction: str | None = None
    rotation_deg: float = 0.0
    unit: str = ""
    sensor_unit: str = "nm"


def is_labelled(given: object) -> bool:
    """Whether it is an `xarray.DataArray`; xarray need not be there."""
    return type(given).__name__ == "DataArray" and hasattr(given, "dims") and hasattr(given, "coords")


def grid_of_labelled(given: Any, about: Frame) -> Any:
    """The array with its last dimension along x and both ascending; puts what its labels tell into `about`."""
    if given.ndim != 2:
        raise ValueError(f"expected a DataArray of 2 dimensions (y, x), found {given.dims}")
    y, x = given.dims
    if str(x).startswith("y") and str(y).startswith("x"):
        given = given.transpose(x, y)
        y, x = x, y
    pitch, centre = [], []
    for dim in (x, y):
        if dim not in given.coords:
            break
        places = np.asarray(given.coords[dim].values, dtype=float)
        unit = given.coords[dim].attrs.get("units", "nm")
        if unit not in NM_PER:
            raise ValueError(f"coordinate {dim}: expected a unit of length ({', '.join(NM_PER)}), found {unit!r}")
        steps = np.diff(places) * NM_PER[unit]
        if len(steps) == 0 or np.ptp(steps) > 1e-3 * abs(steps.mean()):
            raise ValueError(f"coordinate {dim}: expected places at equal distances")
        pitch.append(abs(float(steps.mean())))
        centre.append(float(places.mean()) * NM_PER[unit])
        if steps.mean() < 0:
            given = given.isel({dim: slice(None, None, -1)})
    if len(pitch) == 2 and about.size_nm is None:
        rows, columns = given.shape
        about.size_nm = (pitch[0] * columns, pitch[1] * rows)
        about.offset_nm = (centre[0], centre[1])
    attrs = given.attrs
    about.unit = about.unit or str(attrs.get("units", ""))
    about.frame_direction = about.frame_direction or attrs.get("frame_direction")
    about.line_rate_hz = about.line_rate_hz or attrs.get("line_rate_hz")
    about.rotation_deg = about.rotation_deg or float(attrs.get("rotation_deg", 0.0))
    return given
