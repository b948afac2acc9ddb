"""What a scene does not need is skipped: the same result as with everything computed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scenes import (
    VACUUM,
    UniformCurrent,
    body,
    cable,
    driven,
    pendulum,
    scene,
    sway,
)

from cablesim.physics.needs import describe_needs
from cablesim.physics.parameters import PROFILE, STILL, UNIFORM
from cablesim.scene import Scene
from cablesim.simulation import Simulation

TIGHT: dict[str, Any] = {
    "relative_tolerance": 1e-8,
    "max_order": 5,
    "segments": 12,
    "interval": 0.1,
    "duration": 1.0,
    "variables": ("position", "tension"),
}
CLOSE = 1e-6  # [m], some ten times what a change of 1e-8 in the tolerance does
HEAVE = driven([1.5, 0.0, 0.0], [[0.0, 0.0, 0, 0.3], [0.5, 0.4, 0, -0.3], [1.0, 0.0, 0, 0.0]])

SCENES = {
    "third dimension, bending, point drag, current": pendulum(**TIGHT),
    "bending, point drag, current": sway(**TIGHT),
    "damping": pendulum(density=VACUUM, **(TIGHT | {"duration": 0.6})),
    "third dimension, driven": scene(b=HEAVE, **TIGHT),
    "profile of a uniform current": scene(
        rope=cable(bending_stiffness=0.02),
        b=HEAVE,
        current=UniformCurrent(velocity=np.array([0.2, 0.3, 0.0])),
        attachments=[body(1.0, mass=0.1, drag_area=1e-3)],
        **TIGHT,
    ),
}


def in_full(case: Scene) -> Scene:
    return replace(case, numerics=replace(case.numerics, skip=False))


@pytest.mark.parametrize("name", SCENES)
def test_skipping_changes_nothing(name: str) -> None:
    lean, full = Simulation(SCENES[name]), Simulation(in_full(SCENES[name]))
    assert lean.model.features != full.model.features
    quick, slow = lean.run(), full.run()
    assert (quick.attrs["status"], slow.attrs["status"]) == ("completed", "completed")
    assert np.abs(quick.position.values - slow.position.values).max() < CLOSE
    assert (
        np.abs(quick.tension.values - slow.tension.values)[1:].max()
        < 1e-3 * np.abs(slow.tension.values).max()
    )


def test_features_follow_from_the_scene() -> None:
    found = {name: Simulation(case).model.features for name, case in SCENES.items()}
    assert [features.dimension for features in found.values()] == [2, 3, 2, 2, 3]
    assert [features.damping for features in found.values()] == [True, True, False, True, True]
    assert [features.current for features in found.values()] == [STILL, STILL, STILL, STILL, UNIFORM]
    assert [features.bending for features in found.values()] == [False, False, False, False, True]


def test_full_kernel_has_all() -> None:
    features = Simulation(in_full(SCENES["third dimension, driven"])).model.features
    assert (features.dimension, features.current) == (3, PROFILE)
    assert features.bending
    assert features.damping
    assert features.point_drag


def test_needs_are_told_in_words() -> None:
    case = SCENES["third dimension, driven"]
    words = describe_needs(Simulation(case).model.features)
    assert words["third dimension"].startswith("skipped")
    assert words["current"].startswith("skipped")
    assert words["structural damping"] == "computed"
    assert describe_needs(Simulation(in_full(case)).model.features)["bending"] == "computed"


def test_motion_out_of_a_plane_is_not_planar() -> None:
    aside = driven([1.5, 0.0, 0.0], [[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 1e-6, 0.0]])
    assert Simulation(scene(b=aside, segments=4)).model.features.dimension == 3
