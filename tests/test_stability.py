"""Random scenes reach their end and keep the laws of physics; `validation/stability.py` is the long form."""

import sys
from pathlib import Path

import pytest

SCENES, SEED = 24, 1


@pytest.fixture(scope="module")
def stability():
    folder = str(Path(__file__).resolve().parents[1] / "validation")
    sys.path.insert(0, folder)
    try:
        import stability
    finally:
        sys.path.remove(folder)
    return stability


@pytest.mark.parametrize("index", range(SCENES))
def test_random_scene_completes_without_faults(stability, index):
    plan = stability.Plan(seed=SEED, kinds=3, shortest=0.2, longest=1.0, time_limit=10.0)
    report = stability.audit(plan, index)
    assert (report.outcome, report.faults) == ("completed", ""), f"{report.message} {report.scene}"


def test_a_scene_follows_from_its_seed_and_index(stability):
    plan = stability.Plan(seed=SEED)
    assert stability.describe(stability.make_scene(plan, 7)) == stability.describe(
        stability.make_scene(plan, 7)
    )
    assert stability.describe(stability.make_scene(plan, 7)) != stability.describe(
        stability.make_scene(plan, 8)
    )
