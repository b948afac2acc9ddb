"""Films show the states of the result."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from runs import only, result, with_imus, with_winch
from typer.testing import CliRunner

from cablesim import write
from cablesim.animation import MOST_GIF_FRAMES, animate, frame_states
from cablesim.cli import app
from cablesim.plot import PlotError


@pytest.fixture
def buoys():
    return with_imus(result("buoys"), imu_1=4.0, imu_2=6.0)


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def call(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def pictures(path):
    with Image.open(path) as film:
        frames = []
        for index in range(film.n_frames):
            film.seek(index)
            frames.append(np.asarray(film.convert("RGB"), dtype=float))
        return frames


def test_a_gif_has_a_picture_for_each_time_and_moves(buoys):
    assert animate(buoys, "run.gif", fps=2, speed=2.0) == 5  # 4 s
    frames = pictures("run.gif")
    assert len(frames) == 5
    scene = [frame[40:, :560] for frame in frames]
    assert np.abs(scene[0] - scene[-1]).max() > 50
    with Image.open("run.gif") as film:
        assert film.info["duration"] == 500


def test_pictures_show_the_last_state_before_their_time():
    times = np.array([0.0, 0.1, 0.2, 0.5, 1.0])
    assert frame_states(times, 10.0, 1.0).tolist() == [0, 1, 2, 2, 2, 3, 3, 3, 3, 3, 4]
    assert frame_states(times, 10.0, 3.0).tolist() == [0, 2, 3, 3, 4]
    assert frame_states(times, 1.0, 0.7).tolist() == [0, 3, 4]
    assert frame_states(times[:1], 25.0, 1.0).tolist() == [0]


def test_each_stored_state_is_met_in_spite_of_rounding():
    times = np.linspace(0.0, 60.0, 601)
    assert frame_states(times, 10.0, 1.0).tolist() == list(range(601))


@pytest.mark.parametrize("change", ["winch", "bare", "planar", "no attachments", "single"])
def test_whatever_a_result_holds_is_filmed(buoys, change):
    dataset = {
        "winch": lambda: with_winch(buoys),
        "bare": lambda: only(buoys, "position"),
        "planar": lambda: result("tow"),
        "no attachments": lambda: result("sway"),
        "single": lambda: buoys.isel(time=[0]),
    }[change]()
    last = float(dataset["time"][-1])
    assert animate(dataset, "run.gif", fps=1, speed=max(last, 1.0)) == (1 if change == "single" else 2)
    assert len(pictures("run.gif")) == (1 if change == "single" else 2)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="ffmpeg is not installed")
def test_an_mp4(buoys):
    assert animate(buoys, "run.mp4", fps=5, speed=2.0) == 11
    assert Path("run.mp4").read_bytes()[4:8] == b"ftyp"
    counted = subprocess.run(
        ["ffmpeg", "-i", "run.mp4", "-f", "null", "-"], capture_output=True, text=True, check=True
    )
    assert "frame=   11" in counted.stderr


def test_missing_ffmpeg_is_explained(buoys, monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(PlotError, match=r"needs the program ffmpeg.*Install it.*or write a \.gif"):
        animate(buoys, "run.mp4")


def test_missing_matplotlib_is_explained(buoys, monkeypatch):
    for name in [name for name in sys.modules if name.partition(".")[0] == "matplotlib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(PlotError, match=r"pip install 'cablesim\[plot\]'"):
        animate(buoys, "run.gif")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"fps": 0.0}, "fps must be a number above 0; received 0"),
        ({"speed": -2.0}, "speed must be a number above 0; received -2"),
        ({"speed": float("nan")}, "received nan"),
        ({"speed": 4.0 / MOST_GIF_FRAMES / 10}, "pictures is too large"),
    ],
)
def test_numbers_without_sense_are_refused(buoys, options, said):
    with pytest.raises(PlotError, match=said):
        animate(buoys, "run.gif", **options)
    assert not Path("run.gif").exists()


def test_without_positions_there_is_no_film(buoys):
    with pytest.raises(PlotError, match="no `position`: add it to output"):
        animate(buoys.drop_vars("position"), "run.gif")


def test_command(buoys):
    write(buoys, "run.nc")
    done = call("animate", "run.nc", "-o", "run.gif", "--fps", "2", "--speed", "4")
    assert done.exit_code == 0, done.output
    assert done.stdout == "run.gif written, 3 pictures\n"
    assert len(pictures("run.gif")) == 3


def test_command_says_what_is_wrong(buoys):
    write(buoys, "run.nc")
    for arguments, said in (
        (["run.nc", "-o", "missing/a.gif"], "missing does not exist"),
        (["run.nc", "-o", "/proc/a.gif"], "cannot write /proc/a.gif"),
        (["run.nc", "-o", "a.avi"], "its name must end in .mp4 or .gif"),
        (["run.nc", "-o", "a.gif", "--fps", "-1"], "fps must be a number above 0; received -1"),
        (["missing.nc"], "missing.nc does not exist"),
    ):
        done = call("animate", *arguments)
        assert done.exit_code == 3, arguments
        assert said in done.stderr
        assert "Traceback" not in done.output
