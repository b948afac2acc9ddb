"""Runs a case: the one place that knows scene, mesh, physics, integrator and trajectory.

Depends on: all of them.
"""

from __future__ import annotations

import contextlib
import gc
import io
import logging
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from cablesim.build import build_scene
from cablesim.case import Case
from cablesim.integrate import IdaIntegrator, Status
from cablesim.integrate.ida import IdaOptions
from cablesim.mesh import Mesh, build_mesh
from cablesim.physics.model import CableModel
from cablesim.physics.scales import absolute_tolerances, scene_scales
from cablesim.scene import Scene
from cablesim.statics import InitialState, find_initial_state
from cablesim.trajectory import History, build_dataset

Array = NDArray[np.float64]

log = logging.getLogger("cablesim")

SAME_TIME = 1e-12  # times closer than this are one: output times and corners differ by rounding


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
    driven: tuple[bool, bool]
    driven_until: float


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
    """

    time: float
    status: Status
    position: Array
    velocity: Array
    tension: Array


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
        self.reset()

    def reset(self) -> None:
        """Go back to t = 0 and the initial shape."""
        if not hasattr(self, "initial"):
            self.initial: InitialState = self._find_initial_state()
        self._driven, self._driven_until = (False, False), -math.inf
        self._stops = self._input_stops()
        self._model = self.initial.model
        self._integrator = self._new_integrator(self._model, self.initial.y)
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
        history = History(self._output_times(), self.model.layout.size)
        history.record(self._y, self._yp)
        self._integrator.start_clock()
        with _undisturbed():
            try:
                status = self._record_run(history, progress)
            except KeyboardInterrupt:  # outside the integrator
                status = Status.INTERRUPTED
        if status is not Status.COMPLETED:
            history.close(self._time, self._y, self._yp)
        return build_dataset(
            self.scene,
            self.mesh,
            self.model,
            history,
            {
                "status": status.value,
                "message": self._message(status),
                "initial_shape": self.initial.message,
                "residual_calls": self._integrator.counters.residual_calls,
                "jacobian_calls": self._integrator.counters.jacobian_calls,
                "starts": self._integrator.counters.starts,
                "wall_seconds": time.perf_counter() - started,
            },
        )

    def step(
        self, duration: float, *, velocity_a: ArrayLike | None = None, velocity_b: ArrayLike | None = None
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

        Returns
        -------
        Observation
            The cable at the end of the step; its status says whether the step succeeded.

        Raises
        ------
        ValueError
            When the step is not positive, a free end is driven, or a planar scene is driven out of
            its plane.
        """
        if not duration > 0.0:
            raise ValueError(f"step: duration is {duration!r} s; give a positive number.")
        if velocity_a is not None or velocity_b is not None or any(self._driven):
            self._drive(duration, velocity_a, velocity_b)
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
        )

    def snapshot(self) -> Snapshot:
        """What is needed to come back to this moment."""
        return Snapshot(self._time, self._y, self._yp, self.model, self._driven, self._driven_until)

    def restore(self, snapshot: Snapshot) -> None:
        """Come back to a moment; the integrator restarts there: runs agree to tolerance, not to the bit."""
        self._driven, self._driven_until = snapshot.driven, snapshot.driven_until
        self._use(snapshot.model)
        self._begin(snapshot.time, snapshot.y, snapshot.yp)

    # Inside -------------------------------------------------------------------------------------

    def _record_run(self, history: History, progress: Callable[[Progress], None] | None) -> Status:
        """Advance from output to output."""
        started = time.perf_counter()
        for t in history.times[1:]:
            status = self._advance(t)
            if status is not Status.COMPLETED:
                return status
            history.record(self._y, self._yp)
            if progress is not None:
                wall = time.perf_counter() - started
                calls = self._integrator.counters.residual_calls
                progress(Progress(self._time, self.scene.duration, calls, wall))
        return Status.COMPLETED

    def _find_initial_state(self) -> InitialState:
        initial = find_initial_state(self.scene, self.mesh)
        log.debug(initial.message)
        return initial

    def _new_integrator(self, model: CableModel, y: Array) -> IdaIntegrator:
        numerics = self.scene.numerics
        scales = scene_scales(self.scene, model, y)
        atol = absolute_tolerances(scales, model, numerics.relative_tolerance)
        return IdaIntegrator(
            model,
            IdaOptions(
                rtol=numerics.relative_tolerance,
                atol=atol,
                first_step=self._first_step(model, y, atol),
                max_order=numerics.max_order,
                max_step=numerics.max_step,
                max_steps=numerics.max_steps,
                linear_solver=numerics.linear_solver,
                time_limit=numerics.time_limit,
            ),
        )

    def _first_step(self, model: CableModel, y: Array, atol: Array) -> float:
        """A thousandth of the way to the first corner, or what changes the state by half its tolerance."""
        rtol = self.scene.numerics.relative_tolerance
        rates = model.consistent_rates(0.0, y) / (rtol * np.abs(y) + atol)
        return min(1e-3 * self._stops[0][0], 0.5 / max(float(np.sqrt(np.mean(rates**2))), 1e-300))

    def _use(self, model: CableModel) -> None:
        """Go on with other equations of the same size."""
        self._model = model
        self._integrator.equations = model

    def _begin(self, t: float, y: Array, yp: Array | None = None) -> None:
        self._time, self._y = t, y
        self._yp = self.model.consistent_rates(t, y) if yp is None else yp
        self._look_ahead()
        self._integrator.start(t, self._y, self._yp)

    def _input_stops(self) -> list[tuple[float, bool]]:
        """Times at which the input has a corner (False) or a jump of velocity (True), then the end."""
        stops = {self.scene.duration: False}
        for end in (self.scene.end_a, self.scene.end_b):
            if end.motion is not None:
                stops |= {float(t): False for t in end.motion.corners if float(t) not in stops}
                stops |= {float(t): True for t in end.motion.jumps}
        return sorted((t, jump) for t, jump in stops.items() if t <= self.scene.duration)

    def _look_ahead(self) -> None:
        """Find the next stop, and the last time that may be evaluated before it."""
        if any(self._driven):
            ahead = self._driven_until > self._time
            self._stop, self._jump = self._driven_until if ahead else math.inf, False
        else:
            self._stop, self._jump = next(
                ((t, jump) for t, jump in self._stops if t > self._time), (np.inf, False)
            )
        # the motion after a jump must not be seen before it
        self._limit = math.nextafter(self._stop, 0.0) if self._jump else self._stop

    def _advance(self, t: float) -> Status:
        """Go to `t`, stopping at the corners of the inputs and restarting where velocities jump."""
        while t - self._time > SAME_TIME * max(1.0, abs(t)):  # closer than that, IDA refuses to start
            if self._time >= self._limit:
                self._look_ahead()
            advance = self._integrator.advance(min(t, self._limit), self._limit)
            status, self._time, self._y, self._yp = advance
            if status is not Status.COMPLETED:
                return status
            if self._jump and self._time >= self._limit:
                self.model.impose_end_velocities(self._stop, self._y)
                self._begin(self._stop, self._y)
        return Status.COMPLETED

    def _drive(self, duration: float, velocity_a: ArrayLike | None, velocity_b: ArrayLike | None) -> None:
        """Replace the motion of driven ends by a ramp of velocity over this step."""
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
        self._driven = (driven[0], driven[1])
        self._driven_until = self._time + duration
        self._use(self.model.with_parameters(parameters._replace(**changes)))
        self._look_ahead()

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
        breaks = np.array([self._time, self._time + duration, self._time + 1e9])
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
        return f"{where}, {self._worst()}. {status.sentence}"

    def _worst(self) -> str:
        """Where the state changes fastest in units of its tolerance: the likely culprit."""
        model, layout = self.model, self.model.layout
        rtol = self.scene.numerics.relative_tolerance
        weights = absolute_tolerances(scene_scales(self.scene, model, self._y), model, rtol) + rtol * np.abs(
            self._y
        )
        index = int(np.argmax(np.abs(self._yp) / weights))
        kind, node = layout.describe(index)
        return f"fastest change in the {kind} at node {node} (s = {self.mesh.nodes[node]:.4g} m)"


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
