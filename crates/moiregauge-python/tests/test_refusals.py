"""Arrays and options that make no sense: errors that say what was expected."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import moiregauge as mg
import numpy as np
import pytest

pytestmark = pytest.mark.filterwarnings("ignore::moiregauge.CaveatWarning")


@pytest.fixture(scope="module")
def array(image: Path) -> np.ndarray:
    return mg.read(image)["TR Phase"].values


def lattice(array: Any) -> Any:
    found = mg.analyze(arrays=[array], pixel_nm=0.5, drift_draws=0, strain_draws=0)
    return found.sets[0].scans[0].vectors


def test_order_and_type_of_memory_change_nothing(array: np.ndarray) -> None:
    expected = lattice(array)
    assert lattice(np.asfortranarray(array)) == expected
    assert lattice(array.astype(">f8")) == expected
    assert lattice(np.ma.masked_array(array, mask=np.zeros_like(array, dtype=bool))) == expected
    assert lattice(np.repeat(array, 2, axis=1)[:, ::2]) == expected
    assert lattice(array.astype(np.float32))[0].sensor.wavelength_nm.value == pytest.approx(
        expected[0].sensor.wavelength_nm.value, rel=1e-5
    )
    assert lattice((1000 * array).astype(np.int16))[0].sensor.wavelength_nm.value == pytest.approx(
        expected[0].sensor.wavelength_nm.value, rel=1e-3
    )


def test_masked_pixels_are_missing(array: np.ndarray) -> None:
    spoiled = array.copy()
    spoiled[:10, :10] = 1e6
    masked = np.ma.masked_greater(spoiled, 1e5)
    assert lattice(masked)[0].sensor.wavelength_nm.value == pytest.approx(
        lattice(array)[0].sensor.wavelength_nm.value, rel=1e-2
    )


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (np.full((64, 64), np.nan), "nothing but NaN"),
        (np.zeros((2, 64, 64)), r"2-D array.*\(2, 64, 64\)"),
        (np.zeros(64), r"2-D array.*\(64,\)"),
        (np.zeros((0, 64)), "empty"),
        (np.zeros((64, 64), dtype=complex), "real numbers, found complex128"),
        (np.array([["a", "b"]]), "real numbers"),
    ],
)
def test_no_images(wrong: np.ndarray, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        mg.analyze(arrays=[wrong], pixel_nm=0.5)


def test_a_stack_is_refused_with_what_to_do() -> None:
    with pytest.raises(ValueError, match="list"):
        mg.analyze(np.zeros((3, 64, 64)), pixel_nm=0.5)


def test_a_flat_array_has_no_lattice() -> None:
    with pytest.raises(mg.MeasureError) as error:
        mg.analyze(arrays=[np.zeros((64, 64))], pixel_nm=0.5)
    assert error.value.file == "array 1"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({}, "pixel_nm or size_nm"),
        ({"pixel_nm": 0.5, "size_nm": (1.0, 1.0)}, "found both"),
        ({"pixel_nm": -1.0}, "above 0"),
        ({"pixel_nm": 0.5, "frame_direction": ["up", "down"]}, "expected 1"),
        ({"pixel_nm": 0.5, "frame_direction": "sideways"}, "sideways"),
        ({"pixel_nm": 0.5, "names": ["a", "b"]}, "names"),
        ({"pixel_nm": 0.5, "x_sensor": "X"}, "x_sensor goes with files"),
        ({"pixel_nm": 0.5, "material": "unobtainium"}, "graphene"),
        ({"pixel_nm": 0.5, "layers": "graphene/unobtainium"}, "unobtainium"),
        ({"pixel_nm": 0.5, "seeds": 1}, "seeds"),
        ({"pixel_nm": 0.5, "seed": "one"}, "seed"),
        ({"pixel_nm": 0.5, "drift_draws": -1}, "drift_draws"),
        ({"pixel_nm": 0.5, "threads": 0}, "threads"),
    ],
)
def test_options_that_make_no_sense(array: np.ndarray, options: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        mg.analyze(arrays=[array], **options)


def test_files_that_cannot_be_read_are_named(tmp_path: Path, image: Path) -> None:
    broken = tmp_path / "broken.spm"
    broken.write_bytes(image.read_bytes()[:3000])
    for path in (broken, tmp_path / "missing.spm"):
        with pytest.raises(mg.ReadError) as error:
            mg.read(path)
        assert error.value.file == str(path)
        with pytest.raises(mg.ReadError) as error:
            mg.analyze(path)
        assert error.value.file == str(path)
    with pytest.warns(mg.FailedFileWarning, match="broken.spm"):
        found = mg.analyze([image, broken])
    assert found.failed[0].file == str(broken)


def test_doubts_are_warned_of_once_a_kind(image: Path) -> None:
    with pytest.warns(mg.CaveatWarning) as warned:
        found = mg.analyze(image)
    codes = {caveat.code for caveat in found.caveats}
    doubts = [one for one in warned if issubclass(one.category, mg.CaveatWarning)]
    assert codes and len(doubts) == len(codes)
    # At the line of the user's call.
    assert {one.filename for one in doubts} == {__file__}


class Writer(threading.Thread):
    """Writes noise into an array, from when it is told to until it is stopped."""

    def __init__(self, array: np.ndarray) -> None:
        super().__init__()
        self.array, self.begin, self.end, self.times = array, threading.Event(), threading.Event(), 0

    def run(self) -> None:
        noise = np.random.default_rng(1)
        self.begin.wait()
        while not self.end.is_set() or not self.times:
            self.array[:] = noise.normal(size=self.array.shape)
            self.times += 1

    def __enter__(self) -> Writer:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.begin.set()
        self.end.set()
        self.join()


def test_another_thread_may_write_into_an_array(array: np.ndarray) -> None:
    """What is written once the work goes on comes too late."""
    expected, shared = lattice(array), array.copy()
    with Writer(shared) as writer:
        options = {"pixel_nm": 0.5, "drift_draws": 0, "strain_draws": 0}
        found = mg.analyze(arrays=[shared], progress=lambda *_: writer.begin.set(), **options)
    assert found.sets[0].scans[0].vectors == expected
    assert writer.times and not (shared == array).any()


def test_an_array_that_is_written_all_the_time_is_one_of_noise(array: np.ndarray) -> None:
    """An answer, or a refusal that names the array; nothing else."""
    shared = array.copy()
    with Writer(shared) as writer:
        writer.begin.set()
        for _ in range(20):
            try:
                mg.analyze(arrays=[shared], pixel_nm=0.5, drift_draws=0, strain_draws=0)
            except mg.MeasureError as error:
                assert error.file == "array 1"
