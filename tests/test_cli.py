"""The command line: what it writes, what it says, how it ends; and the runs side by side behind it."""

import contextlib
import json
import logging
import os
import re
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import pytest
import xarray as xr
from runs import result, short_case
from typer.testing import CliRunner

from cablesim import Case, load_case, read, write
from cablesim.batch import Outcome, OutputError, Watcher, plan_runs, run_many, source
from cablesim.build import build_scene
from cablesim.cli import app
from cablesim.cli.on_cases import Starter
from cablesim.starters import STARTERS

COMMAND = [sys.executable, "-c", "from cablesim.cli import main; main()"]
LONG = ["--set", "simulation.duration=8000", "--set", "output.interval=0.2"]
"""Makes a case whose ends keep moving run for minutes."""

IMUS = """attachments:
  - {kind: imu, name: one, at: 1 m}
  - {kind: imu, name: two, at: 2 m, mounting: {rotation_vector: [0, 0, 90 deg]}}
"""


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    yield
    log = logging.getLogger("cablesim")  # as the commands found it
    log.handlers.clear()
    log.setLevel(logging.NOTSET)


@pytest.fixture
def sway():
    Path("sway.yaml").write_text(short_case("sway"))
    return "sway.yaml"


@pytest.fixture
def moving():
    """A case that keeps the integrator busy as long as it is told to run."""
    text = STARTERS["sway"].format(file="moving.yaml", name="moving")
    motion = "motion: harmonic\n    position: [1.5, 0, 0]\n    amplitude: [0, 0.3, 0.2]\n    period: 4 s"
    text = re.sub(r"motion: velocity_waypoints.*?(?=\n\ninitial)", motion, text, flags=re.DOTALL)
    Path("moving.yaml").write_text(text)
    return "moving.yaml"


def call(*arguments):
    """Run a command in this process."""
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def spawn(*arguments, **options):
    """Run a command as a user does."""
    return subprocess.run(
        [*COMMAND, *map(str, arguments)], capture_output=True, text=True, timeout=120, check=False, **options
    )


def assert_readable_to_people(*texts):
    for text in texts:
        assert "Traceback" not in text
        assert "Error:" not in text.replace("HDF error", "")


# run --------------------------------------------------------------------------------------------


def test_run_writes_a_result_and_one_line(sway):
    outcome = call("run", sway)
    assert outcome.exit_code == 0, outcome.output
    (line,) = outcome.stdout.splitlines()
    assert re.fullmatch(
        r"sway\.yaml: completed, 1 s in [\d.e-]+ s, [\d.e+]+ x real time, \d+ residual calls, sway\.nc", line
    )
    assert not [text for text in outcome.stderr.splitlines() if not text.startswith("Compiling")]
    dataset = read("sway.nc")
    xr.testing.assert_allclose(dataset["position"], result("sway")["position"])
    assert dataset.attrs["status"] == "completed"


def test_run_as_a_process_is_silent_in_pipes(sway):
    done = spawn("run", sway, "--quiet")
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert read("sway.nc").sizes["time"] == 51


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo terminal")
def test_a_terminal_shows_how_far_the_run_is(sway):
    import pty

    terminal, screen = pty.openpty()
    done = subprocess.Popen([*COMMAND, "run", sway], stdout=subprocess.PIPE, stderr=screen, text=True)
    out, _ = done.communicate(timeout=60)
    os.close(screen)
    shown = os.read(terminal, 100_000).decode()
    os.close(terminal)
    assert done.returncode == 0
    assert re.search(r"sway.* of 1 s .* x real time", shown)
    assert out.startswith("sway.yaml: completed, 1 s in ")


def test_output_is_a_folder_or_a_file(sway):
    Path("results").mkdir()
    assert call("run", sway, "-o", "results").exit_code == 0
    assert call("run", sway, "-o", "results/other.nc").exit_code == 0
    assert sorted(os.listdir("results")) == ["other.nc", "sway.nc"]


