"""Around an analysis: the same answers as the program's."""

from __future__ import annotations

import json
import pickle
from pathlib import Path

import moiregauge as mg
import pytest
from conftest import program

pytestmark = pytest.mark.filterwarnings("ignore::moiregauge.CaveatWarning")


def test_files_are_described(image: Path, tmp_path: Path) -> None:
    (found,) = mg.inspect(image)
    assert found.frame_direction == "up" and found.channels[0].rows == 128
    assert found.to_dict() == json.loads(program("info", image, "--json").stdout)[0]
    with pytest.raises(mg.ReadError):
        mg.inspect(tmp_path)


def test_moires_have_layers_and_layers_moires() -> None:
    magic = mg.moire(1.1)
    assert magic.cell.wavelengths_nm[0] == pytest.approx(12.8, abs=0.1)
    assert magic.to_dict() == json.loads(program("moire", "--twist", 1.1, "--json").stdout)
    assert "<svg" in magic._repr_svg_()
    again = pickle.loads(pickle.dumps(magic))
    assert again == magic and again._repr_svg_() == magic._repr_svg_()
    read = mg.moire(wavelengths_nm=[13.72, 12.7, 10.18], sigma_nm=0.05)
    assert read.twist_strain.twist_deg.value == pytest.approx(1.19, abs=0.001)
    assert mg.moire(0.5, layers="graphene/hBN").layers != magic.layers
    with pytest.raises(ValueError, match="expected one of"):
        mg.moire()
    with pytest.raises(ValueError, match="expected one of"):
        mg.moire(1.1, wavelengths_nm=[1.0, 1.0, 1.0])
    with pytest.raises(AttributeError, match="cell"):
        _ = magic.nothing


def test_plans_meet_wishes() -> None:
    found = mg.plan(twist_deg=0.05)
    assert found.plans[0].met and found.plans[0].twist_sigma_deg.total < 0.05
    with pytest.raises(ValueError, match="twist_deg"):
        mg.plan(twist_deg=-1.0)
    with pytest.raises(ValueError, match="nonsense"):
        mg.plan(twist_deg=0.1, conditions={"nonsense": 1})


def test_simulations_are_those_of_the_program(scans: Path, tmp_path: Path) -> None:
    (folder,) = mg.simulate(tmp_path, name="set", seed=3, raster={"scans": 4, "pixels": [128, 128]})
    for file in scans.iterdir():
        if not file.name.startswith("."):
            assert (folder / file.name).read_bytes() == file.read_bytes(), file.name
    with pytest.raises(OSError, match="already holds"):
        mg.simulate(tmp_path, name="set", seed=4)
    with pytest.raises(ValueError, match="name"):
        mg.simulate(tmp_path, name="../up")


def test_scans_are_converted(image: Path, tmp_path: Path) -> None:
    (file,) = mg.convert(image, tmp_path / "scan.gwy")
    assert mg.read(file)["TR Phase"].values.shape == (128, 128)
    assert len(mg.convert([image], tmp_path / "all", format="gsf", channels=["TR Phase"])) == 2
    with pytest.raises(ValueError, match="xyz"):
        mg.convert(image, tmp_path / "scan.xyz")
    with pytest.raises(mg.ReadError):
        mg.convert(tmp_path / "missing.spm", tmp_path / "a.gwy")


def test_scanners_are_calibrated(tmp_path: Path) -> None:
    (folder,) = mg.simulate(
        tmp_path,
        name="atoms",
        sample={"pattern": "layer1"},
        raster={"scans": 2, "pixels": [128, 128], "nominal_size_nm": [5.0, 5.0]},
    )
    found = mg.calibrate(folder, lattice="graphene", out=tmp_path / "scanner.toml")
    assert abs(found.calibration.gain_percent) < 20
    assert found.schema == "moiregauge/calibration/1"
    image = next(folder.glob("*.spm"))
    for scanner in (found.calibration.to_dict(), tmp_path / "scanner.toml"):
        # It is understood: what is refused is the channel.
        with pytest.raises(mg.MeasureError, match="no channel"):
            mg.analyze(image, scanner=scanner, channel="nothing")
    with pytest.raises(ValueError, match="unobtainium"):
        mg.calibrate(folder, lattice="unobtainium")


def test_estimators_are_validated() -> None:
    found = mg.validate(sets=4, conditions={"raster": {"pixels": [96, 96]}})
    assert found.sets + found.failed == 4
    assert {quantity.name for quantity in found.quantities} >= {"twist"}
    assert found.conditions.raster.scans == 4


def test_layers_and_settings_files(image: Path, tmp_path: Path) -> None:
    file = tmp_path / "settings.toml"
    file.write_text('material = "graphene"\nsubstrate = "hBN"\nseed = 7\n')
    fast = {"drift_draws": 0, "strain_draws": 0}
    of_file = mg.analyze(image, settings=file, **fast).settings
    assert (of_file.substrate.name, of_file.seed) == ("hBN", 7)
    assert mg.analyze(image, layers="graphene/hBN", seed=7, **fast).settings == of_file
    # Options come on top.
    assert mg.analyze(image, settings=of_file, layers="graphene", **fast).settings.substrate is None
    own = mg.analyze(image, material={"name": "graphene", "lattice_constant_nm": 0.25}, **fast).settings.material
    assert own.lattice_constant_nm == 0.25 and "changed by the user" in own.source and own.poisson_ratio > 0
