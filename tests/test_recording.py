"""Recordings written here and read back, and the real ones of the COSMER tank."""

import logging
from pathlib import Path

import numpy as np
import pytest
import xarray

from cablesim.motion import recorded
from cablesim.recording import (
    RecordingError,
    read_columns,
    read_lengths,
    read_markers,
    read_recording,
    rotate_to_vertical,
)

RECORDED = Path(__file__).parents[1] / "validation" / "recorded"
MARKERS = RECORDED / "cable6_y200dis1_0024_markers.csv"

TIMES = np.arange(8) * 0.25
POSITIONS = np.stack([TIMES, np.sin(TIMES), -1.5 + 0 * TIMES], axis=1)


def write(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def table(separator, names=("t", "x", "y", "z")):
    rows = [[repr(float(v)) for v in (t, *p)] for t, p in zip(TIMES, POSITIONS, strict=True)]
    return "\n".join(separator.join(row) for row in [list(names), *rows]) + "\n"


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", " , ", "   "])
def test_separators_are_recognised(tmp_path, separator):
    path = write(tmp_path / "motion.csv", table(separator))
    times, positions = read_recording(path, time_column="t")
    np.testing.assert_array_equal(times, TIMES)
    np.testing.assert_array_equal(positions, POSITIONS)


def test_decimal_commas_between_semicolons(tmp_path):
    path = write(tmp_path / "motion.csv", table(";").replace(".", ","))
    np.testing.assert_array_equal(read_recording(path, time_column="t")[1], POSITIONS)


def test_names_in_a_comment_line_of_savetxt(tmp_path):
    path = tmp_path / "motion.txt"
    np.savetxt(path, np.column_stack([TIMES, POSITIONS]), header="t x y z")
    np.testing.assert_allclose(read_recording(path, time_column="t")[1], POSITIONS, rtol=1e-15)


def test_sample_interval_and_unit_factor(tmp_path):
    path = write(tmp_path / "motion.csv", "east north up\n1 2 3\n4 5 6\n")
    times, positions = read_recording(
        path, sample_interval=0.03, columns=("north", "east", "up"), unit_factor=1e-3
    )
    np.testing.assert_array_equal(times, [0.0, 0.03])
    np.testing.assert_allclose(positions, [[2e-3, 1e-3, 3e-3], [5e-3, 4e-3, 6e-3]])


def test_where_picks_rows_by_number_or_text(tmp_path):
    text = "frame,who,t,x,y,z\n1,a,0.0,1,2,3\n1,b,0.0,7,7,7\n2.0,a,0.5,4,5,6\n2.0,b,0.5,7,7,7\n"
    path = write(tmp_path / "motion.csv", text)
    times, positions = read_recording(path, time_column="t", where={"who": "a"})
    np.testing.assert_array_equal(times, [0.0, 0.5])
    np.testing.assert_array_equal(positions, [[1, 2, 3], [4, 5, 6]])
    arc, _ = read_markers(path, arc_column="x", where={"frame": 2})
    np.testing.assert_array_equal(arc, [4, 7])


def test_lost_samples_leave_a_gap_and_a_warning(tmp_path, caplog):
    path = write(tmp_path / "motion.csv", "x,y,z\n1,2,3\n,,\n,,\n4,5,6\n7,8,9\n")
    with caplog.at_level(logging.WARNING, logger="cablesim.recording"):
        times, positions = read_recording(path, sample_interval=0.5)
    np.testing.assert_array_equal(times, [0.0, 1.5, 2.0])
    np.testing.assert_array_equal(positions[1], [4, 5, 6])
    assert "lost in 2 of 5 samples, longest gap 1.5 s" in caplog.text


def test_markers_are_sorted_along_the_cable(tmp_path):
    path = write(tmp_path / "shape.csv", "s,x,y,z\n2.0,3,0,0\n0.5,1,0,0\n1.0,,,\n1.5,2,0,0\n")
    arc, positions = read_markers(path, arc_column="s")
    np.testing.assert_array_equal(arc, [0.5, 1.5, 2.0])
    np.testing.assert_array_equal(positions[:, 0], [1, 2, 3])


def qtm_text(*, frame_and_time, header_line, lost="0.000", frequency="4", extra=""):
    """Text of an export with markers "rod" and "robot"; the robot is lost in frame 3."""
    lines = [
        "NO_OF_FRAMES\t8",
        "NO_OF_CAMERAS\t5",
        "NO_OF_MARKERS\t2",
        f"FREQUENCY\t{frequency}",
        "NO_OF_ANALOG\t0",
        "DESCRIPTION\t--",
        "TIME_STAMP\t2022-11-23, 10:39:38.777\t406646.66137317",
        "DATA_INCLUDED\t3D",
        "EVENT\tstart\t1\t0.00000",
        "MARKER_NAMES\trod\trobot",
        "TRAJECTORY_TYPES\tMeasured\tMixed",
    ]
    if header_line:
        names = ["Frame", "Time"] if frame_and_time else []
        lines.append("\t".join(names + [f"{name} {axis}" for name in ("rod", "robot") for axis in "XYZ"]))
    for i, (t, p) in enumerate(zip(TIMES, POSITIONS, strict=True)):
        cells = [str(i + 1), f"{t:.5f}"] if frame_and_time else []
        robot = [lost] * 3 if i == 2 else [f"{1000 * v:.3f}" for v in p]
        lines.append("\t".join([*cells, "1.000", "2.000", "3.000", *robot]) + extra)
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("frame_and_time", [True, False])
@pytest.mark.parametrize("header_line", [True, False])
@pytest.mark.parametrize("lost", ["0.000", ""])
@pytest.mark.parametrize("extra", ["", "\t"])
def test_qtm_export(tmp_path, frame_and_time, header_line, lost, extra):
    text = qtm_text(frame_and_time=frame_and_time, header_line=header_line, lost=lost, extra=extra)
    path = write(tmp_path / "run.tsv", text)
    times, positions = read_recording(path, marker="robot")
    kept = np.arange(8) != 2
    np.testing.assert_allclose(times, TIMES[kept])
    np.testing.assert_allclose(positions, POSITIONS[kept], atol=5e-7)
    rod = read_recording(path, format="qtm", marker="rod")[1]
    np.testing.assert_allclose(rod, np.tile([0.001, 0.002, 0.003], (8, 1)))


def test_qtm_with_one_marker_lost_for_whole_lines(tmp_path):
    text = "NO_OF_FRAMES\t4\nFREQUENCY\t10\nMARKER_NAMES\tend\n1\t2\t3\n\t\t\n4\t5\t6\n7\t8\t9\n"
    times, positions = read_recording(write(tmp_path / "run.tsv", text))
    np.testing.assert_allclose(times, [0, 0.2, 0.3])
    np.testing.assert_allclose(positions[1], [0.004, 0.005, 0.006])


def test_qtm_on_an_external_timebase_needs_an_interval(tmp_path):
    path = write(tmp_path / "run.tsv", qtm_text(frame_and_time=False, header_line=False, frequency="EXT"))
    with pytest.raises(RecordingError, match="FREQUENCY is 'EXT'; give sample_interval"):
        read_recording(path, marker="rod")
    times, _ = read_recording(path, marker="rod", sample_interval=0.1)
    np.testing.assert_allclose(times, 0.1 * np.arange(8))


def dataset():
    """Two points against time in one variable, and the first again in three variables."""
    both = np.stack([POSITIONS, POSITIONS + 10], axis=1)
    return xarray.Dataset(
        {
            "position": (("time", "point", "xyz"), both),
            **{name: ("time", component) for name, component in zip("xyz", POSITIONS.T, strict=True)},
            "clock": ("time", TIMES + 5, {"units": "s"}),
        },
        coords={"time": ("time", TIMES, {"units": "seconds since start"}), "point": ["rod", "robot"]},
    )


def test_netcdf_with_three_variables(tmp_path):
    dataset().to_netcdf(tmp_path / "motion.nc")
    times, positions = read_recording(tmp_path / "motion.nc")
    np.testing.assert_array_equal(times, TIMES)
    np.testing.assert_array_equal(positions, POSITIONS)
    times, _ = read_recording(tmp_path / "motion.nc", time_column="clock")
    np.testing.assert_array_equal(times, TIMES + 5)
    times, _ = read_recording(tmp_path / "motion.nc", sample_interval=0.1)
    np.testing.assert_array_equal(times, 0.1 * np.arange(8))


def test_netcdf_without_times(tmp_path):
    dataset().drop_vars("time").to_netcdf(tmp_path / "motion.nc")
    with pytest.raises(RecordingError, match="'time' has no coordinate; give time_column or sample_interval"):
        read_recording(tmp_path / "motion.nc")


def test_netcdf_with_a_position_variable(tmp_path):
    dataset().transpose("xyz", "time", "point").to_netcdf(tmp_path / "motion.nc")
    times, positions = read_recording(tmp_path / "motion.nc", columns=("position",), where={"point": "robot"})
    np.testing.assert_array_equal(times, TIMES)
    np.testing.assert_array_equal(positions, POSITIONS + 10)


def test_netcdf_fill_values_are_lost_samples(tmp_path):
    data = dataset()
    data["position"][3] = np.nan
    data.to_netcdf(tmp_path / "motion.nc")
    times, _ = read_recording(tmp_path / "motion.nc", columns=["position"], where={"point": "rod"})
    np.testing.assert_array_equal(times, np.delete(TIMES, 3))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"columns": ["positoin"]}, "no variable 'positoin'.*did you mean 'position'"),
        ({"columns": ["position"]}, "pick from the others with `where`"),
        ({"columns": ["position"], "where": {"point": "boat"}}, "no point = 'boat'; found rod, robot"),
        ({"columns": ("x", "y")}, "give the names of x, y and z, or one name"),
        ({"columns": ("x", "y", "position")}, "they need one and the same"),
        ({"where": {"position": 1}}, "name one with a single dimension"),
        ({"time_column": "clock", "sample_interval": 1.0}, "both time_column and sample_interval"),
        ({"time_column": "hours"}, "'hours' has dimensions.*unit 'm'"),
    ],
)
def test_netcdf_mistakes(tmp_path, options, message):
    dataset().assign(hours=("time", TIMES / 3600, {"units": "m"})).to_netcdf(tmp_path / "motion.nc")
    with pytest.raises(RecordingError, match=message):
        read_recording(tmp_path / "motion.nc", **options)


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("t,x,y,z\n0,1,2,3\n1,2,nan,4\n", {"time_column": "t"}, r"line 3, column 'y': 'nan' is not a finite"),
        ("t,x,y,z\n0,1,2,3\n1,2,?,4\n", {"time_column": "t"}, r"line 3, column 'y': '\?'"),
        ("t,x,y,z\n0,1,2,3\n1,2,,4\n", {"time_column": "t"}, "line 3: position .* is incomplete"),
        ("t,x,y,z\n0,1,2,3\n0,2,2,4\n", {"time_column": "t"}, "line 3: time 0 s comes after 0 s"),
        ("t,x,y,z\n0,1,2,3\n\n1,2,3\n", {"time_column": "t"}, "line 4: 3 cells under 4 names"),
        ("time,x,y,z\n0,1,2,3\n", {"time_column": "tine"}, "columns: time, x, y, z; did you mean 'time'"),
        ("t,X,y,z\n0,1,2,3\n", {"time_column": "t"}, "no column 'x'.*did you mean 'X'"),
        ("t,x,y,z\n0,1,2,3\n", {"time_column": "t"}, "1 of 1 rows hold a position"),
        ("t,x,y,z\n0,1,2,3\n", {}, "neither of time_column and sample_interval"),
        ("t,x,y,z\n0,1,2,3\n", {"time_column": "t", "sample_interval": 1.0}, "both of time_column"),
        ("x,y,z\n1,2,3\n", {"sample_interval": 0.0}, "sample_interval is 0.0 s"),
        ("0,1,2,3\n1,2,3,4\n", {"time_column": "t"}, "line 1: numbers where the names"),
        ("", {"time_column": "t"}, "no rows"),
        ("t,x,y,z\n0,1,2,3\n", {"time_column": "t", "where": {"x": 5}}, "no row with x = 5; found 1"),
        ("t,x,y,z\n0,1,2,3\n", {"time_column": "t", "marker": "a"}, "marker 'a' is for QTM exports"),
        ("t,x,y,z\n0,1,2,3\n", {"format": "excel"}, "format 'excel' is unknown"),
        ("t,x,y,z\n0,1,2,3\n", {"format": "netcdf"}, "not a readable netCDF file"),
        ("t,x,y,z\n0,1,2,3\n", {"columns": ("x", "y"), "time_column": "t"}, "give the names of x, y and z"),
        ("NO_OF_FRAMES\t1\nMARKER_NAMES\ta\tb\n1\t2\t3\t4\t5\t6\n", {}, "no marker None; markers: a, b"),
        ("NO_OF_FRAMES\t1\nMARKER_NAMES\trobot\n1\t2\t3\n", {"marker": "robo"}, "did you mean 'robot'"),
        ("NO_OF_FRAMES\t1\nMARKER_NAMES\ta\n1\t2\t3\t4\t5\t6\n", {}, "line 3: 6 cells for 1 markers"),
        ("NO_OF_FRAMES\t1\nMARKER_NAMES\ta\n", {}, "no frames after the header"),
        ("NO_OF_FRAMES\t1\nDATA_INCLUDED\t2D\n1\t2\n", {}, "export 3D trajectories"),
        ("NO_OF_FRAMES\t1\nMARKER_NAMES\ta\n1\t2\t3\n", {"time_column": "t"}, "no meaning in a QTM export"),
    ],
)
def test_mistakes_are_reported_with_place_and_remedy(tmp_path, text, options, message):
    with pytest.raises(RecordingError, match=message):
        read_recording(write(tmp_path / "motion.csv", text), **options)