def test_set_changes_the_case(sway):
    done = call("run", sway, "--set", "simulation.duration=0.5 s", "--set", "output.variables=[tension]")
    assert done.exit_code == 0, done.output
    dataset = read("sway.nc")
    assert float(dataset["time"][-1]) == 0.5
    assert list(dataset.data_vars) == ["tension"]
    kept = Case.from_yaml(dataset.attrs["case"])
    assert kept.simulation.duration == 0.5
    assert load_case(sway).simulation.duration == 1.0


@pytest.mark.parametrize(
    ("override", "said"),
    [
        (
            "simulation.duratio=3",
            "--set: simulation.duratio: is not known here; received 3. Did you mean 'duration'?",
        ),
        ("simulation.duration=-3", "--set: simulation.duration: must be greater than 0; received -3"),
        ("simulation.duration", "is not of the form key=value"),
        ("=3", "is not of the form key=value"),
        ("ends.a.position.7=3", "--set: ends.a.position.7=3: does not fit the case"),
        ("cable.length.x=3", "does not fit the case"),
        ("cable.length=[", "is not valid YAML"),
    ],
)
def test_a_wrong_override_is_refused(sway, override, said):
    done = call("run", sway, "--set", override)
    assert done.exit_code == 2
    assert said in done.stderr
    assert not Path("sway.nc").exists()


def test_overrides_reach_into_lists_and_new_groups():
    data = {"a": [{"b": 1}], "c": {}}
    for override in ("a.0.b=2 m", "a[0].d=[1, 2]", "c.e.f=true"):
        source.set_value(data, override)
    assert data == {"a": [{"b": "2 m", "d": [1, 2]}], "c": {"e": {"f": True}}}


def test_errors_elsewhere_keep_their_line_with_an_override(sway):
    Path(sway).write_text(Path(sway).read_text().replace("length: 3 m", "length: -3 m"))
    line = 1 + [text.strip()[:7] for text in Path(sway).read_text().splitlines()].index("length:")
    done = call("run", sway, "--set", "simulation.duration=2")
    assert f"sway.yaml:{line}: cable.length: " in done.stderr


def test_a_wrong_case_lists_all_its_errors():
    Path("bad.yaml").write_text("name: bad\ncable: {length: -1, diametre: 3}\n")
    done = spawn("run", "bad.yaml")
    assert done.returncode == 2
    assert done.stdout == "bad.yaml: refused\n"
    for text in ("bad.yaml:2: cable.length", "Did you mean 'diameter'?", "ends: is missing"):
        assert text in done.stderr
    assert_readable_to_people(done.stderr)
    assert not Path("bad.nc").exists()


def test_what_is_no_case(tmp_path):
    Path("bytes.yaml").write_bytes(bytes(range(256)))
    Path("folder.yaml").mkdir()
    Path("empty.yaml").touch()
    for name, code, said in (
        ("bytes.yaml", 2, "bytes.yaml: is not text in UTF-8"),
        ("empty.yaml", 2, "empty.yaml: the case is empty"),
        ("folder.yaml", 3, "folder.yaml: Is a directory"),
        ("nothing.yaml", 3, "nothing.yaml: No such file"),
    ):
        for extra in ([], ["--set", "simulation.duration=1"]):
            done = call("run", name, *extra)
            assert done.exit_code == code, name
            assert said in done.stderr.replace(":1: ", ": ")
            assert_readable_to_people(done.output)


def test_a_case_without_a_rest_shape_is_refused(sway, monkeypatch):
    from cablesim import simulation, statics

    def fail(*_, **__):
        raise statics.StaticsError("No rest shape was found.")

    monkeypatch.setattr(simulation, "simulate", fail)
    done = call("run", sway)
    assert done.exit_code == 2
    assert "No rest shape" in done.stderr


def test_a_run_that_stops_early_leaves_its_file(sway, monkeypatch):
    from cablesim import simulation

    stopped = result("sway").isel(time=slice(0, 10)).assign_attrs(status="not finite", message="It blew up.")
    monkeypatch.setattr(simulation, "simulate", lambda *_, **__: stopped)
    done = call("run", sway)
    assert done.exit_code == 1
    assert "sway.yaml: not finite, 0.18 s in" in done.stdout
    assert "It blew up." in done.stderr
    assert read("sway.nc").sizes["time"] == 10


