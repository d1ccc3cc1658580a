"""What users give → what the compiled half takes: paths, bytes, arrays, options."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray

from moiregauge._labelled import Frame, grid_of_labelled, is_labelled
from moiregauge._options import TOLD
from moiregauge._scan import Scan

PathLike: TypeAlias = "str | os.PathLike[str]"
# Arrays are objects here, since xarray need not be installed.
Input: TypeAlias = "PathLike | BinaryIO | NDArray[Any] | Scan | Mapping[str, Any] | Any"

# Dtypes that are taken as they are; others become float64.
TAKEN = ("float64", "float32", "int16", "int32")


@dataclass
class Asked:
    """Inputs sorted by what they are."""

    paths: list[Path] = field(default_factory=list)
    held: list[tuple[str, Any]] = field(default_factory=list)
    options: str = "{}"
    told: str = "{}"


def is_array(given: object) -> bool:
    return isinstance(given, (np.ndarray, Scan, Mapping)) or is_labelled(given)


def listed(given: Any) -> list[Any]:
    """One input or several as a list."""
    if given is None:
        return []
    single = isinstance(given, (str, os.PathLike)) or hasattr(given, "read") or is_array(given)
    if isinstance(given, np.ndarray) and given.ndim > 2:
        raise ValueError(
            f"expected a 2-D array or a list of them, found one of shape {given.shape}: "
            "a stack of images is given as arrays=list(stack)"
        )
    return [given] if single else list(cast(Any, given))


def asked(
    paths: Any,
    arrays: Any,
    pixel_nm: float | tuple[float, float] | None,
    names: Sequence[str] | None,
    options: Mapping[str, Any],
) -> Asked:
    """Sorts inputs and options."""
    found = Asked()
    told = {name: options[name] for name in TOLD if options.get(name) is not None}
    settings = {name: value for name, value in options.items() if name not in TOLD and value is not None}
    found.options = words(settings)
    images = []
    for given in listed(paths):
        if is_array(given):
            images.append(given)
        elif hasattr(given, "read"):
            found.held.append((name_of(given, len(found.held)), content_of(given)))
        else:
            found.paths.append(Path(os.fspath(given)))
    images += listed(arrays)
    if not (found.paths or found.held or images):
        raise ValueError("expected paths of scans or arrays, found none")
    if images:
        if found.paths or found.held:
            raise ValueError("expected files or arrays, found both: analyze them apart, or read() the files first")
        if names is not None and len(names) != len(images):
            raise ValueError(f"names: expected {len(images)}, one for each array, found {len(names)}")
        for number, given in enumerate(images):
            name = names[number] if names is not None else f"array {number + 1}"
            about = frame(told, pixel_nm, number, len(images))
            found.held.append((name, scan_of(given, about, name)))
        return found
    if pixel_nm is not None:
        raise ValueError("pixel_nm goes with arrays; size_nm=(width, height) tells the size of files")
    if not isinstance(told.get("frame_direction", ""), str):
        raise ValueError('a list of frame directions goes with arrays; files are "up", "down" or alternating')
    found.told = words(told)
    return found


def words(options: Mapping[str, Any]) -> str:
    """Options as JSON; numbers of numpy are numbers, dataclasses are dictionaries."""

    def plain(value: Any) -> Any:
        if isinstance(value, np.generic):
            return value.item()
        if hasattr(value, "to_dict"):
            return value.to_dict()
        if isinstance(value, np.ndarray):
            return value.tolist()
        if isinstance(value, os.PathLike):
            return os.fspath(value)
        raise ValueError(f"expected numbers, words, lists and dictionaries as options, found {value!r}")

    return json.dumps(options, default=plain)


def name_of(file: Any, number: int) -> str:
    name = getattr(file, "name", None)
    return os.path.basename(name) if isinstance(name, str) else f"file {number + 1}"


def content_of(file: Any) -> bytes:
    content = file.read()
    if not isinstance(content, bytes):
        raise ValueError(
            f'expected a file opened for bytes, as in open(path, "rb"), found one of {type(content).__name__}'
        )
    return content


def frame(told: Mapping[str, Any], pixel_nm: Any, number: int, count: int) -> Frame:
    """What is told of one of several arrays."""
    for name in ("crop", "x_sensor", "y_sensor", "sensors"):
        if name in told:
            raise ValueError(
                f"{name} goes with files; of arrays take a slice, or a dictionary with x_sensor and y_sensor"
            )
    size = told.get("size_nm")
    if size is not None and pixel_nm is not None:
        raise ValueError("expected pixel_nm or size_nm, found both")
    direction = told.get("frame_direction")
    if isinstance(direction, str) and direction.startswith("alternating-"):
        first = direction == "alternating-up"
        direction = "up" if (number % 2 == 0) == first else "down"
    elif direction is not None and not isinstance(direction, str):
        if len(direction) != count:
            raise ValueError(f"frame_direction: expected {count}, one for each array, found {len(direction)}")
        direction = direction[number]
    about = Frame(
        size_nm=None if size is None else (float(size[0]), float(size[1])),
        line_rate_hz=told.get("line_rate_hz"),
        frame_direction=direction,
        rotation_deg=told.get("rotation_deg", 0.0),
        unit=told.get("unit", ""),
        sensor_unit=told.get("sensor_unit", "nm"),
    )
    if pixel_nm is not None:
        along, across = np.broadcast_to(np.asarray(pixel_nm, dtype=float), 2).tolist()
        about.pixel_nm = (along, across)
    return about


def scan_of(given: Any, about: Frame, name: str) -> tuple[str, list[NDArray[Any]]]:
    """A scan in memory, as the compiled half takes it: words about it, and its arrays."""
    channels: list[dict[str, Any]] = []
    arrays: list[NDArray[Any]] = []

    def add(array: Any, called: str, unit: str, line: str | None) -> None:
        arrays.append(checked(array, f"{name}, {called}" if called != "image" else name))
        channels.append({"name": called, "unit": unit, "line_direction": line})

    if isinstance(given, Scan):
        about.size_nm = about.size_nm or given.size_nm
        about.offset_nm = given.offset_nm
        about.line_rate_hz = about.line_rate_hz or given.line_rate_hz
        about.frame_direction = about.frame_direction or given.frame_direction
        about.rotation_deg = about.rotation_deg or given.rotation_deg
        for channel in given.channels:
            add(channel.values, channel.name, channel.unit, channel.line_direction)
    elif is_labelled(given):
        given = grid_of_labelled(given, about)
        add(given.values, str(given.name or "image"), about.unit, None)
    elif isinstance(given, Mapping):
        for key, array in given.items():
            sensor = {"x_sensor": "X Sensor", "y_sensor": "Y Sensor"}.get(key)
            stem, _, line = key.rpartition("_")
            if sensor is not None:
                add(array, sensor, about.sensor_unit, None)
            elif line in ("trace", "retrace"):
                add(array, stem or "image", about.unit, line)
            else:
                add(
                    array,
                    "image" if key in ("trace", "retrace") else key,
                    about.unit,
                    key if key in ("trace", "retrace") else None,
                )
    else:
        add(given, "image", about.unit, None)
    rows, columns = arrays[0].shape
    if about.pixel_nm is not None:
        about.size_nm = (about.pixel_nm[0] * columns, about.pixel_nm[1] * rows)
    if about.size_nm is None:
        raise ValueError(f"{name}: expected pixel_nm or size_nm: an array does not tell how large its pixels are")
    if not (np.isfinite(about.size_nm).all() and min(about.size_nm) > 0):
        raise ValueError(f"{name}: expected a size above 0 nm, found {about.size_nm}")
    for array in arrays:
        if array.shape != arrays[0].shape:
            raise ValueError(f"{name}: expected arrays of one shape, found {arrays[0].shape} and {array.shape}")
    told = {key: value for key, value in vars(about).items() if key not in ("unit", "sensor_unit", "pixel_nm")}
    return words({**told, "channels": channels}), arrays


def checked(array: Any, name: str) -> NDArray[Any]:
    """A 2-D array of numbers that the compiled half can take; copied only where it has to be converted."""
    if isinstance(array, np.ma.MaskedArray):
        array = np.ma.filled(array.astype(float), np.nan)
    array = np.asarray(array)
    if array.ndim != 2:
        raise ValueError(f"{name}: expected a 2-D array (rows, columns), found one of shape {array.shape}")
    if 0 in array.shape:
        raise ValueError(f"{name}: expected an image, found an empty array of shape {array.shape}")
    if array.dtype.kind not in "fiub":
        raise ValueError(f"{name}: expected real numbers, found {array.dtype}")
    if array.dtype.kind == "f" and not np.isfinite(array).any():
        raise ValueError(f"{name}: expected an image, found nothing but NaN and infinity")
    if array.dtype.name not in TAKEN or not array.dtype.isnative or not array.flags.aligned:
        array = array.astype("float64")
    return cast("NDArray[Any]", array)
