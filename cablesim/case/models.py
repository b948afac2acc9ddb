"""The models of a case file: one field for each key, with its unit and default.

Depends on: quantities.

Every model is frozen and refuses unknown keys.  Fields hold SI floats; what may be written
for them (``"4 mm"``) is said in `quantities`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Discriminator,
    Field,
    PlainValidator,
    Tag,
    WithJsonSchema,
    model_validator,
)
from pydantic_core import PydanticCustomError

from cablesim.case.quantities import (
    Acceleration,
    AccelerationPerForce,
    Angle,
    Area,
    BendingStiffness,
    Density,
    Direction,
    Force,
    Length,
    LinearDensity,
    LinearForce,
    Mass,
    Number,
    Point,
    Quantity,
    Rate,
    Speed,
    SpeedPerForce,
    Time,
    UnitError,
    Velocity,
    Volume,
)


class Part(BaseModel):
    """What all parts of a case have in common: frozen, and no unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def _one_of(part: BaseModel, *names: str, at_least: int = 1) -> None:
    """Refuse a part that gives more than one of `names`, or fewer than `at_least`."""
    given = [name for name in names if getattr(part, name) is not None]
    if len(given) > 1:
        raise PydanticCustomError(
            "one_of",
            "{message}",
            {
                "message": f"gives {' and '.join(f'`{name}`' for name in given)}, which exclude each other",
                "remedy": "Keep one of them.",
            },
        )
    if len(given) < at_least:
        listed = " nor ".join(f"`{name}`" for name in names)
        raise PydanticCustomError(
            "one_of", "{message}", {"message": f"gives neither {listed}", "remedy": "Add one of them."}
        )


# Water ------------------------------------------------------------------------------------------


class UniformCurrent(Part):
    """The same water velocity everywhere."""

    kind: Literal["uniform"] = Field(description="the same velocity everywhere")
    velocity: Velocity = Field(description="water velocity [m/s]")


class ProfileCurrent(Part):
    """Water velocity against height."""

    kind: Literal["profile"] = Field(description="velocity against height")
    heights: tuple[Length, ...] = Field(
        min_length=1, description="world z, increasing [m]; the end values hold outside"
    )
    velocities: tuple[Velocity, ...] = Field(min_length=1, description="water velocity at each height [m/s]")


class MapCurrent(Part):
    """Water velocity on a grid in a netCDF file; a coordinate that is absent means constant along it."""

    kind: Literal["map"] = Field(description="velocity on a grid in a netCDF file")
    file: str = Field(min_length=1, description="netCDF file, relative to the case file")
    u: str = Field(default="u", description="variable with the velocity along x [m/s]")
    v: str = Field(default="v", description="variable with the velocity along y [m/s]")
    w: str | None = Field(default=None, description="variable with the velocity along z [m/s]; none: zero")
    time: str = Field(default="time", description="coordinate of time, counted from the start of the run [s]")
    x: str = Field(default="x", description="coordinate along x [m]")
    y: str = Field(default="y", description="coordinate along y [m]")
    z: str = Field(default="z", description="coordinate along z, upwards [m]")


def _current_tag(value: Any) -> str | None:
    """Tell which of the currents is meant."""
    if isinstance(value, str):
        return value
    return value.get("kind") if isinstance(value, dict) else getattr(value, "kind", None)


Current = Annotated[
    Annotated[Literal["none"], Tag("none")]
    | Annotated[UniformCurrent, Tag("uniform")]
    | Annotated[ProfileCurrent, Tag("profile")]
    | Annotated[MapCurrent, Tag("map")],
    Discriminator(
        _current_tag,
        custom_error_type="kind",
        custom_error_message="is no kind of current",
        custom_error_context={"known": ["none", "uniform", "profile", "map"], "key": "kind"},
    ),
]


class Water(Part):
    """The water around the cable."""

    density: Density = Field(default=1000.0, ge=0, description="density [kg/m3]; 0 means vacuum")
    current: Current = Field(
        default="none", description="velocity of the water: none, uniform, profile or map"
    )


