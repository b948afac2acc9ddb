"""Rest shapes and other initial states, consistent with the discrete equations.

Depends on: scene, mesh, physics.

A ladder, and the report says which rung was used: straight, arc or elastic catenary give a first
shape; Newton on the static residual follows it to the full load; dynamic relaxation is last.

Newton and relaxation are one thing here.  A step of the implicit Euler method of length h on the
equations of motion, with the velocities set back to nought before it, is Newton's method on the
static residual when h is long, and a heavily damped motion downhill when h is short.  It needs no
equations of its own, and closure and compatibility, which are linear, hold at every iterate.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator
from scipy.linalg import LinAlgError, solve_banded, solveh_banded
from scipy.optimize import brentq, root

from cablesim.mesh import Mesh
from cablesim.motion import FOREVER
from cablesim.physics.model import CableModel, build_model
from cablesim.physics.needs import scene_frame
from cablesim.physics.parameters import (
    DRAG_NORMAL,
    DRAG_POINT,
    DRAG_TANGENTIAL,
    EA_,
    EI_,
    WET_WEIGHT,
)
from cablesim.scene import (
    EquilibriumShape,
    MarkerShape,
    SavedState,
    Scene,
    TautShape,
)

Array = NDArray[np.float64]

NEWTON_ITERATIONS = 30
LONGEST_TURN = 0.5  # largest change of a segment vector in one Newton iteration
STATIC_STEP = 1e6  # [s] implicit Euler step that makes inertia vanish
FIRST_STEP, LAST_STEP = 1e-2, 1e5  # [s] of relaxation
RELAXATION_STEPS = 400
CLOSING_ITERATIONS = 200
COLLINEAR, BOW = 1e-4, 0.1  # spread off one line below which a cable gets a bow, and its angle
LONGEST_RELAXATION = 1.0  # a longer step swings joints that are folded over, to and fro for ever
SMALLEST_LOAD_STEP = 1.0 / 64.0
REST_TOLERANCE = 1e-9  # unbalanced force on a node at rest, over the scene's largest force


class Rung(StrEnum):
    """Which step of the ladder gave the initial state."""

    TAUT = "taut"
    CATENARY = "catenary"
    NEWTON = "newton"
    RELAXATION = "relaxation"
    MARKERS = "markers"
    SAVED = "saved state"


class StaticsError(RuntimeError):
    """No rest shape was found; the message says how far the search came and what to try."""


@dataclass(frozen=True)
class InitialState:
    """A state that fulfils the discrete equations at t = 0.

    Attributes
    ----------
    model : CableModel
        The equations it belongs to.
    y : ndarray, shape (size,)
        State.
    rung : Rung
        How it was found.
    residual : float
        Largest unbalanced force on a node, were the cable held at rest [N].
    iterations : int
        Newton iterations spent.
    """

    model: CableModel
    y: Array
    rung: Rung
    residual: float
    iterations: int

    @property
    def message(self) -> str:
        """One sentence on how the state was found."""
        return (
            f"initial shape by {self.rung.value}: {self.iterations} Newton iterations, "
            f"largest unbalanced force {self.residual:.2g} N"
        )


@dataclass(frozen=True)
class Guess:
    """First shape: unit directions (n, 3) from A to B, tensions (n,) and the rung it stands for."""

    directions: Array
    tension: Array
    rung: Rung


def find_initial_state(scene: Scene, mesh: Mesh) -> InitialState:
    """Initial state of a scene, as its `initial` shape asks.

    Parameters
    ----------
    scene : Scene
        What is simulated.
    mesh : Mesh
        Its nodes.

    Returns
    -------
    InitialState
        State, model and how it was found.

    Raises
    ------
    StaticsError
        When no rest shape is found.
    """
    guess = _first_guess(scene, mesh)
    vectors = guess.directions
    if isinstance(scene.initial, SavedState):
        vectors = np.concatenate((vectors, scene.initial.velocities))
    model = build_model(scene, mesh, scene_frame(scene, vectors))
    if isinstance(scene.initial, SavedState):
        return _resumed(scene.initial, scene, mesh, model)
    y = _state_of(guess, model, scene)
    if isinstance(scene.initial, EquilibriumShape):
        return _Search(model, _frame_velocity(scene, model)).equilibrium(y, guess.rung)
    strain = np.zeros(mesh.segments)
    for _ in range(3):  # tensions stretch the segments, which turns them, which changes the tensions
        if _close(y, model, strain):
            break
        strain = _momentum_tension(y, model) / scene.cable.axial_stiffness
    else:
        _close(y, model, strain)
    _set_velocities(y, scene, model)
    search = _Search(model, np.zeros(model.layout.dimension))
    return InitialState(model, y, guess.rung, search.unbalanced_force(y), 0)


# First shapes ---------------------------------------------------------------------------------------


def _first_guess(scene: Scene, mesh: Mesh) -> Guess:
    shape = scene.initial
    if isinstance(shape, SavedState):
        return Guess(_saved_chords(shape, mesh.nodes), np.zeros(mesh.segments), Rung.SAVED)
    if isinstance(shape, MarkerShape):
        return Guess(
            marker_directions(shape.arc, shape.positions, mesh.nodes), np.zeros(mesh.segments), Rung.MARKERS
        )
    if isinstance(shape, EquilibriumShape) and shape.guess is not None:
        arc = np.concatenate(([0.0], np.cumsum(np.linalg.norm(np.diff(shape.guess, axis=0), axis=1))))
        arc *= scene.start_length / arc[-1]
        return Guess(marker_directions(arc, shape.guess, mesh.nodes), np.zeros(mesh.segments), Rung.MARKERS)
    if isinstance(shape, TautShape) and shape.direction is not None:
        return _straight(shape.direction, 0.0, mesh)
    if scene.end_a.motion is None or scene.end_b.motion is None:
        return _hanging(scene, mesh)
    return _between_ends(scene, mesh)


def _straight(direction: Array, tension: float, mesh: Mesh) -> Guess:
    return Guess(np.tile(direction, (mesh.segments, 1)), np.full(mesh.segments, tension), Rung.TAUT)


def _hanging(scene: Scene, mesh: Mesh) -> Guess:
    """Straight up or down from the held end, as the whole weight in water asks."""
    weight = _node_weights(scene, mesh)
    from_a = scene.end_b.motion is None
    sinks = weight.sum() >= 0.0
    beyond = np.cumsum(weight[::-1])[::-1][1:] if from_a else np.cumsum(weight)[:-1]
    direction = np.array([0.0, 0.0, -1.0 if sinks == from_a else 1.0])
    return Guess(np.tile(direction, (mesh.segments, 1)), beyond if sinks else -beyond, Rung.TAUT)


def _node_weights(scene: Scene, mesh: Mesh) -> Array:
    weight = scene.cable.wet_weight * mesh.node_lengths
    for index, node in mesh.in_water():
        attachment = scene.attachments[index]
        weight[node] += (attachment.mass - scene.water.density * attachment.volume) * scene.gravity
    return weight


def _between_ends(scene: Scene, mesh: Mesh) -> Guess:
    """Straight when the ends are as far apart as the cable is long, else a catenary or an arc."""
    assert scene.end_a.motion is not None
    assert scene.end_b.motion is not None
    cable = scene.cable
    span = scene.end_b.motion.position(0.0) - scene.end_a.motion.position(0.0)
    distance = float(np.linalg.norm(span))
    if distance >= scene.start_length:
        return _straight(span / distance, cable.axial_stiffness * (distance / scene.start_length - 1.0), mesh)
    middle = 0.5 * (mesh.nodes[1:] + mesh.nodes[:-1])
    weight = float(_node_weights(scene, mesh).sum()) / scene.start_length
    if (
        abs(cable.wet_weight) * scene.start_length > 1e-3 * abs(weight * scene.start_length)
        and cable.wet_weight != 0.0
    ):
        force = elastic_catenary(span, scene.start_length, cable.wet_weight, cable.axial_stiffness)
        pull = force[None, :] + np.outer(middle, [0.0, 0.0, cable.wet_weight])
        tension = np.linalg.norm(pull, axis=1)
        return Guess(pull / tension[:, None], tension, Rung.CATENARY)
    return Guess(
        _arc_directions(span, scene.start_length, middle, down=weight >= 0.0),
        np.zeros(mesh.segments),
        Rung.CATENARY,
    )


def elastic_catenary(span: Array, length: float, wet_weight: float, axial_stiffness: float) -> Array:
    """Force with which a hanging elastic cable is pulled at its lower-s end (Irvine, Cable Structures).

    Parameters
    ----------
    span : ndarray, shape (3,)
        From end A to end B [m].
    length : float
        Unstretched length [m].
    wet_weight : float
        Weight per unstretched metre [N/m], not nought; negative when the cable floats.
    axial_stiffness : float
        EA [N].

    Returns
    -------
    ndarray, shape (3,)
        The tension vector at end A, pointing into the cable; at s it is this plus (0, 0, wet_weight s) [N].
    """
    w = abs(wet_weight)
    up = np.sign(wet_weight)
    across, rise = float(np.hypot(span[0], span[1])), float(span[2]) * up
    heading = span[:2] / across if across > 0.0 else np.array([1.0, 0.0])
    across = max(across, 1e-9 * length)  # a cable folded on itself hangs from an all but vanishing pull

    def ends(horizontal: float, vertical: float) -> tuple[float, float]:
        top = vertical + w * length
        x = horizontal / w * (np.arcsinh(top / horizontal) - np.arcsinh(vertical / horizontal))
        z = (np.hypot(horizontal, top) - np.hypot(horizontal, vertical)) / w
        x += horizontal * length / axial_stiffness
        z += (vertical + 0.5 * w * length) * length / axial_stiffness
        return x, z

    def mismatch(unknown: Array) -> list[float]:
        x, z = ends(float(np.exp(unknown[0])), unknown[1] * w * length)
        return [(x - across) / length, (z - rise) / length]

    solution = root(mismatch, _catenary_start(across, rise, length, w, axial_stiffness), tol=1e-13)
    horizontal, vertical = float(np.exp(solution.x[0])), solution.x[1] * w * length
    return np.array([horizontal * heading[0], horizontal * heading[1], vertical * up])


def _catenary_start(
    across: float, rise: float, length: float, w: float, axial_stiffness: float
) -> list[float]:
    """Logarithm of the horizontal force, and vertical force at A over the weight, of a nearby cable."""
    chord = float(np.hypot(across, rise))
    if length > chord * (1.0 + 1e-6):
        # inextensible: sinh(u)/u = sqrt(L^2 - rise^2)/across
        ratio = np.sqrt(length**2 - rise**2) / across
        u = brentq(lambda u: np.log(np.sinh(u) / u) - np.log(ratio), 1e-9, 700.0)
        horizontal = w * across / (2.0 * u)
        vertical = 0.5 * w * (rise / np.tanh(u) - length)
    else:
        pull = max(axial_stiffness * (chord / length - 1.0), 0.1 * w * length)
        horizontal, vertical = pull * across / chord, pull * rise / chord - 0.5 * w * length
    return [float(np.log(horizontal)), float(vertical / (w * length))]


def _arc_directions(span: Array, length: float, arc: Array, *, down: bool) -> Array:
    """Directions (n, 3), at places `arc`, along a circular arc through both ends in a vertical plane."""
    distance = float(np.linalg.norm(span))
    along = span / distance if distance > 1e-9 * length else np.array([1.0, 0.0, 0.0])
    side = np.array([0.0, 0.0, -1.0 if down else 1.0])
    side -= (side @ along) * along
    if np.linalg.norm(side) < 1e-9:  # ends one above the other: sag to +x
        side = np.array([1.0, 0.0, 0.0])
    side /= np.linalg.norm(side)
    half = np.pi
    if distance > 1e-9 * length:
        half = brentq(lambda a: np.sin(a) / a - distance / length, 1e-9, np.pi)
    angle = half * (1.0 - 2.0 * arc / length)
    return np.outer(np.cos(angle), along) + np.outer(np.sin(angle), side)


def marker_directions(arc: Array, positions: Array, nodes: Array) -> Array:
    """Segment directions (n, 3) of a smooth curve through markers.

    Parameters
    ----------
    arc : ndarray, shape (m,)
        Material coordinate of each marker [m].
    positions : ndarray, shape (m, 3)
        World positions [m].
    nodes : ndarray, shape (n+1,)
        Material coordinates of the mesh [m].

    Returns
    -------
    ndarray, shape (n, 3)
        Unit vectors from A to B.  Shape-preserving cubics: markers with errors do not make loops.
    """
    chords = np.diff(PchipInterpolator(arc, positions, extrapolate=True)(nodes), axis=0)
    return chords / np.linalg.norm(chords, axis=1)[:, None]


def _saved_chords(saved: SavedState, nodes: Array) -> Array:
    """Chords (n, 3) of a saved cable on a mesh, as they are where the mesh is the same."""
    places = np.stack([np.interp(nodes, saved.arc, saved.positions[:, c]) for c in range(3)], axis=1)
    return np.diff(places, axis=0)


# States from shapes ---------------------------------------------------------------------------------


def _state_of(guess: Guess, model: CableModel, scene: Scene) -> Array:
    """State with the guess's directions and tensions, at rest."""
    layout = model.layout
    y = np.zeros(layout.size)
    strain = guess.tension / scene.cable.axial_stiffness
    layout.chord(y)[:] = (
        model.frame.vectors_in(guess.directions) * ((1.0 + strain) * model.unstretched(0.0))[:, None]
    )
    layout.tension(y)[:] = guess.tension
    if scene.end_a.motion is None:
        layout.end_place(y)[:] = _start_of_end_b(scene, model)
    else:
        layout.end_place(y)[:] = _sum_of_chords(y, model)
    return y


