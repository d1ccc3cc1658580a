"""What others rely on."""

from __future__ import annotations

import json
import pickle
import subprocess
import warnings
from pathlib import Path

import moiregauge as mg
import numpy as np
import pytest
from conftest import PROGRAM, program

pytestmark = pytest.mark.filterwarnings("ignore::moiregauge.CaveatWarning")


@pytest.fixture(scope="module")
def results(scans: Path) -> mg.Results:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return mg.analyze([scans], seed=1)


def without_run(document: dict) -> dict:
    """A document without what tells how it was asked for."""
    document = json.loads(json.dumps(document))
    document["provenance"].pop("run", None)
    return document


def test_estimates_have_values_and_errors(results: mg.Results) -> None:
    twist = results.sets[0].mean.twist_deg
    assert 0 < twist.sigma < twist.sigma_total < 0.1
    assert abs(twist.value - 1.13) < 0.1
    assert "±" in str(twist)
    with pytest.raises(TypeError, match="value"):
        float(twist)


def test_documents_are_those_of_the_program(results: mg.Results, scans: Path, tmp_path: Path) -> None:
    program("analyze", scans, "--out", tmp_path / "out", "--seed", 1, "--no-report")
    written = json.loads((tmp_path / "out" / "results.json").read_text())
    assert without_run(results.to_dict()) == without_run(written)
    # Everything of the program's document is kept, its run, too.
    assert mg.Results.from_dict(written).to_dict() == written


def test_reports_are_those_of_the_program(results: mg.Results, scans: Path, tmp_path: Path) -> None:
    program("analyze", scans, "--out", tmp_path / "program", "--seed", 1)
    page = results.report(tmp_path / "python")
    assert page == tmp_path / "python" / "report.html" and page.is_file()
    names = {p.relative_to(tmp_path / "program") for p in (tmp_path / "program").rglob("*") if p.is_file()}
    assert names == {p.relative_to(tmp_path / "python") for p in (tmp_path / "python").rglob("*") if p.is_file()}
    # Documents and the page record how the run was asked for; the list of files has their hashes.
    asked = {"results.json", "report.html", "moiregauge-files.json"}
    for name in names:
        if name.name not in asked:
            assert (tmp_path / "program" / name).read_bytes() == (tmp_path / "python" / name).read_bytes(), name
    documents = [json.loads((tmp_path / by / "results.json").read_text()) for by in ("program", "python")]
    assert without_run(documents[0]) == without_run(documents[1])
    # The run of one, done again by the program, is the report of the other.
    program("analyze", "--replay", tmp_path / "python" / "results.json", "--out", tmp_path / "again")
    for name in names:
        assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "python" / name).read_bytes(), name
    with pytest.raises(OSError, match="already holds results"):
        results.report(tmp_path / "python")
    results.report(tmp_path / "python", force=True, png=False)


def test_results_survive_pickling(results: mg.Results, tmp_path: Path) -> None:
    again = pickle.loads(pickle.dumps(results))
    assert again == results and again is not results
    assert str(again) == str(results)
    assert again.report(tmp_path / "out", png=False).is_file()


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ValueError, match="nonsense"):
        mg.Estimate.from_dict({"value": 1.0, "sigma": 0.1, "nonsense": 2})
    with pytest.raises(ValueError, match="expected 2 values, found 3"):
        mg.results.Window.from_dict({"centre_nm": [0.0, 0.0, 0.0], "extent_nm": [1.0, 1.0]})


def test_classes_of_users_are_documents_too() -> None:
    class Own(mg.Estimate):
        pass

    own = Own.from_dict({"value": 1, "sigma": None})
    assert own.to_dict() == {"value": 1.0, "sigma": None} and isinstance(own.value, float)


def test_channels_have_row_0_at_the_bottom(image: Path, tmp_path: Path) -> None:
    scan = mg.read(image)
    values = scan.channels[0].values
    assert values.shape == (128, 128) and values.dtype == np.float64
    # The first line of an array file is the top one.
    program("convert", image, "--out", tmp_path / "one.npz", ok=False)
    np.save(tmp_path / "top_first.npy", np.array([[1.0, 2.0], [3.0, 4.0]]))
    small = mg.read(tmp_path / "top_first.npy", size_nm=(2.0, 2.0))
    assert small.channels[0].values.tolist() == [[3.0, 4.0], [1.0, 2.0]]
    with open(image, "rb") as file:
        assert np.array_equal(mg.read(file).channels[0].values, values)
    assert scan["TR Phase"].unit == "°"
    with pytest.raises(KeyError, match="TR Phase"):
        scan["nothing"]