# Cable and mesh ---------------------------------------------------------------------------------


class Cable(Part):
    """A homogeneous cable.

    The displaced section carries buoyancy and added mass.  It follows from the diameter unless
    `displaced_section` or the measured `wet_weight` is given (a porous rope's measured weight counts).
    """

    length: Length = Field(
        gt=0,
        description="unstretched length; with a winch of the whole cable, drum included [m]",
    )
    diameter: Length = Field(gt=0, description="outer diameter, on which drag acts [m]")
    mass_per_length: LinearDensity = Field(gt=0, description="dry mass per unstretched metre [kg/m]")
    axial_stiffness: Force = Field(gt=0, description="EA [N]")
    bending_stiffness: BendingStiffness = Field(default=0.0, ge=0, description="EI [N m2]")
    drag_normal: Number = Field(
        default=1.2, ge=0, description="normal drag coefficient, on the diameter d [-]"
    )
    drag_tangential: Number = Field(
        default=0.01, ge=0, description="tangential drag coefficient, on pi d [-]"
    )
    added_mass_normal: Number = Field(
        default=1.0, ge=0, description="added mass per displaced mass, across the cable [-]"
    )
    added_mass_tangential: Number = Field(
        default=0.0, ge=0, description="added mass per displaced mass, along the cable [-]"
    )
    structural_damping: Time = Field(
        default=1e-3, ge=0, description="Kelvin-Voigt time tau of T + tau dT/dt [s]; 0 is allowed but slow"
    )
    wet_weight: LinearForce | None = Field(
        default=None,
        description="measured weight in water per metre [N/m], positive when it sinks, 0 when neutral",
    )
    displaced_section: Area | None = Field(
        default=None, ge=0, description="displaced volume per metre [m2]; default pi d^2/4"
    )

    @model_validator(mode="after")
    def _one_weight(self) -> Cable:
        _one_of(self, "wet_weight", "displaced_section", at_least=0)
        return self


class Refinement(Part):
    """Shorter segments near one place of the cable."""

    around: str | None = Field(
        default=None, description="name of the attachment in the middle of the refined part"
    )
    at: Length | None = Field(default=None, ge=0, description="or its material coordinate s [m]")
    within: Length = Field(gt=0, description="the refined part reaches so far to both sides [m]")
    segment_length: Length = Field(gt=0, description="longest segment in it [m]")

    @model_validator(mode="after")
    def _one_place(self) -> Refinement:
        _one_of(self, "around", "at")
        return self


class Mesh(Part):
    """How the cable is cut into segments."""

    segment_length: Length = Field(gt=0, description="longest segment [m]")
    refine: tuple[Refinement, ...] = Field(default=(), description="places with shorter segments")


# Attachments ------------------------------------------------------------------------------------


class Body(Part):
    """A point body fixed to the cable; its weight in water follows from mass and volume."""

    kind: Literal["buoy", "ballast", "body"] = Field(description="what it is; the physics is the same")
    name: str = Field(min_length=1, description="label, unique in the case")
    at: Length = Field(ge=0, description="material coordinate s, from end A [m]")
    mass: Mass = Field(ge=0, description="dry mass [kg]")
    volume: Volume = Field(ge=0, description="displaced volume [m3]")
    drag_area: Area = Field(default=0.0, ge=0, description="drag coefficient times frontal area, CdA [m2]")
    added_mass: Number = Field(default=0.5, ge=0, description="added mass per displaced mass [-]; sphere 0.5")


class Mounting(Part):
    """Rotation that turns the cable's local frame (x along the tangent) into the sensor's."""

    quaternion: tuple[Number, Number, Number, Number] | None = Field(
        default=None, description="unit quaternion, scalar last: [x, y, z, w]"
    )
    rotation_vector: tuple[Angle, Angle, Angle] | None = Field(
        default=None, description="or rotation vector: axis times angle [rad]"
    )

    @model_validator(mode="after")
    def _one_rotation(self) -> Mounting:
        _one_of(self, "quaternion", "rotation_vector")
        return self