def _start_of_end_b(scene: Scene, model: CableModel) -> Array:
    if scene.end_b.motion is not None:
        return model.frame.places_in(scene.end_b.motion.position(0.0))
    shape = scene.initial
    polyline = shape.positions if isinstance(shape, MarkerShape) else getattr(shape, "guess", None)
    if polyline is None:
        raise StaticsError(
            "Both ends are free and nothing says where the cable is: give the shape by markers or a polyline."
        )
    return model.frame.places_in(polyline[-1])


def _sum_of_chords(y: Array, model: CableModel) -> Array:
    return model.parameters.lengths @ model.layout.chord(y)


def _close(y: Array, model: CableModel, strain: Array) -> bool:
    """Give the segments these strains and turn them a little, so that their chords reach from A to B exactly.

    Returns whether the ends are further apart than the cable so stretched is long: it is then taut,
    stretched evenly further, and holds the tension that goes with it.
    """
    features, layout = model.features, model.layout
    lengths = model.lengths(0.0) * (1.0 + strain)
    directions = layout.chord(y) / np.linalg.norm(layout.chord(y), axis=1)[:, None]
    taut = 1.0
    if not (features.free_a or features.free_b):
        target = model.end_place_and_velocity("b", 0.0)[0] - model.end_place_and_velocity("a", 0.0)[0]
        taut = max(1.0, float(np.linalg.norm(target)) / lengths.sum())
        directions = _turned(directions, lengths, target / taut)
    strain = taut * (1.0 + strain) - 1.0
    layout.chord(y)[:] = ((1.0 + strain) * model.unstretched(0.0))[:, None] * directions
    layout.tension(y)[:] = model.parameters.constants[0] * strain
    if not features.free_a:
        layout.end_place(y)[:] = _sum_of_chords(y, model)
    return taut > 1.0