def test_arrays_give_what_their_file_gives(scans: Path) -> None:
    files = sorted(scans.glob("*.spm"))
    read = [mg.read(file) for file in files]
    arrays = [scan["TR Phase"].values for scan in read]
    found = mg.analyze(
        arrays=arrays,
        pixel_nm=read[0]["TR Phase"].pitch_nm,
        line_rate_hz=read[0].line_rate_hz,
        frame_direction=["up", "down", "up", "down"],
    )
    assert [len(group.scans) for group in found.sets] == [4]
    assert found.sets[0].scans[0].file == "array 1"
    # Of an array nothing but nominal places are known.
    files_too = mg.analyze(files, line="trace")
    for one, of_file in zip(found.sets[0].scans, files_too.sets[0].scans, strict=True):
        nominal = of_file.vectors[0].nominal.wavelength_nm.value
        assert one.vectors[0].sensor.wavelength_nm.value == pytest.approx(nominal, rel=2e-3)
        assert one.frame_direction == of_file.frame_direction
    assert found.sets[0].drift is not None
    same = mg.analyze(read, line="trace", seed=1)
    of_files = mg.analyze(files, line="trace", seed=1)
    for a, b in zip(same.sets[0].scans, of_files.sets[0].scans, strict=True):
        assert a.vectors[0].sensor == b.vectors[0].sensor


def test_maps_have_arrays(image: Path) -> None:
    found = mg.map([image])
    columns, rows = found.nodes
    assert found.arrays["twist"].shape == (rows, columns)
    assert (found.arrays["mask"] == 0).any()
    again = pickle.loads(pickle.dumps(found))
    assert again == found
    again.arrays["twist"][0, 0] += 1  # a view of its own values
    assert mg.MapResults.from_dict(found.to_dict()).to_dict() == found.to_dict()


def test_the_program_is_there(tmp_path: Path) -> None:
    assert PROGRAM.is_file()
    assert mg.__version__ in program("--version").stdout
    assert program("analyze", tmp_path / "nothing", "--out", tmp_path / "out", ok=False).returncode == 1
    assert "twist" in program("explain", "--markdown").stdout
    # The one line for somebody without anything.
    said = subprocess.run([str(PROGRAM), "demo"], cwd=tmp_path, capture_output=True, text=True, timeout=300, check=True)
    assert "True values of the simulation" in said.stdout
    assert (tmp_path / "moiregauge-demo" / "results" / "report.html").is_file()


def test_moires_are_several(scans: Path) -> None:
    with pytest.raises(ValueError, match="analyze_moires"):
        mg.analyze([scans], moires=2)


def test_campaigns_measure_once(scans: Path) -> None:
    files = sorted(scans.glob("*.spm"))
    campaign = mg.Campaign(seed=2)
    campaign.add(*files[:3])
    three = campaign.analyze()
    told: list[tuple[str, int, int]] = []
    campaign.add(files[3])
    four = campaign.analyze(progress=lambda *now: told.append(now))
    assert len(three.sets[0].scans) == 3 and len(four.sets[0].scans) == 4
    assert len(campaign) == 4 and told
    assert four == mg.analyze(files, seed=2) or four.to_dict()["sets"] == mg.analyze(files, seed=2).to_dict()["sets"]
    campaign.remove(files[3])
    assert pickle.loads(pickle.dumps(campaign)).analyze().sets == three.sets


def test_one_scan_is_measured(image: Path, scans: Path) -> None:
    found = mg.measure(image)
    assert found.vectors[0].sensor.wavelength_nm.value > 10
    with pytest.raises(ValueError, match="expected one scan, found 4"):
        mg.measure(scans)


def test_maps_answer_and_report_as_the_program(image: Path, tmp_path: Path) -> None:
    low, high = mg.map(image).extent_nm[0]
    middle = (low + high) / 2
    found = mg.map(
        image,
        regions={"all": [(low, low), (high, low), (high, high), (low, high)]},
        wanted_deg=(1.13, 0.05),
        device_nm=(15.0, 15.0),
    )
    assert found.details.regions[0].name == "all" and found.details.wanted.twist_deg == 1.13
    assert found.details.devices
    with pytest.raises(ValueError, match="outside"):
        mg.map(image, regions={"far": [(1e5, 0), (1e5 + 1, 0), (1e5, 1)]})
    with pytest.raises(ValueError, match="window_nm"):
        mg.map(image, window_nm=-1.0)
    plain = mg.map(image)
    plain.report(tmp_path / "python")
    program("map", image, "--out", tmp_path / "program", ok=False)
    names = {p.relative_to(tmp_path / "program") for p in (tmp_path / "program").rglob("*") if p.is_file()}
    assert names == {p.relative_to(tmp_path / "python") for p in (tmp_path / "python").rglob("*") if p.is_file()}
    asked = {"map.json", "report.html", "moiregauge-files.json"}
    for name in names:
        if name.name not in asked:
            assert (tmp_path / "program" / name).read_bytes() == (tmp_path / "python" / name).read_bytes(), name
    written = json.loads((tmp_path / "program" / "map.json").read_text())
    assert without_run(plain.to_dict()) == without_run(written)
    assert middle > low
    with pytest.raises(ValueError, match="map the scans again"):
        pickle.loads(pickle.dumps(plain)).report(tmp_path / "again")