class Imu(Part):
    """A massless inertial sensor on the cable."""

    kind: Literal["imu"] = Field(description="an inertial sensor without mass")
    name: str = Field(min_length=1, description="label, unique in the case")
    at: Length = Field(ge=0, description="material coordinate s, from end A [m]")
    mounting: Mounting | None = Field(
        default=None,
        description="rotation that turns the cable's local frame into the sensor's; default none",
    )


Attachment = Annotated[Body | Imu, Field(discriminator="kind")]


# Ends -------------------------------------------------------------------------------------------


class _End(Part):
    clamp: Direction | None = Field(
        default=None,
        description="tangent imposed on a cable that bends, pointing from A to B; default: ball joint",
    )


class FixedEnd(_End):
    """An end that does not move."""

    motion: Literal["fixed"] = Field(description="the end does not move")
    position: Point = Field(description="where it is [m]")


class FreeEnd(_End):
    """An end that nothing holds."""

    motion: Literal["free"] = Field(description="nothing holds the end")
    position: Point | None = Field(
        default=None, description="where it starts [m]; needed only when the other end is free too"
    )


class VelocityWaypointsEnd(_End):
    """An end whose velocity is linear between waypoints."""

    motion: Literal["velocity_waypoints"] = Field(description="velocity linear between waypoints")
    position: Point = Field(description="where it starts [m]")
    waypoints: tuple[tuple[Time, Speed, Speed, Speed], ...] = Field(
        min_length=1, description="rows [t, vx, vy, vz] in s and m/s, t not decreasing"
    )


Channel = Literal["surge", "sway", "heave", "yaw"]
_CHANNELS: tuple[Channel, ...] = ("surge", "sway", "heave", "yaw")
_RATE = {
    "surge": Quantity("speed", "m/s", "0.25 m/s"),
    "sway": Quantity("speed", "m/s", "0.25 m/s"),
    "heave": Quantity("speed", "m/s", "0.25 m/s"),
    "yaw": Quantity("angular rate", "rad/s", "20 deg/s"),
}
_WAYPOINT_TIME = Quantity("time", "s", "10 ms")
_Converted = Annotated[float, WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "string"}]})]


class RovWaypointsEnd(_End):
    """An end carried by a vehicle whose body rates are linear between waypoints (paper, Table IV)."""

    motion: Literal["rov_waypoints"] = Field(description="surge, sway, heave, yaw rates between waypoints")
    position: Point = Field(description="where the end of the cable starts [m]")
    heading: Angle = Field(
        default=0.0, description="vehicle's heading at the start, from +x towards +y [rad]"
    )
    attachment_offset: Point = Field(
        default=(0.0, 0.0, 0.0),
        description="from the vehicle's reference point to the end of the cable, in its axes [m]",
    )
    channels: tuple[Channel, ...] = Field(
        default=_CHANNELS, min_length=1, description="what the columns after the time are; the others stay 0"
    )
    waypoints: tuple[tuple[_Converted, ...], ...] = Field(
        min_length=1, description="rows [t, ...] in s, m/s and rad/s, one column for each channel"
    )

    @model_validator(mode="before")
    @classmethod
    def _convert_rows(cls, data: Any) -> Any:
        """Convert each column by the unit of its channel."""
        if not isinstance(data, dict) or not isinstance(data.get("waypoints"), list | tuple):
            return data
        channels = data.get("channels", _CHANNELS)
        if not isinstance(channels, list | tuple):
            return data
        columns = [_WAYPOINT_TIME, *(_RATE.get(str(name)) for name in channels)]
        rows = [_convert_row(row, index, columns) for index, row in enumerate(data["waypoints"])]
        return {**data, "waypoints": rows}

    @model_validator(mode="after")
    def _each_channel_once(self) -> RovWaypointsEnd:
        if len(set(self.channels)) != len(self.channels):
            raise PydanticCustomError(
                "channels", "{message}", {"message": "names a channel twice", "remedy": "Name each once."}
            )
        return self


