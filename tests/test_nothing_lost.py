"""No command replaces what it reads, nor anything but its own earlier result; and never by half a file."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from runs import result, short_case
from typer.testing import CliRunner

from cablesim import Case, read, write
from cablesim.batch import OutputError, run_many
from cablesim.batch.source import files_read
from cablesim.cli import app
from cablesim.files import Product, maker_and_case, replacing

MAP = "current: {kind: map, file: m.nc, u: east, v: north, z: height}"
LAW = "{kind: function, period: 0.1, function: 'laws.py:Law', options: {path: table.csv}}"


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


@pytest.fixture
def sway():
    Path("sway.yaml").write_text(short_case("sway"))
    return "sway.yaml"


@pytest.fixture
def sway_result(sway):
    """A result as the command leaves it."""
    assert call("run", sway).exit_code == 0
    return "sway.nc"


def call(*arguments, stdin=None):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], input=stdin)


def assert_refused(done, said, *kept):
    """The command ends with exit code 3, and all files are as they were."""
    assert done.exit_code == 3, done.output
    assert said in done.stderr
    for file, content in kept:
        assert Path(file).read_bytes() == content


def kept(*files):
    return [(file, Path(file).read_bytes()) for file in files]


def case_in_a_current(name):
    text = short_case("sway").replace("density: 1000 kg/m^3", f"{MAP}\n  density: 1000 kg/m^3")
    Path(name).write_text(text)
    heights = np.array([-20.0, 20.0])
    still = ("height", [0.1, 0.1], {"units": "m/s"})
    xr.Dataset({"east": still, "north": still}, {"height": heights}).to_netcdf("m.nc")


def result_with_an_imu():
    imu = "attachments: [{kind: imu, name: one, at: 1 m}]\nends:"
    case = Case.from_yaml(short_case("sway").replace("ends:", imu))
    return result("sway").assign_attrs(case=case.to_yaml())


# What a run reads -------------------------------------------------------------------------------


@pytest.mark.parametrize("force", [[], ["--force"]])
def test_a_run_does_not_replace_the_current_map_that_it_reads(force):
    case_in_a_current("m.yaml")
    before = kept("m.nc")
    assert_refused(call("run", "m.yaml", *force), "cannot write m.nc: m.yaml reads it", *before)


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_nor_through_a_link(link):
    case_in_a_current("case.yaml")
    link("m.nc", "other.nc")
    before = kept("m.nc")
    assert_refused(call("run", "case.yaml", "-o", "other.nc", "--force"), "case.yaml reads it", *before)
    done = call("run", "case.yaml")
    assert done.exit_code == 0, done.output


def test_nor_what_another_run_of_the_batch_reads(sway_result):
    text = Path("sway.yaml").read_text()
    saved = "shape: state\n  file: sway.nc\n  time: 0"
    Path("goes_on.yaml").write_text(text.replace("shape: equilibrium", saved))
    before = kept("sway.nc")
    done = call("run", "sway.yaml", "goes_on.yaml")
    assert_refused(done, "cannot write sway.nc: goes_on.yaml reads it", *before)
    assert call("run", "goes_on.yaml").exit_code == 0
    assert_refused(call("run", "goes_on.yaml", "-o", "sway.nc", "--force"), "reads it", *before)


def test_all_files_that_a_case_names_are_known(sway):
    text = Path(sway).read_text()
    for old, new in (
        ("A rope in water", "see a.csv, which is not in this folder"),
        ("density: 1000 kg/m^3", MAP),
        ("motion: fixed\n    position: [0, 0, 0]", "motion: recorded\n    file: records/a.csv"),
        ("shape: equilibrium", "shape: markers\n  file: markers.csv\n  arc_column: s"),
        ("simulation:", f"winch: {{deployed_length: 2 m, maximum_speed: 1, payout: {LAW}}}\nsimulation:"),
    ):
        text = text.replace(old, new)
    Path("records").mkdir()
    named = ["records/a.csv", "markers.csv", "laws.py", "table.csv", "m.nc"]
    for name in (*named, "other.csv"):
        Path(name).touch()
    found = files_read(Case.from_yaml(text))
    assert {path.relative_to(Path.cwd()).as_posix() for path in found} == set(named)


def test_no_command_replaces_the_result_that_it_reads(sway):
    write(result_with_an_imu(), "r.nc")
    before = kept("r.nc")
    os.symlink("r.nc", "link.nc")
    for output in ("r.nc", "link.nc"):
        for force in ([], ["--force"]):
            done = call("imu", "r.nc", "-o", output, *force)
            assert_refused(done, f"cannot write {output}: cablesim imu reads it", *before)


# What is not an earlier result of the same case -------------------------------------------------


def test_an_earlier_result_of_the_same_case_is_replaced(sway):
    for duration in ("1 s", "0.5 s"):
        Path(sway).write_text(short_case("sway").replace("duration: 1 s", f"duration: {duration}"))
        assert call("run", sway).exit_code == 0
        assert float(read("sway.nc")["time"][-1]) == float(duration[:-2])
    Path("sub").mkdir()
    os.chdir("sub")  # the same case and result, seen from elsewhere
    assert call("run", "../sway.yaml", "-o", "..").exit_code == 0


def test_a_result_from_python_is_replaced_by_that_of_its_case(sway):
    write(result("sway"), "sway.nc")
    assert call("run", sway).exit_code == 0
    write(result("tow"), "sway.nc")
    assert_refused(call("run", sway), "was not made by this command", *kept("sway.nc"))


def test_variants_do_not_share_a_result(sway_result):
    before = kept("sway.nc")
    variant = ["run", "sway.yaml", "--set", "simulation.duration=0.5"]
    said = "what is there was made by `cablesim run sway.yaml`. Give --output another name, or replace it"
    assert_refused(call(*variant), said, *before)
    assert call(*variant, "-o", "short.nc").exit_code == 0
    assert call(*variant, "-o", "short.nc").exit_code == 0
    said = "made by `cablesim run sway.yaml --set simulation.duration=0.5`"
    assert_refused(call("run", "sway.yaml", "-o", "short.nc"), said, *kept("short.nc"))
    assert call(*variant, "--force").exit_code == 0
    assert float(read("sway.nc")["time"][-1]) == 0.5


def test_cases_of_one_name_do_not_share_a_result(sway):
    Path("results").mkdir()
    Path("other").mkdir()
    shutil.copy(sway, "other/sway.yaml")
    Path("other/sway.yaml").write_text(short_case("sway").replace("length: 3 m", "length: 3.1 m"))
    assert call("run", sway, "-o", "results").exit_code == 0
    done = call("run", "other/sway.yaml", "-o", "results")
    assert_refused(done, "made by `cablesim run ../sway.yaml`", *kept("results/sway.nc"))
    with pytest.raises(OutputError, match="--force"):
        run_many(["other/sway.yaml"], "results")
    run_many(["other/sway.yaml"], "results", force=True)


def test_two_names_of_one_file_are_not_written_twice(sway):
    shutil.copy(sway, "other.yaml")
    os.symlink("sway.nc", "other.nc")
    done = call("run", sway, "other.yaml")
    assert_refused(done, "sway.yaml and other.yaml would both be written to other.nc")


def test_a_link_to_a_result_stays_a_link(sway):
    Path("store").mkdir()
    os.symlink("store/first.nc", "sway.nc")
    assert call("run", sway).exit_code == 0
    assert Path("sway.nc").is_symlink()
    assert read("store/first.nc").attrs["status"] == "completed"


def test_a_run_and_a_rest_shape_are_not_one_result(sway_result):
    before = kept("sway.nc")
    done = call("statics", "sway.yaml", "-o", "sway.nc")
    assert_refused(done, "made by `cablesim run sway.yaml`", *before)
    assert call("statics", "sway.yaml", "-o", "rest.nc").exit_code == 0
    assert call("statics", "sway.yaml", "-o", "rest.nc").exit_code == 0
    assert_refused(call("run", "sway.yaml", "-o", "rest.nc"), "made by `cablesim statics", *kept("rest.nc"))


def foreign(name):
    """A file of somebody else, of a kind that fits its name."""
    if name.endswith(".nc"):
        xr.Dataset({"temperature": ("month", [1.0])}).to_netcdf(name)
    else:
        Path(name).write_bytes(b"mine")


@pytest.mark.parametrize(
    ("command", "file"),
    [
        ("run sway.yaml", "sway.nc"),
        ("run sway.yaml -o x.nc", "x.nc"),
        ("statics sway.yaml -o x.nc", "x.nc"),
        ("schema -o sway.yaml", "sway.yaml"),
        ("schema -o case.json", "case.json"),
        ("imu r.nc", "r_imu.nc"),
        ("plot r.nc", "r.png"),
        ("plot r.nc -o x.svg", "x.svg"),
        ("plot r.nc -o x.pdf", "x.pdf"),
        ("report r.nc", "r.html"),
        ("animate r.nc -o x.gif", "x.gif"),
        ("export r.nc -f csv -o x", "x/nodes.csv"),
        ("export r.nc -f vtk -o x", "x/r_0000.vtp"),
        ("imu r.nc --csv x", "x/one.csv"),
        ("new", "sway.yaml"),
    ],
)
def test_what_is_no_result_is_replaced_when_forced_only(sway, command, file):
    write(result_with_an_imu(), "r.nc")
    Path("x").mkdir()
    if not Path(file).exists():
        foreign(file)
    assert_refused(call(*command.split()), f"{file}", *kept(file), *kept("r.nc"))
    before = Path(file).read_bytes()
    shutil.rmtree("x") if "/" not in file else None
    assert call(*command.split(), "--force").exit_code == 0
    assert Path(file).read_bytes() != before
    if command != "new":
        assert call(*command.split()).exit_code == 0, "it is its own earlier result now"


def test_statics_writes_results_only(sway):
    done = call("statics", sway, "-o", sway)
    assert_refused(done, "sway.yaml: its name must end in .nc", *kept(sway))


@pytest.mark.parametrize(
    "command", ["plot {} -o x.png", "report {} -o x.html", "animate {} -o x.gif", "export {} -f csv -o x"]
)
def test_pictures_of_different_results_do_not_replace_one_another(command):
    write(result("sway"), "one.nc")
    write(result("tow").isel(time=[0, 1]), "other.nc")
    Path("x").mkdir()
    assert call(*command.format("one.nc").split()).exit_code == 0
    done = call(*command.format("other.nc").split())
    assert done.exit_code == 3
    assert "cannot write x" in done.stderr


def test_an_export_replaces_the_earlier_one_as_a_whole():
    write(result("sway"), "r.nc")
    assert call("export", "r.nc", "-f", "vtk", "-o", "x").exit_code == 0
    Path("x/mine.txt").write_text("mine")
    write(result("sway").isel(time=slice(0, 3)), "r.nc")
    assert call("export", "r.nc", "-f", "vtk", "-o", "x").exit_code == 0
    frames = ["r_0000.vtp", "r_0001.vtp", "r_0002.vtp"]
    assert sorted(os.listdir("x")) == ["about.json", "mine.txt", "r.pvd", *frames]


def test_cases_from_standard_input_replace_only_themselves(sway):
    text = Path(sway).read_text()
    for _ in range(2):
        assert call("run", "-", stdin=text).exit_code == 0
    other = text.replace("length: 3 m", "length: 3.1 m")
    assert_refused(call("run", "-", stdin=other), "made by `cablesim run -`", *kept("sway.nc"))


def test_names_with_all_sorts_of_letters_are_kept_in_files(tmp_path):
    for maker in ("cablesim plot 'a [b] (c) <d> & \"e\".nc'", "cablesim plot ünïcode--naïve.nc"):
        product = Product(Path("x.svg"), maker)
        Path("x.svg").write_text(f"<svg><!-- {product.mark} --></svg>")
        assert maker_and_case(Path("x.svg")) == (maker, "")
        product.check()


# Halves -----------------------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
def test_a_kill_in_the_middle_of_writing_leaves_the_earlier_file():
    Path("x.txt").write_text("earlier")
    script = (
        "import os, signal; from pathlib import Path; from cablesim.files import replacing\n"
        "with replacing(Path('x.txt')) as part:\n"
        "    part.write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = subprocess.run([sys.executable, "-c", script], check=False)
    assert done.returncode == -9
    assert Path("x.txt").read_text() == "earlier"


def test_a_failure_in_the_middle_of_writing_leaves_nothing_else():
    Path("x.txt").write_text("earlier")
    os.chmod("x.txt", 0o640)

    def fail_half_way():
        with replacing(Path("x.txt")) as part:
            part.write_text("half")
            raise OSError(28, "No space left on device")

    with pytest.raises(OutputError, match=r"cannot write x\.txt: No space left on device"):
        fail_half_way()
    assert Path("x.txt").read_text() == "earlier"
    with replacing(Path("x.txt")) as part:
        part.write_text("later")
    assert os.listdir() == ["x.txt"]
    assert (Path("x.txt").read_text(), Path("x.txt").stat().st_mode & 0o777) == ("later", 0o640)


# Before the run ---------------------------------------------------------------------------------


def test_places_where_nothing_can_be_written_are_told_before_the_run(sway, monkeypatch):
    from cablesim import simulation

    monkeypatch.setattr(simulation, "Simulation", None)  # would fail if it came to that
    os.mkfifo("pipe.nc")
    for output, said in (
        ("pipe.nc", "it is no ordinary file"),
        (f"{'x' * 300}.nc", "File name too long"),
        ("missing/x.nc", "missing does not exist"),
    ):
        for command in ("run", "statics"):
            assert_refused(call(command, sway, "-o", output), said)


def test_the_case_of_a_result_says_what_was_set(sway):
    assert call("run", sway, "--set", "simulation.duration=0.5", "-o", "x.nc").exit_code == 0
    attributes = read("x.nc").attrs
    assert attributes["maker"] == "cablesim run sway.yaml --set simulation.duration=0.5"
    assert Case.from_yaml(attributes["case"]).simulation.duration == 0.5