def _turned(directions: Array, lengths: Array, target: Array) -> Array:
    """Directions near these with which segments of these lengths reach `target`, by least turning.

    Along the line of a cable folded on itself turning changes nothing to first order: such a cable gets a
    bow first.  Near that line Newton's step is far too long: without its limit the gap swings to and
    fro by metres (kinked or hanging cables, 9 of 400 random scenes).

    Raises
    ------
    StaticsError
        When the gap is not closed.
    """
    total, identity = lengths.sum(), np.eye(target.size)
    middle = (np.cumsum(lengths) - 0.5 * lengths) / total
    for _ in range(CLOSING_ITERATIONS):
        gap = target - lengths @ directions
        if np.linalg.norm(gap) < 1e-14 * total:
            return directions
        second_moment = (directions * lengths[:, None]).T @ directions
        spread, axes = np.linalg.eigh(second_moment / total)
        if spread[-1] > 1.0 - COLLINEAR:
            directions = directions + np.outer(BOW * np.cos(np.pi * middle), axes[:, 0])
        else:  # each segment may only turn, so invert sum l (1 - t t^T)
            turn = np.linalg.solve(total * identity - second_moment, gap)
            directions = directions + min(1.0, LONGEST_TURN / float(np.linalg.norm(turn))) * turn
        directions = directions / np.linalg.norm(directions, axis=1)[:, None]
    if np.linalg.norm(gap) < 1e-9 * total:
        return directions
    raise StaticsError(
        f"The first shape could not be closed: {np.linalg.norm(gap):.3g} m are missing between the ends. "
        "Start from 'equilibrium', or give markers nearer to a possible shape."
    )