def _convert_row(row: Any, index: int, columns: list[Quantity | None]) -> list[float]:
    if not isinstance(row, list | tuple) or len(row) != len(columns):
        raise PydanticCustomError(
            "row",
            "{message}",
            {
                "message": f"has {len(row)} columns" if isinstance(row, list | tuple) else "is not a row",
                "remedy": f"Give the time and one column for each channel, {len(columns)} in all.",
                "at": ["waypoints", index],
            },
        )
    converted = []
    for column, (quantity, value) in enumerate(zip(columns, row, strict=True)):
        try:
            # an unknown channel is refused by its own check, whatever stands in its column
            converted.append(0.0 if quantity is None else quantity.parse(value))
        except UnitError as error:
            raise PydanticCustomError(
                "quantity",
                "{message}",
                {"message": error.message, "remedy": error.remedy, "at": ["waypoints", index, column]},
            ) from None
    return converted


class HarmonicEnd(_End):
    """An end that swings about a point."""

    motion: Literal["harmonic"] = Field(description="sine about a point")
    position: Point = Field(description="middle of the swing [m]")
    amplitude: Point = Field(description="amplitude along x, y, z [m]")
    period: Time = Field(gt=0, description="period [s]")
    phase: Angle = Field(default=0.0, description="phase at t = 0 [rad]")
    ramp: Time = Field(default=0.0, ge=0, description="the amplitude grows from 0 during this time [s]")


def _cell(value: Any) -> str | int | float:
    """Accept what can stand in a cell of a table."""
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise PydanticCustomError(
            "cell",
            "{message}",
            {"message": "is neither text nor a number", "remedy": "Give what stands in the column."},
        )
    return value


Cell = Annotated[
    Any, PlainValidator(_cell), WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "number"}]})
]


class MeanOfRows(Part):
    """A point measured as the mean of some rows of the same file."""

    where: dict[str, Cell] = Field(
        min_length=1, description="rows with these values, for instance {point: rod_end}"
    )


def _origin_tag(value: Any) -> str:
    """Tell a point from the mean of rows."""
    return "rows" if isinstance(value, dict | MeanOfRows) else "point"


MeasuredOrigin = Annotated[
    Annotated[Point, Tag("point")] | Annotated[MeanOfRows, Tag("rows")], Discriminator(_origin_tag)
]


class RecordedEnd(_End):
    """An end that follows a recording, smoothed before it is differentiated."""

    motion: Literal["recorded"] = Field(description="follows a recording")
    file: str = Field(min_length=1, description="recording, relative to the case file")
    format: Literal["auto", "csv", "netcdf", "qtm"] = Field(
        default="auto", description="form of the file; auto: by its ending"
    )
    columns: tuple[str, str, str] | None = Field(
        default=None, description="names of the columns with x, y, z; default: x, y, z"
    )
    time_column: str | None = Field(default=None, description="name of the column with the time [s]")
    sample_interval: Time | None = Field(
        default=None, gt=0, description="time between rows when there is no time column [s]"
    )
    where: dict[str, Cell] | None = Field(
        default=None, description="keep only rows with these values, for instance {point: robot}"
    )
    marker: str | None = Field(default=None, description="name of the marker in a file with several")
    unit: str = Field(default="m", description="unit of the positions in the file")
    up: Direction | None = Field(
        default=None,
        description="measured vertical in the frame of the file; positions are turned so that it is z",
    )
    origin: MeasuredOrigin = Field(
        default=(0.0, 0.0, 0.0),
        description="point of the file that becomes (0, 0, 0) [m], subtracted before turning",
    )
    noise: Length = Field(default=7e-4, ge=0, description="standard deviation of the measurement noise [m]")
    start: Time | None = Field(
        default=None, description="time in the recording at which the run starts [s]; default: its first row"
    )

    @model_validator(mode="after")
    def _one_time(self) -> RecordedEnd:
        _one_of(self, "time_column", "sample_interval", at_least=0)
        return self


