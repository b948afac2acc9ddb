"""Files of trajectories: size, precision, attributes, and material coordinates that select."""

from __future__ import annotations

import re

import netCDF4
import numpy as np
import pytest
import xarray as xr

import cablesim

CASE = {
    "name": "files",
    "description": "A cable with two buoys, for its file.",
    "cable": {
        "length": 3.0,
        "diameter": "5 mm",
        "mass_per_length": 0.055,
        "axial_stiffness": "10 kN",
        "bending_stiffness": 1e-3,
    },
    "mesh": {"segment_length": 0.05},
    "attachments": [
        {"kind": "buoy", "name": "bóya", "at": 1.2, "mass": 0.02, "volume": "60 cm^3"},
        {"kind": "buoy", "name": "b", "at": 1.8, "mass": 0.02, "volume": "60 cm^3"},
    ],
    "ends": {
        "a": {"motion": "fixed", "position": [0, 0, 0]},
        "b": {
            "motion": "velocity_waypoints",
            "position": [1.5, 0, 0],
            "waypoints": [[0, 0, 0, 0], [0.5, 0, 0.4, 0]],
        },
    },
    "simulation": {"duration": 2.0},
    "output": {"interval": 0.02, "markers": {"count": 7}},
}
WINCH = {
    "winch": {
        "deployed_length": 2.02,
        "payout": {"kind": "waypoints", "waypoints": [[0, 0], [0.5, 0.2]]},
    }
}


def run(output: dict | None = None, **changes: object) -> xr.Dataset:
    given = CASE | changes | {"output": CASE["output"] | (output or {})}
    return cablesim.simulate(cablesim.Case.from_dict(given))


@pytest.fixture(scope="module")
def dataset() -> xr.Dataset:
    return run()


@pytest.fixture(scope="module")
def reeled() -> xr.Dataset:
    return run(**WINCH)


@pytest.fixture
def file(dataset, tmp_path):
    cablesim.write(dataset, tmp_path / "run.nc")
    return tmp_path / "run.nc"


# Size and precision -----------------------------------------------------------------------------


def test_a_file_is_compressed_and_loses_nothing(dataset, file, tmp_path):
    dataset.to_netcdf(tmp_path / "plain.nc", engine="netcdf4")
    assert file.stat().st_size < 0.95 * (tmp_path / "plain.nc").stat().st_size  # a cable that never rests
    xr.testing.assert_identical(cablesim.read(file), dataset)


def test_what_rests_takes_next_to_nothing(tmp_path):
    still = run(ends={"a": CASE["ends"]["a"], "b": {"motion": "fixed", "position": [1.5, 0, 0]}})
    still = still.isel(time=[0] * 100).assign_coords(time=np.arange(100.0))
    cablesim.write(still, tmp_path / "rest.nc")
    assert (tmp_path / "rest.nc").stat().st_size < 0.25 * still.nbytes


def test_single_precision_halves_memory_and_file(dataset, file, tmp_path):
    single = run({"precision": "single"})
    cablesim.write(single, tmp_path / "single.nc")
    assert (tmp_path / "single.nc").stat().st_size < 0.6 * file.stat().st_size
    assert single.nbytes < 0.55 * dataset.nbytes
    back = cablesim.read(tmp_path / "single.nc")
    assert {variable.dtype for variable in back.data_vars.values()} == {np.dtype(np.float32)}
    assert all(back[name].dtype == np.float64 for name in ("time", "s", "s_segment", "marker_s"))
    for name, variable in back.data_vars.items():
        exact = dataset[name].values
        np.testing.assert_allclose(variable.values, exact, rtol=1.2e-7, atol=1e-37, err_msg=name)


def test_counts_stay_whole_numbers_in_single_precision():
    single = run({"precision": "single"}, **WINCH)
    assert single.winch_event_change.dtype == np.int32  # CF knew no longer ones before 1.9
    assert set(np.unique(single.winch_event_change)) == {1}