def _momentum_tension(y: Array, model: CableModel) -> Array:
    """Tensions (n,) that fulfil the momentum rows best in the least-squares sense (paper, III-B).

    Weighted with the inverse of the mass this is Gauss' principle of least constraint: segments keep
    their lengths at the first instant, so that no axial wave starts.  Tri-diagonal.
    """
    layout = model.layout
    n = layout.segments
    trial = y.copy()
    layout.tension(trial)[:] = 0.0
    force = np.empty(layout.size)
    model.residual(0.0, trial, np.zeros(layout.size), force)
    chord = layout.chord(y)
    tangent = chord / np.linalg.norm(chord, axis=1)[:, None]
    free = np.ones(n + 1)
    free[0], free[n] = float(model.features.free_a), float(model.features.free_b)
    rows = np.concatenate((layout.velocity(force), layout.end_velocity(force)[None]))
    acceleration = -model.accelerations(0.0, y, rows) * free[:, None]
    right = free[1:, None] * model.accelerations(0.0, y, tangent, slice(1, None))
    left = free[:-1, None] * model.accelerations(0.0, y, tangent, slice(0, n))
    diagonal = np.sum(tangent * (left + right), axis=1)
    coupling = -np.sum(
        tangent[1:] * free[1:-1, None] * model.accelerations(0.0, y, tangent[:-1], slice(1, n)), axis=1
    )
    diagonal += 1e-12 * diagonal.max()
    band = np.stack((np.concatenate(([0.0], coupling)), diagonal))
    return solveh_banded(band, np.sum(tangent * np.diff(acceleration, axis=0), axis=1))