def test_an_unexpected_error_is_a_sentence(sway, monkeypatch):
    from cablesim import simulation

    monkeypatch.setattr(simulation, "simulate", lambda *_, **__: 1 / 0)
    done = call("run", sway)
    assert done.exit_code == 1
    assert "ZeroDivisionError: division by zero. This is a mistake in cablesim" in done.stderr
    assert_readable_to_people(done.output.replace("ZeroDivisionError:", ""))


def test_warnings_about_a_case_are_shown(sway, monkeypatch):
    from cablesim import simulation

    def simulate(*_, **__):
        warnings.warn("the cable is very thick", stacklevel=1)
        warnings.warn("for programmers", DeprecationWarning, stacklevel=1)
        return result("sway")

    monkeypatch.setattr(simulation, "simulate", simulate)
    warnings.simplefilter("ignore", DeprecationWarning)
    done = call("run", sway)
    assert done.stderr == "warning: sway.yaml: the cable is very thick\n"


# Where results go -------------------------------------------------------------------------------


@pytest.fixture
def forbidden(tmp_path):
    """A folder in which nothing can be made, also by root."""
    if os.geteuid() == 0:
        return Path("/proc")
    folder = tmp_path / "forbidden"
    folder.mkdir(mode=0o500)
    return folder


def test_output_is_checked_before_the_run(sway, forbidden):
    Path("file").touch()
    Path("folder.nc").mkdir()
    Path("results.nc").mkdir()
    (Path("results.nc") / "sway.nc").mkdir()
    for output, said in (
        ("missing", "missing does not exist. Create it"),
        ("missing/a.nc", "missing does not exist. Create it"),
        ("file", "file is not a folder"),
        (forbidden, f"cannot write {forbidden}/sway.nc"),
        ("results.nc", "results.nc/sway.nc: it is a folder"),
    ):
        started = time.perf_counter()
        done = call("run", sway, "-o", output)
        assert time.perf_counter() - started < 0.5
        assert done.exit_code == 3
        assert said in done.stderr
        assert_readable_to_people(done.output)


def test_a_folder_that_cannot_be_written_as_a_user_sees_it(sway, forbidden):
    done = spawn("run", sway, "-o", forbidden)
    assert done.returncode == 3
    assert done.stdout == ""
    assert re.fullmatch(r"cannot write \S+: [\w ]+\.\n", done.stderr)


def test_two_results_of_one_name_are_refused(sway):
    Path("other").mkdir()
    other = Path("other/sway.yaml")
    other.write_text(short_case("sway"))
    with pytest.raises(OutputError, match=r"sway.yaml and other/sway.yaml would both be written to sway.nc"):
        plan_runs([sway, other])
    with pytest.raises(OutputError, match=r"a\.nc is one file for 2 cases"):
        plan_runs([sway, "tow.yaml"], "a.nc")


@pytest.mark.skipif(sys.platform == "win32", reason="needs limits of processes")
def test_a_full_disk_is_explained_and_the_old_result_kept(sway):
    import resource

    write(result("sway"), "sway.nc")
    before = Path("sway.nc").read_bytes()
    done = spawn(
        "run", sway, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
    )
    assert done.returncode == 3
    assert "cannot write sway.nc: " in done.stderr
    assert "Is the disk full?" in done.stderr
    assert_readable_to_people(done.stderr)
    assert Path("sway.nc").read_bytes() == before
    assert sorted(os.listdir()) == ["sway.nc", "sway.yaml"]


# Interruptions ----------------------------------------------------------------------------------


def wait_for_work(pid, seconds):
    """Wait until a process has worked for so long, however busy the machine is; where none tells, as long."""
    stat = Path(f"/proc/{pid}/stat")
    worked, ends = 0.0, time.monotonic() + (60.0 if stat.exists() else seconds)
    while worked < seconds and time.monotonic() < ends:
        time.sleep(0.02)
        if stat.exists():
            user, system = stat.read_text().rpartition(")")[2].split()[11:13]
            worked = (int(user) + int(system)) / os.sysconf("SC_CLK_TCK")


