"""The code that a case names: it runs when the case is run and not before, and not all may be named."""

from __future__ import annotations

import json
import subprocess
import sys
import sysconfig
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from cablesim import Case, CaseError, Simulation, build_scene, load_case, simulate
from cablesim.control import ControllerLoadError, check_source, user_controller

CASE: dict[str, Any] = {
    "name": "rope",
    "simulation": {"duration": 0.5},
    "cable": {"length": 4, "diameter": "5 mm", "mass_per_length": 0.02, "axial_stiffness": 1000},
    "ends": {
        "a": {"motion": "fixed", "position": [0, 0, -1]},
        "b": {"motion": "fixed", "position": [1, 0, -1]},
    },
    "mesh": {"segment_length": 0.2},
}

MARKS = """\
from pathlib import Path

with (Path(__file__).parent / "ran").open("a") as file:
    file.write("x")


def law(measured):
    return 0.0
"""


def written(folder: Path, function: str, **options: Any) -> Path:
    """A case file in `folder` whose controller is `function`."""
    payout = {"kind": "function", "function": function, "period": 0.1, "options": options}
    path = folder / "rope.yaml"
    path.write_text(json.dumps({**CASE, "winch": {"deployed_length": 2, "payout": payout}}))
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    (tmp_path / "marks.py").write_text(MARKS)
    package = tmp_path / "marking"
    package.mkdir()
    (package / "__init__.py").write_text(MARKS.replace("(__file__).parent", "(__file__).parent.parent"))
    (package / "laws.py").write_text("def law(measured):\n    return 0.0\n")
    yield tmp_path
    for name in ("marks", "marking", "marking.laws"):
        sys.modules.pop(name, None)


# When it runs -------------------------------------------------------------------------------------


@pytest.mark.parametrize("function", ["marks.py:law", "marks:law", "marking.laws:law"])
def test_looking_at_a_case_runs_none_of_its_code(folder: Path, function: str) -> None:
    case = load_case(written(folder, function))
    simulation = Simulation(build_scene(case))
    simulation.present()
    assert not (folder / "ran").exists()
    simulation.run()
    assert (folder / "ran").read_text() == "x"


@pytest.mark.parametrize("command", ["validate", "info", "schema"])
def test_commands_that_look_at_a_case_run_none_of_its_code(folder: Path, command: str) -> None:
    path = written(folder, "marks.py:law")
    arguments = [] if command == "schema" else [path.name]
    found = subprocess.run(
        [sys.executable, "-m", "cablesim.cli", command, *arguments],
        cwd=folder,
        capture_output=True,
        text=True,
    )
    assert found.returncode == 0, found.stderr
    assert not (folder / "ran").exists()


def test_help_says_that_a_case_is_trusted_input() -> None:
    found = subprocess.run(
        [sys.executable, "-m", "cablesim.cli", "--help"], capture_output=True, text=True, check=True
    )
    assert "trusted input" in " ".join(found.stdout.split())


def test_what_goes_wrong_when_it_runs_is_said_of_the_case(folder: Path) -> None:
    (folder / "broken.py").write_text("one = 1 / 0\n\n\ndef law(measured):\n    return 0.0\n")
    path = written(folder, "broken.py:law")
    case = load_case(path)
    build_scene(case)
    with pytest.raises(CaseError, match=r"winch\.payout\.function.*ZeroDivisionError.*broken\.py, line 1"):
        simulate(case)


# What may be named --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "function",
    [
        "os:system",
        "subprocess:Popen",
        "builtins:print",
        "shutil:rmtree",
        "posix:system",
        "numpy:save",
        "numpy.lib._utils_impl:show_runtime",
        "cablesim.files:replacing",
        "pip:main",
        f"{sysconfig.get_path('stdlib')}/subprocess.py:Popen",
        f"{sysconfig.get_path('purelib')}/numpy/__init__.py:save",
    ],
)
def test_code_that_is_on_the_disk_anyway_may_not_be_named(folder: Path, function: str) -> None:
    path = written(folder, function, args=["touch", str(folder / "done")])
    with pytest.raises(CaseError, match=r"winch\.payout\.function"):
        build_scene(load_case(path))
    with pytest.raises(ControllerLoadError):
        user_controller(function, folder, {})
    assert not (folder / "done").exists()


def test_a_link_to_a_library_is_the_library(folder: Path) -> None:
    (folder / "mine.py").symlink_to(Path(subprocess.__file__))
    with pytest.raises(ControllerLoadError, match="belongs to Python or an installed package"):
        check_source("mine.py:Popen", folder, {})


