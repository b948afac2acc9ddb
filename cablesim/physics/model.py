"""The compiled equations of one scene on one mesh: `residual` and `jacobian`, and nothing of an integrator.

Depends on: scene, mesh, physics.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cablesim.mesh import Mesh
from cablesim.motion import FOREVER, Motion
from cablesim.physics.equations import Equations, compile_equations, end_motion
from cablesim.physics.layout import StateLayout
from cablesim.physics.needs import Frame, scene_features
from cablesim.physics.parameters import (
    ADDED_NORMAL,
    ADDED_TANGENTIAL,
    DRAG_NORMAL,
    DRAG_POINT,
    DRAG_TANGENTIAL,
    EA_,
    FLUID_MASS,
    MASS,
    WET_WEIGHT,
    WINCH_START_,
    Features,
    Parameters,
    pack,
)
from cablesim.scene import (
    Attachment,
    End,
    GriddedCurrent,
    ProfileCurrent,
    Scene,
    UniformCurrent,
)

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class CableModel:
    """Residual and Jacobian of one scene, in the coordinates of its frame.

    Attributes
    ----------
    layout : StateLayout
        Where the unknowns stand.
    features : Features
        What the equations were compiled for.
    frame : Frame
        Coordinates of the solution.
    parameters : Parameters
        Arrays read by the equations; writing to them changes the equations.
    """

    layout: StateLayout
    features: Features
    frame: Frame
    parameters: Parameters
    _buffer: Array
    _equations: Equations

    @property
    def bandwidths(self) -> tuple[int, int]:
        """Lower and upper half-bandwidth of the Jacobian."""
        return self.layout.bandwidths(bending=self.features.bending)

    @property
    def bytes(self) -> int:
        """Memory of the arrays."""
        return self._buffer.nbytes

    @property
    def algebraic_rows(self) -> NDArray[np.int64]:
        """Rows without any Y': the prescribed velocities of the ends."""
        d, last = self.layout.dimension, self.layout.segments * self.layout.cell
        rows = [] if self.features.free_a else [np.arange(d)]
        rows += [] if self.features.free_b else [np.arange(last, last + d)]
        return np.concatenate([np.empty(0, dtype=np.int64), *rows])

    def with_parameters(self, parameters: Parameters) -> CableModel:
        """The same equations with other numbers (a copy)."""
        buffer, views = pack(parameters)
        return CableModel(self.layout, self.features, self.frame, views, buffer, self._equations)

    def __reduce__(self) -> tuple[Any, ...]:
        # views that are copied one by one would no longer be those of the buffer
        return _unpickled, (self.layout, self.features, self.frame, self.parameters)

    def residual(self, t: float, y: Array, yp: Array, out: Array) -> None:
        """Write F(t, Y, Y') to `out`, shape (size,)."""
        self._equations.residual(t, y, yp, 0.0, out, 0, 0, 0, self._buffer)

    def jacobian(self, t: float, y: Array, yp: Array, c_j: float, out: Array) -> None:
        """Write the band of dF/dY + c_j dF/dY' to the full matrix `out`, shape (size, size)."""
        self._equations.jacobian(t, y, yp, c_j, out.reshape(-1), 0, y.size, 1, self._buffer)

    def band_jacobian(self, t: float, y: Array, yp: Array, c_j: float, rows_above: int = 0) -> Array:
        """dF/dY + c_j dF/dY' in LAPACK band storage, shape (rows_above + lower + upper + 1, size).

        `rows_above` leaves room for the fill of a factorisation.  Columns are contiguous, as LAPACK
        has them.
        """
        lower, upper = self.bandwidths
        rows = rows_above + lower + upper + 1
        columns = np.zeros((y.size, rows))
        base = rows_above + upper
        self._equations.jacobian(t, y, yp, c_j, columns.reshape(-1), base, 1, rows - 1, self._buffer)
        return columns.T

    def impose_end_velocities(self, t: float, y: Array) -> None:
        """Set the velocities of prescribed ends in `y` to what their rows ask for at `t`."""
        out = np.empty_like(y)
        self.residual(t, y, np.zeros_like(y), out)
        y[self.algebraic_rows] -= out[self.algebraic_rows]

    def consistent_rates(self, t: float, y: Array) -> Array:
        """Y' that fulfils F(t, Y, Y') = 0 for a given Y.

        F is affine in Y', and triangular: the rates of chords, tensions and of the place of end B
        stand alone in their rows; with them the balance of forces gives the accelerations, node by
        node.  The velocities of prescribed ends have no rate in F; they get the ends' accelerations,
        which helps the first predictor.

        Parameters
        ----------
        t : float
            Time [s].
        y : ndarray, shape (size,)
            State.

        Returns
        -------
        ndarray, shape (size,)
            Rates.
        """
        layout, rates, out = self.layout, np.zeros_like(y), np.empty_like(y)
        self.residual(t, y, rates, out)
        layout.tension(rates)[:] = -self.parameters.constants[EA_] * layout.tension(out)
        layout.chord(rates)[:] = -layout.chord(out)
        layout.end_place(rates)[:] = -layout.end_place(out)
        if self.features.damping:  # then the rates of the tensions pull, too
            self.residual(t, y, rates, out)
        acceleration = -self.accelerations(t, y, layout.node_velocity(out))
        layout.velocity(rates)[:] = acceleration[:-1]
        layout.end_velocity(rates)[:] = acceleration[-1]
        rates[self.algebraic_rows] = self._end_accelerations(t)
        return rates

    def lengths(self, t: float) -> Array:
        """Unstretched lengths of the segments at one time, shape (n,) [m]."""
        lengths = self.parameters.lengths.copy()
        if self.features.winch:
            lengths[-1] = self.deployed_length(t)[0] - self.parameters.constants[WINCH_START_]
        return lengths

    def unstretched(self, t: float) -> Array:
        """Size |q| of unstretched segments, shape (n,): 1, but for the segment of a winch."""
        return self.lengths(t) / self.parameters.lengths

    def loads(self, t: float) -> Array:
        """Half of both segments beside each node and the bodies on it, shape (n+1, 8).

        Columns as in `physics.parameters`.
        """
        halves = np.pad(0.5 * self.lengths(t), 1)
        return np.outer(halves[1:] + halves[:-1], self.parameters.cable) + self.parameters.bodies

    def mass_matrices(self, t: float, y: Array) -> Array:
        """Mass with added mass of each node, shape (n+1, D, D) [kg].

        The added mass of half a segment is less along that segment than across it.
        """
        loads, cable = self.loads(t), self.parameters.cable
        chord = self.layout.chord(y)
        softer = 0.5 * (cable[ADDED_NORMAL] - cable[ADDED_TANGENTIAL]) * self.lengths(t)
        softer /= np.einsum("ec,ec->e", chord, chord)
        along = np.pad(np.einsum("e,ec,ed->ecd", softer, chord, chord), ((1, 1), (0, 0), (0, 0)))
        across = (loads[:, MASS] + loads[:, ADDED_NORMAL])[:, None, None] * np.eye(self.layout.dimension)
        return across - along[1:] - along[:-1]

    def accelerations(self, t: float, y: Array, forces: Array, nodes: slice = slice(None)) -> Array:
        """What forces (k, D) [N] on these nodes give to their mass and added mass, were they free [m/s2]."""
        solved = np.linalg.solve(self.mass_matrices(t, y)[nodes], forces[..., None])
        return np.asarray(solved[..., 0], dtype=float)

    def deployed_length(self, t: float) -> tuple[float, float]:
        """Deployed length L [m] and payout speed L' [m/s] of a winch at one time."""
        length, speed = np.empty(1), np.empty(1)
        end_motion(self.parameters.winch_breaks, self.parameters.winch_coefficients, t, length, speed)
        return float(length[0]), float(speed[0])

    def deployed_motion(self, t: float) -> tuple[float, float, float]:
        """Deployed length [m], payout speed [m/s] and its rate [m/s2] at one time."""
        parameters = self.parameters
        rate = _second_derivative(parameters.winch_breaks, parameters.winch_coefficients, t)
        return *self.deployed_length(t), float(rate[0])

    def kinetic_energy_and_momentum(self, t: float, y: Array, at_winch: Array) -> tuple[float, Array]:
        """Kinetic energy [J] and momentum (D,) [kg m/s] of the deployed cable, added mass included.

        Node n moves with `at_winch` (D,), the velocity of the material there.
        """
        velocity = self.layout.node_velocity(y)
        velocity[-1] = at_winch
        momentum = np.einsum("ncd,nd->nc", self.mass_matrices(t, y), velocity)
        return 0.5 * float(np.sum(momentum * velocity)), momentum.sum(axis=0)

    def end_place_and_velocity(self, name: str, t: float) -> tuple[Array, Array]:
        """Place and velocity, each (D,), that the equations give to prescribed end ``a`` or ``b``."""
        place, velocity = np.empty(self.layout.dimension), np.empty(self.layout.dimension)
        breaks = getattr(self.parameters, f"breaks_{name}")
        end_motion(breaks, getattr(self.parameters, f"coefficients_{name}"), t, place, velocity)
        return place, velocity

    def node_places(self, t: float, y: Array) -> Array:
        """Coordinates (n+1, D) of all nodes at one time."""
        chords = self.parameters.lengths[:, None] * self.layout.chord(y)
        from_a = np.concatenate((np.zeros((1, self.layout.dimension)), np.cumsum(chords, axis=0)))
        if self.features.free_a:
            return self.layout.end_place(y) + from_a - from_a[-1]
        return self.end_place_and_velocity("a", t)[0] + from_a

    def node_place_and_velocity(self, node: int, t: float, y: Array) -> tuple[Array, Array]:
        """Coordinates and velocity, each (D,), of one node at one time."""
        layout = self.layout
        lengths = self.parameters.lengths
        velocity = layout.end_velocity(y) if node == layout.segments else layout.velocity(y)[node]
        if self.features.free_a:
            return layout.end_place(y) - lengths[node:] @ layout.chord(y)[node:], velocity
        start = self.end_place_and_velocity("a", t)[0]
        return start + lengths[:node] @ layout.chord(y)[:node], velocity

    def _end_accelerations(self, t: float) -> Array:
        parameters = self.parameters
        ends = []
        if not self.features.free_a:
            ends.append(_second_derivative(parameters.breaks_a, parameters.coefficients_a, t))
        if not self.features.free_b:
            ends.append(_second_derivative(parameters.breaks_b, parameters.coefficients_b, t))
        return np.concatenate([np.empty(0), *ends])