def test_a_run_goes_on_from_single_precision(dataset, tmp_path):
    cablesim.write(run({"precision": "single"}), tmp_path / "single.nc")
    start = {"shape": "state", "file": str(tmp_path / "single.nc"), "time": 1.0}
    fixed = {"a": CASE["ends"]["a"], "b": {"motion": "fixed", "position": [1.5, 0.3, 0.0]}}
    at = dataset.position.sel(time=1.0, method="nearest")
    fixed["b"]["position"] = [float(x) for x in at.isel(node=-1)]
    resumed = run(ends=fixed, initial=start).position.isel(time=0)
    np.testing.assert_allclose(resumed, at, atol=1e-6)


# Selecting by material coordinate ---------------------------------------------------------------


def test_material_coordinates_select(dataset, file):
    for data in (dataset, cablesim.read(file)):
        chosen = data.position.sel(s=1.21, method="nearest")
        assert float(chosen.s) == pytest.approx(1.2)
        np.testing.assert_array_equal(chosen, data.position.values[:, 24])
        part = data.position.sel(s=slice(0.99, 2.01))
        assert (float(part.s[0]), float(part.s[-1])) == pytest.approx((1.0, 2.0))
        assert float(data.tension.sel(s_segment=0.0, method="nearest").s_segment) == pytest.approx(0.025)
        assert data.marker_position.sel(marker_s=1.5).sizes == {"time": 101, "axis": 3}
        assert data.end_tension.sel(end="b").dims == ("time",)
        assert data.attachment_position.sel(attachment="bóya", axis="z").dims == ("time",)


def test_material_coordinates_select_with_a_winch(reeled):
    inside = reeled.position.sel(s=1.2, method="nearest")
    assert np.isfinite(inside).all()
    drum = reeled.position.sel(s=2.6, method="nearest")
    assert np.isnan(drum.isel(time=0)).all()
    outlet = reeled.position.sel(s=3.0)
    np.testing.assert_array_equal(outlet, reeled.position.isel(node=-1))


def test_sums_of_selections_line_up_along_the_cable(dataset):
    half = dataset.position.sel(s=slice(0.0, 1.5))
    np.testing.assert_array_equal((dataset.position - half).s, half.s)


# Attributes -------------------------------------------------------------------------------------


def test_attributes_after_cf_and_acdd(dataset):
    attributes = dataset.attrs
    assert attributes["Conventions"] == "CF-1.11, ACDD-1.3"
    assert attributes["title"] == "files"
    assert attributes["summary"] == CASE["description"]
    assert attributes["time_coverage_duration"] == "PT2S"
    assert attributes["time_coverage_resolution"] == "PT0.02S"
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", attributes["date_created"])
    assert {"keywords", "source", "product_version", "history"} <= set(attributes)
    for name, variable in dataset.variables.items():
        kind = "coordinate" if name in dataset.coords else "modelResult"
        assert variable.attrs["coverage_content_type"] == kind, name
        assert variable.attrs["long_name"], name


def test_a_file_keeps_what_cf_asks_for(file):
    with netCDF4.Dataset(file) as data:
        for name in ("time", "s", "s_segment", "marker_s", "axis", "end", "attachment"):
            assert "_FillValue" not in data[name].ncattrs(), name
        # coordinate variables are numbers; labels are characters
        for name, dimension in ((name, name) for name in data.dimensions if name in data.variables):
            numeric = data[name].dtype.kind == "f" and data[name].dimensions == (dimension,)
            assert numeric or (data[name].dtype == "S1" and data[name].ndim == 2), name
        assert data["position"].coordinates == "s"
        assert list(data["attachment"][:]) == ["bóya", "b"]


def test_a_case_gives_attributes_of_its_own():
    given = {"creator_name": "A. Nalyst", "institution": "A basin", "license": "CC-BY-4.0"}
    assert given.items() <= run({"attributes": given}).attrs.items()


@pytest.mark.parametrize("name", ["creator_nam", "status", "case"])
def test_other_attributes_are_refused(name):
    with pytest.raises(cablesim.CaseError, match=f"output.attributes.{name}.*not an attribute"):
        run({"attributes": {name: "x"}})
