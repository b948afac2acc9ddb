"""Controllers of the user's in a run: what they may return, and how a run survives the rest."""

from __future__ import annotations

import math
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from test_winch import cycle, winched

from cablesim import Simulation, Status, simulate
from cablesim.control import Measurement
from cablesim.control.deadline import OutOfTime, call_until
from cablesim.scene import Control, Scene

PERIOD = 0.05


def controlled(controller: Callable[[Measurement], Any], **changes: Any) -> Scene:
    base = cycle(**({"duration": 1.0, "interval": 0.1, "relative_tolerance": 1e-4} | changes))
    return winched(base, 3.0, Control(period=PERIOD, delay=0.0, make=lambda: controller))


def limited(controller: Callable[[Measurement], Any], seconds: float) -> Scene:
    base = controlled(controller)
    return replace(base, numerics=replace(base.numerics, time_limit=seconds))


# Answers ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "wrap",
    [float, np.float32, np.array, lambda x: np.array([x]), lambda x: [[x]], xr.DataArray],
    ids=["float", "float32", "0-d", "1-d", "list", "DataArray"],
)
def test_one_number_in_any_wrapping_is_taken(wrap: Callable[[float], Any]) -> None:
    result = simulate(controlled(lambda measured: wrap(0.125)))
    assert result.attrs["status"] == "completed", result.attrs["message"]
    assert float(result.deployed_length[-1]) == pytest.approx(3.0 + 0.125 * (1.0 - 1.5 * PERIOD), abs=1e-9)


@pytest.mark.parametrize("answer", [None, "0.1", [0.1, 0.2], np.zeros(3), [], 1j, {}, math.nan, np.inf])
def test_what_is_not_one_finite_number_ends_the_run(answer: Any) -> None:
    result = simulate(controlled(lambda measured: answer))
    assert result.attrs["status"] == "controller failed"
    assert "at t = 0 s" in result.attrs["message"]


# Failures -----------------------------------------------------------------------------------------


def leaves(measured: Measurement) -> float:
    if measured.time > 0.5:
        sys.exit(3)
    return 0.1


def divides(measured: Measurement) -> float:
    return 1.0 / (0.6 - round(measured.time, 6))


def solves(measured: Measurement) -> float:
    return float(np.linalg.solve(np.zeros((2, 2)), np.ones(2))[0])


@pytest.mark.parametrize(
    ("controller", "words"),
    [(leaves, "SystemExit: 3"), (divides, "ZeroDivisionError"), (solves, "LinAlgError: Singular matrix")],
)
def test_a_failure_names_the_line_of_the_user(controller: Callable[[Measurement], float], words: str) -> None:
    result = simulate(controlled(controller))
    line = controller.__code__.co_firstlineno
    assert result.attrs["status"] == "controller failed"
    assert words in result.attrs["message"]
    lines = [f"(test_controllers_at_work.py, line {line + k})" for k in (1, 2)]
    assert any(place in result.attrs["message"] for place in lines)


def test_a_place_that_is_not_there_is_named_with_those_that_are() -> None:
    result = simulate(controlled(lambda measured: measured.position("bouy")[0]))
    assert "no attachment 'bouy'; known are a, b" in result.attrs["message"]


# Hanging ------------------------------------------------------------------------------------------


def spins(measured: Measurement) -> float:
    while measured.time > 0.4:
        pass
    return 0.0


def sleeps(measured: Measurement) -> float:
    if measured.time > 0.4:
        time.sleep(30.0)
    return 0.0


def holds_on(measured: Measurement) -> float:
    """Catches what is to end it, once."""
    try:
        return spins(measured)
    except BaseException:
        return spins(measured)


@pytest.mark.parametrize("controller", [spins, sleeps, holds_on])
def test_time_limit_ends_a_controller_that_hangs(controller: Callable[[Measurement], float]) -> None:
    simulate(controlled(lambda measured: 0.0))  # compiled and warm
    before = signal.getsignal(signal.SIGALRM)
    started = time.monotonic()
    result = simulate(limited(controller, 1.0))
    assert time.monotonic() - started < 20.0
    assert result.attrs["status"] == "time limit"
    assert "controller was still at work" in result.attrs["message"]
    assert float(result.time[-1]) == pytest.approx(0.45, abs=1e-6)
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


