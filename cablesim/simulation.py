"""Runs a case: the one place that knows scene, mesh, physics, integrator and trajectory.

Depends on: all of them.
"""

from __future__ import annotations

import contextlib
import copy
import gc
import io
import logging
import math
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from cablesim.build import build_scene
from cablesim.case import Case
from cablesim.control import Measurement
from cablesim.control.loop import SAME_INSTANT, ControlError, ControlLoop, limited_speed
from cablesim.integrate import IdaIntegrator, Status
from cablesim.integrate.ida import IdaOptions
from cablesim.integrate.protocol import Counters
from cablesim.mesh import Mesh, build_mesh
from cablesim.motion import FOREVER, Motion
from cablesim.physics.model import CableModel, build_model
from cablesim.physics.scales import Scales, absolute_tolerances, scene_scales
from cablesim.physics.winch import material_velocity
from cablesim.scene import Control, Scene
from cablesim.statics import InitialState, find_initial_state
from cablesim.trajectory.dataset import build_dataset
from cablesim.trajectory.history import History, WinchEvent
from cablesim.winch import Winding

Array = NDArray[np.float64]

log = logging.getLogger("cablesim")

SAME_TIME = 1e-12  # times closer than this are one: output times and corners differ by rounding

START_CHANGE, RESTART_CHANGE = 0.5, 10.0
"""Change of the state in the first step, over its tolerance.

After a node has come or gone the motion goes on smoothly and its rates are known exactly, so that the
first step's error is of second order: in the winch cycle 446 Jacobians and 2429 residual calls suffice
instead of 767 and 2697 with 0.5.  At 30 it is 312 and 2105, but tension strays by 1.6 % of its range
instead of 0.35 %.
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
    driven: tuple[bool, bool, bool]
    driven_until: float
    loop: ControlLoop | None


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
        self.scene: Scene = build_scene(case) if isinstance(case, Case) else case
        self.mesh: Mesh = build_mesh(self.scene)
        self.initial: InitialState = self._find_initial_state()
        self._scales: Scales = scene_scales(self.scene, self.initial.model, self.initial.y)
        self._integrators: OrderedDict[int, IdaIntegrator] = OrderedDict()  # by number of segments
        self.reset()

    def reset(self) -> None:
        """Go back to t = 0 and the initial shape."""
        scene, start = self.scene, self.initial.model
        self._driven, self._driven_until = (False, False, False), -math.inf
        self._stops = self._input_stops()
        self._counters = Counters()
        for integrator in self._integrators.values():
            integrator.close()
        self._integrators.clear()
        self._events: list[WinchEvent] = []
        self._model = start.with_parameters(start.parameters)
        self._winding: Winding | None = None
        self._loop: ControlLoop | None = None
        if scene.winch is not None:
            self._winding = Winding(self.mesh, scene.winch.minimum_length, self._model, self._build_model)
            if isinstance(scene.winch.payout, Control):
                self._loop = ControlLoop(scene.winch.payout, scene.winch)
        self._failure = ""
        self._begin(0.0, self.initial.y.copy())

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._time

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
        self._counters.deadline = time.monotonic() + (self.scene.numerics.time_limit or math.inf)
        with _undisturbed():
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
            When the step is not positive, a free end or a cable of fixed length is driven, or a planar
            scene is driven out of its plane.
        """
        if not duration > 0.0:
            raise ValueError(f"step: duration is {duration!r} s; give a positive number.")
        commands = (velocity_a, velocity_b, payout_speed)
        if any(self._driven) or any(command is not None for command in commands):
            self._drive(duration, *commands)
        with _undisturbed():
            status = self._advance(self._time + duration)
        return self.observe(status)

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
            self._driven_until,
            copy.deepcopy(self._loop),
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Come back to a moment; the integrator restarts there: runs agree to tolerance, not to the bit."""
        self._driven, self._driven_until = snapshot.driven, snapshot.driven_until
        self._stops = self._input_stops()
        self._loop = copy.deepcopy(snapshot.loop)
        self._use(snapshot.model.with_parameters(snapshot.model.parameters))
        self._begin(snapshot.time, snapshot.y, snapshot.yp)

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

    def _new_integrator(self, model: CableModel) -> IdaIntegrator:
        numerics = self.scene.numerics
        atol = absolute_tolerances(self._scales, model, numerics.relative_tolerance)
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
        return min(1e-3 * self._stops[0][0], START_CHANGE / rate)

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

    def _input_stops(self) -> list[tuple[float, bool]]:
        """Times at which the input has a corner (False) or a jump of velocity (True), then the end.

        What is driven from outside has left its motion.
        """
        scene, stops = self.scene, {self.scene.duration: False}
        program = scene.winch.payout if scene.winch is not None else None
        for motion, driven in zip(
            (scene.end_a.motion, scene.end_b.motion, program), self._driven, strict=True
        ):
            if isinstance(motion, Motion) and not driven:
                stops |= {float(t): False for t in motion.corners if float(t) not in stops}
                stops |= {float(t): True for t in motion.jumps}
        return sorted((t, jump) for t, jump in stops.items() if t <= scene.duration)

    def _look_ahead(self) -> None:
        """Find the next stop, and the last time that may be evaluated before something changes."""
        self._stop, self._jump = next(
            ((t, jump) for t, jump in self._stops if t > self._time), (math.inf, False)
        )
        if self._time < self._driven_until < self._stop:
            self._stop, self._jump = self._driven_until, False
        # the motion after a jump must not be seen before it
        self._limit = math.nextafter(self._stop, 0.0) if self._jump else self._stop
        if self._loop is not None:
            self._limit = min(self._limit, self._loop.known_until)
        if self._winding is not None:
            self._limit = min(self._limit, self._winding.guard_time(self._time))

    def _advance(self, t: float) -> Status:
        """Go to `t`, stopping at the corners of the inputs and restarting where something jumps."""
        while t - self._time > SAME_TIME * max(1.0, abs(t)):  # closer than that, IDA refuses to start
            status = self._sample_controller()
            if status is not Status.COMPLETED:
                return status
            if self._time >= self._limit:
                self._look_ahead()
            target = min(t, self._limit)
            if self._loop is not None:
                target = min(target, self._loop.next_sample)
            status, self._time, self._y, self._yp = self._integrator.advance(target, self._limit)
            if status is Status.EVENT:
                status = self._wind()
            if status is not Status.COMPLETED:
                return status
            if self._jump and math.nextafter(self._time, math.inf) >= self._stop:
                self.model.impose_end_velocities(self._stop, self._y)
                self._begin(self._stop, self._y)
        return Status.COMPLETED

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
        if self._loop is None or self._time < self._loop.next_sample - SAME_INSTANT:
            return Status.COMPLETED
        start, period = self._loop.next_sample, self._loop.period
        ahead, speed_ahead = self.model.deployed_length(start + period)
        try:
            speed = self._loop.sample(self._measure(), speed_ahead)
        except ControlError as error:
            self._failure = str(error)
            return Status.CONTROLLER_FAILED
        # the piece that is under way stays; behind it the answer is appended
        breaks, coefficients = _length_ramp(start + period, period, ahead, speed_ahead, speed)
        table = self.model.parameters
        length, now = self.model.deployed_length(start)
        table.winch_coefficients[0, :3, 0] = length, now, 0.5 * (speed_ahead - now) / period
        table.winch_breaks[0], table.winch_breaks[1:] = start, breaks
        table.winch_coefficients[1:] = coefficients
        self._look_ahead()
        return Status.COMPLETED

    def _measure(self) -> Measurement:
        """What a controller may know; places are computed when it asks for them."""
        model, t, y = self.model, self._time, self._y
        length, speed = model.deployed_length(t)
        tension = model.layout.tension(y)
        return Measurement(
            time=t,
            deployed_length=length,
            payout_speed=speed,
            tension_a=float(tension[0]),
            tension_b=float(tension[-1]),
            locate=_Places(model, t, y, self._node_of),
        )

    def _node_of(self, name: str) -> int | None:
        """Node of an attachment, or of end ``a``; ``None`` for ``b``."""
        if name in ("a", "b"):
            return 0 if name == "a" else None
        for attachment, node in zip(self.scene.attachments, self.mesh.attachment_nodes, strict=True):
            if attachment.name == name:
                return int(node)
        names = ", ".join(attachment.name for attachment in self.scene.attachments)
        raise KeyError(f"there is no attachment {name!r}; known are a, b, {names}")

    def _deployed(self) -> Array | None:
        """Deployed length, its speed and acceleration now; ``None`` without a winch."""
        return None if self._winding is None else np.array(self.model.deployed_motion(self._time))

    # Driven from outside ---------------------------------------------------------------------------

    def _drive(
        self,
        duration: float,
        velocity_a: ArrayLike | None,
        velocity_b: ArrayLike | None,
        payout_speed: float | None,
    ) -> None:
        """Replace the motion of driven ends, and of the winch, by a ramp over this step."""
        parameters = self.model.parameters
        changes: dict[str, Array] = {}
        driven = list(self._driven)
        for k, (name, command, end) in enumerate(
            (("a", velocity_a, self.scene.end_a), ("b", velocity_b, self.scene.end_b))
        ):
            if command is None and not driven[k]:
                continue
            if end.motion is None:
                raise ValueError(f"step: velocity_{name} drives a free end; give it a motion in the case.")
            changes |= self._ramp(name, duration, command)
            driven[k] = True
        if payout_speed is not None or driven[2]:
            changes |= self._payout_ramp(duration, payout_speed)
            driven[2] = True
        begins = not any(self._driven)
        self._driven = (driven[0], driven[1], driven[2])
        self._driven_until = self._time + duration
        self._stops = self._input_stops()
        self._use(self.model.with_parameters(parameters._replace(**changes)))
        self._integrator.equations = self.model
        if begins:  # the integrator may have stepped beyond, into what will not be
            self._begin(self._time, self._y, self._yp)
        else:
            self._look_ahead()

    def _payout_ramp(self, duration: float, command: float | None) -> dict[str, Array]:
        """Breaks and coefficients of a deployed length whose rate changes evenly over `duration`."""
        if self.scene.winch is None:
            raise ValueError("step: payout_speed drives a cable of fixed length; give the case a winch.")
        length, present = self.model.deployed_length(self._time)
        asked = present if command is None else float(command)
        if not math.isfinite(asked):
            raise ValueError(f"step: payout_speed is {command!r}; give a finite number [m/s].")
        target = limited_speed(asked, present, duration, self.scene.winch)
        self._loop = None
        breaks, coefficients = _length_ramp(self._time, duration, length, present, target)
        return {"winch_breaks": breaks, "winch_coefficients": coefficients}

    def _ramp(self, name: str, duration: float, command: ArrayLike | None) -> dict[str, Array]:
        """Breaks and coefficients of an end that changes its velocity evenly over `duration`."""
        frame = self.model.frame
        place, now = self.model.end_place_and_velocity(name, self._time)
        target = now
        if command is not None:
            world = np.asarray(command, dtype=float)
            target = frame.vectors_in(world) if world.shape == (3,) else now
            if world.shape != (3,) or not np.allclose(frame.vectors_out(target), world, rtol=0.0, atol=1e-9):
                raise ValueError(
                    f"step: velocity_{name} is {command!r}; give three numbers, and set simulation.skip to "
                    "false in the case when the motion leaves the plane in which the scene began."
                )
        coefficients = np.zeros((2, 6, frame.dimension))
        coefficients[0, :3] = place, now, 0.5 * (target - now) / duration
        coefficients[1, :2] = place + 0.5 * (now + target) * duration, target
        breaks = np.array([self._time, self._time + duration, self._time + FOREVER])
        return {f"breaks_{name}": breaks, f"coefficients_{name}": coefficients}

    def _output_times(self) -> Array:
        interval, end = self.scene.output.interval, self.scene.duration
        steps = np.arange(np.floor(self._time / interval) + 1, np.floor(end / interval + 1e-9) + 1)
        times = np.concatenate(([self._time], steps * interval))
        return times if end - times[-1] < 1e-9 * interval else np.append(times, end)

    def _message(self, status: Status) -> str:
        if status is Status.COMPLETED:
            return status.sentence
        where = f"Stopped at t = {self._time:.6g} s of {self.scene.duration:g} s"
        if status in _WINCH_STOPS:
            length = self.model.deployed_length(self._time)[0]
            return f"{where}, with {length:.6g} m deployed. {status.sentence}"
        if status is Status.CONTROLLER_FAILED:
            return f"{where}. {self._failure} {status.sentence}"
        return f"{where}, {self._worst()}. {status.sentence}"

    def _worst(self) -> str:
        """Where the state changes fastest in units of its tolerance: the likely culprit."""
        model, layout = self.model, self.model.layout
        rtol = self.scene.numerics.relative_tolerance
        weights = absolute_tolerances(self._scales, model, rtol) + rtol * np.abs(self._y)
        index = int(np.argmax(np.abs(self._yp) / weights))
        kind, node = layout.describe(index)
        return f"fastest change in the {kind} at node {node} (s = {self.mesh.nodes[node]:.4g} m)"


_TABLES = ("breaks", "coefficients")
_WINCH_STOPS = (Status.ATTACHMENT_AT_WINCH, Status.DRUM_EMPTY, Status.MINIMUM_LENGTH)


@dataclass(frozen=True, eq=False)
class _Places:
    """Place and velocity of a named point in a state, in the world frame."""

    model: CableModel
    time: float
    y: Array
    node_of: Callable[[str], int | None]

    @cached_property
    def _found(self) -> dict[str, tuple[Array, Array]]:
        return {}

    def __call__(self, name: str) -> tuple[Array, Array]:
        if name not in self._found:
            frame, segments = self.model.frame, self.model.layout.segments
            node = self.node_of(name)
            node = segments if node is None else min(node, segments)
            place, velocity = self.model.node_place_and_velocity(node, self.time, self.y)
            self._found[name] = frame.places_out(place), frame.vectors_out(velocity)
        return self._found[name]


def _length_ramp(t: float, duration: float, length: float, now: float, then: float) -> tuple[Array, Array]:
    """Breaks (3,) and coefficients (2, 6, 1) of a length whose rate goes evenly from `now` to `then`."""
    ramp = [length, now, 0.5 * (then - now) / duration, 0.0, 0.0, 0.0]
    after = [length + 0.5 * (now + then) * duration, then, 0.0, 0.0, 0.0, 0.0]
    return np.array([t, t + duration, t + FOREVER]), np.array([ramp, after])[:, :, None]


@contextlib.contextmanager
def _undisturbed() -> Iterator[None]:
    """Integrate without interruptions from elsewhere.

    The binding of IDA prints its warnings on standard output; they belong in the log.  It also makes
    many short-lived containers, none in a cycle: the garbage collector would look through the whole
    process every few steps and find nothing (some 3 % of the samples of a short run's profile).
    """
    text = io.StringIO()
    collecting = gc.isenabled()
    gc.disable()
    try:
        with contextlib.redirect_stdout(text):
            yield
    finally:
        if collecting:
            gc.enable()
        if text.getvalue().strip():
            log.debug(text.getvalue().strip())
