"""What the two ends of the cable do.

Depends on: part, measured, quantities.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, WithJsonSchema, model_validator
from pydantic_core import PydanticCustomError

from cablesim.case.models.measured import Cell, MeasuredOrigin
from cablesim.case.models.part import Part, one_of
from cablesim.case.quantities import Angle, Direction, Length, Point, Quantity, Speed, Time, UnitError


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
    unit: str | None = Field(
        default=None, description="unit of the positions in the file; default: what the file says, or m"
    )
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
        one_of(self, "time_column", "sample_interval", at_least=0)
        return self


End = Annotated[
    FixedEnd | FreeEnd | VelocityWaypointsEnd | RovWaypointsEnd | HarmonicEnd | RecordedEnd,
    Field(discriminator="motion"),
]


class Ends(Part):
    """The two ends of the cable."""

    a: End = Field(description="end A, s = 0")
    b: End = Field(description="end B, s = length")
