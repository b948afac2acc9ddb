"""The command line at its edges: closed and full streams, -h, versions, completion, standard input."""

import os
import re
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import pytest
from runs import short_case
from typer.testing import CliRunner

import cablesim
from cablesim import read
from cablesim.cli import app

COMMAND = [sys.executable, "-m", "cablesim"]
posix = pytest.mark.skipif(sys.platform == "win32", reason="needs a POSIX shell")


@pytest.fixture(autouse=True)
def in_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("sway.yaml").write_text(short_case("sway"))
    Path("tow.yaml").write_text(short_case("tow"))


def call(*arguments, stdin=None):
    return CliRunner().invoke(app, [str(argument) for argument in arguments], input=stdin)


def in_shell(text):
    """Run a line of a shell in which `cablesim` is ours."""
    line = text.replace("cablesim", " ".join(COMMAND), 1)
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", line], capture_output=True, text=True, timeout=120, check=False
    )


@posix
@pytest.mark.parametrize("closing", [">&-", ">&- 2>&-", "<&- >&- 2>&-"])
def test_closed_streams_cost_nothing(closing):
    done = in_shell(f"cablesim run sway.yaml tow.yaml {closing}")
    assert (done.returncode, done.stderr) == (0, "")
    for name in ("sway", "tow"):
        assert read(f"{name}.nc").attrs["status"] == "completed"


@posix
def test_a_reader_that_goes_away_costs_nothing():
    done = in_shell("cablesim run sway.yaml tow.yaml | true")
    assert (done.returncode, done.stderr) == (0, "")
    assert read("tow.nc").attrs["status"] == "completed"
    done = in_shell("cablesim schema | head -1")
    assert (done.returncode, done.stdout, done.stderr) == (0, "{\n", "")


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_disk_behind_standard_output_is_told_and_costs_no_result():
    done = in_shell("cablesim run sway.yaml tow.yaml > /dev/full")
    assert done.returncode == 3
    assert done.stderr == "cannot write to standard output: No space left on device.\n"
    assert read("tow.nc").attrs["status"] == "completed"


def test_versions_agree():
    assert cablesim.__version__ == version("cablesim")
    done = subprocess.run([*COMMAND, "--version"], capture_output=True, text=True, check=True)
    assert done.stdout == f"cablesim {cablesim.__version__}\n"


@pytest.mark.parametrize("command", [[], ["run"], ["report"]])
def test_h_is_help(command):
    assert call(*command, "-h").stdout == call(*command, "--help").stdout
    assert "Exit codes: " in call(*command, "-h").stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_is_there_for_shells(shell):
    done = subprocess.run(
        [sys.executable, "-c", "from cablesim.cli import main; main()", "--show-completion", shell],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"},
    )
    assert done.returncode == 0, done.stderr
    assert "COMPLETE" in done.stdout


def test_completion_names_commands_and_options():
    def completed(words):
        script = "import sys; sys.argv = ['cablesim']; from cablesim.cli import main; main()"
        environment = {
            "_CABLESIM_COMPLETE": "complete_bash",
            "COMP_WORDS": f"cablesim {words}",
            "COMP_CWORD": str(len(words.split())),
        }
        done = subprocess.run(
            [sys.executable, "-c", script],
            capture_output=True,
            text=True,
            check=False,
            env={**os.environ, **environment},
        )
        return done.stdout.split()

    assert completed("r") == ["run", "report"]
    assert "--jobs" in completed("run --j")
    assert completed("new --from s") == ["sway"]


def test_a_case_comes_from_standard_input():
    text = Path("sway.yaml").read_text().replace('name: "sway"', "name: from/pipe")
    assert call("validate", "-", stdin=text).stdout == "standard input: ok\n"
    assert "60 segments of 0.05 m" in call("info", "-", stdin=text).stdout
    assert "tension at end A" in call("statics", "-", stdin=text).stdout
    done = call("run", "-", "--set", "simulation.duration=0.5", stdin=text)
    assert done.exit_code == 0, done.output
    assert done.stdout.startswith("standard input: completed, 0.5 s in ")
    assert float(read("from_pipe.nc")["time"][-1]) == 0.5
    done = call("run", "-", "sway.yaml", "--jobs", 2, "--force", stdin=text)
    assert done.exit_code == 0, done.output
    assert float(read("from_pipe.nc")["time"][-1]) == 1.0


def test_what_is_wrong_on_standard_input_has_its_line():
    text = Path("sway.yaml").read_text().replace("length: 3 m", "length: -3 m")
    line = 1 + text.splitlines().index("  length: -3 m # unstretched")
    for command in ("run", "validate", "info", "statics"):
        done = call(command, "-", stdin=text)
        assert done.exit_code == 2
        assert f"standard input:{line}: cable.length: " in done.stderr
    done = call("validate", "-", stdin=b"\xff\xfe\x00")
    assert done.exit_code == 2
    assert "standard input: is not text in UTF-8" in done.stderr
    done = call("run", "-", "-", stdin=text)
    assert done.exit_code == 3
    assert "standard input can be read once" in done.stderr


def test_verbose_shows_the_log():
    plain, verbose = call("run", "sway.yaml"), call("run", "sway.yaml", "--verbose")
    assert "initial shape by" not in plain.stderr
    assert re.search("initial shape by newton", verbose.stderr)
    assert plain.stdout.split(",")[0] == verbose.stdout.split(",")[0]


@pytest.mark.skipif(sys.platform != "linux", reason="reads the peak of its memory from Linux")
def test_info_estimates_the_file_and_the_memory_of_a_run():
    options = ["--set", "output.interval=0.0002"]
    size = re.search(
        r"result file +some ([\d.e+]+) to ([\d.e+]+) MB", call("info", "sway.yaml", *options).stdout
    )
    memory = re.search(r"memory +some ([\d.]+) GB", call("info", "sway.yaml", *options).stdout)
    assert call("run", "sway.yaml", *options).exit_code == 0
    assert float(size[1]) < Path("sway.nc").stat().st_size / 1e6 < float(size[2])
    script = (
        "import re\nfrom cablesim.cli import app\n"
        f"app(['run', 'sway.yaml', '--force', *{options!r}], standalone_mode=False)\n"
        # what getrusage tells begins with the peak of the process that starts this one
        "print(int(re.search(r'VmHWM: *\\s*(\\d+)', open('/proc/self/status').read())[1]) * 1024 / 1e9)"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert float(done.stdout.split()[-1]) == pytest.approx(float(memory[1]), rel=0.5)