def interrupted(arguments, *, whole_group, after, wait=lambda _, seconds: time.sleep(seconds)):
    """Start a command, press Ctrl-C after so many seconds and wait for its end."""
    process = subprocess.Popen(
        [*COMMAND, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    wait(process.pid, after)
    if whole_group:
        os.killpg(process.pid, signal.SIGINT)
    else:
        process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    return process.returncode, out, err


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
def test_ctrl_c_leaves_a_readable_result(moving):
    assert call("run", moving, "-o", "warm_up.nc").exit_code == 0  # compiled now
    code, out, err = interrupted(["run", moving, *LONG], whole_group=False, after=9)
    assert code == 130
    assert "moving.yaml: interrupted, " in out
    assert "what was computed is kept" in err
    assert_readable_to_people(out, err)
    dataset = read("moving.nc")
    assert dataset.attrs["status"] == "interrupted"
    assert 2 < dataset.sizes["time"] < 1e6
    assert bool(dataset["position"].notnull().all())


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
@pytest.mark.parametrize("whole_group", [True, False])
def test_ctrl_c_leaves_readable_results_of_runs_side_by_side(moving, sway, whole_group):
    assert call("run", moving, "-o", "warm_up.nc").exit_code == 0
    Path("second.yaml").write_text(Path(moving).read_text())
    arguments = ["run", moving, "second.yaml", sway, "--jobs", "2", *LONG]
    code, out, err = interrupted(arguments, whole_group=whole_group, after=12)
    assert code == 130
    assert_readable_to_people(out, err)
    for name in ("moving", "second"):
        assert read(f"{name}.nc").attrs["status"] == "interrupted"
    assert "sway.yaml: interrupted" in out
    assert "The run was not started." in err
    assert not Path("sway.nc").exists()


@pytest.mark.skipif(sys.platform == "win32", reason="needs POSIX signals")
@pytest.mark.parametrize("after", [0.3, 0.8])
def test_ctrl_c_before_the_run_begins(moving, after):
    code, out, err = interrupted(["run", moving, *LONG], whole_group=True, after=after, wait=wait_for_work)
    assert code == 130
    assert_readable_to_people(out, err)


def test_an_interrupt_that_a_library_swallows_is_not_lost(sway, monkeypatch):
    from cablesim import simulation

    calls = []

    def simulate(scene, progress):
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        try:
            progress(simulation.Progress(0.5, 1.0, 10, 0.1))
        except KeyboardInterrupt:
            calls.append("seen")
            return result("sway").assign_attrs(status="interrupted", message="Kept.")

    monkeypatch.setattr(simulation, "simulate", simulate)
    assert [summary.outcome for summary in run_many([sway])] == [Outcome.INTERRUPTED]
    assert calls == ["seen"]


# Many cases -------------------------------------------------------------------------------------


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_failing_case_does_not_stop_the_others(sway, jobs):
    Path("bad.yaml").write_text("name: bad\n")
    Path("tow.yaml").write_text(short_case("tow"))
    done = call("run", "bad.yaml", sway, "missing.yaml", "tow.yaml", "--jobs", jobs)
    assert done.exit_code == 3
    assert read("sway.nc").attrs["status"] == read("tow.nc").attrs["status"] == "completed"
    table = done.stdout[done.stdout.index("x real time", done.stdout.index("simulated ")) :]
    for name, status in (
        ("bad", "refused"),
        ("sway", "completed"),
        ("missing", "file problem"),
        ("tow", "completed"),
    ):
        assert re.search(rf"{name} +{status}", table)
    assert_readable_to_people(done.output)


def test_side_by_side_gives_the_same_numbers(sway):
    Path("tow.yaml").write_text(short_case("tow"))
    seen = {}

    class Recorder(Watcher):
        def finished(self, index, summary):
            seen[index] = summary

    summaries = run_many([sway, "tow.yaml"], jobs=2, watcher=Recorder())
    assert [summary.case.name for summary in summaries] == ["sway.yaml", "tow.yaml"]
    assert seen == dict(enumerate(summaries))
    for summary, kind in zip(summaries, ("sway", "tow"), strict=True):
        assert summary.outcome is Outcome.COMPLETED
        assert summary.file == Path(f"{kind}.nc")
        assert summary.simulated_seconds == result(kind)["time"].values[-1]
        xr.testing.assert_allclose(read(summary.file)["position"], result(kind)["position"])


def test_progress_reaches_the_watcher(sway):
    times = []

    class Recorder(Watcher):
        def progressed(self, index, time, duration):
            times.append((index, time, duration))

    run_many([sway], watcher=Recorder())
    assert times[0][0] == 0
    assert [time for _, time, _ in times] == result("sway")["time"].values[1:].tolist()
    assert {duration for *_, duration in times} == {1.0}


# The other commands -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", list(Starter))
def test_starters_are_right(kind):
    done = call("new", "a b.yaml", "--from", kind)
    assert done.exit_code == 0
    case = load_case("a b.yaml")
    assert case.name == "a b"
    assert build_scene(case).duration > 0
    assert call("validate", "a b.yaml").stdout == "a b.yaml: ok\n"


def test_starter_names_agree():
    assert {kind.value for kind in Starter} == set(STARTERS)


@pytest.mark.parametrize("kind", list(Starter))
def test_what_a_starter_offers_in_comments_is_right(kind):
    """Every key that is commented out can be used."""
    text = STARTERS[kind].format(file="x.yaml", name="x")
    text = re.sub(r"^( *)# (?=\w+:( |$)|  - )", r"\1", text, flags=re.MULTILINE)
    assert Case.from_yaml(text)


def test_new_does_not_overwrite():
    assert call("new").exit_code == 0
    Path("sway.yaml").write_text("mine")
    done = call("new")
    assert done.exit_code == 3
    assert "sway.yaml is already there" in done.stderr
    assert Path("sway.yaml").read_text() == "mine"
    assert call("new", "--force").exit_code == 0
    assert load_case("sway.yaml")
    assert call("new", "missing/a.yaml").exit_code == 3


def test_validate_lists_the_errors_of_every_file(sway):
    Path("bad.yaml").write_text("name: bad\n")
    Path("worse.yaml").write_text("name: [\n")
    done = call("validate", sway, "bad.yaml", "worse.yaml")
    assert done.exit_code == 2
    assert done.stdout == "sway.yaml: ok\n"
    assert "bad.yaml:1: simulation: is missing" in done.stderr
    assert "worse.yaml:2: is not valid YAML" in done.stderr
    assert call("validate", sway, "missing.yaml", "bad.yaml").exit_code == 3


def rows(text):
    """Name -> value of the tables."""
    pairs = [re.split(r" {2,}", line.strip(), maxsplit=1) for line in text.splitlines()]
    return {pair[0]: pair[1] for pair in pairs if len(pair) == 2}


def test_info_says_what_a_case_amounts_to():
    Path("buoys.yaml").write_text(short_case("buoys"))
    done = call("info", "buoys.yaml")
    assert done.exit_code == 0, done.output
    shown = rows(done.stdout)
    dataset = result("buoys")
    assert f"{dataset.sizes['segment']} segments of " in shown["cable"]
    assert shown["attachments"] == "float at 4 m, weight at 8 m"
    assert shown["bending"] == "computed"
    assert shown["current"].startswith("computed: profile")
    assert shown["cable, dry"] == "0.78 kg"
    assert shown["float, in water"] == f"{(0.05 - 1025 * 250e-6) * 9.81:.4g} N"
    assert shown["section of added mass"].endswith("mm^2 (the outer section)")
    speed = (20e3 / 52e-3) ** 0.5
    assert shown["axial wave speed"].startswith(f"{speed:.4g} m/s")
    assert shown["highest mesh frequency"] == f"{speed / (3.141592653589793 * 0.05):.4g} Hz (axial)"
    assert {"tension", "velocity", "unknowns", "highest bending frequency"} <= set(shown)


def test_info_says_which_section_carries_the_added_mass(sway):
    text = Path(sway).read_text().replace("  diameter: 5 mm", "  diameter: 5 mm\n  wet_weight: 0.4418 N/m")
    Path(sway).write_text(text)
    shown = rows(call("info", sway).stdout)
    assert shown["displaced section"] == "9.964 mm^2 (50.7 % of the outer section)"
    assert shown["section of added mass"] == "19.63 mm^2 (the outer section)"
    Path(sway).write_text(text.replace("  diameter:", "  added_mass_section: 9.964 mm^2\n  diameter:"))
    assert rows(call("info", sway).stdout)["section of added mass"] == shown["displaced section"]


def test_highest_mesh_frequency_is_that_of_a_chain(sway):
    """Largest eigenvalue of a chain of springs and masses."""
    import numpy as np

    shown = rows(call("info", sway).stdout)
    n, length, stiffness, mass = 60, 0.05, 10e3, 55e-3
    chain = 2 * np.eye(n - 1) - np.eye(n - 1, k=1) - np.eye(n - 1, k=-1)
    largest = np.linalg.eigvalsh(chain * stiffness / length / (mass * length)).max() ** 0.5 / (2 * np.pi)
    assert float(shown["highest mesh frequency"].split()[0]) == pytest.approx(largest, rel=2e-3)


def test_statics_finds_the_rest_shape(sway):
    done = call("statics", sway, "-o", "rest.nc")
    assert done.exit_code == 0, done.output
    shown = rows(done.stdout)
    rest = read("rest.nc")
    assert rest.sizes["time"] == 1
    assert shown["tension at end A"] == shown["tension at end B"] == f"{float(rest['tension'][0, 0]):.4g} N"
    assert float(shown["force left on a node"].split()[0]) < 1e-9
    assert shown["lowest point"].endswith("s = 1.5 m")
    weight = (0.055 - 1000 * 3.141592653589793 * 0.005**2 / 4) * 9.81 * 3
    up = rest["end_force"].sel(axis="z").values[0]
    assert abs(up).sum() == pytest.approx(weight, rel=1e-6)


def test_statics_of_a_case_that_starts_elsewhere():
    Path("tow.yaml").write_text(short_case("tow").replace("direction: [0, 0, -1]", "direction: [1, 0, 0]"))
    shown = rows(call("statics", "tow.yaml").stdout)
    assert shown["lowest point"].endswith("s = 100 m")
    assert float(re.findall(r"-?[\d.]+", shown["lowest point"])[2]) == pytest.approx(-100, abs=0.1)


def test_plot_and_export(tmp_path):
    write(result("tow"), "tow.nc")
    assert call("plot", "tow.nc").exit_code == 0
    assert Path("tow.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    assert call("plot", "tow.nc", "-o", "picture.svg").exit_code == 0
    assert Path("picture.svg").read_text().startswith("<?xml")
    assert call("export", "tow.nc", "--format", "csv").exit_code == 0
    assert "nodes.csv" in os.listdir("tow_csv")
    assert call("export", "tow.nc", "--format", "vtk", "-o", "vtk").exit_code == 0
    assert len(os.listdir("vtk")) == 2 + result("tow").sizes["time"]


def test_what_is_no_result(tmp_path):
    Path("text.nc").write_text("hello")
    Path("folder.nc").mkdir()
    write(result("sway"), "whole.nc")
    Path("cut.nc").write_bytes(Path("whole.nc").read_bytes()[:20_000])
    xr.Dataset({"temperature": ("month", [1.0])}).to_netcdf("foreign.nc")
    for name, said in (
        ("text.nc", "text.nc cannot be read as a result"),
        ("folder.nc", "folder.nc is a folder"),
        ("cut.nc", "cut.nc cannot be read as a result"),
        ("missing.nc", "missing.nc does not exist"),
        ("foreign.nc", "is it a result of cablesim?"),
    ):
        for command in (["plot"], ["export", "-f", "csv"], ["export", "-f", "vtk"]):
            done = call(command[0], name, *command[1:])
            assert done.exit_code == 3, (name, command)
            assert said in done.stderr
            assert_readable_to_people(done.output)


def test_imu(tmp_path):
    text = short_case("sway").replace("ends:", IMUS + "ends:")
    data = result("sway").assign_attrs(case=Case.from_yaml(text).to_yaml())
    write(data, "sway.nc")
    done = call("imu", "sway.nc", "--rate", 50, "--errors", "bmx160", "--seed", 1, "--csv", "logs")
    assert done.exit_code == 0, done.output
    assert "sway_imu.nc: 2 sensors, 51 samples written" in done.stdout
    assert "logs: one.csv, two.csv written" in done.stdout
    read_back = read("sway_imu.nc")
    assert (read_back.attrs["errors"], read_back.attrs["seed"]) == ("bmx160", 1)
    assert call("imu", "sway.nc", "--rate", 50, "--frame", "paper", "-o", "exact.nc").exit_code == 0
    assert read("exact.nc").attrs["frame"] == "paper"
    assert len(Path("logs/one.csv").read_text().splitlines()) == 52


def test_imu_of_a_case_without_sensors():
    write(result("sway"), "sway.nc")
    done = call("imu", "sway.nc")
    assert (done.exit_code, done.stdout) == (3, "")
    assert "add attachments of kind imu" in done.stderr
    done = call("imu", "sway.nc", "-o", "missing/a.nc")
    assert done.exit_code == 3
    assert "missing does not exist" in done.stderr


def test_plot_and_export_check_where_they_write(forbidden):
    write(result("sway"), "sway.nc")
    for arguments, said in (
        (["plot", "sway.nc", "-o", "missing/a.png"], "missing does not exist"),
        (["plot", "sway.nc", "-o", "a.xyz"], "its name must end in .png, .pdf or .svg"),
        (["plot", "sway.nc", "-o", "noending"], "its name must end in .png"),
        (["export", "sway.nc", "-f", "csv", "-o", "missing/a"], "missing does not exist"),
        (["export", "sway.nc", "-f", "vtk", "-o", "sway.nc"], "is not a folder"),
        (["export", "sway.nc", "-f", "csv", "-o", str(forbidden)], f"cannot write {forbidden}"),
        (["statics", "sway.yaml", "-o", "missing/a.nc"], "missing does not exist"),
        (["schema", "-o", "missing/a.json"], "missing does not exist"),
    ):
        done = call(*arguments)
        assert done.exit_code == 3, arguments
        assert said in done.stderr
        assert_readable_to_people(done.output)


def test_missing_variables_are_explained():
    write(result("sway")[["tension"]], "sway.nc")
    done = call("export", "sway.nc", "-f", "vtk")
    assert done.exit_code == 3
    assert "The result holds no `position`: add it to output.variables" in done.stderr


def test_schema_is_json():
    assert json.loads(call("schema").stdout)["title"] == "cablesim case"
    assert call("schema", "-o", "case.json").exit_code == 0
    assert json.loads(Path("case.json").read_text())["$schema"]


def test_exit_codes_are_in_every_help():
    for command in ([], ["run"], ["validate"], ["statics"], ["plot"], ["export"]):
        text = " ".join(call(*command, "--help").stdout.split())
        assert "Exit codes: 0 all completed; 1 a run stopped before its end" in text
        assert "130 interrupted by Ctrl-C" in text


# Start-up ---------------------------------------------------------------------------------------


def imported_by(code):
    script = f"{code}\nimport sys; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    return {name.partition(".")[0] for name in done.stdout.splitlines()[-1].split()}


def test_the_command_line_starts_without_heavy_imports():
    heavy = {"numpy", "xarray", "numba", "scipy", "matplotlib", "pydantic", "pint", "netCDF4", "rich"}
    assert not imported_by("import cablesim.cli") & heavy
    assert not imported_by("from cablesim.cli import app\napp(['new'], standalone_mode=False)") & (
        heavy - {"rich", "pydantic"}
    )


def test_reading_a_case_does_not_start_the_simulator():
    assert not imported_by("import cablesim.batch") & {"xarray", "numba", "scipy", "matplotlib", "numpy"}
