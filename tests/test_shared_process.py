"""A simulation among others in one process: standard output, threads, the collector, copies, snapshots."""

from __future__ import annotations

import copy
import gc
import pickle
import subprocess
import sys
import textwrap
import threading
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import cable, scene, sway
from test_winch import cycle, winched

from cablesim import Simulation, Status, simulate
from cablesim.control import ConstantLength, Measurement, user_controller
from cablesim.scene import Control, Scene

SHORT: dict[str, Any] = {"segments": 20, "duration": 1.0, "interval": 0.1}


def talking(words: str, length: float = 3.4) -> Scene:
    """A winch whose controller prints at every sample."""
    law = ConstantLength(length=length, proportional=1.0)

    def controller(measured: Measurement) -> float:
        print(words)
        return law(measured)

    control = Control(period=0.1, delay=0.2, make=lambda: controller)
    return winched(cycle(duration=1.0, relative_tolerance=1e-4, interval=0.1), 3.0, control)


def steady() -> Scene:
    """The same, of what can be pickled."""
    control = Control(period=0.1, delay=0.2, make=still_law)
    return winched(cycle(duration=1.0, relative_tolerance=1e-4, interval=0.1), 3.0, control)


def still_law() -> ConstantLength:
    return ConstantLength(length=3.4, proportional=1.0)


# What the process shares --------------------------------------------------------------------------


def test_what_a_controller_prints_is_seen(capsys: pytest.CaptureFixture[str]) -> None:
    simulate(talking("asked"))
    assert capsys.readouterr().out.split() == ["asked"] * 10


def test_standard_output_stays_what_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    before, seen = sys.stdout, []
    simulation = Simulation(sway(**SHORT))
    simulation.run(lambda progress: seen.append((sys.stdout, gc.isenabled())))
    assert set(seen) == {(before, True)}


def test_what_ida_says_about_a_failure_is_not_printed(capfd: pytest.CaptureFixture[str]) -> None:
    result = simulate(sway(**(SHORT | {"max_steps": 3})))
    assert result.attrs["status"] == "step limit"
    assert capfd.readouterr() == ("", "")


def test_threads_do_not_disturb_each_other(capsys: pytest.CaptureFixture[str]) -> None:
    """Two runs at once give what they give alone, bit by bit, and both print."""
    words = {"low": 3.2, "high": 3.5}
    alone = {word: simulate(talking(word, length)) for word, length in words.items()}
    capsys.readouterr()
    together: dict[str, Any] = {}
    barrier = threading.Barrier(2)

    def work(word: str) -> None:
        simulation = Simulation(talking(word, words[word]))
        barrier.wait()
        together[word] = simulation.run()

    threads = [threading.Thread(target=work, args=(word,)) for word in words]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    printed = capsys.readouterr().out.split()
    for word in words:
        assert printed.count(word) == 10
        for name in alone[word].data_vars:
            np.testing.assert_array_equal(together[word][name], alone[word][name])


# Copies -------------------------------------------------------------------------------------------


def pickled(simulation: Simulation) -> Simulation:
    return pickle.loads(pickle.dumps(simulation))


def winding() -> Simulation:
    simulation = Simulation(steady())
    simulation.step(0.35)
    return simulation


def swaying() -> Simulation:
    simulation = Simulation(sway(**SHORT))
    simulation.step(0.2, velocity_b=[0.0, 0.1, 0.0])
    return simulation


@pytest.mark.parametrize("make", [winding, swaying])
@pytest.mark.parametrize("copied", [pickled, copy.deepcopy])
def test_a_copy_goes_on_as_the_original(
    make: Callable[[], Simulation], copied: Callable[[Simulation], Simulation]
) -> None:
    original = make()
    twin = copied(original)
    assert twin.time == original.time
    np.testing.assert_array_equal(twin.observe().position, original.observe().position)
    before = original.observe().position
    seen = [twin.step(0.1) for _ in range(4)]
    np.testing.assert_array_equal(original.observe().position, before)
    wanted = [original.step(0.1) for _ in range(4)]
    for one, other in zip(seen, wanted, strict=True):
        assert one.time == pytest.approx(other.time, abs=1e-12)
        assert one.deployed_length == pytest.approx(other.deployed_length, abs=1e-4)
        assert np.abs(one.position - other.position).max() < 5e-4


def test_a_copy_of_the_start_runs_as_the_original_to_the_bit() -> None:
    original = Simulation(sway(**SHORT))
    np.testing.assert_array_equal(pickled(original).run().position, original.run().position)


def test_a_snapshot_is_pickled_with_its_equations() -> None:
    simulation = swaying()
    moment = pickle.loads(pickle.dumps(simulation.snapshot()))
    wanted = simulation.step(0.3).position
    simulation.restore(moment)
    assert np.abs(simulation.step(0.3).position - wanted).max() < 5e-4


def test_a_controller_from_a_file_is_unpickled_in_another_process(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(
        "class Law:\n    seen = 0\n\n    def __call__(self, measured):\n"
        "        self.seen += 1\n        return 0.01 * self.seen\n"
    )
    control = Control(period=0.1, delay=0.0, make=partial(user_controller, "law.py:Law", tmp_path, {}))
    simulation = Simulation(winched(cycle(), 3.0, control))
    simulation.step(0.35)
    (tmp_path / "simulation.pickle").write_bytes(pickle.dumps(simulation))
    wanted = simulation.step(0.2).deployed_length
    code = f"""
        import pickle
        from pathlib import Path
        simulation = pickle.loads(Path({str(tmp_path / "simulation.pickle")!r}).read_bytes())
        print(simulation.step(0.2).deployed_length)
    """
    found = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, check=True
    )
    assert float(found.stdout) == pytest.approx(wanted, abs=1e-12)


# Snapshots of other scenes ------------------------------------------------------------------------


@pytest.mark.parametrize(
    "other",
    [
        sway(**(SHORT | {"segments": 24})),
        sway(**SHORT, rope=cable(diameter=0.02)),
        sway(**SHORT, heading=0.3),
        cycle(segment=0.15),
    ],
    ids=["mesh", "cable", "motion", "winch"],
)
def test_snapshot_of_another_scene_is_refused(other: Scene) -> None:
    moment = Simulation(other).snapshot()
    simulation = swaying()
    before = simulation.time
    with pytest.raises(ValueError, match="snapshot is of another scene"):
        simulation.restore(moment)
    assert simulation.time == before
    assert simulation.step(0.1).status is Status.COMPLETED


def test_snapshot_of_a_scene_that_differs_in_its_length_of_time_is_taken() -> None:
    moment = Simulation(scene(**SHORT)).snapshot()
    Simulation(scene(**(SHORT | {"duration": 2.0}))).restore(moment)
