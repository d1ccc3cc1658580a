"""A reader for napari: every channel of a scan is a layer, in nm, up on the screen being up at the sample.

napari finds it by `napari.yaml`; nothing of napari is imported here.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

from moiregauge._analyze import read
from moiregauge._errors import ReadError

# Values, how to show them, and what kind of layer they are.
Layer: TypeAlias = tuple[Any, dict[str, Any], str]


def get_reader(path: str | Sequence[str]) -> Callable[[str | Sequence[str]], list[Layer]] | None:
    """The reader of these files; `None` where one of them is no scan, so that napari asks others."""
    try:
        found = {name: _layers(name) for name in _names(path)}
    except ReadError:
        return None
    return lambda path: [layer for name in _names(path) for layer in found.get(name) or _layers(name)]


def _names(path: str | Sequence[str]) -> list[str]:
    return [path] if isinstance(path, str) else [os.fspath(one) for one in path]


def _layers(name: str) -> list[Layer]:
    scan = read(name)
    layers: list[Layer] = []
    for channel in scan.channels:
        words = " ".join(filter(None, [os.path.basename(name), channel.name, channel.line_direction]))
        about: dict[str, Any] = {
            "name": words,
            # One channel is looked at first; the others wait.
            "visible": not layers,
            "metadata": {
                "unit": channel.unit,
                "format": scan.format,
                "line_rate_hz": scan.line_rate_hz,
                "frame_direction": scan.frame_direction,
                "rotation_deg": scan.rotation_deg,
                "header": dict(scan.metadata),
            },
        }
        if channel.pitch_nm is not None:
            x, y = channel.pitch_nm
            about.update(scale=(y, x), units=("nm", "nm"))
        # Rows of images are counted from the top.
        layers.append((channel.values[::-1], about, "image"))
    return layers
