"""From a case to a scene: SI data with the motions made, and a refusal of what cannot run.

Depends on: case, motion, recording, scene.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from cablesim import motion as motions
from cablesim import recording, scene
from cablesim.case import Case, CaseError, Problem, models
from cablesim.case.errors import Location, nearest, suggestion
from cablesim.case.quantities import UnitError, length_factor
from cablesim.current_map import read_current_map
from cablesim.saved_state import SavedStateError, read_saved_state
from cablesim.scene import Vector
from cablesim.variables import VARIABLES

STRAIN_LIMIT = 0.05
"""Strain a cable may need to span its ends at t = 0, or a measured chord over its arc."""

STRETCH_LIMIT = 0.5
"""Strain that the motions of the ends may impose later: more is a mistake in a path or a length."""

SEGMENTS_LIMIT = 200_000
"""Most segments of a mesh."""

STATES_LIMIT = 10_000_000
"""Most states kept of a run."""

_STRAIGHT = 1e-6  # slack over length that still counts as taut
_SPAN = 1e-3  # part of the length by which markers may miss the ends of the cable
_OFF_END = 0.05  # part of the length by which a marker may miss the end it stands for
_MARKERS = 100_000  # most places whose positions are kept
_SAMPLES = 400  # times at which the distance of the ends is checked


def build_scene(case: Case, *, directory: str | Path | None = None) -> scene.Scene:
    """Turn a case into the data a simulation needs, and refuse a case that cannot run.

    Parameters
    ----------
    case : Case
        The case.
    directory : path, optional
        Where relative paths in the case start; default: the directory of the case.

    Raises
    ------
    CaseError
        With everything found wrong: place in the case, value received, remedy.
    """
    return _Builder(case, case.directory if directory is None else Path(directory)).build()


class _Stop(Exception):  # noqa: N818
    """Leaves the part of the case that has just been refused."""


class _Builder:
    """Builds the parts of a scene one by one and collects what is wrong with each."""

    def __init__(self, case: Case, directory: Path) -> None:
        self.case = case
        self.directory = directory
        self.problems: list[Problem] = []

    def build(self) -> scene.Scene:
        case = self.case
        parts: dict[str, Any] = {}
        for name in ("cable", "water", "mesh", "attachments", "ends", "output"):
            with self._collect():
                parts[name] = getattr(self, f"_{name}")()
        with self._collect():
            parts["initial"] = self._initial(parts.get("cable"), parts.get("ends"), parts.get("attachments"))
        if self.problems:
            raise CaseError(sorted(self.problems, key=lambda problem: problem.line or 0))
        bodies, imus = parts["attachments"]
        end_a, end_b = parts["ends"]
        return scene.Scene(
            name=case.name,
            gravity=case.gravity,
            water=parts["water"],
            cable=parts["cable"],
            mesh=parts["mesh"],
            attachments=bodies,
            imus=imus,
            end_a=end_a,
            end_b=end_b,
            initial=parts["initial"],
            duration=case.simulation.duration,
            numerics=_numerics(case.simulation),
            output=parts["output"],
            source=case.to_yaml(),
        )

    # Collecting ---------------------------------------------------------------------------------

    @contextmanager
    def _collect(self) -> Iterator[None]:
        with suppress(_Stop):
            yield

    def _note(self, path: Location, message: str, remedy: str, received: Any = ...) -> None:
        self.problems.append(self.case.problem(path, message, remedy, received))

    def _refuse(self, path: Location, message: str, remedy: str, received: Any = ...) -> _Stop:
        self._note(path, message, remedy, received)
        return _Stop()

    @contextmanager
    def _trying(self, path: Location, remedy: str) -> Iterator[None]:
        """Turn what a reader or a motion refuses into a problem of the case."""
        try:
            yield
        except (ValueError, OverflowError, OSError) as error:
            if isinstance(error, OSError) and error.strerror:
                message = f"cannot be read: {error.strerror}"
            else:
                message, remedy = _message_and_remedy(str(error), remedy)
            raise self._refuse(path, message, remedy) from None

    def _file(self, name: str, path: Location) -> Path:
        file = self.directory / name
        if file.is_file():
            return file
        siblings = [entry.name for entry in file.parent.iterdir()] if file.parent.is_dir() else []
        close = nearest(file.name, siblings)
        hint = f"Did you mean '{close}'?" if close else "Paths are relative to the case file."
        raise self._refuse(path, f"there is no file {file}", hint)

    def _unit(self, direction: ArrayLike, path: Location) -> Vector:
        vector = np.asarray(direction, dtype=float)
        norm = float(np.linalg.norm(vector))
        if not norm > 0:
            raise self._refuse(path, "has no length", "Give a direction such as [1, 0, 0].")
        return vector / norm

    # Cable, water, mesh -------------------------------------------------------------------------

    def _cable(self) -> scene.Cable:
        given = self.case.cable
        if given.diameter > 1:
            warnings.warn(
                f"cable.diameter is {given.diameter:g} m; did you mean {given.diameter:g} mm?", stacklevel=4
            )
        section, weight = self._section_and_weight()
        return scene.Cable(
            length=given.length,
            diameter=given.diameter,
            mass_per_length=given.mass_per_length,
            displaced_section=section,
            wet_weight=weight,
            axial_stiffness=given.axial_stiffness,
            bending_stiffness=given.bending_stiffness,
            drag_normal=given.drag_normal,
            drag_tangential=given.drag_tangential,
            added_mass_normal=given.added_mass_normal,
            added_mass_tangential=given.added_mass_tangential,
            structural_damping=given.structural_damping,
        )

    def _section_and_weight(self) -> tuple[float, float]:
        """Displaced section [m2] and weight in water [N/m]; each follows from the other."""
        cable, density, gravity = self.case.cable, self.case.water.density, self.case.gravity
        circle = math.pi * cable.diameter**2 / 4
        if cable.wet_weight is None:
            section = circle if cable.displaced_section is None else cable.displaced_section
            return section, (cable.mass_per_length - density * section) * gravity
        where: Location = ("cable", "wet_weight")
        if gravity == 0:
            if cable.wet_weight != 0:
                raise self._refuse(where, "is a weight without gravity", "Leave it out, or set `gravity`.")
            return circle, 0.0
        weight_in_air = cable.mass_per_length * gravity
        if density == 0:
            raise self._refuse(
                where,
                "has no meaning in vacuum (water.density is 0)",
                f"Leave it out: the cable weighs {weight_in_air:.4g} N/m.",
            )
        section = (weight_in_air - cable.wet_weight) / (gravity * density)
        if section < -1e-9 * circle:
            raise self._refuse(
                where,
                f"is more than the weight in air, {weight_in_air:.4g} N/m",
                "Check it against `mass_per_length`; in water the cable cannot be heavier.",
            )
        return max(section, 0.0), cable.wet_weight

    def _water(self) -> scene.Water:
        given = self.case.water
        if given.current == "none":
            return scene.Water(density=given.density)
        where: Location = ("water", "current")
        if given.density == 0:
            raise self._refuse(
                where, "there is no current in vacuum (water.density is 0)", "Leave one of them out.", None
            )
        if isinstance(given.current, models.UniformCurrent):
            return scene.Water(
                density=given.density,
                current=scene.UniformCurrent(velocity=np.array(given.current.velocity)),
            )
        if isinstance(given.current, models.ProfileCurrent):
            return scene.Water(density=given.density, current=self._profile(given.current, where))
        file = self._file(given.current.file, (*where, "file"))
        with self._trying((*where, "file"), "Check the file and the names of its variables."):
            return scene.Water(density=given.density, current=read_current_map(file, given.current))

    def _profile(self, given: models.ProfileCurrent, where: Location) -> scene.ProfileCurrent:
        heights, velocities = np.array(given.heights), np.array(given.velocities)
        if len(heights) != len(velocities):
            raise self._refuse(
                (*where, "velocities"),
                f"has {len(velocities)} rows for {len(heights)} heights",
                "Give one velocity for each height.",
            )
        falls = np.flatnonzero(np.diff(heights) <= 0)
        if falls.size:
            raise self._refuse(
                (*where, "heights", int(falls[0]) + 1),
                f"is not above the height before it, {heights[falls[0]]:g} m",
                "Sort the heights upwards (z is up, depths are negative).",
            )
        return scene.ProfileCurrent(heights=heights, velocities=velocities)

    def _mesh(self) -> scene.MeshRules:
        given, length = self.case.mesh, self.case.cable.length
        where: Location = ("mesh", "segment_length")
        if given.segment_length > length / 3 * (1 + 1e-9):
            self._note(
                where,
                f"is longer than a third of the cable, {length:g} m",
                f"Give {length / 3:.3g} m or less; a tenth or less for a shape worth looking at.",
            )
        rules = []
        count = length / given.segment_length
        for index, refinement in enumerate(given.refine):
            with self._collect():
                rule = self._refinement(refinement, ("mesh", "refine", index))
                count += min(2 * rule.within, length) / rule.segment_length
                rules.append(rule)
        if count > SEGMENTS_LIMIT:
            self._note(
                where,
                f"makes {count:.3g} segments with the refinements, more than {SEGMENTS_LIMIT}",
                f"Give longer segments: {length / SEGMENTS_LIMIT:.2g} m at the least.",
            )
        return scene.MeshRules(segment_length=given.segment_length, refinements=tuple(rules))

    def _refinement(self, given: models.Refinement, where: Location) -> scene.Refinement:
        length, longest = self.case.cable.length, self.case.mesh.segment_length
        if given.segment_length > longest:
            self._note(
                (*where, "segment_length"),
                f"is longer than mesh.segment_length, {longest:g} m",
                "A refinement makes segments shorter.",
            )
        if given.around is not None:
            places = {attachment.name: attachment.at for attachment in self.case.attachments}
            if given.around not in places:
                raise self._refuse(
                    (*where, "around"), "is no attachment of this case", suggestion(given.around, places)
                )
            position = places[given.around]
        else:
            position = given.at if given.at is not None else 0.0
            if position > length:
                raise self._refuse(
                    (*where, "at"), f"is beyond the cable, {length:g} m", f"Give 0 to {length:g} m."
                )
        return scene.Refinement(position=position, within=given.within, segment_length=given.segment_length)

    # Attachments --------------------------------------------------------------------------------

    def _attachments(self) -> tuple[tuple[scene.Attachment, ...], tuple[scene.Imu, ...]]:
        bodies: list[scene.Attachment] = []
        imus: list[scene.Imu] = []
        names: set[str] = set()
        closest = self.case.mesh.segment_length / 1000
        for index, given in enumerate(self.case.attachments):
            where: Location = ("attachments", index)
            if given.name in names:
                self._note((*where, "name"), "is taken by an attachment before", "Give each its own name.")
            names.add(given.name)
            if given.at > self.case.cable.length:
                self._note(
                    (*where, "at"),
                    f"is beyond the cable, {self.case.cable.length:g} m",
                    "Move it, or make the cable longer; `at` is counted from end A.",
                )
            if isinstance(given, models.Imu):
                with self._collect():
                    mounting = self._mounting(given.mounting, (*where, "mounting"))
                    imus.append(scene.Imu(name=given.name, position=given.at, mounting=mounting))
                continue
            for other in bodies:
                if abs(other.position - given.at) < max(closest, 1e-9):
                    self._note(
                        (*where, "at"),
                        f"is the place of '{other.name}', {other.position:g} m",
                        f"Move it by {closest:.2g} m or more, or make one body of the two.",
                    )
            bodies.append(
                scene.Attachment(
                    name=given.name,
                    kind=given.kind,
                    position=given.at,
                    mass=given.mass,
                    volume=given.volume,
                    drag_area=given.drag_area,
                    added_mass=given.added_mass,
                )
            )
        return tuple(bodies), tuple(imus)

    def _mounting(self, given: models.Mounting | None, where: Location) -> Vector:
        if given is None:
            return np.array([0.0, 0.0, 0.0, 1.0])
        if given.rotation_vector is not None:
            vector = np.array(given.rotation_vector)
            angle = float(np.linalg.norm(vector))
            return np.append(vector * (0.5 * np.sinc(angle / (2 * np.pi))), math.cos(angle / 2))
        quaternion = np.array(given.quaternion, dtype=float)
        norm = float(np.linalg.norm(quaternion))
        if abs(norm - 1) > 0.01:
            raise self._refuse(
                (*where, "quaternion"),
                f"has the norm {norm:g}, not 1",
                "Give a unit quaternion with the scalar last, [0, 0, 0, 1] for no rotation.",
            )
        return quaternion / norm

    # Ends ---------------------------------------------------------------------------------------

    def _ends(self) -> tuple[scene.End, scene.End]:
        ends: list[scene.End] = []
        for name in ("a", "b"):
            with self._collect():
                ends.append(self._end(getattr(self.case.ends, name), ("ends", name)))
        if len(ends) < 2:
            raise _Stop
        end_a, end_b = ends
        if end_a.motion is not None and end_b.motion is not None:
            self._check_distance(end_a.motion, end_b.motion)
        return end_a, end_b

    def _end(self, given: Any, where: Location) -> scene.End:
        clamp = None
        if given.clamp is not None:
            clamp = self._unit(given.clamp, (*where, "clamp"))
            if isinstance(given, models.FreeEnd):
                self._note((*where, "clamp"), "clamps a free end", "Leave it out, or prescribe a motion.")
            if self.case.cable.bending_stiffness == 0:
                self._note(
                    (*where, "clamp"),
                    "clamps a cable without bending stiffness",
                    "Leave it out, or give `cable.bending_stiffness`.",
                )
        if isinstance(given, models.FreeEnd):
            return scene.End(motion=None, clamp=clamp)
        motion = self._motion(given, where)
        duration = self.case.simulation.duration
        if motion.end_time < duration * (1 - 1e-9):
            what = "recording" if isinstance(given, models.RecordedEnd) else "motion"
            raise self._refuse(
                (*where, "motion"),
                f"the {what} ends {motion.end_time:g} s after the start, before the run of {duration:g} s",
                f"Give `simulation.duration` of {motion.end_time:g} s or less, or a longer {what}.",
                None,
            )
        return scene.End(motion=motion, clamp=clamp)

    def _motion(self, given: Any, where: Location) -> motions.Motion:
        if isinstance(given, models.FixedEnd):
            return motions.fixed(given.position)
        if isinstance(given, models.RecordedEnd):
            return self._recorded(given, where)
        if isinstance(given, models.HarmonicEnd):
            with self._trying(where, "Check period, ramp and duration."):
                return motions.harmonic(
                    given.position,
                    given.amplitude,
                    given.period,
                    phase=given.phase,
                    ramp=given.ramp,
                    duration=self.case.simulation.duration,
                )
        self._check_waypoints(given.waypoints, (*where, "waypoints"))
        table = np.array(given.waypoints, dtype=float)
        with self._trying((*where, "waypoints"), "Check the rows."):
            if isinstance(given, models.VelocityWaypointsEnd):
                return motions.velocity_waypoints(given.position, table[:, 0], table[:, 1:])
            rates = np.zeros((len(table), 4))
            order = ("surge", "sway", "heave", "yaw")
            rates[:, [order.index(channel) for channel in given.channels]] = table[:, 1:]
            return motions.rov_waypoints(
                given.position, given.heading, table[:, 0], rates, given.attachment_offset
            )

    def _check_waypoints(self, rows: Sequence[Sequence[float]], where: Location) -> None:
        times = np.array([row[0] for row in rows])
        if times[0] > 0:
            raise self._refuse(
                (*where, 0, 0), "is after the start", "Add a first waypoint at 0 s: how the motion begins."
            )
        falls = np.flatnonzero(np.diff(times) < 0)
        if falls.size:
            raise self._refuse(
                (*where, int(falls[0]) + 1, 0),
                f"is before the waypoint above it, {times[falls[0]]:g} s",
                "Sort the waypoints by time; two at one time make a jump.",
            )

    def _recorded(self, given: models.RecordedEnd, where: Location) -> motions.Motion:
        file = self._file(given.file, (*where, "file"))
        factor = self._length_factor(given.unit, (*where, "unit"))
        options: dict[str, Any] = {
            "format": given.format,
            "time_column": given.time_column,
            "sample_interval": given.sample_interval,
            "marker": given.marker,
            "unit_factor": factor,
        }
        if given.columns is not None:
            options["columns"] = given.columns
        with self._trying((*where, "file"), "Check the file, `format`, `columns` and `where`."):
            times, positions = recording.read_recording(file, where=given.where, **options)
            if isinstance(given.origin, models.MeanOfRows):
                centre = recording.read_recording(file, where=given.origin.where, **options)[1].mean(axis=0)
            else:
                centre = np.array(given.origin)
        positions = self._upright(positions - centre, given.up, where)
        with self._trying(where, "Check the recording, `noise` and `start`."):
            return motions.recorded(times, positions, given.noise, start=given.start)

    def _length_factor(self, unit: str, where: Location) -> float:
        try:
            return length_factor(unit)
        except UnitError as error:
            raise self._refuse(where, error.message, error.remedy) from None

    def _upright(self, positions: Vector, up: ArrayLike | None, where: Location) -> Vector:
        if up is None:
            return positions
        return recording.rotate_to_vertical(positions, self._unit(up, (*where, "up")))

    def _check_distance(self, motion_a: motions.Motion, motion_b: motions.Motion) -> None:
        """Refuse ends farther apart than the cable can span."""
        length, duration = self.case.cable.length, self.case.simulation.duration
        times = np.linspace(0.0, duration, _SAMPLES)
        distances = np.linalg.norm(motion_b.position(times) - motion_a.position(times), axis=-1)
        strain = distances[0] / length - 1
        if strain > STRAIN_LIMIT:
            force = self.case.cable.axial_stiffness * strain
            raise self._refuse(
                ("ends",),
                f"the ends are {distances[0]:.4g} m apart at the start, a cable of {length:g} m would need "
                f"{strain:.1%} strain ({force:.3g} N)",
                f"Bring them within {length:g} m, or give a longer cable.",
                None,
            )
        far = int(np.argmax(distances))
        if distances[far] > length * (1 + STRETCH_LIMIT):
            first = int(np.argmax(distances > length * (1 + STRETCH_LIMIT)))
            raise self._refuse(
                ("ends",),
                f"the motions take the ends {distances[far]:.4g} m apart (t = {times[far]:.4g} s), "
                f"a cable of {length:g} m would be torn at t = {times[first]:.4g} s",
                "Shorten the run or the way, or give a longer cable.",
                None,
            )

    # Initial shape ------------------------------------------------------------------------------

    def _initial(
        self,
        cable: scene.Cable | None,
        ends: tuple[scene.End, scene.End] | None,
        attachments: tuple[tuple[scene.Attachment, ...], tuple[scene.Imu, ...]] | None,
    ) -> scene.InitialShape:
        given = self.case.initial
        if isinstance(given, models.StateStart):
            return self._saved_state(given, ends)
        if isinstance(given, models.MarkersStart):
            arc, positions = self._markers(given)
            return self._marker_shape(arc, positions, ends)
        if cable is None or ends is None or attachments is None:
            raise _Stop  # refused already; what follows needs them
        held = [end.motion for end in ends if end.motion is not None]
        if isinstance(given, models.TautStart):
            return self._taut(given, ends)
        if isinstance(given, models.CatenaryStart):
            return self._catenary(cable, held)
        if not held:
            self._check_drifting(given, cable, attachments[0])
        guess = None if given.through is None else np.array(given.through)
        return scene.EquilibriumShape(guess=guess)

    def _saved_state(
        self, given: models.StateStart, ends: tuple[scene.End, scene.End] | None
    ) -> scene.SavedState:
        file = self._file(given.file, ("initial", "file"))
        try:
            state = read_saved_state(file, given.time)
        except SavedStateError as error:
            raise self._refuse(("initial", "file"), str(error), "Give another result or time.") from error
        length = self.case.cable.length
        if abs(state.arc[-1] - length) > 1e-6 * length:
            raise self._refuse(
                ("initial", "file"),
                f"is the state of {state.arc[-1]:g} m of cable, not of {length:g} m",
                f"Give a cable.length of {state.arc[-1]:g} m, or the state of such a cable.",
            )
        for end, place, name in zip(ends or (), state.positions[[0, -1]], "ab", strict=False):
            if end.motion is not None:
                self._check_saved_end(name, float(np.linalg.norm(end.motion.position(0.0) - place)))
        return state

    def _check_saved_end(self, name: str, distance: float) -> None:
        if distance > _SPAN * self.case.cable.length:
            raise self._refuse(
                ("initial", "file"),
                f"has end {name} {distance:.3g} m from where ends.{name} begins",
                f"Let ends.{name} begin where the earlier run ended.",
            )

    def _check_drifting(
        self, given: models.EquilibriumStart, cable: scene.Cable, bodies: Sequence[scene.Attachment]
    ) -> None:
        """With both ends free only a neutral cable can rest, and only where it is put."""
        weights = [(body.mass - self.case.water.density * body.volume) * self.case.gravity for body in bodies]
        dry = cable.mass_per_length * self.case.gravity
        neutral = abs(cable.wet_weight) <= 1e-9 * dry and all(abs(weight) <= 1e-9 for weight in weights)
        if not neutral:
            raise self._refuse(
                ("initial",),
                "there is no equilibrium: both ends are free and the cable is not neutral",
                "Start `taut` with a `direction`, or hold an end.",
                None,
            )
        if given.through is None:
            raise self._refuse(
                ("initial",),
                "any shape of a free neutral cable is in equilibrium",
                "Say which with `through`, or start `taut` with a `direction`.",
                None,
            )

    def _taut(
        self, given: models.TautStart, ends: tuple[scene.End, scene.End]
    ) -> scene.TautShape | scene.MarkerShape:
        length = self.case.cable.length
        direction = None if given.direction is None else self._unit(given.direction, ("initial", "direction"))
        motion_a, motion_b = ends[0].motion, ends[1].motion
        if motion_a is not None and motion_b is not None:
            chord = motion_b.position(0.0) - motion_a.position(0.0)
            distance = float(np.linalg.norm(chord))
            if distance < length * (1 - _STRAIGHT):
                raise self._refuse(
                    ("initial", "shape"),
                    f"the ends are {distance:.6g} m apart and the cable is {length:g} m long: it hangs slack",
                    "Use `catenary` or `equilibrium`, or move the ends apart.",
                )
            if direction is not None and np.linalg.norm(direction - chord / distance) > 0.01:
                raise self._refuse(
                    ("initial", "direction"),
                    "is not the direction between the two prescribed ends",
                    f"Leave it out; it is {np.round(chord / distance, 4).tolist()}.",
                )
            return scene.TautShape()
        if direction is None:
            raise self._refuse(
                ("initial",),
                "`taut` with a free end does not say its direction",
                "Add `direction`, from A to B, for instance [0, 0, -1].",
                None,
            )
        if motion_a is None and motion_b is None:
            return self._taut_between_free_ends(direction)
        return scene.TautShape(direction=direction)

    def _taut_between_free_ends(self, direction: Vector) -> scene.MarkerShape:
        """Place a straight cable that nothing holds where one of its free ends says."""
        length = self.case.cable.length
        free_a, free_b = (getattr(end, "position", None) for end in (self.case.ends.a, self.case.ends.b))
        if free_a is None and free_b is None:
            raise self._refuse(
                ("ends",),
                "both ends are free and none says where it starts",
                "Add `position` to one of them.",
                None,
            )
        if free_a is None:
            positions = np.array([np.array(free_b) - length * direction, free_b])
        else:
            positions = np.array([free_a, np.array(free_a) + length * direction])
            if free_b is not None and np.linalg.norm(positions[1] - free_b) > _STRAIGHT * length:
                raise self._refuse(
                    ("ends", "b", "position"),
                    "is not where a straight cable from end A ends",
                    f"Leave it out; it is {np.round(positions[1], 6).tolist()}.",
                )
        return scene.MarkerShape(arc=np.array([0.0, length]), positions=positions)

    def _catenary(self, cable: scene.Cable, held: list[motions.Motion]) -> scene.CatenaryShape:
        where: Location = ("initial", "shape")
        if len(held) < 2:
            raise self._refuse(
                where, "hangs between two prescribed ends, one is free", "Use `taut` with a `direction`."
            )
        distance = float(np.linalg.norm(held[1].position(0.0) - held[0].position(0.0)))
        neutral = abs(cable.wet_weight) <= 1e-9 * max(cable.mass_per_length * self.case.gravity, 1e-12)
        if neutral and distance < cable.length:
            raise self._refuse(
                where,
                "does not exist for a neutral cable with slack",
                "Give its shape with `markers`, or use `equilibrium` with `through`.",
            )
        return scene.CatenaryShape()

    def _markers(self, given: models.MarkersStart) -> tuple[Vector, Vector]:
        if given.file is None:
            arc, positions = np.array(given.arc), np.array(given.positions)
            if len(arc) != len(positions):
                raise self._refuse(
                    ("initial", "positions"),
                    f"has {len(positions)} rows for {len(arc)} values of `arc`",
                    "Give one position for each marker.",
                )
            return arc, positions
        where: Location = ("initial", "file")
        file = self._file(given.file, where)
        options: dict[str, Any] = {"unit_factor": self._length_factor(given.unit, ("initial", "unit"))}
        if given.columns is not None:
            options["columns"] = given.columns
        with self._trying(where, "Check the file, `arc_column`, `columns` and `where`."):
            arc, positions = recording.read_markers(
                file, arc_column=str(given.arc_column), where=given.where, **options
            )
            if isinstance(given.origin, models.MeanOfRows):
                rows = recording.read_recording(
                    file, format="csv", sample_interval=1.0, where=given.origin.where, **options
                )  # the times do not matter for a mean
                centre = rows[1].mean(axis=0)
            else:
                centre = np.array(given.origin)
        return arc, self._upright(positions - centre, given.up, ("initial",))

    def _marker_shape(
        self, arc: Vector, positions: Vector, ends: tuple[scene.End, scene.End] | None
    ) -> scene.MarkerShape:
        length = self.case.cable.length
        where: Location = ("initial",) if getattr(self.case.initial, "file", None) else ("initial", "arc")
        falls = np.flatnonzero(np.diff(arc) <= 0)
        if falls.size:
            raise self._refuse(
                (*where, int(falls[0]) + 1),
                f"the markers' arc does not increase: {arc[falls[0] + 1]:g} m after {arc[falls[0]]:g} m",
                "Sort the markers from A to B and leave out repeated ones.",
                None,
            )
        if abs(arc[0]) > _SPAN * length or abs(arc[-1] - length) > _SPAN * length:
            raise self._refuse(
                where,
                f"the markers span {arc[0]:g} to {arc[-1]:g} m of a cable from 0 to {length:g} m",
                "Add markers at both ends, or correct `cable.length`.",
                None,
            )
        arc = arc.copy()
        arc[[0, -1]] = 0.0, length
        if ends is not None:
            positions = self._tie(positions, ends)
        chords, arcs = np.linalg.norm(np.diff(positions, axis=0), axis=1), np.diff(arc)
        worst = int(np.argmax(chords / arcs))
        if chords[worst] > arcs[worst] * (1 + STRAIN_LIMIT):
            raise self._refuse(
                where,
                f"markers {worst} and {worst + 1} are {chords[worst]:.4g} m apart "
                f"with {arcs[worst]:.4g} m of cable between them",
                "Check units, `arc` and positions: a chord cannot be longer than its arc.",
                None,
            )
        return scene.MarkerShape(arc=arc, positions=positions)

    def _tie(self, positions: Vector, ends: tuple[scene.End, scene.End]) -> Vector:
        """Put the outermost markers exactly on the prescribed ends; they differ by measurement noise."""
        positions = positions.copy()
        for name, index, end in (("a", 0, ends[0]), ("b", -1, ends[1])):
            if end.motion is None:
                continue
            place = end.motion.position(0.0)
            off = float(np.linalg.norm(place - positions[index]))
            if off > _OFF_END * self.case.cable.length:
                raise self._refuse(
                    ("initial",),
                    f"the {'first' if name == 'a' else 'last'} marker is {off:.4g} m from end {name.upper()} "
                    f"at t = 0, {np.round(place, 4).tolist()}",
                    "Check `origin`, `up` and the order of the markers (from A to B).",
                    np.round(positions[index], 4).tolist(),
                )
            positions[index] = place
        return positions

    # Output -------------------------------------------------------------------------------------

    def _output(self) -> scene.Output:
        given, duration = self.case.output, self.case.simulation.duration
        interval = default_interval(duration) if given.interval is None else given.interval
        if interval > duration * (1 + 1e-9):
            self._note(
                ("output", "interval"),
                f"is longer than the run of {duration:g} s",
                f"Give {default_interval(duration):g} s, for instance.",
            )
        if duration / interval > STATES_LIMIT:
            self._note(
                ("output", "interval"),
                f"makes {duration / interval:.3g} states to keep, more than {STATES_LIMIT}",
                f"Give {default_interval(duration):g} s, for instance.",
            )
        for index, name in enumerate(given.variables):
            if name not in VARIABLES:
                self._note(
                    ("output", "variables", index),
                    "is not a variable of a trajectory",
                    suggestion(name, VARIABLES),
                )
        return scene.Output(interval=interval, variables=given.variables, markers=self._output_markers())

    def _output_markers(self) -> Vector:
        given, length = self.case.output.markers, self.case.cable.length
        where: Location = ("output", "markers")
        if isinstance(given, models.SpacedMarkers):
            spacing = length if given.spacing is None else given.spacing
            count = length / spacing + 1 if given.count is None else given.count
            if count > _MARKERS:
                raise self._refuse(where, f"makes {count:.3g} markers, more than {_MARKERS}", "Keep fewer.")
            if given.count is not None:
                return np.linspace(0.0, length, given.count)
            if spacing > length:
                raise self._refuse(
                    (*where, "spacing"), f"is longer than the cable, {length:g} m", "Give a shorter one."
                )
            return np.minimum(np.arange(int(length / spacing * (1 + 1e-12)) + 1) * spacing, length)
        for index, position in enumerate(given):
            if position > length:
                self._note((*where, index), f"is beyond the cable, {length:g} m", f"Give 0 to {length:g} m.")
        return np.array(given, dtype=float)


def _message_and_remedy(text: str, remedy: str) -> tuple[str, str]:
    """Split what a reader or a motion says, ``what is wrong; what to do``."""
    message, semicolon, rest = text.rstrip(".").rpartition("; ")
    return (message, f"{rest[0].upper()}{rest[1:]}.") if semicolon and rest else (text.rstrip("."), remedy)


def default_interval(duration: float) -> float:
    """Choose a round time (1, 2 or 5 times a power of ten) that cuts `duration` into 500 to 1250 parts.

    It is 1 ms at the least, unless the run is shorter.
    """
    target = duration / 500
    decade = 10.0 ** math.floor(math.log10(target) + 1e-9)
    step = max(factor for factor in (1, 2, 5) if factor * decade <= target * (1 + 1e-9)) * decade
    return min(max(float(f"{step:.3g}"), 1e-3), duration)


def _numerics(given: models.Simulation) -> scene.Numerics:
    return scene.Numerics(
        relative_tolerance=given.relative_tolerance,
        max_order=given.max_order,
        max_step=given.max_step,
        max_steps=given.max_steps,
        time_limit=given.time_limit,
        linear_solver=given.linear_solver,
        strain_feedback=given.strain_feedback,
        closure_feedback=given.closure_feedback,
        skip=given.skip,
    )
