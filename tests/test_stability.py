"""Random scenes reach their end and keep the laws of physics; `validation/stability.py` is the long form."""

import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

from cablesim import simulate

SCENES, SEED = 24, 1


@pytest.fixture(scope="module")
def validation():
    """Import a module of `validation/`."""
    folder = str(Path(__file__).resolve().parents[1] / "validation")
    sys.path.insert(0, folder)
    yield import_module
    sys.path.remove(folder)


@pytest.fixture
def random_scenes(validation):
    return validation("random_scenes")


@pytest.mark.parametrize("index", range(SCENES))
def test_random_scene_completes_without_faults(validation, random_scenes, index):
    plan = random_scenes.Plan(seed=SEED, kinds=3, shortest=0.2, longest=1.0, time_limit=10.0)
    report = validation("audit").audit(plan, index)
    assert (report.outcome, report.faults) == ("completed", ""), f"{report.message} {report.scene}"


def test_a_scene_follows_from_its_seed_and_index(random_scenes):
    plan = random_scenes.Plan(seed=SEED)
    seventh, again, eighth = (random_scenes.make_scene(plan, index) for index in (7, 7, 8))
    assert random_scenes.describe(seventh) == random_scenes.describe(again)
    assert random_scenes.describe(seventh) != random_scenes.describe(eighth)


def test_work_done_between_the_samples_is_no_energy_created(validation, random_scenes):
    """A hundred axial waves pass between the samples of this scene, and its end is shaken by noise."""
    scene = random_scenes.make_scene(random_scenes.Plan(seed=11), 317)
    scene = replace(scene, duration=0.05, numerics=replace(scene.numerics, mesh_damping=0.0))
    balance, run = validation("energy_balance"), simulate(scene)
    seen = balance.energy_created(scene, run, limit=float("inf"))
    assert seen > 30.0
    assert balance.energy_created(scene, run, limit=30.0) < 30.0


def test_energy_that_is_created_is_seen(validation, random_scenes, monkeypatch):
    """More than drag takes out, at whatever interval one looks."""
    balance = validation("energy_balance")
    scene = random_scenes.make_scene(random_scenes.Plan(seed=1, kinds=3, shortest=0.2, longest=1.0), 4)

    def creating(scene):
        run = simulate(scene)
        gain = 10.0 * run.kinetic_energy.max() * run.time / scene.duration
        return run.assign(kinetic_energy=run.kinetic_energy + gain)

    assert balance.energy_created(scene, simulate(scene), 30.0) <= 30.0
    monkeypatch.setattr(balance, "simulate", creating)
    assert balance.energy_created(scene, creating(scene), 30.0) > 30.0


@pytest.mark.parametrize("index", [158, 413, 852, 907])
def test_interpolated_noise_is_not_refused(random_scenes, index):
    """A noise level of 0 asks for the samples as they are, and the spline through them is as rough."""
    random_scenes.make_scene(random_scenes.Plan(seed=20261124), index)
