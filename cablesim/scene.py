"""Plain frozen data that the physics needs, in SI units; made from a case.

Depends on: motion.

A scene holds no behaviour beyond a few derived numbers.  z is up, `s` is the
unstretched material coordinate measured from end A, angles are in radians.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cablesim.motion import Motion

Vector = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Cable:
    """A homogeneous cable (paper, Section III-A).

    Attributes
    ----------
    length : float
        Unstretched length [m]; with a winch of the whole cable, drum included.
    diameter : float
        Outer diameter on which drag acts [m].
    mass_per_length : float
        Dry mass per unstretched metre [kg/m].
    displaced_section : float
        Displaced volume per unstretched metre [m2]; carries buoyancy.
    added_mass_section : float
        Section on which the added mass is counted [m2].
    wet_weight : float
        Weight in water per unstretched metre [N/m], positive when the cable sinks.
    axial_stiffness, bending_stiffness : float
        EA [N] and EI [N m2].
    drag_normal, drag_tangential : float
        Coefficients on d and on pi d (convention of MoorDyn and WHOI Cable).
    added_mass_normal, added_mass_tangential : float
        Added mass over the mass of water in that section, normal to and along the cable.
    structural_damping : float
        Kelvin-Voigt time tau of T + tau dT/dt [s].
    minimum_bend_radius, breaking_load : float or None
        Radius [m] and tension [N] beyond which a run warns.
    """

    length: float
    diameter: float
    mass_per_length: float
    displaced_section: float
    added_mass_section: float
    wet_weight: float
    axial_stiffness: float
    bending_stiffness: float
    drag_normal: float
    drag_tangential: float
    added_mass_normal: float
    added_mass_tangential: float
    structural_damping: float
    minimum_bend_radius: float | None = None
    breaking_load: float | None = None

    def __post_init__(self) -> None:
        for name in ("length", "mass_per_length", "axial_stiffness"):
            value = getattr(self, name)
            if not 0.0 < value < math.inf:
                raise ValueError(f"Cable: {name} is {value!r}; give a positive finite number.")


@dataclass(frozen=True, kw_only=True)
class Attachment:
    """A point body fixed to the cable: buoy, ballast or any other body.

    Attributes
    ----------
    name, kind : str
        Label, and one of ``buoy``, ``ballast``, ``body``.
    position : float
        Material coordinate s [m].
    mass, volume : float
        Dry mass [kg] and displaced volume [m3].
    drag_area : float
        Drag coefficient times area, CdA [m2].
    added_mass : float
        Added mass per displaced mass [-].
    """

    name: str
    kind: str
    position: float
    mass: float
    volume: float
    drag_area: float
    added_mass: float


@dataclass(frozen=True, kw_only=True)
class Imu:
    """A massless inertial sensor on the cable.

    Attributes
    ----------
    name : str
        Label.
    position : float
        Material coordinate s [m].
    mounting : ndarray, shape (4,)
        Rotation that turns the cable's local frame into the sensor's, quaternion with the scalar last.
    """

    name: str
    position: float
    mounting: Vector


@dataclass(frozen=True, kw_only=True)
class StillWater:
    """Water at rest."""


@dataclass(frozen=True, kw_only=True)
class UniformCurrent:
    """The same water velocity everywhere [m/s], shape (3,)."""

    velocity: Vector


@dataclass(frozen=True, kw_only=True)
class ProfileCurrent:
    """Water velocity against height.

    Attributes
    ----------
    heights : ndarray, shape (m,)
        World z, strictly increasing [m]; the end values hold outside.
    velocities : ndarray, shape (m, 3)
        Water velocity at each height [m/s].
    """

    heights: Vector
    velocities: Vector


@dataclass(frozen=True, kw_only=True)
class GriddedCurrent:
    """Water velocity on a rectangular grid, linear in between, end values outside.

    Attributes
    ----------
    times, x, y, z : ndarray
        Strictly increasing grid coordinates [s, m, m, m]; length 1 means constant along it.
    velocities : ndarray, shape (len(times), len(x), len(y), len(z), 3)
        Water velocity [m/s].
    """

    times: Vector
    x: Vector
    y: Vector
    z: Vector
    velocities: Vector


Current = StillWater | UniformCurrent | ProfileCurrent | GriddedCurrent


@dataclass(frozen=True, kw_only=True)
class Water:
    """Density [kg/m3] (0 means vacuum), current, and height of the surface [m] if it is known."""

    density: float
    current: Current = StillWater()
    surface: float | None = None


@dataclass(frozen=True, kw_only=True)
class End:
    """One end of the cable.

    Attributes
    ----------
    motion : Motion or None
        Prescribed motion; ``None`` leaves the end free.
    clamp : ndarray of shape (3,) or None
        Unit tangent (pointing from A to B) that the end imposes on a cable that
        bends; ``None`` is a ball joint.
    """

    motion: Motion | None
    clamp: Vector | None = None


@dataclass(frozen=True, kw_only=True)
class Control:
    """A controller of the winch and how often it is asked.

    Attributes
    ----------
    period : float
        Sampling period [s].
    delay : float
        Age of the measurements that the controller is given [s].
    make : callable
        Makes a fresh controller for a run: a callable from `cablesim.control.Measurement` to the
        payout speed that it asks for [m/s].
    """

    period: float
    delay: float
    make: Callable[[], Any]


@dataclass(frozen=True, kw_only=True)
class Winch:
    """A winch at end B: the cable beyond the deployed length is on its drum.

    Attributes
    ----------
    deployed_length : float
        Unstretched length between A and B at t = 0 [m].
    payout : Motion or Control
        The deployed length as a function of time, a `Motion` of one component that starts with
        `deployed_length`; or a controller that asks for payout speeds.
    maximum_speed, maximum_acceleration : float
        What the winch can do [m/s], [m/s2]; a controller gets no more, a program may not ask for more.
    minimum_length : float
        The run stops when the deployed length falls to this [m].
    """

    deployed_length: float
    payout: Motion | Control
    maximum_speed: float = math.inf
    maximum_acceleration: float = math.inf
    minimum_length: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Refinement:
    """Segments no longer than `segment_length` for |s - position| <= `within` [m]."""

    position: float
    within: float
    segment_length: float


@dataclass(frozen=True, kw_only=True)
class MeshRules:
    """Target segment length [m] and local refinements."""

    segment_length: float
    refinements: tuple[Refinement, ...] = ()


@dataclass(frozen=True, kw_only=True)
class StartVelocity:
    """Velocity of the cable at t = 0, linear between places on it, end values beyond.

    Attributes
    ----------
    arc : ndarray, shape (m,)
        Material coordinates, strictly increasing [m].
    velocities : ndarray, shape (m, 3)
        World velocities there [m/s].
    """

    arc: Vector
    velocities: Vector

    def at(self, arc: Vector) -> Vector:
        """World velocities (n, 3) at material coordinates (n,) [m/s]."""
        return np.stack([np.interp(arc, self.arc, column) for column in self.velocities.T], axis=1)


@dataclass(frozen=True, kw_only=True)
class StartShape:
    """What all shapes at t = 0 have in common.

    Attributes
    ----------
    velocity : StartVelocity or None
        How the cable moves; ``None``: at rest between its ends, or linearly from the velocity of one held
        end to that of the other.
    """

    velocity: StartVelocity | None = None

    @property
    def polyline(self) -> Vector | None:
        """World points (m, 3) from A to B through which the case says that the cable goes [m]."""
        return None


@dataclass(frozen=True, kw_only=True)
class EquilibriumShape(StartShape):
    """Rest shape of the scene at t = 0.

    `guess` is an optional polyline of world points (m, 3) from A to B from which the search starts.
    """

    guess: Vector | None = None

    @property
    def polyline(self) -> Vector | None:
        """The guess."""
        return self.guess


@dataclass(frozen=True, kw_only=True)
class TautShape(StartShape):
    """Straight cable.

    Attributes
    ----------
    direction : ndarray of shape (3,) or None
        Unit vector from A to B; needed only when an end is free.
    places : ndarray of shape (2, 3) or None
        Where the ends are when neither is held [m].
    stretched : bool
        Whether the cable holds the tension that its ends, loads and motion ask for, or none.
    """

    direction: Vector | None = None
    places: Vector | None = None
    stretched: bool = True

    @property
    def polyline(self) -> Vector | None:
        """The places of the ends when neither is held."""
        return self.places


@dataclass(frozen=True, kw_only=True)
class CatenaryShape(StartShape):
    """Elastic catenary between the two ends, attachments and bending left out."""


@dataclass(frozen=True, kw_only=True)
class MarkerShape(StartShape):
    """Shape interpolated through measured markers (paper, Section III-B).

    Attributes
    ----------
    arc : ndarray, shape (m,)
        Material coordinate of each marker, strictly increasing [m].
    positions : ndarray, shape (m, 3)
        World positions [m].
    """

    arc: Vector
    positions: Vector

    @property
    def polyline(self) -> Vector | None:
        """The markers."""
        return self.positions


@dataclass(frozen=True, kw_only=True)
class SavedState:
    """State of an earlier run.

    Attributes
    ----------
    arc : ndarray, shape (m+1,)
        Material coordinates of its nodes [m].
    positions, velocities : ndarray, shape (m+1, 3)
        World positions [m] and velocities [m/s] of its nodes.
    tension : ndarray, shape (m,)
        Axial force of its segments, damping part included [N].
    """

    arc: Vector
    positions: Vector
    velocities: Vector
    tension: Vector


GivenShape = EquilibriumShape | TautShape | CatenaryShape | MarkerShape
InitialShape = GivenShape | SavedState


@dataclass(frozen=True, kw_only=True)
class Numerics:
    """What the integrator is told.

    Attributes
    ----------
    relative_tolerance : float
        rtol of IDA; the absolute tolerances follow from it and the scales of the scene.
    max_order : int
        Highest order of the backward differentiation formulas, 1 to 5.
    max_step : float or None
        Longest step [s].
    max_steps : int
        Give up after so many steps between two outputs.
    time_limit : float or None
        Wall-clock seconds after which the run stops and keeps what it has.
    linear_solver : str
        ``auto``, ``band`` or ``krylov``.
    strain_feedback, closure_feedback : float
        beta and kappa [1/s] of the tension row and of the end rows.
    mesh_damping : float
        Least damping of the shortest axial wave that the mesh holds, over its critical damping.
    skip : bool
        Compile for what the scene needs (True), or the full three-dimensional kernel.
    """

    relative_tolerance: float = 5e-6
    max_order: int = 2
    max_step: float | None = None
    max_steps: int = 1_000_000
    time_limit: float | None = None
    linear_solver: str = "auto"
    strain_feedback: float = 10.0
    closure_feedback: float = 20.0
    mesh_damping: float = 0.2
    skip: bool = True


@dataclass(frozen=True, kw_only=True)
class Output:
    """What is kept of a run.

    Attributes
    ----------
    interval : float
        Time between two kept states [s].
    variables : tuple of str
        Their names; empty: all.
    markers : ndarray, shape (m,)
        Material coordinates whose positions are kept [m].
    precision : {'double', 'single'}
        Of the numbers.
    attributes : dict
        Global attributes of the file that the user gives.
    """

    interval: float
    variables: tuple[str, ...] = ()
    markers: Vector = field(default_factory=lambda: np.empty(0))
    precision: str = "double"
    attributes: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Everything one simulation needs.

    `gravity` [m/s2] acts along -z; `description` says what the case shows and `source` is the case as
    text, both kept with the results; `warnings` says in sentences what is odd about it; `winch` is
    ``None`` for a cable of fixed length.
    """

    name: str
    gravity: float
    water: Water
    cable: Cable
    mesh: MeshRules
    attachments: tuple[Attachment, ...]
    imus: tuple[Imu, ...]
    end_a: End
    end_b: End
    initial: InitialShape
    duration: float
    numerics: Numerics
    output: Output
    description: str = ""
    source: str = ""
    warnings: tuple[str, ...] = ()
    winch: Winch | None = None

    @property
    def start_length(self) -> float:
        """Unstretched length between A and B at t = 0 [m]."""
        return self.cable.length if self.winch is None else self.winch.deployed_length

    @property
    def damping_time(self) -> float:
        """Kelvin-Voigt time tau of the equations [s]: the cable's, or what waves of the mesh's size need.

        Axial waves of two segments have the frequency 2 c/l, c = sqrt(EA/m), and tau damps them by c tau/l
        of critical; the slowest wave of n segments has pi/(2 n) of that.
        """
        wave_speed = math.sqrt(self.cable.axial_stiffness / self.cable.mass_per_length)
        of_mesh = self.numerics.mesh_damping * self.mesh.segment_length / wave_speed
        return max(self.cable.structural_damping, of_mesh)
