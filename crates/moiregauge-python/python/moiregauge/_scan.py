"""What a file holds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray


@dataclass(frozen=True, kw_only=True, eq=False)
class Channel:
    """One image of a scan: a quantity at every pixel."""

    name: str
    """The name that the instrument shows."""
    internal_name: str
    """The instrument's own name; empty where there is none."""
    unit: str
    """Unit of the values."""
    line_direction: str | None
    """`trace` or `retrace`, where the file tells."""
    pitch_nm: tuple[float, float] | None
    """Nominal distance of neighbouring pixels along a line and of neighbouring lines, nm."""
    edges_nm: tuple[float, float] | None
    """Width and height from edge to edge, nm."""
    plane_fit: str | None
    """What the instrument subtracted."""
    values: NDArray[np.float64]
    """Rows × columns, row 0 at the bottom, column 0 at the left; missing values are NaN."""

    def to_xarray(self, scan: Scan | None = None) -> xarray.DataArray:
        """The image as an `xarray.DataArray` with the nominal places of its pixels, nm, along `y` and `x`.

        With its `scan` the attributes tell what an analysis needs, and `analyze` takes the array as it is.
        """
        import xarray

        if self.pitch_nm is None:
            raise ValueError(f"{self.name}: the file tells no size")
        rows, columns = self.values.shape
        x, y = scan.offset_nm if scan is not None else (0.0, 0.0)
        coords = {
            "y": ("y", y + (np.arange(rows) - (rows - 1) / 2) * self.pitch_nm[1], {"units": "nm"}),
            "x": ("x", x + (np.arange(columns) - (columns - 1) / 2) * self.pitch_nm[0], {"units": "nm"}),
        }
        attrs: dict[str, Any] = {"units": self.unit, "long_name": self.name}
        if scan is not None:
            told = {
                "frame_direction": scan.frame_direction,
                "line_rate_hz": scan.line_rate_hz,
                "rotation_deg": scan.rotation_deg,
            }
            attrs.update({key: value for key, value in told.items() if value is not None})
        return xarray.DataArray(self.values, dims=("y", "x"), coords=coords, name=self.name, attrs=attrs)


@dataclass(frozen=True, kw_only=True, eq=False)
class Scan:
    """One frame as the instrument wrote it."""

    file: str
    """The file as it was named."""
    format: str
    """The format in words."""
    instrument: str | None
    acquired: datetime | None
    """When the frame was saved, by the instrument's clock."""
    frame_direction: str | None
    """`up` if the bottom line was first, `down` if the top one was."""
    line_rate_hz: float | None
    """Lines per second, trace and retrace together."""
    rotation_deg: float
    """Rotation of the fast axis against x, counter-clockwise."""
    offset_nm: tuple[float, float]
    """Centre of the frame as it was set, nm."""
    size_nm: tuple[float, float] | None
    """Nominal size of the full frame along the fast and the slow axis, nm."""
    closed_loop: bool | None
    notes: tuple[str, ...]
    """Doubts about how the file was understood."""
    unreadable: tuple[tuple[str, str], ...]
    """Channels that could not be read, and why."""
    metadata: tuple[tuple[str, str], ...]
    """What else the header says, in the order of the file."""
    channels: tuple[Channel, ...]

    def __getitem__(self, name: str) -> Channel:
        """The first channel of this name."""
        for channel in self.channels:
            if name in (channel.name, channel.internal_name):
                return channel
        raise KeyError(f"no channel {name!r}; there are {[channel.name for channel in self.channels]}")

    def __repr__(self) -> str:
        names = ", ".join(dict.fromkeys(channel.name for channel in self.channels))
        return f"Scan({self.file!r}, {self.format}, channels: {names})"


def pair(value: Any) -> tuple[float, float] | None:
    return None if value is None else (float(value[0]), float(value[1]))


def scan(about: Mapping[str, Any], values: list[NDArray[np.float64]]) -> Scan:
    """That of the compiled half."""
    channels = tuple(
        Channel(
            **{**channel, "pitch_nm": pair(channel["pitch_nm"]), "edges_nm": pair(channel["edges_nm"])},
            values=image,
        )
        for channel, image in zip(about["channels"], values, strict=True)
    )
    acquired = about["acquired"]
    return Scan(
        **{
            **about,
            "acquired": None if acquired is None else datetime.fromisoformat(acquired),
            "offset_nm": pair(about["offset_nm"]) or (0.0, 0.0),
            "size_nm": pair(about["size_nm"]),
            "notes": tuple(about["notes"]),
            "unreadable": tuple(tuple(one) for one in about["unreadable"]),
            "metadata": tuple(tuple(one) for one in about["metadata"]),
            "channels": channels,
        }
    )
