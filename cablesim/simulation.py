"""Runs a case: the one place that knows scene, mesh, physics, integrator and trajectory.

Depends on: all of them.
"""

from __future__ import annotations

import copy
import hashlib
import logging
import math
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from cablesim.build import build_scene
from cablesim.case import Case
from cablesim.control import Measurement
from cablesim.control.deadline import OutOfTime
from cablesim.control.loop import ControllerRunError, ControlLoop
from cablesim.control.measurement import Places
from cablesim.driving import Driven, Orders, is_number
from cablesim.integrate import Advance, IdaIntegrator
from cablesim.integrate.ida import IdaOptions
from cablesim.integrate.protocol import Counters
from cablesim.mesh import Mesh, build_mesh
from cablesim.motion.drive import ramp
from cablesim.physics.model import CableModel, build_model
from cablesim.physics.scales import Scales, absolute_tolerances, scene_scales
from cablesim.physics.winch import material_velocity
from cablesim.plausibility import warnings_of
from cablesim.scene import Control, Scene, Winch
from cablesim.statics import InitialState, find_initial_state
from cablesim.status import WINCH_STOPS, Status
from cablesim.stops import SAME_TIME, Stop, Stops, same_time
from cablesim.trajectory.dataset import build_dataset
from cablesim.trajectory.history import History, WinchEvent
from cablesim.winch import Winding

Array = NDArray[np.float64]

log = logging.getLogger("cablesim")

START_CHANGE, RESTART_CHANGE = 0.5, 10.0
"""Change of the state in the first step, over its tolerance.

After a node has come or gone the motion goes on smoothly and its rates are known exactly, so that the
first step's error is of second order: at rtol 1e-5 the winch cycle takes 553 Jacobians instead of 815 with
1.0, and 470 with 20.0; the moonpool's tension is then 0.90 % of its range off instead of 0.80 %.
"""

KEPT_INTEGRATORS, KEPT_BYTES = 64, 100e6
"""Most solver objects kept for other numbers of segments, and most bytes of their full matrices."""


@dataclass(frozen=True)
class Progress:
    """How far a run is: simulated time and its end [s], solver calls so far, wall-clock seconds."""

    time: float
    duration: float
    residual_calls: int
    wall_seconds: float


@dataclass(frozen=True, eq=False)
class Snapshot:
    """All that is needed to go on from a moment, to the integrator's tolerance."""

    time: float
    y: Array
    yp: Array
    model: CableModel
    driven: Driven
    loop: ControlLoop | None
    scene: str


@dataclass(frozen=True)
class Observation:
    """The cable at one moment, in the world frame.

    Attributes
    ----------
    time : float
        [s].
    status : Status
        ``completed`` when the step reached its end.
    position, velocity : ndarray, shape (n+1, 3)
        Nodes [m], [m/s].
    tension : ndarray, shape (n,)
        Segments [N].
    deployed_length, payout_speed : float
        Unstretched length between the ends [m], and its rate [m/s].
    """

    time: float
    status: Status
    position: Array
    velocity: Array
    tension: Array
    deployed_length: float
    payout_speed: float


def simulate(case: Case | Scene, *, progress: Callable[[Progress], None] | None = None) -> xr.Dataset:
    """Run a case from its initial shape to its end.

    Parameters
    ----------
    case : Case or Scene
        What to simulate.
    progress : callable, optional
        Called with a `Progress` at every output time.

    Returns
    -------
    xarray.Dataset
        The trajectory.  A run that stopped early returns what it computed: see the attributes
        ``status`` and ``message``.

    Raises
    ------
    CaseError
        When the case cannot be built.
    StaticsError
        When no rest shape is found.
    """
    return Simulation(case).run(progress)


