"""Every variable that a trajectory can hold.

Depends on: scene.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from cablesim.scene import Scene


@dataclass(frozen=True)
class Variable:
    """Dimensions, units and meaning of a variable, and whether a scene has it at all."""

    dimensions: tuple[str, ...]
    units: str
    long_name: str
    needed: Callable[[Scene], bool] = lambda scene: True


_NODE, _SEGMENT, _EVENT = ("time", "node"), ("time", "segment"), ("winch_event",)


def _has_winch(scene: Scene) -> bool:
    return scene.winch is not None


VARIABLES: dict[str, Variable] = {
    "position": Variable((*_NODE, "axis"), "m", "position of the nodes in the world frame, z up"),
    "velocity": Variable((*_NODE, "axis"), "m s-1", "velocity of the nodes in the world frame"),
    "acceleration": Variable((*_NODE, "axis"), "m s-2", "acceleration of the nodes in the world frame"),
    "tension": Variable(_SEGMENT, "N", "tangential internal force T_t"),
    "shear_normal": Variable(_SEGMENT, "N", "normal internal force T_n"),
    "shear_binormal": Variable(_SEGMENT, "N", "binormal internal force T_b"),
    "theta": Variable(_SEGMENT, "rad", "orientation angle theta of equation (8)"),
    "phi": Variable(_SEGMENT, "rad", "orientation angle phi of equation (8), unwrapped"),
    "velocity_tangential": Variable(_NODE, "m s-1", "tangential velocity V_t"),
    "velocity_normal": Variable(_NODE, "m s-1", "normal velocity V_n"),
    "velocity_binormal": Variable(_NODE, "m s-1", "binormal velocity V_b"),
    "end_force": Variable(("time", "end", "axis"), "N", "force of the cable on what holds its ends"),
    "end_tension": Variable(
        ("time", "end"), "N", "tangential internal force T_t of the end segments, at a winch in its outlet"
    ),
    "attachment_position": Variable(
        ("time", "attachment", "axis"),
        "m",
        "position of the attachments in the world frame",
        lambda scene: bool(scene.attachments),
    ),
    "marker_position": Variable(
        ("time", "marker", "axis"),
        "m",
        "position of the markers in the world frame",
        lambda scene: scene.output.markers.size > 0,
    ),
    "kinetic_energy": Variable(("time",), "J", "kinetic energy of cable, attachments and added mass"),
    "potential_energy": Variable(("time",), "J", "potential energy of the weight in water, nought at z = 0"),
    "elastic_energy": Variable(("time",), "J", "energy of stretching"),
    "bending_energy": Variable(("time",), "J", "energy of bending"),
    "deployed_length": Variable(("time",), "m", "unstretched length between end A and the winch", _has_winch),
    "payout_speed": Variable(("time",), "m s-1", "rate of the deployed length", _has_winch),
    "deployed_mass": Variable(("time",), "kg", "dry mass of cable and attachments that are out", _has_winch),
    "winch_event_time": Variable(_EVENT, "s", "time at which a node came out or went in", _has_winch),
    "winch_event_change": Variable(_EVENT, "1", "+1: a node came out, -1: it went on the drum", _has_winch),
    "winch_event_energy_change": Variable(_EVENT, "J", "change of kinetic energy", _has_winch),
    "winch_event_momentum_change": Variable(_EVENT, "kg m s-1", "size of the change of momentum", _has_winch),
    "closure_error": Variable(("time",), "m", "distance of the last node from the prescribed end B"),
}
"""Every variable that a trajectory can hold."""