def _unpickled(layout: StateLayout, features: Features, frame: Frame, parameters: Parameters) -> CableModel:
    buffer, views = pack(parameters)
    return CableModel(layout, features, frame, views, buffer, compile_equations(features))


def _second_derivative(breaks: Array, coefficients: Array, t: float) -> Array:
    piece = min(max(int(np.searchsorted(breaks, t, side="right")) - 1, 0), breaks.size - 2)
    dt = t - breaks[piece]
    powers = np.array([0.0, 0.0, 2.0, 6.0 * dt, 12.0 * dt**2, 20.0 * dt**3])
    return powers @ coefficients[piece]


def build_model(scene: Scene, mesh: Mesh, frame: Frame) -> CableModel:
    """Compile the equations of a scene and pack its numbers.

    Parameters
    ----------
    scene : Scene
        What is simulated.
    mesh : Mesh
        Its nodes.
    frame : Frame
        Coordinates of the solution, from `physics.needs.scene_frame`.

    Returns
    -------
    CableModel
        Equations ready to be integrated.
    """
    features = scene_features(scene, frame)
    numerics, cable = scene.numerics, scene.cable
    breaks_a, coefficients_a = _end_table(scene.end_a, frame)
    breaks_b, coefficients_b = _end_table(scene.end_b, frame)
    times, x, y, z, velocity = _current_table(scene, frame)
    winch_breaks, winch_coefficients = _winch_table(scene)
    parameters = Parameters(
        lengths=mesh.reference_lengths,
        cable=_per_metre(scene),
        bodies=_body_table(scene, mesh),
        constants=np.array(
            [
                cable.axial_stiffness,
                cable.bending_stiffness,
                scene.damping_time,
                numerics.strain_feedback,
                numerics.closure_feedback,
                mesh.nodes[-2],
            ]
        ),
        winch_breaks=winch_breaks,
        winch_coefficients=winch_coefficients,
        breaks_a=breaks_a,
        coefficients_a=coefficients_a,
        breaks_b=breaks_b,
        coefficients_b=coefficients_b,
        clamps=np.stack([_clamp(scene.end_a, frame), _clamp(scene.end_b, frame)]),
        current_times=times,
        current_x=x,
        current_y=y,
        current_z=z,
        current_velocity=velocity,
    )
    buffer, views = pack(parameters)
    layout = StateLayout(frame.dimension, mesh.segments)
    return CableModel(layout, features, frame, views, buffer, compile_equations(features))