class Simulation:
    """A simulation that can be stepped and driven from outside.

    Parameters
    ----------
    case : Case or Scene
        What to simulate.

    Examples
    --------
    >>> simulation = Simulation(load_case("cases/sway.yaml"))  # doctest: +SKIP
    >>> before = simulation.snapshot()  # doctest: +SKIP
    >>> simulation.step(0.1, velocity_b=[0.0, 0.2, 0.0]).tension[0]  # doctest: +SKIP
    >>> simulation.restore(before)  # doctest: +SKIP
    """

    def __init__(self, case: Case | Scene) -> None:
        if not isinstance(case, Case | Scene):
            raise TypeError(f"cablesim simulates a case, not {case!r:.80}; read one with load_case(path).")
        self.scene: Scene = build_scene(case) if isinstance(case, Case) else case
        self.mesh: Mesh = build_mesh(self.scene)
        self.initial: InitialState = self._find_initial_state()
        model, y = self.initial.model, self.initial.y
        self.scales: Scales = scene_scales(self.scene, model, y, model.consistent_rates(0.0, y))
        self._integrators: OrderedDict[int, IdaIntegrator] = OrderedDict()  # by number of segments
        self._fingerprint = _fingerprint(self.initial.model, self.scene)
        self.reset()

    def reset(self) -> None:
        """Go back to t = 0 and the initial shape."""
        scene, start = self.scene, self.initial.model
        self._follow(Driven())
        self._counters = Counters()
        self._close_integrators()
        self._events: list[WinchEvent] = []
        self._model = start.with_parameters(start.parameters)
        self._winding = self._new_winding()
        self._loop: ControlLoop | None = None
        if scene.winch is not None and isinstance(scene.winch.payout, Control):
            self._loop = ControlLoop(scene.winch.payout, scene.winch)
        self._failure = ""
        self._begin(0.0, self.initial.y.copy())

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._time

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is odd about the scene and the cable now; what was odd in a run is said in its dataset."""
        return warnings_of(self.present())

    @property
    def model(self) -> CableModel:
        """The equations being integrated."""
        return self._model

    @property
    def state(self) -> tuple[Array, Array]:
        """Y and Y' now, in the layout of `model.layout` (copies)."""
        return self._y.copy(), self._yp.copy()

    def run(self, progress: Callable[[Progress], None] | None = None) -> xr.Dataset:
        """Go on to the end of the case and return the trajectory from here on.

        Parameters
        ----------
        progress : callable, optional
            Called with a `Progress` at every output time.

        Returns
        -------
        xarray.Dataset
            Output times from now to the end, or to where the run stopped.
        """
        started = time.perf_counter()
        history = History(self._output_times(), self._whole_model().layout)
        history.events = self._events = []
        history.record(self._y, self._yp, self._deployed())
        self._set_deadline()
        try:
            status = self._record_run(history, progress)
        except KeyboardInterrupt:  # outside the integrator
            status = Status.INTERRUPTED
        if status is not Status.COMPLETED:
            history.close(self._time, self._y, self._yp, self._deployed())
        return build_dataset(
            self.scene,
            self.mesh,
            self._whole_model(),
            history,
            {
                "status": status.value,
                "message": self._message(status),
                "initial_shape": self.initial.message,
                "residual_calls": self._counters.residual_calls,
                "jacobian_calls": self._counters.jacobian_calls,
                "starts": self._counters.starts,
                "wall_seconds": time.perf_counter() - started,
            },
        )

    def step(
        self,
        duration: float,
        *,
        velocity_a: ArrayLike | None = None,
        velocity_b: ArrayLike | None = None,
        payout_speed: float | None = None,
    ) -> Observation:
        """Advance by `duration` seconds.

        A step ends early where a run would end, and says so by its status.  Where the winch can go no
        further, time stands still for as long as it is told, or left, to go on; ordered to stop or to
        turn, it begins from rest.

        Parameters
        ----------
        duration : float
            Length of the step [s].
        velocity_a, velocity_b : array_like of shape (3,), optional
            Velocity that an end is to have at the end of the step [m/s]; it gets there at constant
            acceleration, so that the integrator need not restart.  From then on the end leaves the
            motion of the case and keeps its velocity until told otherwise.
        payout_speed : float, optional
            The same for the winch [m/s], as far as its limits of speed and acceleration allow; its
            program or controller is left then.

        Returns
        -------
        Observation
            The cable at the end of the step; its status says whether the step succeeded.

        Raises
        ------
        ValueError
            When the step is no longer than `SAME_TIME` or ends after a motion that is known only for a
            while, a free end or a cable of fixed length is driven, or a planar scene is driven out of
            its plane.
        """
        if not is_number(duration) or not SAME_TIME < duration < math.inf:
            raise ValueError(f"step: duration is {duration!r} s; give a positive number above {SAME_TIME:g}.")
        until = self._stops.snapped(self._time + duration)
        orders = Orders(velocity_a, velocity_b, payout_speed)
        if self._driven.any() or orders.any():
            self._drive(orders, until)
        self._refuse_unknown(until)
        self._set_deadline()
        return self.observe(self._advance(until))

    def observe(self, status: Status = Status.COMPLETED) -> Observation:
        """The cable now, in the world frame; `status` is kept with it."""
        layout, frame = self.model.layout, self.model.frame
        return Observation(
            self._time,
            status,
            frame.places_out(self.model.node_places(self._time, self._y)),
            frame.vectors_out(layout.node_velocity(self._y)),
            layout.tension(self._y).copy(),
            *(self.scene.cable.length, 0.0)
            if self._winding is None
            else self.model.deployed_length(self._time),
        )

    def present(self, attributes: Mapping[str, object] | None = None) -> xr.Dataset:
        """The cable now, as a trajectory of one time.

        Parameters
        ----------
        attributes : mapping, optional
            Attributes of the dataset besides its own.
        """
        history = History(np.array([self._time]), self._whole_model().layout)
        history.record(self._y, self._yp, self._deployed())
        given = {"initial_shape": self.initial.message, **(attributes or {})}
        return build_dataset(self.scene, self.mesh, self._whole_model(), history, given)

    def snapshot(self) -> Snapshot:
        """What is needed to come back to this moment."""
        return Snapshot(
            self._time,
            self._y,
            self._yp,
            self.model.with_parameters(self.model.parameters),
            self._driven,
            copy.deepcopy(self._loop),
            self._fingerprint,
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Come back to a moment; the integrator restarts there: runs agree to tolerance, not to the bit.

        Raises
        ------
        ValueError
            When the snapshot was taken in another scene.
        """
        if not isinstance(snapshot, Snapshot):
            raise TypeError(f"restore takes what snapshot() gave, not {snapshot!r:.80}.")
        if snapshot.scene != self._fingerprint:
            raise ValueError(
                "restore: the snapshot is of another scene: cable, bodies, water, mesh, motions or winch "
                "differ; restore it in a simulation of the case that it was taken in."
            )
        self._loop = copy.deepcopy(snapshot.loop)
        self._follow(snapshot.driven)
        self._use(snapshot.model.with_parameters(snapshot.model.parameters))
        self._begin(snapshot.time, snapshot.y, snapshot.yp)

    def __getstate__(self) -> dict[str, object]:
        return {name: value for name, value in vars(self).items() if name not in _REMADE}

    def __setstate__(self, state: dict[str, object]) -> None:
        vars(self).update(state)
        self._integrators = OrderedDict()
        self._winding = self._new_winding()
        self._begin(self._time, self._y, self._yp)

    # Inside -------------------------------------------------------------------------------------

    def _record_run(self, history: History, progress: Callable[[Progress], None] | None) -> Status:
        """Advance from output to output."""
        started = time.perf_counter()
        for t in history.times[1:]:
            status = self._advance(t)
            if status is not Status.COMPLETED:
                return status
            history.record(self._y, self._yp, self._deployed())
            if progress is not None:
                wall = time.perf_counter() - started
                calls = self._counters.residual_calls
                progress(Progress(self._time, self.scene.duration, calls, wall))
        return Status.COMPLETED

    def _find_initial_state(self) -> InitialState:
        mesh, start = self.mesh, self.scene.start_length
        if self.scene.winch is not None:
            mesh = mesh.deployed(mesh.segments_at(start), start)
        initial = find_initial_state(self.scene, mesh)
        log.debug(initial.message)
        return initial

    def _new_winding(self) -> Winding | None:
        winch = self.scene.winch
        if winch is None:
            return None
        return Winding(self.mesh, winch.minimum_length, self._model, self._build_model)

    def _set_deadline(self) -> None:
        self._counters.deadline = time.monotonic() + (self.scene.numerics.time_limit or math.inf)

    def _build_model(self, mesh: Mesh) -> CableModel:
        return build_model(self.scene, mesh, self.model.frame)

    def _whole_model(self) -> CableModel:
        """Equations of the whole cable, for the dataset; its ends move as they do."""
        if self._winding is None:
            return self.model
        whole, now = self._build_model(self.mesh), self.model.parameters
        ends = {f"{table}_{end}": getattr(now, f"{table}_{end}") for table in _TABLES for end in "ab"}
        return whole.with_parameters(whole.parameters._replace(**ends))

    def _integrator_of(self, model: CableModel) -> IdaIntegrator:
        """The integrator of this size, kept from the last time or made now."""
        segments = model.layout.segments
        if segments not in self._integrators:
            self._integrators[segments] = self._new_integrator(model)
            kept = min(KEPT_INTEGRATORS, max(4, int(KEPT_BYTES / (8 * model.layout.size**2))))
            while len(self._integrators) > kept:
                self._integrators.popitem(last=False)[1].close()
        self._integrators.move_to_end(segments)
        self._integrators[segments].equations = model
        return self._integrators[segments]

    def _close_integrators(self) -> None:
        while self._integrators:
            self._integrators.popitem()[1].close()

    def _new_integrator(self, model: CableModel) -> IdaIntegrator:
        numerics = self.scene.numerics
        atol = absolute_tolerances(self.scales, model, numerics.relative_tolerance)
        return IdaIntegrator(
            model,
            IdaOptions(
                rtol=numerics.relative_tolerance,
                atol=atol,
                first_step=self._first_step(atol),
                max_order=numerics.max_order,
                max_step=numerics.max_step,
                max_steps=numerics.max_steps,
                linear_solver=numerics.linear_solver,
            ),
            events=self._winding,
            counters=self._counters,
        )

    def _first_step(self, atol: Array) -> float:
        """What changes the state by so much of its tolerance; at the start, not far into the first ramp."""
        rtol = self.scene.numerics.relative_tolerance
        rates = self._yp / (rtol * np.abs(self._y) + atol)
        rate = max(float(np.sqrt(np.mean(rates**2))), 1e-300)
        if self._integrators:
            return RESTART_CHANGE / rate
        return min(1e-3 * (self._stop.time - self._time), START_CHANGE / rate)

    def _use(self, model: CableModel) -> None:
        """Go on with other equations."""
        self._model = model
        if self._winding is not None:
            self._winding.use(model)

    def _begin(self, t: float, y: Array, yp: Array | None = None) -> None:
        self._time, self._y = t, y
        self._yp = self.model.consistent_rates(t, y) if yp is None else yp
        self._look_ahead()
        self._integrator = self._integrator_of(self.model)
        self._integrator.start(t, self._y, self._yp)

    def _follow(self, driven: Driven) -> None:
        """Let these inputs be driven from outside; the stops of the others stay in force."""
        self._driven = driven
        self._stops = Stops(driven.motions(self.scene), self.scene.duration)

    def _look_ahead(self) -> None:
        """Find the next stop, and the last time that may be evaluated before something changes."""
        self._stop, ramp_end = self._stops.after(self._time), self._driven.until
        if self._time < ramp_end < self._stop.time and not same_time(self._time, ramp_end):
            self._stop = Stop(ramp_end, ramp_end, False)
        self._limit = self._stop.limit
        if self._loop is not None:
            self._limit = min(self._limit, self._loop.known_until)
        if self._winding is not None:
            self._limit = min(self._limit, self._winding.guard_time(self._time))

    def _advance(self, t: float) -> Status:
        """Go to `t`, stopping at the corners of the inputs and restarting where something jumps."""
        while self._time < t and not same_time(self._time, t):
            status = self._try_to_advance(t)
            if status is not Status.COMPLETED:
                self._begin(self._time, self._y, self._yp)  # what comes next comes from here
                return status
            if self._stop.jump and same_time(self._time, self._stop.time):
                self._restart_at(self._stop.resume)
        return Status.COMPLETED

    def _try_to_advance(self, t: float) -> Status:
        """Go as far towards `t` as the integrator can go at once."""
        ended = None if self._winding is None else self._winding.ended(self._time)
        status = self._sample_controller() if ended is None else ended
        if status is not Status.COMPLETED:
            return status
        if self._time >= self._limit or same_time(self._time, self._limit):
            self._look_ahead()
        target = min(t, self._limit)
        if self._loop is not None:
            target = min(target, self._loop.next_sample)
        outcome, self._time, self._y, self._yp = self._integrator.advance(target, self._limit)
        return self._wind() if outcome is Advance.EVENT else Status.of(outcome)

    def _restart_at(self, t: float) -> None:
        """Begin anew where the velocity of an input jumps."""
        self.model.impose_end_velocities(t, self._y)
        self._begin(t, self._y)

    # The winch -----------------------------------------------------------------------------------

    def _wind(self) -> Status:
        """Let a node come or go, and restart the integrator."""
        assert self._winding is not None
        before, y = self.model, self._y
        energy, momentum = self._motion_of(before, y)
        status, y = self._winding.cross(self._time, self._y, self._yp)
        if status is not Status.COMPLETED:
            return status
        self._model = self._winding.model
        self._begin(self._time, y)
        energy_after, momentum_after = self._motion_of(self.model, y)
        self._events.append(
            WinchEvent(
                self._time,
                self.model.layout.segments - before.layout.segments,
                energy_after - energy,
                float(np.linalg.norm(momentum_after - momentum)),
            )
        )
        return status

    def _motion_of(self, model: CableModel, y: Array) -> tuple[float, Array]:
        return model.kinetic_energy_and_momentum(self._time, y, material_velocity(self._time, y, model))

    def _sample_controller(self) -> Status:
        """Ask the controller when it is time to, and let the winch's speed go to its answer evenly."""
        if self._loop is None or not self._loop.due(self._time):
            return Status.COMPLETED
        start, period = self._loop.next_sample, self._loop.period
        ahead, speed_ahead = self.model.deployed_length(start + period)
        try:
            speed = self._loop.sample(self._measure(), speed_ahead, self._counters.deadline)
        except ControllerRunError as error:
            self._failure = str(error)
            return Status.CONTROLLER_FAILED
        except OutOfTime:
            self._failure = "The winch's controller was still at work."
            return Status.TIME_LIMIT
        # the piece that is under way stays; behind it the answer is appended
        table = self.model.parameters
        length, now = self.model.deployed_length(start)
        table.winch_coefficients[0, :3, 0] = length, now, 0.5 * (speed_ahead - now) / period
        table.winch_breaks[0] = start
        table.winch_breaks[1:], table.winch_coefficients[1:] = ramp(
            start + period, start + 2 * period, np.array([ahead]), np.array([speed_ahead]), np.array([speed])
        )
        self._look_ahead()
        return Status.COMPLETED

    def _measure(self) -> Measurement:
        """What a controller may know."""
        seen = self.observe()
        return Measurement(
            time=seen.time,
            deployed_length=seen.deployed_length,
            payout_speed=seen.payout_speed,
            tension_a=float(seen.tension[0]),
            tension_b=float(seen.tension[-1]),
            locate=Places(seen.position, seen.velocity, self._nodes_by_name),
        )

    @cached_property
    def _nodes_by_name(self) -> dict[str, int]:
        """Node of each attachment on the whole cable, and of the ends."""
        names = [attachment.name for attachment in self.scene.attachments]
        places = dict(zip(names, self.mesh.attachment_nodes.tolist(), strict=True))
        return {"a": 0, "b": self.mesh.segments, **places}

    def _deployed(self) -> Array | None:
        """Deployed length, its speed and acceleration now; ``None`` without a winch."""
        return None if self._winding is None else np.array(self.model.deployed_motion(self._time))

    # Driven from outside ---------------------------------------------------------------------------

    def _drive(self, orders: Orders, until: float) -> None:
        """Replace the motion of what is driven by a ramp over this step."""
        limit = None if self._winding is None else self._winding.limit_at(self._time)
        before, begins = self.model, not self._driven.any()
        driven, tables = self._driven.follow(orders, self.scene, before, limit, self._time, until)
        self._follow(driven)
        if driven.winch:
            self._loop = None
        self._use(before.with_parameters(before.parameters._replace(**tables)))
        self._integrator.equations = self.model
        if self.model.deployed_length(self._time) != before.deployed_length(self._time):
            self._restart_at(self._time)  # the winch, stopped at its limit
        elif begins:  # the integrator may have stepped beyond, into what will not be
            self._begin(self._time, self._y, self._yp)
        else:
            self._look_ahead()

    def _refuse_unknown(self, t: float) -> None:
        """Refuse a time at which a motion of the case is not known."""
        known = min((motion.end_time for motion in self._driven.motions(self.scene)), default=math.inf)
        if t > known and not same_time(t, known):
            raise ValueError(
                f"step: a motion of the case is known only up to {known:g} s, and the step ends at {t:g} s; "
                "give a longer motion, or drive what it moves."
            )

    def _output_times(self) -> Array:
        """Now, the multiples of the interval in between, and the end of the case."""
        now, interval, end = self._time, self.scene.output.interval, self.scene.duration
        if now >= end or same_time(now, end):
            return np.array([now])
        multiples = interval * np.arange(np.floor(now / interval) + 1, np.ceil(end / interval))
        between = [t for t in multiples if not (same_time(t, now) or same_time(t, end))]
        return np.array([now, *map(self._stops.snapped, between), end])

    def _message(self, status: Status) -> str:
        if status is Status.COMPLETED:
            return status.sentence
        where = f"Stopped at t = {self._time:.6g} s of {self.scene.duration:g} s"
        if status in WINCH_STOPS:
            length = self.model.deployed_length(self._time)[0]
            return f"{where}, with {length:.6g} m deployed. {status.sentence}"
        if self._failure:
            return f"{where}. {self._failure} {status.sentence}"
        return f"{where}, {self._worst()}. {status.sentence}"

    def _worst(self) -> str:
        """Where the state changes fastest in units of its tolerance: the likely culprit."""
        model, layout = self.model, self.model.layout
        rtol = self.scene.numerics.relative_tolerance
        weights = absolute_tolerances(self.scales, model, rtol) + rtol * np.abs(self._y)
        index = int(np.argmax(np.abs(self._yp) / weights))
        kind, node = layout.describe(index)
        return f"fastest change in the {kind} at node {node} (s = {self.mesh.nodes[node]:.4g} m)"


_TABLES = ("breaks", "coefficients")
_REMADE = ("_integrators", "_integrator", "_winding")
"""What a copy of a simulation makes for itself: solvers, and equations that can be had again."""


def _fingerprint(model: CableModel, scene: Scene) -> str:
    """What tells a scene from others for which its states mean nothing."""
    digest = hashlib.sha256()
    for part in (model.features, model.layout, scene.winch and _winch_facts(scene.winch)):
        digest.update(repr(part).encode())
    for field in fields(model.frame):
        digest.update(np.asarray(getattr(model.frame, field.name), dtype=float).tobytes())
    for array in model.parameters:
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def _winch_facts(winch: Winch) -> tuple[float, ...]:
    control = winch.payout
    sampling = (control.period, control.delay) if isinstance(control, Control) else ()
    return (winch.maximum_speed, winch.maximum_acceleration, winch.minimum_length, *sampling)