def _frame_velocity(scene: Scene, model: CableModel) -> Array:
    """Velocity (D,) with which the whole cable may move at rest relative to its ends."""
    velocities = [
        model.frame.vectors_in(end.motion.velocity(0.0))
        for end in (scene.end_a, scene.end_b)
        if end.motion is not None
    ]
    if velocities and np.ptp(np.stack(velocities), axis=0).max() < 1e-12:
        return velocities[0]
    return np.zeros(model.layout.dimension)


def _set_velocities(y: Array, scene: Scene, model: CableModel) -> None:
    """Velocities that vary linearly from one end to the other."""
    ends = [
        end.motion.velocity(0.0) if end.motion is not None else None for end in (scene.end_a, scene.end_b)
    ]
    first = ends[0] if ends[0] is not None else ends[1]
    last = ends[1] if ends[1] is not None else ends[0]
    if first is None or last is None:
        return
    layout = model.layout
    share = np.concatenate(([0.0], np.cumsum(model.lengths(0.0))))
    share /= share[-1]
    velocity = np.outer(1.0 - share, model.frame.vectors_in(first)) + np.outer(
        share, model.frame.vectors_in(last)
    )
    layout.velocity(y)[:] = velocity[:-1]
    layout.end_velocity(y)[:] = velocity[-1]
    model.impose_end_velocities(0.0, y)


def _resumed(saved: SavedState, scene: Scene, mesh: Mesh, model: CableModel) -> InitialState:
    """The state of an earlier run, on its own mesh exactly, on another by linear interpolation."""
    layout, frame, constants = model.layout, model.frame, model.parameters.constants
    y = np.zeros(layout.size)
    velocity = np.stack([np.interp(mesh.nodes, saved.arc, saved.velocities[:, c]) for c in range(3)], axis=1)
    layout.velocity(y)[:] = frame.vectors_in(velocity[:-1])
    layout.end_velocity(y)[:] = frame.vectors_in(velocity[-1])
    layout.chord(y)[:] = frame.vectors_in(_saved_chords(saved, mesh.nodes)) / mesh.reference_lengths[:, None]
    free_a = scene.end_a.motion is None
    layout.end_place(y)[:] = frame.places_in(saved.positions[-1]) if free_a else _sum_of_chords(y, model)
    middle, saved_middle = (0.5 * (nodes[1:] + nodes[:-1]) for nodes in (mesh.nodes, saved.arc))
    force = np.interp(middle, saved_middle, saved.tension)
    # force = T + tau T', and the tension row gives T' = EA (stretching/l + beta (strain - T/EA))
    size = np.linalg.norm(layout.chord(y), axis=1)
    change = np.diff(layout.node_velocity(y), axis=0)
    stretching = np.sum(change * layout.chord(y), axis=1) / (size * mesh.lengths)
    stiffness, tau, beta = constants[0], constants[2], constants[3]
    rate = stiffness * (stretching + beta * (size / model.unstretched(0.0) - 1.0))
    layout.tension(y)[:] = (force - tau * rate) / (1.0 - tau * beta)
    model.impose_end_velocities(0.0, y)
    search = _Search(model, np.zeros(layout.dimension))
    return InitialState(model, y, Rung.SAVED, search.unbalanced_force(y), 0)