End = Annotated[
    FixedEnd | FreeEnd | VelocityWaypointsEnd | RovWaypointsEnd | HarmonicEnd | RecordedEnd,
    Field(discriminator="motion"),
]


class Ends(Part):
    """The two ends of the cable."""

    a: End = Field(description="end A, s = 0")
    b: End = Field(description="end B, s = length")


# Winch ------------------------------------------------------------------------------------------


class WaypointsPayout(Part):
    """A program: the payout speed is linear between waypoints and stays what it is after the last."""

    kind: Literal["waypoints"] = Field(description="payout speed linear between waypoints")
    waypoints: tuple[tuple[Time, Speed], ...] = Field(
        min_length=1,
        description="rows [t, speed] in s and m/s, t not decreasing, speed positive when cable goes out",
    )


class RecordedPayout(Part):
    """A program: the deployed length follows a recording, smoothed before it is differentiated.

    The result of an earlier run with a winch is such a recording.
    """

    kind: Literal["recorded"] = Field(description="deployed length follows a recording")
    file: str = Field(min_length=1, description="recording, relative to the case file")
    format: Literal["auto", "csv", "netcdf"] = Field(
        default="auto", description="form of the file; auto: by its contents"
    )
    column: str = Field(
        default="deployed_length",
        min_length=1,
        description="name of the column or variable with the deployed length",
    )
    time_column: str | None = Field(default=None, description="name of the column with the time [s]")
    sample_interval: Time | None = Field(
        default=None, gt=0, description="time between rows when there is no time column [s]"
    )
    where: dict[str, Cell] | None = Field(
        default=None, description="keep only rows with these values, for instance {run: 24}"
    )
    unit: str = Field(default="m", description="unit of the length in the file")
    noise: Length = Field(
        default=1e-3,
        ge=0,
        description="standard deviation of the measurement noise [m]; 0 for the result of a simulation",
    )
    start: Time | None = Field(
        default=None, description="time in the recording at which the run starts [s]; default: its first row"
    )

    @model_validator(mode="after")
    def _one_time(self) -> RecordedPayout:
        _one_of(self, "time_column", "sample_interval", at_least=0)
        return self


class _Controlled(Part):
    """What all controllers have in common."""

    period: Time = Field(default=0.05, gt=0, description="time between two samples [s]")
    delay: Time = Field(
        default=0.0, ge=0, description="age of the measurements when the controller gets them [s]"
    )


class BuoyGapPayout(_Controlled):
    """A controller that keeps two buoys at a distance: wider than that, the cable is taut and goes out."""

    kind: Literal["buoy_gap"] = Field(description="keeps two buoys of the cable at a distance")
    buoys: tuple[str, str] = Field(description="names of the two buoys")
    gap: Length | None = Field(default=None, gt=0, description="distance to keep [m]")
    table: str | None = Field(
        default=None,
        min_length=1,
        description="or csv file with columns speed [m/s] and gap [m]: the distance to keep, linear in the "
        "speed of the buoys between its rows; relative to the case file",
    )
    speed_time: Time = Field(
        default=0.0, ge=0, description="time constant that smooths the measured speed of the buoys [s]"
    )
    proportional: Rate = Field(ge=0, description="payout speed per metre too wide [1/s]")
    derivative: Number = Field(default=0.0, ge=0, description="payout speed per speed of widening [-]")

    @model_validator(mode="after")
    def _one_set_point(self) -> BuoyGapPayout:
        _one_of(self, "gap", "table")
        return self


