"""What people do to the command and to case files by mistake: refused in words, or done right."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
import xarray as xr
from runs import result, short_case
from typer.testing import CliRunner

from cablesim import Case, load_case, simulate, write
from cablesim.build import build_scene
from cablesim.cli import app


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def sway():
    Path("sway.yaml").write_text(short_case("sway"))
    return "sway.yaml"


def call(*arguments, stdin=None):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], input=stdin)


def assert_refused(done, code, *words):
    """One exit code, words that help, and no word of a mistake in the program."""
    assert done.exit_code == code, done.output
    for word in (*words,):
        assert word in done.stderr
    assert "mistake in cablesim" not in done.stderr
    assert not list(Path.cwd().glob("*.nc"))


# Places -----------------------------------------------------------------------------------------


def test_a_case_without_end_is_refused():
    assert_refused(call("validate", "/dev/zero"), 2, "/dev/zero: is longer than 64 MiB. Name a case file.")


@pytest.mark.parametrize("command", ["run", "validate", "info"])
def test_a_case_that_links_to_itself_is_no_file(command):
    os.symlink("loop.yaml", "loop.yaml")
    assert_refused(call(command, "loop.yaml"), 3, "loop.yaml: Too many levels of symbolic links")


def test_a_result_that_links_to_itself_stays(sway):
    os.symlink("out.nc", "out.nc")
    done = call("run", sway, "--output", "out.nc")
    assert done.exit_code == 3
    assert "cannot write out.nc: Too many levels of symbolic links" in done.stderr
    assert os.readlink("out.nc") == "out.nc"


def test_a_name_with_a_long_ending_is_written():
    name = "x." + "y" * 240
    assert call("new", name).exit_code == 0
    assert Path(name).read_text().startswith("#")


def test_a_case_from_a_pipe_is_read_once(sway):
    """As ``cablesim run <(generate)`` gives it: what is planned and what runs are one reading."""
    command = f"{sys.executable} -m cablesim run <(cat {sway})"
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    with xr.open_dataset("sway.nc") as result:
        assert result.attrs["status"] == "completed"
    again = short_case("sway").replace("duration: 1 s", "duration: 0.5 s")
    Path(sway).write_text(again)
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 3  # another case of the same name: the earlier result stays
    assert "cannot write sway.nc" in done.stderr


@pytest.mark.parametrize("file", [".", "/dev/zero"])
def test_what_is_no_ordinary_file_is_not_called_missing(sway, file):
    start = f"initial={{shape: state, file: {file}}}"
    assert_refused(call("run", sway, "--set", start), 2, "is no ordinary file", "Name a file.")


# Text -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("length: 3 m", "length: " + "9" * 5000, "no int: 9999"),
        ("duration: 1 s", "duration: !!int five", "no int: five"),
        ("duration: 1 s", "duration: !!float five", "no float: five"),
        ("duration: 1 s", "duration: !!timestamp 2001-99-99", "no timestamp: 2001-99-99"),
        ("  length: 3 m", "  <<: 7\n  length: 3 m", "<< takes a group of keys"),
        ("  length: 3 m", "  <<: [1, {diameter: 1}]\n  length: 3 m", "<< takes a group of keys"),
        ("name: sway", "name: sway\n? [a, b]\n: 4", "a key is a list or a group of keys"),
        ("name: sway", 'name: "a\\0b"', "name: has letters that cannot be shown"),
        ("name: sway", 'name: "a\\nb"', "name: has letters that cannot be shown"),
        ("name: sway", 'name: "\\e[31mred"', "name: has letters that cannot be shown"),
        ("duration: 1 s", "duration: 1e-9", "counts as no time"),
        ("duration: 1 s", "duration: 1e-300", "counts as no time"),
    ],
)
def test_yaml_that_means_nothing_is_refused_with_its_line(old, new, words):
    text = short_case("sway").replace('"sway"', "sway")
    assert old in text
    Path("case.yaml").write_text(text.replace(old, new))
    assert_refused(call("run", "case.yaml"), 2, "case.yaml:", words)
    done = call("run", "-", stdin=text.replace(old, new))
    assert_refused(done, 2, "standard input:", words)


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("ends.b.waypoints.²=[0, 0, 0, 0]", "does not fit the case"),
        ("ends.b.waypoints.-1=[0, 0, 0, 0]", "does not fit the case"),
        ("ends.b.waypoints.99999999999999999999=1", "does not fit the case"),
        ("simulation.duration==2", "simulation.duration: is no time; received '=2'"),
        ("simulation.duration: 2", "is not of the form key=value"),
        ("simulation.duration=1\n---\n2", "expected a single document"),
        ("output.attributes={maker: me}", "is not an attribute that a case can give"),
    ],
)
def test_overrides_that_mean_nothing(sway, override, words):
    assert_refused(call("run", sway, "--set", override), 2, "--set", words)


def test_the_last_of_equal_overrides_counts(sway):
    sets = ["--set", "simulation.duration=2", "--set", "simulation.duration=0.5"]
    assert call("run", sway, *sets).exit_code == 0
    with xr.open_dataset("sway.nc") as result:
        assert float(result["time"][-1]) == 0.5


@pytest.mark.parametrize("text", ["\ufeff{}", "{}...\n", "%YAML 1.2\n---\n{}"])
def test_marks_around_the_text_change_nothing(sway, text):
    Path("case.yaml").write_bytes(text.replace("{}", short_case("sway")).encode())
    assert load_case("case.yaml").model_dump() == load_case(sway).model_dump()


@pytest.mark.parametrize("ending", [b"\r\n", b"\r"])
def test_line_endings_of_other_systems_change_nothing(sway, ending):
    Path("case.yaml").write_bytes(Path(sway).read_bytes().replace(b"\n", ending))
    assert load_case("case.yaml").model_dump() == load_case(sway).model_dump()


# Physics ----------------------------------------------------------------------------------------


THROUGH = ("  shape: equilibrium", "  through: [[0, 0, 0], [0, 0, -1.2], [1.5, 0, 0]]\n  shape: equilibrium")
NEUTRAL = ("mass_per_length: 55 g/m", "mass_per_length: 55 g/m\n  wet_weight: 0")


@pytest.mark.parametrize(
    ("edits", "warned"),
    [
        ([NEUTRAL], True),
        ([("name:", "gravity: 0\nname:")], True),
        ([NEUTRAL, ("axial_stiffness", "bending_stiffness: 1e-3\n  axial_stiffness")], False),
        ([NEUTRAL, THROUGH], False),
        ([], False),
    ],
)
def test_a_rest_shape_that_is_one_of_many_is_said(edits, warned):
    text = short_case("sway")
    for old, new in edits:
        assert old in text
        text = text.replace(old, new, 1)
    warnings = build_scene(Case.from_yaml(text)).warnings
    assert any("any shape is at rest" in warning for warning in warnings) is warned


def test_a_scene_far_from_the_origin_runs_as_near_it():
    """Coordinates of a map, 6800 km from their origin, leave 1.5 nm of a place."""
    text = short_case("sway").replace("relative_tolerance: 1e-4", "relative_tolerance: 1e-6")
    far = text.replace("[0, 0, 0]", "[500000, 6800000, 0]").replace("[1.5, 0, 0]", "[500001.5, 6800000, 0]")
    one, other = (simulate(Case.from_yaml(case))["tension"] for case in (text, far))
    assert float(abs(one - other).max()) < 1e-3 * float(one.max() - one.min())


@pytest.mark.parametrize(
    ("gravity", "warned"), [("981", True), ("9.81e-3", True), ("0", False), ("1.62", False)]
)
def test_gravity_in_another_unit_is_said(gravity, warned):
    warnings = build_scene(Case.from_yaml(f"gravity: {gravity}\n{short_case('sway')}")).warnings
    assert any(f"gravity is {float(gravity):g} m/s2" in warning for warning in warnings) is warned


# Terminals and results --------------------------------------------------------------------------


@pytest.mark.parametrize("command", [["info", "sway.yaml"], ["schema"]])
def test_terminals_without_some_letters_show_their_numbers(sway, command):
    Path(sway).write_text(re.sub("name: .*", "name: Trosse ü", short_case("sway"), count=1))
    done = subprocess.run(
        [sys.executable, "-c", "from cablesim.cli import main; main()", *command],
        env={**os.environ, "PYTHONIOENCODING": "ascii"},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert "\\x" in done.stdout


@pytest.mark.parametrize("name", ["-", "two\nlines.yaml"])
def test_new_cases_get_names_that_commands_can_read(name):
    done = call("new", "--", name)
    assert_refused(done, 3, "is no name for a case")
    assert not list(Path.cwd().iterdir())


@pytest.mark.parametrize("options", [["--fps", "1e9"], ["--speed", "1e-9"]])
@pytest.mark.parametrize("kind", ["gif", "mp4"])
def test_films_without_end_are_refused(options, kind):
    write(result("sway"), "result")
    done = call("animate", "result", "-o", f"film.{kind}", *options)
    assert_refused(done, 3, "pictures is too long", "Raise the speed, or lower the fps")


@pytest.mark.parametrize("command", [["plot"], ["report"], ["export", "-f", "vtk"], ["imu"]])
@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda run: run.drop_vars("s"), "holds no `s`"),
        (lambda run: run.drop_vars("s_segment"), "holds no `s_segment`"),
        (lambda run: run.assign_coords(time=run["time"].values.astype("timedelta64[s]")), "no plain numbers"),
    ],
)
def test_results_that_lost_their_places_or_seconds_are_refused(command, edit, said):
    write(edit(result("sway").isel(time=[0, 50])), "result")
    assert_refused(call(*command, "result"), 3, said)
