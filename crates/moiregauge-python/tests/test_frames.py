"""Tables and labelled arrays, where pandas and xarray are there."""

from __future__ import annotations

import json
from pathlib import Path

import moiregauge as mg
import numpy as np
import pytest

pytestmark = pytest.mark.filterwarnings("ignore::moiregauge.CaveatWarning")
pandas = pytest.importorskip("pandas")
xarray = pytest.importorskip("xarray")


def test_one_row_a_scan(results: mg.Results) -> None:
    table = results.to_pandas()
    assert len(table) == 4 and table["scan"].tolist() == [1, 2, 3, 4]
    first = results.sets[0].scans[0]
    assert table["twist_deg"][0] == first.twist_strain.drift_corrected.twist_deg.value
    assert table["l1_nm"][0] == first.vectors[0].drift_corrected.wavelength_nm.value
    assert table["l1_sigma_nm"][0] == first.vectors[0].drift_corrected.wavelength_nm.sigma
    assert set(table["coordinates"]) == {"drift_corrected"}
    assert str(table["acquired"].dtype).startswith("datetime64")
    assert len(results.to_pandas("sets")) == 1 and len(results.to_pandas("vectors")) == 36
    with pytest.raises(ValueError, match="budget"):
        results.to_pandas("nothing")


@pytest.mark.parametrize("kind", ["netcdf", "zarr"])
def test_scans_and_maps_survive_files(results: mg.Results, mapped: mg.MapResults, kind: str, tmp_path: Path) -> None:
    for number, data in enumerate([results.to_xarray(), mapped.to_xarray()]):
        path = tmp_path / f"{number}.{kind}"
        if kind == "netcdf":
            pytest.importorskip("netCDF4")
            data.to_netcdf(path)
            with xarray.open_dataset(path) as again:
                xarray.testing.assert_identical(again.load(), data)
        else:
            pytest.importorskip("zarr")
            data.to_zarr(path)
            xarray.testing.assert_identical(xarray.open_zarr(path).load(), data)


def test_scans_are_labelled(results: mg.Results) -> None:
    data = results.to_xarray()
    assert data["twist_deg"].attrs["units"] == "degree"
    assert data["twist_deg"].attrs["ancillary_variables"] == "twist_sigma_deg"
    assert "twist_sigma_deg" in data
    assert json.loads(data.attrs["settings"]) == results.to_dict()["settings"]


def test_maps_are_labelled(mapped: mg.MapResults) -> None:
    data = mapped.to_xarray()
    assert data["twist"].dims == ("y", "x")
    assert data["twist"].attrs["units"] == "degree"
    assert "twist_sigma" in data["twist"].attrs["ancillary_variables"]
    assert data["mask"].dtype == np.uint8 and "good" in data["mask"].attrs["flag_meanings"]
    assert data["x"].attrs["units"] == "nm" and data.attrs["Conventions"].startswith("CF")
    assert np.array_equal(data["strain"].values, mapped.arrays["strain"], equal_nan=True)
    # Places are those of the nodes.
    assert np.allclose(data["position_x"].values[0], data["x"].values) or "along" in data["x"].attrs["long_name"]


def test_labelled_arrays_are_taken_as_they_are(image: Path) -> None:
    scan = mg.read(image)
    labelled = scan["TR Phase"].to_xarray(scan)
    plain = mg.measure(scan["TR Phase"].values, pixel_nm=scan["TR Phase"].pitch_nm)
    found = mg.measure(labelled)
    assert found.frame_direction == scan.frame_direction
    near = pytest.approx(plain.vectors[0].sensor.wavelength_nm.value, rel=1e-9)
    assert found.vectors[0].sensor.wavelength_nm.value == near
    # Upside down, in other units, and transposed: the same.
    turned = labelled.isel(y=slice(None, None, -1)).transpose("x", "y")
    turned = turned.assign_coords(x=("x", turned.x.values / 1000, {"units": "µm"}))
    assert mg.measure(turned).vectors[0].sensor.wavelength_nm.value == near
    with pytest.raises(ValueError, match="equal distances"):
        mg.measure(labelled.assign_coords(x=("x", labelled.x.values**3)))
    with pytest.raises(ValueError, match="unit of length"):
        mg.measure(labelled.assign_coords(x=("x", labelled.x.values, {"units": "V"})))