class ConstantTensionPayout(_Controlled):
    """A controller that pays out when the cable pulls more than it should."""

    kind: Literal["constant_tension"] = Field(description="keeps the tension at one end of the cable")
    tension: Force = Field(ge=0, description="tension to keep [N]")
    end: Literal["a", "b"] = Field(default="b", description="where it is measured; b is the winch")
    proportional: SpeedPerForce = Field(ge=0, description="payout speed per newton too much [m/s/N]")
    integral: AccelerationPerForce = Field(
        default=0.0, ge=0, description="payout speed gained per second and newton too much [m/s2/N]"
    )
    speed_limit: Speed | None = Field(
        default=None,
        gt=0,
        description="greatest speed asked for, at which the integral stops [m/s]; default: that of the winch",
    )


class ConstantLengthPayout(_Controlled):
    """A controller that brings the deployed length to a value."""

    kind: Literal["constant_length"] = Field(description="brings the deployed length to a value")
    length: Length = Field(gt=0, description="deployed length to keep [m]")
    proportional: Rate = Field(ge=0, description="payout speed per metre too short [1/s]")


class FunctionPayout(_Controlled):
    """A controller of the user's own: Python code that runs with all the rights of the user.

    It is called with a `cablesim.control.Measurement` and returns a payout speed [m/s].  A class is
    made anew for each run.
    """

    kind: Literal["function"] = Field(description="a Python function or class of your own")
    function: str = Field(
        min_length=1,
        description="file.py:name, relative to the case file, or package.module:name",
    )
    options: dict[str, Any] = Field(
        default_factory=dict, description="keyword arguments for the function or class"
    )


Payout = Annotated[
    WaypointsPayout
    | RecordedPayout
    | BuoyGapPayout
    | ConstantTensionPayout
    | ConstantLengthPayout
    | FunctionPayout,
    Field(discriminator="kind"),
]


class Winch(Part):
    """A winch at end B; the cable beyond the deployed length is on its drum."""

    deployed_length: Length = Field(gt=0, description="unstretched length between A and B at t = 0 [m]")
    maximum_speed: Speed | None = Field(
        default=None, gt=0, description="fastest payout and reeling in [m/s]; default: no limit"
    )
    maximum_acceleration: Acceleration | None = Field(
        default=None, gt=0, description="fastest change of the speed [m/s2]; default: no limit"
    )
    minimum_length: Length = Field(
        default=0.0, ge=0, description="the run stops when the deployed length falls to this [m]"
    )
    payout: Payout = Field(description="program or controller of the payout")


# Initial shape ----------------------------------------------------------------------------------


class EquilibriumStart(Part):
    """Start from the rest shape of the scene."""

    shape: Literal["equilibrium"] = Field(default="equilibrium", description="rest shape of the scene")
    through: tuple[Point, ...] | None = Field(
        default=None, min_length=2, description="polyline from A to B where the search starts [m]"
    )


class TautStart(Part):
    """Start from a straight cable."""

    shape: Literal["taut"] = Field(description="straight cable")
    direction: Direction | None = Field(
        default=None, description="from A to B; needed only when an end is free"
    )


class CatenaryStart(Part):
    """Start from the elastic catenary between the two ends."""

    shape: Literal["catenary"] = Field(
        description="elastic catenary between the ends, attachments and bending left out"
    )