def test_missing_file_names_a_similar_one(tmp_path):
    write(tmp_path / "trajectory_24.txt", "x y z\n1 2 3\n")
    with pytest.raises(RecordingError, match=r"no such file.*did you mean 'trajectory_24.txt'"):
        read_recording(tmp_path / "trajectory_42.txt", sample_interval=0.03)


def test_marker_arc_given_twice(tmp_path):
    path = write(tmp_path / "shape.csv", "s,x,y,z\n1,0,0,0\n2,0,0,0\n1,0,0,1\n")
    with pytest.raises(RecordingError, match="line 4: s = 1 occurs twice; pick one moment"):
        read_markers(path, arc_column="s")


def test_smallest_rotation_to_the_vertical():
    up = np.array([0.006, -0.083, 0.9965]) * 3
    turned = rotate_to_vertical(np.stack([up, np.cross(up, [0, 0, 1])]), up)
    np.testing.assert_allclose(turned[0], [0, 0, np.linalg.norm(up)], atol=1e-14)
    np.testing.assert_allclose(turned[1], np.cross(up, [0, 0, 1]), atol=1e-14)  # the axis stays


@pytest.mark.parametrize("up", [[0, 0, 2.0], [0, 0, -1.0], [1.0, 0, 0]])
def test_rotations_keep_lengths_and_reach_the_vertical(up):
    np.testing.assert_allclose(rotate_to_vertical(up, up), [0, 0, np.linalg.norm(up)], atol=1e-14)
    np.testing.assert_allclose(
        np.linalg.norm(rotate_to_vertical(POSITIONS, up), axis=1), np.linalg.norm(POSITIONS, axis=1)
    )


