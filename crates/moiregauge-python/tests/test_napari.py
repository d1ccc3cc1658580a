"""The reader for napari: found by its manifest, without napari itself."""

from __future__ import annotations

from pathlib import Path

import moiregauge as mg
import numpy as np
import pytest

npe2 = pytest.importorskip("npe2")


def test_napari_finds_the_reader_and_layers_are_as_wide_as_scans(image: Path, tmp_path: Path) -> None:
    manifest = npe2.PluginManifest.from_distribution("moiregauge")
    manager = npe2.PluginManager.instance()
    manager.register(manifest)
    assert [reader.command for reader in manager.iter_compatible_readers([str(image)])] == ["moiregauge.read"]
    layers = npe2.read([str(image)], stack=False)
    scan = mg.read(image)
    assert len(layers) == len(scan.channels)
    values, about, kind = layers[0]
    channel = scan.channels[0]
    assert kind == "image" and np.array_equal(values[::-1], channel.values)
    assert about["scale"] == channel.pitch_nm[::-1] and channel.name in about["name"]
    assert [layer[1]["visible"] for layer in layers].count(True) == 1
    # What is no scan is left to other readers.
    other = tmp_path / "other.spm"
    other.write_text("no scan")
    with pytest.raises(ValueError, match="No readers"):
        npe2.read([str(other)], stack=False)