# Equilibrium ----------------------------------------------------------------------------------------


class _Search:
    """Looks for rest: the model with its ends stopped, and counters for the report."""

    def __init__(self, model: CableModel, velocity: Array) -> None:
        self.moving = model
        self.model = model.with_parameters(_stopped(model, velocity))
        self.velocity = velocity
        self.iterations = 0

    def equilibrium(self, y: Array, rung: Rung) -> InitialState:
        """Climb the ladder from a first shape."""
        y = self._at_rest(y)
        if not self._many_rest_shapes():
            for climb in (self._newton, self._load_continuation):
                found = climb(y)
                if found is not None and self._balanced(found):
                    return self._report(found, rung if rung is Rung.TAUT else Rung.NEWTON)
        found = self._relaxation(y)
        if self._balanced(found):
            return self._report(found, Rung.RELAXATION)
        raise StaticsError(
            f"No rest shape was found: after {self.iterations} Newton iterations a force of "
            f"{self.unbalanced_force(found):.3g} N is left on a node, where the largest force is "
            f"{self._force_scale(found):.3g} N. "
            "Start from markers or a taut shape and let the dynamic simulation settle, or give "
            "'through' points near the rest shape."
        )

    def unbalanced_force(self, y: Array) -> float:
        """Largest force on a node of the cable held at rest [N]."""
        out = np.empty_like(y)
        self.model.residual(0.0, self._at_rest(y), np.zeros_like(y), out)
        rows = np.concatenate((self.model.layout.velocity(out), self.model.layout.end_velocity(out)[None]))
        held = [self.model.features.free_a, *[True] * (len(rows) - 2), self.model.features.free_b]
        return float(np.linalg.norm(rows[held], axis=1).max())

    def _many_rest_shapes(self) -> bool:
        """A slack cable that bends, or weighs nothing, has many rest shapes: go downhill to a stable one."""
        if self.model.features.bending:
            return True
        return float(np.abs(self.model.loads(0.0)[1:-1, WET_WEIGHT]).max()) == 0.0

    def _balanced(self, y: Array) -> bool:
        return bool(np.isfinite(y).all()) and self.unbalanced_force(y) <= REST_TOLERANCE * self._force_scale(
            y
        )

    def _force_scale(self, y: Array) -> float:
        """Largest of tensions, total weight and total drag [N]."""
        parameters, layout = self.model.parameters, self.model.layout
        loads = self.model.loads(0.0)
        weight = np.abs(loads[:, WET_WEIGHT]).sum()
        bending = parameters.constants[EI_] / self.model.lengths(0.0).sum() ** 2
        current = parameters.current_velocity
        drag = loads[:, [DRAG_NORMAL, DRAG_TANGENTIAL, DRAG_POINT]].sum() * float(
            (current**2).sum(axis=-1).max()
        )
        rounding = 1e-9 * parameters.constants[EA_]  # a slack cable without weight holds no force at all
        return max(weight, bending, drag, float(np.abs(layout.tension(y)).max()), rounding)

    def _report(self, y: Array, rung: Rung) -> InitialState:
        y = self._at_rest(y)
        self.model.layout.end_place(y)[:] += _closure_defect(y, self.model)
        self.moving.impose_end_velocities(0.0, y)  # ends that start with a jump leave the cable behind
        return InitialState(self.moving, y, rung, self.unbalanced_force(y), self.iterations)

    def _at_rest(self, y: Array) -> Array:
        y = y.copy()
        self.model.layout.velocity(y)[:] = self.velocity
        self.model.layout.end_velocity(y)[:] = self.velocity
        return y

    def _newton(self, y: Array) -> Array | None:
        """Two long steps: the second takes out what the first left of the closing of the cable."""
        first = self._step(y, STATIC_STEP, self.model)
        return None if first is None else self._step(first, STATIC_STEP, self.model)

    def _load_continuation(self, y: Array) -> Array | None:
        """From the bare cable in still water to the full loads, in steps that adapt."""
        load, step = 0.0, 0.25
        while load < 1.0:
            trial = min(1.0, load + step)
            found = self._step(y, STATIC_STEP, self.model.with_parameters(_loaded(self.model, trial)))
            if found is not None:
                y, load, step = found, trial, 2.0 * step
            else:
                step *= 0.5
                if step < SMALLEST_LOAD_STEP:
                    return None
        return self._step(y, STATIC_STEP, self.model)

    def _relaxation(self, y: Array) -> Array:
        """Steps that grow while Newton converges: first downhill, in the end Newton's method."""
        h = FIRST_STEP
        for _ in range(RELAXATION_STEPS):
            before = self.iterations
            found = self._step(y, h, self.model)
            if found is None or self._turn(y, found) > LONGEST_RELAXATION:
                h *= 0.25
                continue
            y = found
            if h >= LAST_STEP and self._balanced(y):
                break
            easy = self.iterations - before <= 8
            h = min(LAST_STEP, h * (3.0 if easy else 1.0))
        return y

    def _turn(self, y: Array, other: Array) -> float:
        return float(np.abs(self.model.layout.chord(other) - self.model.layout.chord(y)).max())

    def _step(self, y: Array, h: float, model: CableModel) -> Array | None:
        """One implicit Euler step of length h from rest; None when Newton does not converge."""
        start = self._at_rest(y)
        new = start.copy()
        out = np.empty_like(y)
        layout = model.layout
        scale = self._force_scale(y)
        for _ in range(NEWTON_ITERATIONS):
            self.iterations += 1
            rates = (new - start) / h
            if model.features.free_a:  # the place of end B is absolute then, and moves with the whole cable
                layout.end_place(rates)[:] += self.velocity
            model.residual(0.0, new, rates, out)
            try:
                change = solve_banded(
                    model.bandwidths, model.band_jacobian(0.0, new, rates, 1.0 / h), -out, check_finite=False
                )
            except LinAlgError:
                return None
            turn = float(np.abs(layout.chord(change)).max())
            if not np.isfinite(turn):
                return None
            new = new + min(1.0, LONGEST_TURN / max(turn, 1e-300)) * change
            if turn < 1e-11 and np.abs(layout.tension(change)).max() < 1e-9 * scale:
                return new
        return None