def test_a_module_must_not_be_another_of_that_name(folder: Path, tmp_path_factory: Any) -> None:
    """Two cases in two folders, each with its own module `marks`."""
    other = tmp_path_factory.mktemp("other")
    (other / "marks.py").write_text("def law(measured):\n    return 1.0\n")
    assert user_controller("marks:law", folder, {})(None) == 0.0
    with pytest.raises(ControllerLoadError, match=r"taken by another module.*marks\.py:law"):
        user_controller("marks:law", other, {})
    assert user_controller("marks.py:law", other, {})(None) == 1.0


def test_an_installed_package_may_declare_its_controllers(
    folder: Path, tmp_path_factory: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    home = tmp_path_factory.mktemp("installed")
    (home / "lab").mkdir()
    (home / "lab" / "__init__.py").write_text("")
    (home / "lab" / "laws.py").write_text("def law(measured):\n    return 2.0\n")
    (home / "lab" / "tools.py").write_text("def law(measured):\n    return 3.0\n")
    info = home / "lab-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: lab\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[cablesim.controllers]\nlaws = lab.laws\n")
    monkeypatch.syspath_prepend(home)
    assert [entry.module for entry in metadata.entry_points(group="cablesim.controllers")] == ["lab.laws"]
    check_source("lab.laws:law", folder, {})
    assert user_controller("lab.laws:law", folder, {})(None) == 2.0
    with pytest.raises(ControllerLoadError, match=r"lab\.laws has no lew"):
        check_source("lab.laws:lew", folder, {})
    with pytest.raises(ControllerLoadError, match="no installed package declares it"):
        check_source("lab.tools:law", folder, {})


# What its text says -------------------------------------------------------------------------------

KNOWN = """\
import functools


def plain(measured, gain=1.0, *, offset):
    return gain


@functools.cache
def decorated():
    return 0.0


class Law:
    def __init__(self, gain):
        self.gain = gain

    def __call__(self, measured):
        return self.gain


class Silent:
    pass


class Inherited(Law):
    pass


class Deaf:
    def __call__(self):
        return 0.0


if functools:
    def branched(measured):
        return 0.0

number = 3
alias = plain
"""


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("plan", {}, "Did you mean 'plain'"),
        ("plain", {}, "missing a required argument: 'offset'"),
        ("plain", {"offset": 1, "gian": 2}, "gian"),
        ("Law", {}, "missing a required argument: 'gain'"),
        ("Silent", {}, "__call__"),
        ("Deaf", {}, "too many positional arguments"),
        ("number", {}, "is no function but 3"),
        ("branched", {"more": 1}, "more"),
    ],
)
def test_what_the_text_rules_out_is_refused(
    folder: Path, name: str, options: dict[str, Any], words: str
) -> None:
    (folder / "known.py").write_text(KNOWN)
    with pytest.raises(ControllerLoadError) as caught:
        check_source(f"known.py:{name}", folder, options)
    assert words in str(caught.value)
    # the same words as when the code is run
    with pytest.raises(ControllerLoadError) as run:
        user_controller(f"known.py:{name}", folder, options)
    assert str(run.value) == str(caught.value)


@pytest.mark.parametrize(
    ("name", "options"),
    [
        ("plain", {"offset": 1}),
        ("decorated", {}),
        ("Law", {"gain": 1}),
        ("Inherited", {}),
        ("branched", {}),
        ("alias", {}),
        ("functools", {}),
    ],
)
def test_what_the_text_leaves_open_is_left_to_the_run(
    folder: Path, name: str, options: dict[str, Any]
) -> None:
    (folder / "known.py").write_text(KNOWN)
    check_source(f"known.py:{name}", folder, options)


def test_names_that_come_with_a_star_are_left_to_the_run(folder: Path) -> None:
    (folder / "star.py").write_text("from known import *\n")
    check_source("star.py:plain", folder, {})


@pytest.mark.parametrize("text", ["def law(measured:\n", "law = '\0'\n", "\N{SNOWMAN}\n", "(" * 500])
def test_what_is_no_python_is_refused(folder: Path, text: str) -> None:
    (folder / "odd.py").write_text(text)
    with pytest.raises(ControllerLoadError, match=r"no Python that can be run.*Correct the code"):
        check_source("odd.py:law", folder, {})


def test_case_from_a_dictionary_finds_its_code_in_a_folder(folder: Path) -> None:
    payout = {"kind": "function", "function": "marks.py:law", "period": 0.1}
    case = Case.model_validate({**CASE, "winch": {"deployed_length": 2, "payout": payout}})
    build_scene(case, directory=folder)
    assert not (folder / "ran").exists()
