"""Controllers of the winch: by hand, in closed loop against analytic solutions, and of the user's."""

from __future__ import annotations

import math
import pickle
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cablesim.control import (
    BuoyGap,
    ConstantLength,
    ConstantTension,
    Controller,
    ControllerLoadError,
    Measurement,
    user_controller,
)

Places = dict[str, tuple[float, float, float]]


def measured(
    time: float = 0.0, *, length: float = 3.0, a: float = 0.0, b: float = 0.0, places: Places | None = None
) -> Measurement:
    """What a controller would be given; attachments are at rest."""

    def locate(name: str) -> tuple[np.ndarray, np.ndarray]:
        return np.array((places or {})[name]), np.zeros(3)

    return Measurement(
        time=time, deployed_length=length, payout_speed=0.0, tension_a=a, tension_b=b, locate=locate
    )


def apart(time: float, gap: float, middle: float = 0.0) -> Measurement:
    """Two buoys `gap` apart along y, half way between them at x = `middle`."""
    return measured(time, places={"port": (middle, gap / 2, 0), "starboard": (middle, -gap / 2, 0)})


def closed_loop(
    controller: Controller,
    see: Callable[[float, float], Measurement],
    rate: Callable[[float, float], float],
    start: float,
    *,
    period: float = 1e-3,
    duration: float = 4.0,
    delay: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Times and states of x' = rate(t, speed), with speeds held between samples and an ideal winch."""
    steps, late = round(duration / period), round(delay / period)
    times, states = period * np.arange(steps + 1), np.empty(steps + 1)
    states[0] = start
    for k in range(steps):
        seen = max(k - late, 0)
        speed = controller(see(times[seen], states[seen]))
        states[k + 1] = states[k] + period * rate(times[k], speed)
    return times, states


def buoy_gap(**changes: Any) -> BuoyGap:
    given: dict[str, Any] = {"buoys": ("port", "starboard"), "proportional": 2.0, "derivative": 0.0}
    return BuoyGap(**{**given, "speeds": [0.0], "gaps": [0.25], **changes})


# Constant length --------------------------------------------------------------------------------


def test_constant_length_by_hand() -> None:
    controller = ConstantLength(length=3.5, proportional=0.4)
    assert controller(measured(length=3.0)) == pytest.approx(0.2)
    assert controller(measured(length=4.0)) == pytest.approx(-0.2)


@pytest.mark.parametrize("rate", [0.5, 2.0])
def test_constant_length_converges_exponentially(rate: float) -> None:
    controller = ConstantLength(length=3.5, proportional=rate)
    times, lengths = closed_loop(controller, lambda t, x: measured(t, length=x), lambda t, speed: speed, 3.0)
    np.testing.assert_allclose(lengths, 3.5 - 0.5 * np.exp(-rate * times), atol=0.5 * rate * 1e-3)


def test_sampling_makes_a_geometric_series() -> None:
    controller = ConstantLength(length=3.5, proportional=2.0)
    _, lengths = closed_loop(
        controller, lambda t, x: measured(t, length=x), lambda t, speed: speed, 3.0, period=0.1
    )
    np.testing.assert_allclose(lengths, 3.5 - 0.5 * 0.8 ** np.arange(lengths.size), atol=1e-12)


@pytest.mark.parametrize(("gain", "stable"), [(1.4, True), (1.75, False)])
def test_delay_destabilises_beyond_half_pi(gain: float, stable: bool) -> None:
    """x'(t) = -K (x(t - 1 s) - 3.5) swings, with shrinking amplitude while K x 1 s < pi / 2."""
    controller = ConstantLength(length=3.5, proportional=gain)
    times, lengths = closed_loop(
        controller,
        lambda t, x: measured(t, length=x),
        lambda t, speed: speed,
        3.0,
        duration=60.0,
        delay=1.0,
        period=0.01,
    )
    early, late = (np.abs(lengths[(times > a) & (times < a + 10)] - 3.5).max() for a in (10.0, 50.0))
    assert (late < 0.5 * early) == stable
    assert (late > 2 * early) == (not stable)


# Constant tension -------------------------------------------------------------------------------


def test_constant_tension_by_hand() -> None:
    controller = ConstantTension(tension=2.0, proportional=0.1, integral=0.05)
    assert controller(measured(0.0, b=3.0)) == pytest.approx(0.1)
    assert controller(measured(0.5, b=3.0)) == pytest.approx(0.1 + 0.05 * 0.5)
    assert controller(measured(1.0, b=1.0)) == pytest.approx(-0.1 + 0.0)
    assert ConstantTension(tension=2.0, proportional=0.1, end="a")(measured(a=5.0)) == pytest.approx(0.3)


def spring(stiffness: float, pulled: float) -> Callable[[float, float], float]:
    """T' of a spring whose far end moves at `pulled` and whose near end is paid out at a speed."""
    return lambda t, speed: stiffness * (pulled - speed)


def test_proportional_tension_settles_where_the_speeds_agree() -> None:
    """T' = k (u - Kp (T - T0)): towards T0 + u / Kp with the rate k Kp."""
    controller = ConstantTension(tension=2.0, proportional=0.1)
    times, tensions = closed_loop(controller, lambda t, x: measured(t, b=x), spring(20.0, 0.3), 2.0)
    np.testing.assert_allclose(tensions, 5.0 - 3.0 * np.exp(-2.0 * times), atol=5e-3)


def test_integral_takes_the_rest_away() -> None:
    """e'' + k Kp e' + k Ki e = 0 with e(0) = 0, e'(0) = k u: a damped swing back to the set point."""
    stiffness, pulled, gain, integral = 20.0, 0.3, 0.1, 0.25
    controller = ConstantTension(tension=2.0, proportional=gain, integral=integral)
    times, tensions = closed_loop(controller, lambda t, x: measured(t, b=x), spring(stiffness, pulled), 2.0)
    decay = stiffness * gain / 2
    omega = math.sqrt(stiffness * integral - decay**2)
    expected = stiffness * pulled / omega * np.exp(-decay * times) * np.sin(omega * times)
    np.testing.assert_allclose(tensions - 2.0, expected, atol=1e-2)
    assert np.abs(tensions - 2.0).max() > 1.0


def test_integral_does_not_wind_up() -> None:
    """Ten seconds of a pull that the winch cannot follow leave nothing to be worked off."""
    limited = ConstantTension(tension=2.0, proportional=0.1, integral=0.5, speed_limit=0.2)
    speeds = [limited(measured(0.1 * k, b=10.0)) for k in range(100)]
    assert set(speeds) == {0.2}
    assert limited(measured(10.0, b=2.0)) == pytest.approx(0.0, abs=1e-12)
    # without a limit the integral is there
    free = ConstantTension(tension=2.0, proportional=0.1, integral=0.5)
    for k in range(100):
        free(measured(0.1 * k, b=10.0))
    assert free(measured(10.0, b=2.0)) == pytest.approx(0.5 * 8.0 * 9.9)


def test_integral_gained_before_the_limit_is_worked_off_at_the_limit() -> None:
    controller = ConstantTension(tension=2.0, proportional=0.01, integral=1.0, speed_limit=0.5)
    controller(measured(0.0, b=2.0))
    assert controller(measured(1.0, b=2.45)) == pytest.approx(0.4545)
    # the speed would still be above the limit, but the error pulls it down
    assert controller(measured(1.1, b=1.95)) == pytest.approx(0.45 - 0.005 - 0.0005)
    assert controller(measured(1.2, b=-20.0)) == -0.5


# Distance of two buoys --------------------------------------------------------------------------


def test_buoy_gap_by_hand() -> None:
    controller = buoy_gap(derivative=0.5)
    assert controller(apart(0.0, 0.35)) == pytest.approx(2.0 * 0.1)
    assert controller(apart(0.1, 0.37)) == pytest.approx(2.0 * 0.12 + 0.5 * 0.2)
    assert controller(apart(0.2, 0.20)) == pytest.approx(-2.0 * 0.05 - 0.5 * 1.7)


def test_measurement_that_is_no_newer_changes_no_rate() -> None:
    controller = buoy_gap(derivative=0.5)
    controller(apart(0.0, 0.35))
    controller(apart(0.1, 0.37))
    assert controller(apart(0.1, 0.37)) == pytest.approx(2.0 * 0.12 + 0.5 * 0.2)


def test_set_point_follows_the_speed_of_the_buoys() -> None:
    controller = buoy_gap(speeds=[0.0, 0.4], gaps=[0.2, 0.3])
    assert controller(apart(0.0, 0.3)) == pytest.approx(2.0 * 0.1)  # no speed is known yet
    assert controller(apart(1.0, 0.3, middle=0.2)) == pytest.approx(2.0 * 0.05)
    assert controller(apart(2.0, 0.3, middle=-0.8)) == pytest.approx(0.0)  # 1 m/s: the last gap holds


def test_measured_speed_is_smoothed() -> None:
    controller = buoy_gap(speeds=[0.0, 1.0], gaps=[1.0, 2.0], speed_time=0.5)
    controller(apart(0.0, 2.0, middle=0.0))
    middle = 0.4 * 0.1
    controller(apart(0.1, 2.0, middle=middle))  # 0.4 m/s, taken as it is
    for k in range(2, 12):  # then at rest for a second
        speed = 2.0 - 1.0 - controller(apart(0.1 * k, 2.0, middle=middle)) / 2.0
    assert speed == pytest.approx(0.4 * math.exp(-1.0 / 0.5))


def test_buoy_gap_closes_exponentially() -> None:
    """gap' = -k speed with speed = Kp (gap - g0) + Kd gap': the rate is k Kp / (1 + k Kd)."""
    effect, gain, derivative = 0.8, 2.0, 0.5
    times, gaps = closed_loop(
        buoy_gap(proportional=gain, derivative=derivative), apart, lambda t, speed: -effect * speed, 0.4
    )
    rate = effect * gain / (1 + effect * derivative)
    np.testing.assert_allclose(gaps, 0.25 + 0.15 * np.exp(-rate * times), atol=1e-3)


# The user's own ---------------------------------------------------------------------------------

CODE = """\
from __future__ import annotations

from dataclasses import dataclass, field

from helper import GAIN

count = 0


def slack(measured, target=3.0):
    return GAIN * (target - measured.deployed_length)


def counted(measured):
    global count
    count += 1
    return float(count)


@dataclass
class Stubborn:
    speed: float
    memory: list[float] = field(default_factory=list)

    def __call__(self, measured):
        self.memory.append(measured.time)
        return self.speed * len(self.memory)


class Silent:
    pass


class Picky:
    def __init__(self, gain):
        if gain < 0:
            raise ValueError("gain is negative")

    def __call__(self, measured):
        return 0.0


class Deaf:
    def __call__(self):
        return 0.0


number = 3
"""


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    (tmp_path / "mine.py").write_text(CODE)
    (tmp_path / "helper.py").write_text("GAIN = 0.5\n")
    return tmp_path


@pytest.fixture(autouse=True)
def _forget_helper() -> Any:
    yield
    sys.modules.pop("helper", None)


def test_function_from_a_file(directory: Path) -> None:
    controller = user_controller("mine.py:slack", directory, {})
    assert controller(measured(length=2.0)) == 0.5
    assert user_controller("mine.py:slack", directory, {"target": 4.0})(measured(length=2.0)) == 1.0
    assert str(directory) not in sys.path


def test_class_from_a_file_is_made_anew_for_each_run(directory: Path) -> None:
    options = {"speed": 0.1, "memory": []}
    make = partial(user_controller, "mine.py:Stubborn", directory, options)
    first, second = make(), make()
    assert [first(measured()), first(measured())] == pytest.approx([0.1, 0.2])
    assert second(measured()) == pytest.approx(0.1)
    assert options["memory"] == []


def test_globals_of_a_file_are_fresh_for_each_run(directory: Path) -> None:
    first = user_controller("mine.py:counted", directory, {})
    assert [first(measured()), first(measured())] == [1.0, 2.0]
    assert user_controller("mine.py:counted", directory, {})(measured()) == 1.0


def test_controller_from_a_module(directory: Path) -> None:
    package = directory / "my_package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "laws.py").write_text("def still(measured):\n    return 0.0\n")
    assert user_controller("my_package.laws:still", directory, {})(measured()) == 0.0
    # one of ours, where the package is found without the directory
    made = user_controller("cablesim.control:ConstantLength", directory, {"length": 3.5, "proportional": 1.0})
    assert made(measured(length=3.0)) == 0.5


@pytest.mark.parametrize(
    "make",
    [
        partial(buoy_gap, derivative=1.0),
        partial(ConstantTension, tension=2.0, proportional=0.1, integral=1.0),
        partial(user_controller, "mine.py:Stubborn", Path(), {"speed": 1.0}),
    ],
    ids=["buoy_gap", "constant_tension", "function"],
)
def test_what_makes_a_controller_can_be_pickled(
    make: Any, directory: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(directory)
    first, second = make(), pickle.loads(pickle.dumps(make))()
    seen = [apart(0.1 * k, 0.3 + 0.01 * k) for k in range(3)]
    assert [first(one) for one in seen] == [second(one) for one in seen]


@pytest.mark.parametrize(
    ("reference", "options", "words"),
    [
        ("mine.py", {}, ["does not name a function", "file.py:name"]),
        ("main.py:slack", {}, ["there is no file", "main.py", "Did you mean 'mine.py'?"]),
        ("mine.py:slak", {}, ["mine.py has no slak", "Did you mean 'slack'?"]),
        ("mine.py:zzz", {}, ["mine.py has no zzz", "Define `zzz` there"]),
        ("mine.py:number", {}, ["is no function but 3", "Name a function"]),
        (
            "mine.py:slack",
            {"gain": 1},
            ["takes (measured, target)", "given (the measurement, gain)", "'gain'"],
        ),
        ("mine.py:Stubborn", {}, ["takes (speed, memory)", "missing a required argument: 'speed'"]),
        ("mine.py:Stubborn", {"sped": 1}, ["given (sped)", "`options`"]),
        ("mine.py:Picky", {"gain": -1}, ["cannot be made: ValueError: gain is negative (mine.py, line 37)"]),
        ("mine.py:Silent", {}, ["cannot be called", "__call__(self, measured)"]),
        ("mine.py:Deaf", {}, ["an instance of mine.py:Deaf takes ()", "the measurement"]),
        ("broken.py:slack", {}, ["raised ZeroDivisionError: division by zero (broken.py, line 2)"]),
        ("unfinished.py:slack", {}, ["raised SyntaxError", "unfinished.py, line 1"]),
        ("leaving.py:slack", {}, ["raised SystemExit: 3"]),
        ("nowhere.at_all:slack", {}, ["there is no module nowhere.at_all below", "entry points"]),
    ],
)
def test_controllers_that_cannot_be_had(
    directory: Path, reference: str, options: dict[str, Any], words: list[str]
) -> None:
    (directory / "broken.py").write_text("one = 1\ntwo = one / 0\n")
    (directory / "unfinished.py").write_text("def slack(measured:\n")
    (directory / "leaving.py").write_text("raise SystemExit(3)\n")
    with pytest.raises(ControllerLoadError) as caught:
        user_controller(reference, directory, options)
    for word in words:
        assert word in str(caught.value)
    assert caught.value.remedy