def test_no_vertical_without_a_direction():
    with pytest.raises(RecordingError, match="not all zero"):
        rotate_to_vertical(POSITIONS, [0, 0, 0])


def test_real_robot_trajectory_and_markers_agree():
    robot = RECORDED / "cable6_y200dis1_0024_robot.txt"
    times, relative = read_recording(robot, sample_interval=0.03)
    assert times.size == 314
    np.testing.assert_allclose(relative[0], [-1.377, -0.276, -0.587])
    motion = recorded(times, relative, 7e-4)
    # trajectory 5 of the paper: a sway command of 0.6 m/s
    assert 0.4 < motion.speed_limit(9.0) < 0.7
    arc, shape = read_markers(MARKERS, arc_column="arc_m", columns=("x_m", "y_m", "z_m"), where={"frame": 3})
    assert arc.size == 16
    assert arc[-1] == pytest.approx(2.841, abs=1e-3)
    # the README gives 1.9 mm as the worst difference between the two sources
    np.testing.assert_allclose(motion.position(0.03), shape[-1] - shape[0], atol=3e-3)
    assert np.linalg.norm(np.diff(shape, axis=0), axis=1).sum() == pytest.approx(2.841, abs=0.02)


def test_lost_real_markers_are_left_out():
    columns = ("x_m", "y_m", "z_m")
    whole, _ = read_markers(MARKERS, arc_column="arc_m", columns=columns, where={"frame": 3})
    late, positions = read_markers(MARKERS, arc_column="arc_m", columns=columns, where={"frame": 755})
    assert late.size < whole.size
    assert np.isfinite(positions).all()
    times, _ = read_recording(MARKERS, time_column="t_s", columns=columns, where={"point": "cable_10"})
    assert times[0] == pytest.approx(0.03)
    assert times.size < 43


