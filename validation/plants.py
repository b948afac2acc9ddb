"""Plants that are not what their estimators believe: the paper's scenes with other numbers and another mesh.

An estimator that is given the case with which a run was simulated is judged too well.  Here it always
believes the case of the gallery, while the plant has twice as fine a mesh and whatever is changed besides.
"""

from __future__ import annotations

from common import CASES  # isort: skip - sets the threads

from collections.abc import Mapping
from typing import Any

import cablesim

SEGMENT = 0.025  # of the plants; 0.05 in the gallery [m]

SEVERAL: Mapping[str, Any] = {"stiffness": 1.2, "lift": 0.95, "inwards": 0.01, "drag": 1.2}
"""Several things that are not as believed, all at once."""


def believed(scene: str) -> cablesim.Case:
    """The case of the gallery."""
    return cablesim.load_case(CASES / f"{scene}.yaml")


def plant(
    scene: str,
    *,
    stiffness: float = 1.0,
    lift: float = 1.0,
    inwards: float = 0.0,
    drag: float = 1.0,
    current: tuple[float, float, float] | None = None,
) -> cablesim.Case:
    """A scene of the gallery on a finer mesh and with other numbers.

    Parameters
    ----------
    scene : str
        Name of the case.
    stiffness, lift, drag : float
        Factors of EI, of the buoys' net lift, and of the drag of cable and bodies.
    inwards : float
        How much nearer to the ballast the buoys are, both of them [m].
    current : tuple of three floats, optional
        Velocity of the water [m/s].
    """
    data = believed(scene).model_dump(mode="json", exclude_none=True)
    data["mesh"]["segment_length"] = SEGMENT
    data["cable"]["bending_stiffness"] *= stiffness
    data["cable"]["drag_normal"] *= drag
    data["cable"]["drag_tangential"] *= drag
    if current is not None:
        data["water"]["current"] = {"kind": "uniform", "velocity": list(current)}
    for part in data["attachments"]:
        if part["kind"] != "imu":
            _change_body(part, data["water"]["density"], lift, inwards, drag)
    return cablesim.Case.from_dict(data, directory=CASES)


def _change_body(body: dict[str, Any], density: float, lift: float, inwards: float, drag: float) -> None:
    body["drag_area"] *= drag
    if body["kind"] == "buoy":
        body["volume"] = (body["mass"] + lift * (density * body["volume"] - body["mass"])) / density
        body["at"] += inwards if body["name"] == "buoy_a" else -inwards
