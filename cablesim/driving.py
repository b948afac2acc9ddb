"""What is driven from outside: which inputs have left the case, and the ramp that each follows now.

Depends on: control, motion, physics, scene, winch.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cablesim.control.loop import limited_speed
from cablesim.motion import Motion
from cablesim.motion.drive import ramp
from cablesim.physics.model import CableModel
from cablesim.scene import Scene
from cablesim.winch import Limit

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Orders:
    """What a caller of `Simulation.step` wants; ``None`` leaves things as they are.

    Attributes
    ----------
    velocity_a, velocity_b : array_like of shape (3,) or None
        Velocities of the ends in the world frame at the end of the step [m/s].
    payout_speed : float or None
        The same for the winch [m/s].
    """

    velocity_a: ArrayLike | None = None
    velocity_b: ArrayLike | None = None
    payout_speed: float | None = None

    def any(self) -> bool:
        """Whether there is one."""
        return any(order is not None for order in (self.velocity_a, self.velocity_b, self.payout_speed))


@dataclass(frozen=True)
class Driven:
    """The inputs that have left the motions of the case.

    Attributes
    ----------
    a, b, winch : bool
        Whether the end, or the winch, has.
    until : float
        Time at which the present ramps end [s].
    payout_speed : float
        What the winch's ramp ends with [m/s].
    """

    a: bool = False
    b: bool = False
    winch: bool = False
    until: float = -math.inf
    payout_speed: float = 0.0

    def any(self) -> bool:
        """Whether there is one."""
        return self.a or self.b or self.winch

    def motions(self, scene: Scene) -> list[Motion]:
        """Motions of the case that are still followed."""
        program = None if scene.winch is None else scene.winch.payout
        inputs = ((scene.end_a.motion, self.a), (scene.end_b.motion, self.b), (program, self.winch))
        return [motion for motion, driven in inputs if isinstance(motion, Motion) and not driven]

    def follow(
        self, orders: Orders, scene: Scene, model: CableModel, limit: Limit | None, t: float, until: float
    ) -> tuple[Driven, dict[str, Array]]:
        """Take orders that are to be fulfilled between two times.

        Parameters
        ----------
        orders : Orders
            What is wanted.
        scene : Scene
            What is simulated.
        model : CableModel
            Its equations now.
        limit : Limit or None
            Where the winch can go no further: it is stopped there.
        t, until : float
            Now, and the end of the ramps [s].

        Returns
        -------
        Driven
            What is driven then.
        dict of ndarray
            Tables of the equations that change.

        Raises
        ------
        ValueError
            When an order cannot be fulfilled by this scene.
        """
        tables: dict[str, Array] = {}
        after = replace(self, until=until)
        if orders.velocity_a is not None or self.a:
            tables |= _end_ramp("a", orders.velocity_a, scene, model, t, until)
            after = replace(after, a=True)
        if orders.velocity_b is not None or self.b:
            tables |= _end_ramp("b", orders.velocity_b, scene, model, t, until)
            after = replace(after, b=True)
        if orders.payout_speed is not None or self.winch:
            kept = self.payout_speed if self.winch else None
            speed, ramps = _payout_ramp(orders.payout_speed, kept, scene, model, limit, t, until)
            tables |= ramps
            after = replace(after, winch=True, payout_speed=speed)
        return after, tables


def _end_ramp(
    name: str, order: ArrayLike | None, scene: Scene, model: CableModel, t: float, until: float
) -> dict[str, Array]:
    """Tables of an end that goes evenly to the velocity ordered."""
    if (scene.end_a if name == "a" else scene.end_b).motion is None:
        raise ValueError(f"step: velocity_{name} drives a free end; give it a motion in the case.")
    place, now = model.end_place_and_velocity(name, t)
    then = now if order is None else _velocity_in_frame(name, order, model)
    breaks, coefficients = ramp(t, until, place, now, then)
    return {f"breaks_{name}": breaks, f"coefficients_{name}": coefficients}


def _velocity_in_frame(name: str, order: ArrayLike, model: CableModel) -> Array:
    world = np.asarray(order)
    if world.shape == (3,) and world.dtype.kind in "iuf" and np.isfinite(world).all() and not _masked(order):
        velocity = model.frame.vectors_in(world)
        if np.allclose(model.frame.vectors_out(velocity), world, rtol=0.0, atol=1e-9):
            return velocity
    raise ValueError(
        f"step: velocity_{name} is {order!r}; give three finite numbers, and set simulation.skip to "
        "false in the case when the motion leaves the plane in which the scene began."
    )


def is_number(value: object) -> bool:
    """Whether something is one real number: no truth value, text or array of several."""
    array = np.asarray(value)
    return array.size == 1 and array.dtype.kind in "iuf" and not _masked(value)


def _masked(value: object) -> bool:
    return bool(np.ma.is_masked(value))


def _payout_ramp(
    order: float | None,
    kept: float | None,
    scene: Scene,
    model: CableModel,
    limit: Limit | None,
    t: float,
    until: float,
) -> tuple[float, dict[str, Array]]:
    """Payout speed at the end, and tables of a deployed length whose rate goes there evenly."""
    if scene.winch is None:
        raise ValueError("step: payout_speed drives a cable of fixed length; give the case a winch.")
    length, now = model.deployed_length(t)
    if order is not None and not is_number(order):
        raise ValueError(f"step: payout_speed is {order!r}; give a finite number [m/s].")
    asked = (now if kept is None else kept) if order is None else float(order)
    if not math.isfinite(asked):
        raise ValueError(f"step: payout_speed is {order!r}; give a finite number [m/s].")
    if limit is not None and limit.forbids(now):
        now = 0.0
    speed = limited_speed(asked, now, until - t, scene.winch)
    breaks, coefficients = ramp(t, until, np.array([length]), np.array([now]), np.array([speed]))
    return speed, {"winch_breaks": breaks, "winch_coefficients": coefficients}