# Lengths ----------------------------------------------------------------------------------------


def test_length_from_a_table(tmp_path):
    rows = ["run,t,out", "1,0,99", "2,0,3000", "2,0.5,3010", "2,1.0,", "2,1.5,3030"]
    path = write(tmp_path / "encoder.csv", "\n".join(rows))
    times, lengths = read_lengths(path, column="out", time_column="t", where={"run": 2}, unit_factor=1e-3)
    np.testing.assert_array_equal(times, [0, 0.5, 1.5])
    np.testing.assert_allclose(lengths, [3.0, 3.01, 3.03])
    times, _ = read_lengths(path, column="out", sample_interval=0.1)
    np.testing.assert_allclose(times, [0, 0.1, 0.2, 0.4])


def test_length_from_a_result(tmp_path):
    out = xarray.DataArray([[3.0, 3.1, np.nan, 3.3], [1.0, 1.0, 1.0, 1.0]], dims=("run", "time"))
    dataset = xarray.Dataset({"deployed_length": out}, coords={"time": [0.0, 1, 2, 3], "run": [7, 8]})
    dataset.to_netcdf(tmp_path / "result.nc")
    times, lengths = read_lengths(tmp_path / "result.nc", column="deployed_length", where={"run": 7})
    np.testing.assert_array_equal(times, [0, 1, 3])
    np.testing.assert_allclose(lengths, [3.0, 3.1, 3.3])
    with pytest.raises(RecordingError, match=r"'run': 2, 'time': 4.*a length needs one alone"):
        read_lengths(tmp_path / "result.nc", column="deployed_length")