class MarkersStart(Part):
    """Start from a shape through measured markers, typed in or read from a file."""

    shape: Literal["markers"] = Field(description="shape through measured markers")
    arc: tuple[Length, ...] | None = Field(
        default=None, min_length=2, description="material coordinate of each marker, from 0 to the length [m]"
    )
    positions: tuple[Point, ...] | None = Field(
        default=None, min_length=2, description="position of each marker [m]"
    )
    file: str | None = Field(default=None, min_length=1, description="csv file, relative to the case file")
    arc_column: str | None = Field(default=None, description="column with the material coordinate [m]")
    columns: tuple[str, str, str] | None = Field(
        default=None, description="columns with x, y, z; default: x, y, z"
    )
    unit: str = Field(default="m", description="unit of the positions in the file")
    where: dict[str, Cell] | None = Field(
        default=None, description="keep only rows with these values, for instance {frame: 3}"
    )
    up: Direction | None = Field(default=None, description="measured vertical in the frame of the file")
    origin: MeasuredOrigin = Field(
        default=(0.0, 0.0, 0.0),
        description="point of the file that becomes (0, 0, 0) [m], or {where: ...} for a mean of rows",
    )

    @model_validator(mode="after")
    def _one_source(self) -> MarkersStart:
        _one_of(self, "arc", "file")
        _one_of(self, "positions", "file")
        if self.file is not None and self.arc_column is None:
            raise PydanticCustomError(
                "one_of",
                "{message}",
                {"message": "lacks `arc_column`", "remedy": "Name the column of the material coordinates."},
            )
        return self


class StateStart(Part):
    """Start from a state of an earlier result."""

    shape: Literal["state"] = Field(description="state of an earlier result")
    file: str = Field(min_length=1, description="result file, relative to the case file")
    time: Time | None = Field(default=None, description="time in it [s]; default: its last good state")


Initial = Annotated[
    EquilibriumStart | TautStart | CatenaryStart | MarkersStart | StateStart, Field(discriminator="shape")
]


# Run --------------------------------------------------------------------------------------------


class Simulation(Part):
    """How long, and how the integrator is told to work."""

    duration: Time = Field(gt=0, description="length of the run [s]")
    relative_tolerance: Number = Field(default=1e-4, ge=1e-10, le=1e-1, description="rtol of IDA [-]")
    max_order: int = Field(
        default=2, ge=1, le=5, strict=True, description="highest order of BDF; above 2 only with damping"
    )
    max_step: Time | None = Field(default=None, gt=0, description="longest step [s]; default: no limit")
    max_steps: int = Field(
        default=1_000_000,
        ge=1,
        le=2_000_000_000,
        strict=True,
        description="give up after so many steps between two outputs",
    )
    time_limit: Time | None = Field(
        default=None, gt=0, description="wall-clock time after which a run stops [s]; default: no limit"
    )
    linear_solver: Literal["auto", "band", "krylov"] = Field(
        default="auto", description="solver of the linear systems; auto: by size"
    )
    strain_feedback: Rate = Field(default=10.0, ge=0, description="beta, ties tension to chord length [1/s]")
    closure_feedback: Rate = Field(default=20.0, ge=0, description="kappa, ties the chords to the ends [1/s]")
    skip: bool = Field(
        default=True,
        strict=True,
        description="leave out what the scene does not need; the result is the same",
    )


class SpacedMarkers(Part):
    """Output markers at equal distances along the cable."""

    count: int | None = Field(
        default=None, ge=2, le=100_000, strict=True, description="so many, equally spaced, both ends included"
    )
    spacing: Length | None = Field(
        default=None, gt=0, description="or one every so many metres from end A [m]"
    )

    @model_validator(mode="after")
    def _one_rule(self) -> SpacedMarkers:
        _one_of(self, "count", "spacing")
        return self


def _markers_tag(value: Any) -> str:
    """Tell a rule from a list."""
    return "spaced" if isinstance(value, dict | SpacedMarkers) else "list"


class Output(Part):
    """What is kept of the run."""

    interval: Time | None = Field(
        default=None, gt=0, description="time between two kept states [s]; default: some 500 to 1000 states"
    )
    variables: tuple[Annotated[str, Field(min_length=1)], ...] = Field(
        default=(), description="names of the variables to keep; default: all"
    )
    markers: Annotated[
        Annotated[tuple[Annotated[Length, Field(ge=0)], ...], Tag("list")]
        | Annotated[SpacedMarkers, Tag("spaced")],
        Discriminator(_markers_tag),
    ] = Field(default=(), description="material coordinates whose positions are kept [m], or a rule for them")