def _per_metre(scene: Scene) -> Array:
    """What a metre of bare cable has, shape (8,)."""
    cable, density = scene.cable, scene.water.density
    around = density * cable.added_mass_section
    row = np.empty(8)
    row[MASS] = cable.mass_per_length
    row[ADDED_NORMAL] = cable.added_mass_normal * around
    row[ADDED_TANGENTIAL] = cable.added_mass_tangential * around
    row[WET_WEIGHT] = cable.wet_weight
    row[DRAG_NORMAL] = 0.5 * density * cable.drag_normal * cable.diameter
    row[DRAG_TANGENTIAL] = 0.5 * density * cable.drag_tangential * np.pi * cable.diameter
    row[DRAG_POINT] = 0.0
    row[FLUID_MASS] = density * cable.displaced_section
    return row


def _per_body(body: Attachment, scene: Scene) -> Array:
    """What an attachment has, shape (8,)."""
    displaced = scene.water.density * body.volume
    row = np.zeros(8)
    row[MASS] = body.mass
    row[ADDED_NORMAL] = row[ADDED_TANGENTIAL] = body.added_mass * displaced
    row[WET_WEIGHT] = (body.mass - displaced) * scene.gravity
    row[DRAG_POINT] = 0.5 * scene.water.density * body.drag_area
    row[FLUID_MASS] = displaced
    return row