@pytest.mark.parametrize(
    ("text", "options", "message"),
    [
        ("t,out\n0,3\n1,3\n", {"column": "ou", "time_column": "t"}, "no column 'ou'.*did you mean 'out'"),
        ("t,out\n0,3\n1,x\n", {"column": "out", "time_column": "t"}, "line 3, column 'out': 'x'"),
        ("t,out\n1,3\n0,3\n", {"column": "out", "time_column": "t"}, "time 0 s comes after 1 s"),
        ("t,out\n0,3\n1,\n", {"column": "out", "time_column": "t"}, "1 of 2 rows hold"),
        ("t,out\n0,3\n1,3\n", {"column": "out"}, "neither of time_column and sample_interval"),
        ("NO_OF_FRAMES\t2\n", {"column": "out"}, "holds positions, no lengths"),
    ],
)
def test_lengths_that_cannot_be_read(tmp_path, text, options, message):
    with pytest.raises(RecordingError, match=message):
        read_lengths(write(tmp_path / "encoder.csv", text), **options)


def test_columns_of_a_table(tmp_path):
    path = write(tmp_path / "table.csv", "gap;speed;note\n0,2;0;slow\n0,3;0,5;fast\n")
    np.testing.assert_array_equal(read_columns(path, ("speed", "gap")), [[0, 0.2], [0.5, 0.3]])
    with pytest.raises(RecordingError, match="line 2, column 'note': 'slow' is not a finite number"):
        read_columns(path, ("note",))
    with pytest.raises(RecordingError, match="no such file"):
        read_columns(tmp_path / "tabel.csv", ("speed",))