@pytest.mark.parametrize("controller", [spins, holds_on])
def test_time_limit_ends_it_in_a_thread(controller: Callable[[Measurement], float]) -> None:
    found: list[str] = []
    thread = threading.Thread(
        target=lambda: found.append(simulate(limited(controller, 1.0)).attrs["status"]), daemon=True
    )
    thread.start()
    thread.join(60.0)
    assert found == ["time limit"]


def test_time_limit_counts_for_each_step_of_a_driver() -> None:
    simulation = Simulation(limited(spins, 0.5))
    assert simulation.step(0.4).status is Status.COMPLETED
    assert simulation.step(0.4).status is Status.TIME_LIMIT
    assert simulation.time == pytest.approx(0.45, abs=1e-6)


@pytest.fixture
def alarm() -> Iterator[list[int]]:
    """An alarm of the caller's, far away."""
    rung: list[int] = []
    before = signal.signal(signal.SIGALRM, lambda *_: rung.append(1))
    signal.setitimer(signal.ITIMER_REAL, 100.0)
    yield rung
    signal.setitimer(signal.ITIMER_REAL, 0.0)
    signal.signal(signal.SIGALRM, before)


def test_an_alarm_of_the_caller_is_left_alone(alarm: list[int]) -> None:
    handler = signal.getsignal(signal.SIGALRM)
    assert simulate(limited(spins, 1.0)).attrs["status"] == "time limit"
    assert signal.getsignal(signal.SIGALRM) is handler
    assert 10.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 100.0
    assert alarm == []


def test_calls_that_end_in_time_are_as_they_are() -> None:
    for k in range(200):
        assert call_until(time.monotonic() + 5.0, lambda x: x + 1, k) == k + 1
    with pytest.raises(ValueError, match="own"):
        call_until(time.monotonic() + 5.0, _raise, ValueError("own"))
    with pytest.raises(OutOfTime):
        call_until(time.monotonic() - 1.0, len, "abc")


def test_calls_that_end_at_the_deadline_end_one_way_or_the_other() -> None:
    """No alarm is left over that would ring in what comes after."""
    ended = {True: 0, False: 0}
    for k in range(60):
        try:
            call_until(time.monotonic() + 0.004, time.sleep, 0.004 + 1e-5 * (k - 30))
            ended[True] += 1
        except OutOfTime:
            ended[False] += 1
    time.sleep(0.2)
    assert sum(ended.values()) == 60


def _raise(error: Exception) -> None:
    raise error


# Files --------------------------------------------------------------------------------------------


def test_exit_of_a_controller_keeps_the_file_and_the_other_cases(tmp_path: Path) -> None:
    """From the command line: a file of what was computed, exit code 1, and the next case is run."""
    (tmp_path / "law.py").write_text(
        "import sys\n\n\ndef law(measured):\n    return 0.0 if measured.time < 0.3 else sys.exit(0)\n"
    )
    payout = "payout: {kind: function, function: 'law.py:law', period: 0.1}"
    still = "payout: {kind: constant_length, length: 2, proportional: 1, period: 0.1}"
    case = (
        "name: rope\nsimulation: {duration: 1}\n"
        "cable: {length: 4, diameter: 5 mm, mass_per_length: 0.02, axial_stiffness: 1000}\n"
        "ends: {a: {motion: fixed, position: [0, 0, -1]}, b: {motion: fixed, position: [1, 0, -1]}}\n"
        "mesh: {segment_length: 0.2}\nwinch: {deployed_length: 2, %s}\n"
    )
    (tmp_path / "leaves.yaml").write_text(case % payout)
    (tmp_path / "stays.yaml").write_text(case % still)
    command = [sys.executable, "-m", "cablesim.cli", "run", "leaves.yaml", "stays.yaml"]
    found = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert found.returncode == 1, found.stderr
    assert "controller failed" in found.stdout + found.stderr
    assert {path.name for path in tmp_path.glob("*.nc")} == {"leaves.nc", "stays.nc"}