def _body_table(scene: Scene, mesh: Mesh) -> Array:
    """What is attached to each node, shape (n+1, 8)."""
    table = np.zeros((mesh.segments + 1, 8))
    for attachment, node in mesh.in_water():
        table[node] += _per_body(scene.attachments[attachment], scene)
    return table


def _winch_table(scene: Scene) -> tuple[Array, Array]:
    """Breaks and coefficients of the deployed length."""
    program = scene.winch.payout if scene.winch is not None else None
    if isinstance(program, Motion):
        return program.breaks, program.coefficients
    coefficients = np.zeros((3, 6, 1))  # at rest; a controller's commands are written here
    coefficients[:, 0] = scene.start_length
    return np.array([0.0, 1.0, 2.0, FOREVER]), coefficients


def _end_table(end: End, frame: Frame) -> tuple[Array, Array]:
    """Breaks (m+1,) and coefficients (m, 6, D) of an end's motion in the frame."""
    if end.motion is None:
        return np.array([0.0, 1.0]), np.zeros((1, 6, frame.dimension))
    return motion_table(end.motion, frame)


def motion_table(motion: Motion, frame: Frame) -> tuple[Array, Array]:
    """Breaks (m+1,) and coefficients (m, 6, D) of a motion in a frame."""
    coefficients = frame.vectors_in(motion.coefficients)
    coefficients[:, 0] = frame.places_in(motion.coefficients[:, 0])
    return motion.breaks, np.ascontiguousarray(coefficients)


def _clamp(end: End, frame: Frame) -> Array:
    return np.zeros(frame.dimension) if end.clamp is None else frame.vectors_in(end.clamp)


def _current_table(scene: Scene, frame: Frame) -> tuple[Array, Array, Array, Array, Array]:
    """Grid axes and velocities (t, x, y, z, D) of the current; heights count from the frame's origin."""
    current, one = scene.water.current, np.zeros(1)
    if isinstance(current, GriddedCurrent):
        return current.times, current.x, current.y, current.z, frame.vectors_in(current.velocities)
    if isinstance(current, ProfileCurrent):
        velocity = frame.vectors_in(current.velocities)[None, None, None]
        return one, one, one, current.heights - frame.origin[2], velocity
    velocity = current.velocity if isinstance(current, UniformCurrent) else np.zeros(3)
    return one, one, one, one, frame.vectors_in(velocity)[None, None, None, None]
