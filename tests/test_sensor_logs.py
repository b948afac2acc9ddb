"""Logs of real sensors: what is misspelt, missing or impossible in them is said, where it stands."""

import numpy as np
import pytest
from shapes import G, pendulum

from cablesim.sensors import SensorError, SensorWarning, export_imu_csv, imu_signals, read_imu_csv, tangents

S = np.linspace(0.0, 2.0, 41)
HEADER = "time,orientation.x,orientation.y,orientation.z,orientation.w"
FORCES = "linear_acceleration.x,linear_acceleration.y,linear_acceleration.z"


def read(folder, text, **options):
    (folder / "log.csv").write_text(text)
    return read_imu_csv({"a": folder / "log.csv"}, {"a": 1.0}, **options)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"holds no time: .* `time` \[s\]"),
        (f"{HEADER}\n", "holds no rows"),
        ("x\n1\n", "holds no time: .* there are: x"),
        ("time,temperature\n1,2\n", "holds no reading: .*orientation.x"),
        (f"{HEADER}\n2,0,0,0,1\n1,0,0,0,1\n", "line 3: time 1 s follows 2 s, but must increase"),
        (f"{HEADER}\n0,0,0,0,1\n\n,0,0,0,1\n", "line 4, holds no time"),
        (f"{HEADER}\n0,0,0,0,1\n1,0,0,one,1\n", "line 3, cannot be read: .*'one'"),
        (f"{HEADER}\n0,0,0,0,1\n1,0,0\n", "line 3, cannot be read"),
        (f"{HEADER.replace('orientation.w', 'orientaton.w')}\n0,0,0,0,1\n", "is it `orientation.w`"),
        (f"{HEADER},Linear_Acceleration.X\n0,0,0,0,1,0\n", "is it `linear_acceleration.x`"),
        (f"{HEADER},angular_velocity.x\n0,0,0,0,1,0\n", "but not angular_velocity.y, angular_velocity.z"),
        (f"{HEADER}\n0,0,0,0,1\n1,0,0,0,0\n", "line 3: the orientation has the length 0"),
        (f"{HEADER}\n0,0,0,1,1\n", "line 2: the orientation has the length 1.41"),
    ],
)
def test_logs_that_cannot_be_read(tmp_path, text, message):
    with pytest.raises(SensorError, match=message):
        read(tmp_path, text)


def test_columns_of_others_are_left_alone(tmp_path):
    text = f"{HEADER},temperature,orientation_covariance.0\n0,0,0,0,1,20,1\n1,0,0,0,1,20,1\n"
    np.testing.assert_array_equal(read(tmp_path, text).orientation, [[[0, 0, 0, 1]]] * 2)


def test_missing_readings_are_said_and_stay_where_they_are(tmp_path):
    text = f"{HEADER}\n0,0,0,0,1\n1,0,0,0,1\n2,nan,0,0,1\n3,,,,\n4,0,0,0,1\n"
    with pytest.warns(SensorWarning, match="lacks orientation in 2 of 5 rows, first in line 4"):
        log = read(tmp_path, text)
    known = np.isfinite(tangents(log).values).all(axis=(1, 2))
    np.testing.assert_array_equal(known, [True, True, False, False, True])


def test_no_orientation_and_forces_in_g_are_said(tmp_path):
    with pytest.warns(SensorWarning) as said:
        read(tmp_path, f"time,{FORCES}\n0,0,0,1\n1,0,0.1,1\n")
    assert [str(each.message).split(" ", 1)[1][:22] for each in said] == [
        "has no orientation: ta",
        "has forces of 1 m/s2 i",
    ]


def test_rounded_quaternions_have_unit_length(tmp_path):
    log = read(tmp_path, f"{HEADER}\n0,0.5,0.5,0.5,0.501\n")
    np.testing.assert_allclose(np.linalg.norm(log.orientation, axis=-1), 1.0, atol=1e-12)


def test_positions_and_mountings_belong_to_files(tmp_path):
    with pytest.raises(SensorError, match="no position for 'a'"):
        read_imu_csv({"a": tmp_path / "log.csv"}, {})
    with pytest.raises(SensorError, match="There is no files"):
        read_imu_csv({}, {})
    with pytest.raises(SensorError, match="mounting for 'b', but no file: there are a"):
        read(tmp_path, f"{HEADER}\n0,0,0,0,1\n", mountings={"b": [0, 0, 0, 1]})


def test_gaps_are_not_bridged_when_clocks_differ(tmp_path):
    """Nothing is made up over a gap of half a second, and nothing is lost beside it."""
    data = pendulum(np.linspace(0.0, 3.0, 601), S)[0]
    slow = imu_signals(data, {"a": 0.5}, gravity=G, rate=50.0)
    fast = imu_signals(data, {"b": 1.0}, gravity=G, rate=130.0)
    for name in ("orientation", "angular_velocity", "specific_force"):
        fast[name].values[(fast.time.values > 1.0) & (fast.time.values < 1.5)] = np.nan
    files = {"a": export_imu_csv(slow, tmp_path)[0], "b": export_imu_csv(fast, tmp_path)[0]}
    with pytest.warns(SensorWarning, match="lacks"):
        both = read_imu_csv(files, {"a": 0.5, "b": 1.0})
    for name in ("orientation", "specific_force"):
        known = np.isfinite(both[name].sel(imu="b")).all(axis=-1).values
        np.testing.assert_array_equal(known, (both.time <= 1.0) | (both.time >= 1.5))
