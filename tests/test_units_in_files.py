"""Units, dates, directions and kinds of files that maps and recordings come in."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest

from cablesim import CaseError
from cablesim.build import build_scene
from cablesim.case import Case
from cablesim.recording import RecordingError, read_columns, read_lengths, read_markers, read_recording
from cablesim.scene import GriddedCurrent

TIMES = np.arange(8.0)
POSITIONS = np.column_stack((TIMES, 2 * TIMES, -TIMES))


def case(directory: Path, **changes: Any) -> Any:
    given = {
        "name": "units",
        "cable": {"length": 5, "diameter": 0.005, "mass_per_length": 0.055, "axial_stiffness": 1e4},
        "mesh": {"segment_length": 0.5},
        "ends": {
            "a": {"motion": "fixed", "position": [0, 0, 0]},
            "b": {"motion": "fixed", "position": [3, 0, 0]},
        },
        "simulation": {"duration": 1},
    }
    return build_scene(Case.from_dict(given | changes, directory=directory))


# Maps -------------------------------------------------------------------------------------------


def write_map(path: Path, vertical: str = "z", **changes: dict[str, str]) -> None:
    """u = 10 m/s per metre of depth, on depths 0 and 5 m and x 0 and 2 km, in the units of `changes`."""
    attributes = {vertical: {"units": "m", "positive": "down"}} | changes
    with netCDF4.Dataset(path, "w") as file:
        for name, values in ((vertical, [0.0, 5.0]), ("x", [0.0, 2.0])):
            file.createDimension(name, 2)
            file.createVariable(name, "f8", (name,))[:] = values
        for name in ("u", "v"):
            file.createVariable(name, "f8", (vertical, "x"))[:] = [[0, 0], [50, 50]]
        for name, given in attributes.items():
            file[name].setncatts(given)


def read_map(directory: Path, **names: str) -> GriddedCurrent:
    water = {"current": {"kind": "map", "file": "map.nc", **names}}
    current = case(directory, water=water).water.current
    assert isinstance(current, GriddedCurrent)
    return current


@pytest.mark.parametrize(
    ("unit", "factor"),
    [
        ("cm/s", 0.01),
        ("cm s-1", 0.01),
        ("m s-1", 1.0),
        ("m.s-1", 1.0),
        ("m s**-1", 1.0),
        ("knots", 1852 / 3600),
        ("meter second-1", 1.0),
        ("", 1.0),
    ],
)
def test_velocities_in_the_units_of_the_map(tmp_path: Path, unit: str, factor: float) -> None:
    write_map(tmp_path / "map.nc", u={"units": unit})
    velocities = read_map(tmp_path).velocities[0, 0, 0]
    np.testing.assert_allclose(velocities[:, 0], [50 * factor, 0], rtol=1e-9)
    np.testing.assert_allclose(velocities[:, 1], [50, 0])


def test_places_in_kilometres(tmp_path: Path) -> None:
    write_map(tmp_path / "map.nc", x={"units": "km"})
    np.testing.assert_allclose(read_map(tmp_path).x, [0, 2000])


@pytest.mark.parametrize(
    ("attributes", "lowest"),
    [
        ({"units": "m", "standard_name": "depth"}, -5),
        ({"units": "m", "standard_name": "depth", "positive": "up"}, 0),
        ({"units": "m", "positive": "Down"}, -5),
        ({"units": "m", "standard_name": "height"}, 0),
        ({"units": "m"}, 0),
    ],
)
def test_depth_is_known_by_its_attributes(tmp_path: Path, attributes: dict[str, str], lowest: float) -> None:
    write_map(tmp_path / "map.nc", z=attributes)
    assert read_map(tmp_path).z[0] == lowest


def test_a_depth_of_unknown_direction_is_refused(tmp_path: Path) -> None:
    write_map(tmp_path / "map.nc", vertical="Depth", Depth={"units": "m"})
    with pytest.raises(CaseError, match=r"'Depth' does not say which way.*'positive'"):
        read_map(tmp_path, z="Depth")


@pytest.mark.parametrize("unit", ["s since 2024-01-01", "seconds since 2024-01-01T00:00:00Z"])
def test_dates_of_a_map_count_from_its_first(tmp_path: Path, unit: str) -> None:
    with netCDF4.Dataset(tmp_path / "map.nc", "w") as file:
        file.createDimension("time", 2)
        time = file.createVariable("time", "f8", ("time",))
        time[:], time.units = [7200.0, 7260.0], unit
        for name in ("u", "v"):
            file.createVariable(name, "f8", ("time",))[:] = [0, 1]
    np.testing.assert_allclose(read_map(tmp_path).times, [0, 60])


@pytest.mark.parametrize(
    ("attributes", "words"),
    [
        ({"u": {"units": "kg"}}, "'u' is in 'kg', not in a speed"),
        ({"u": {"units": "m"}}, "'u' is in 'm', not in a speed"),
        ({"x": {"units": "degrees_east"}}, "'x' is in 'degrees_east', not in a length"),
    ],
)
def test_maps_in_other_units_are_refused(tmp_path: Path, attributes: Any, words: str) -> None:
    write_map(tmp_path / "map.nc", **attributes)
    with pytest.raises(CaseError) as caught:
        read_map(tmp_path)
    assert words in str(caught.value)


KINDS = {
    "an Excel workbook": b"PK\x03\x04" + bytes(100),
    "a picture": b"\x89PNG\r\n\x1a\n" + bytes(100),
    "a PDF": b"%PDF-1.7\n%\xe2\xe3",
    "a MATLAB file": b"MATLAB 5.0 MAT-file, Platform: GLNXA64" + bytes(100),
    "a ROS bag": b"#ROSBAG V2.0\n" + bytes(20),
    "text in UTF-16": "t,x,y,z\n0,0,0,0\n".encode("utf-16"),
    "a binary file": bytes(range(256)),
}


@pytest.mark.parametrize("kind", [*KINDS, "text"])
def test_maps_of_another_kind_are_refused(tmp_path: Path, kind: str) -> None:
    (tmp_path / "map.nc").write_bytes(KINDS.get(kind, b"x,y,u,v\n0,0,1,1\n"))
    with pytest.raises(CaseError, match=f"{kind}, not a netCDF file"):
        read_map(tmp_path)


# Recordings -------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("format", ["auto", "csv", "qtm"])
def test_recordings_of_another_kind_are_refused(tmp_path: Path, kind: str, format: str) -> None:
    (tmp_path / "motion.csv").write_bytes(KINDS[kind])
    with pytest.raises(RecordingError, match=f"{kind}, not a table of text; export it as CSV"):
        read_recording(tmp_path / "motion.csv", time_column=None if format == "qtm" else "t", format=format)


@pytest.mark.parametrize("kind", KINDS)
def test_other_tables_of_another_kind_are_refused(tmp_path: Path, kind: str) -> None:
    (tmp_path / "table.csv").write_bytes(KINDS[kind])
    with pytest.raises(RecordingError, match=f"{kind}, not a table of text"):
        read_markers(tmp_path / "table.csv", arc_column="s")
    with pytest.raises(RecordingError, match=f"{kind}, not a table of text"):
        read_columns(tmp_path / "table.csv", ["speed", "gap"])


def test_markers_in_netcdf_are_refused(tmp_path: Path) -> None:
    write_netcdf(tmp_path / "markers.csv")
    with pytest.raises(RecordingError, match="an HDF5 or netCDF file, not a table of text"):
        read_markers(tmp_path / "markers.csv", arc_column="s")


def write_netcdf(path: Path, *, position: str | None = None, time: str | None = "s") -> None:
    with netCDF4.Dataset(path, "w") as file:
        file.createDimension("time", TIMES.size)
        for name, values, unit in (
            ("time", TIMES + 100, time),
            *zip("xyz", POSITIONS.T, [position] * 3, strict=True),
            ("deployed_length", TIMES, position),
        ):
            variable = file.createVariable(name, "f8", ("time",))
            variable[:] = values
            if unit is not None:
                variable.units = unit


@pytest.mark.parametrize(
    ("unit", "factor"), [("cm", 0.01), ("km", 1000.0), ("m", 1.0), ("", 1.0), (None, 1.0)]
)
def test_positions_in_the_units_of_the_file(tmp_path: Path, unit: str | None, factor: float) -> None:
    write_netcdf(tmp_path / "motion.nc", position=unit)
    np.testing.assert_allclose(read_recording(tmp_path / "motion.nc")[1], factor * POSITIONS)
    lengths = read_lengths(tmp_path / "motion.nc", column="deployed_length")[1]
    np.testing.assert_allclose(lengths, factor * TIMES)


def test_a_unit_that_contradicts_the_file_is_refused(tmp_path: Path) -> None:
    write_netcdf(tmp_path / "motion.nc", position="cm")
    with pytest.raises(RecordingError, match=r"says that its values are in .cm..*leave `unit` out"):
        read_recording(tmp_path / "motion.nc", unit_factor=1e-3)
    np.testing.assert_allclose(read_recording(tmp_path / "motion.nc", unit_factor=0.01)[1], 0.01 * POSITIONS)
    write_netcdf(tmp_path / "motion.nc", position="degrees_north")
    with pytest.raises(RecordingError, match="'degrees_north', which is no length"):
        read_recording(tmp_path / "motion.nc")


@pytest.mark.parametrize(
    ("unit", "expected"),
    [
        ("ms", 1e-3 * (TIMES + 100)),
        ("h", 3600 * (TIMES + 100)),
        ("seconds since 2024-05-01 12:00", TIMES),
        ("days since 1970-01-01", 86400 * TIMES),
        ("", TIMES + 100),
        (None, TIMES + 100),
    ],
)
def test_times_in_the_units_of_the_file(tmp_path: Path, unit: str | None, expected: Any) -> None:
    write_netcdf(tmp_path / "motion.nc", time=unit)
    np.testing.assert_allclose(read_recording(tmp_path / "motion.nc")[0], expected)


@pytest.mark.parametrize("unit", ["m", "months since 2024-01-01", "years", "3"])
def test_times_in_no_unit_of_time_are_refused(tmp_path: Path, unit: str) -> None:
    write_netcdf(tmp_path / "motion.nc", time=unit)
    with pytest.raises(RecordingError, match="in a unit of time"):
        read_recording(tmp_path / "motion.nc")


def test_dates_in_a_table_count_from_the_first(tmp_path: Path) -> None:
    rows = [
        "2024-05-01T12:00:00.250Z,0,0,0",
        "2024-05-01T12:00:00.500Z,1,0,0",
        "2024-05-01T14:00:01+02:00,2,0,0",
    ]
    (tmp_path / "motion.csv").write_text("\n".join(["stamp,x,y,z", *rows]))
    times, _ = read_recording(tmp_path / "motion.csv", time_column="stamp")
    np.testing.assert_allclose(times, [0.0, 0.25, 0.75])


def test_a_row_without_its_date_is_refused(tmp_path: Path) -> None:
    (tmp_path / "motion.csv").write_text("stamp,x,y,z\n2024-05-01 12:00,0,0,0\n12.5,1,0,0\n")
    with pytest.raises(RecordingError, match=r"line 3, column 'stamp': '12.5' is not a date"):
        read_recording(tmp_path / "motion.csv", time_column="stamp")


def test_units_in_brackets_after_names_of_columns(tmp_path: Path) -> None:
    (tmp_path / "motion.csv").write_text("t [ms];x [mm];y (mm);z (up)\n0;1000;2000;3\n500;1000;2000;4\n")
    columns = ("x [mm]", "y (mm)", "z (up)")
    times, positions = read_recording(tmp_path / "motion.csv", time_column="t [ms]", columns=columns)
    np.testing.assert_allclose(times, [0.0, 0.5])
    np.testing.assert_allclose(positions, [[1, 2, 3], [1, 2, 4]])
    (tmp_path / "markers.csv").write_text("s;x [cm];y [cm];z [cm]\n0;0;0;0\n1;0;0;100\n")
    markers = read_markers(tmp_path / "markers.csv", arc_column="s", columns=("x [cm]", "y [cm]", "z [cm]"))
    np.testing.assert_allclose(markers[1][1], [0, 0, 1])


def test_a_motion_capture_export_is_in_millimetres_whoever_says_so(tmp_path: Path) -> None:
    """`unit: mm` beside an export that is in millimetres anyway made micrometres of them."""
    text = "NO_OF_FRAMES\t2\nFREQUENCY\t100\nMARKER_NAMES\trobot\n1000\t0\t0\n2000\t0\t0\n"
    (tmp_path / "motion.tsv").write_text(text)
    for factor in (None, 1e-3):
        positions = read_recording(tmp_path / "motion.tsv", unit_factor=factor)[1]
        np.testing.assert_allclose(positions[:, 0], [1, 2])
    with pytest.raises(RecordingError, match="in 'mm'"):
        read_recording(tmp_path / "motion.tsv", unit_factor=1.0)


def test_a_case_reads_the_unit_of_its_recording(tmp_path: Path) -> None:
    write_netcdf(tmp_path / "motion.nc", position="cm")
    end = {"motion": "recorded", "file": "motion.nc", "noise": 0}
    ends = {"a": {"motion": "fixed", "position": [0, 0, 0]}, "b": end}
    motion = case(tmp_path, ends=ends).end_b.motion
    np.testing.assert_allclose(motion.position(1.0), 0.01 * POSITIONS[1], atol=1e-12)
    with pytest.raises(CaseError, match="Leave `unit` out"):
        case(tmp_path, ends={**ends, "b": {**end, "unit": "mm"}})


def test_missing_numbers_are_said(tmp_path: Path) -> None:
    (tmp_path / "motion.csv").write_text("t,x,y,z\n0,0,0,0\n1,nan,nan,nan\n2,1,1,1\n")
    with pytest.raises(RecordingError, match="line 3, column 'x': 'nan' is not a finite number"):
        read_recording(tmp_path / "motion.csv", time_column="t")