def _closure_defect(y: Array, model: CableModel) -> Array:
    """What is missing (rounding) between the integrated place of end B and the sum of the chords."""
    if model.features.free_a:
        return np.zeros(model.layout.dimension)
    return _sum_of_chords(y, model) - model.layout.end_place(y)


def _stopped(model: CableModel, velocity: Array):
    """Parameters with both ends in uniform motion through their places at t = 0, and the winch at rest."""
    changes = {}
    for end in ("a", "b"):
        coefficients = np.zeros((1, 6, model.layout.dimension))
        coefficients[0, 0] = model.end_place_and_velocity(end, 0.0)[0]
        coefficients[0, 1] = velocity
        changes[f"coefficients_{end}"] = coefficients
        changes[f"breaks_{end}"] = np.array([0.0, FOREVER])
    changes["winch_coefficients"] = np.zeros((1, 6, 1))
    changes["winch_coefficients"][0, 0] = model.deployed_length(0.0)[0]
    changes["winch_breaks"] = np.array([0.0, FOREVER])
    return model.parameters._replace(**changes)


def _loaded(model: CableModel, load: float):
    """Parameters with a share of the point loads and of the current; the bare cable at 0."""
    bodies = model.parameters.bodies.copy()
    bodies[:, [WET_WEIGHT, DRAG_POINT]] *= load
    return model.parameters._replace(bodies=bodies, current_velocity=load * model.parameters.current_velocity)
