"""A winch and what drives it: a program, a controller or a function.

Depends on: part, measured, quantities.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from cablesim.case.models.measured import Cell
from cablesim.case.models.part import Part, one_of
from cablesim.case.quantities import (
    Acceleration,
    AccelerationPerForce,
    Force,
    Length,
    Number,
    Rate,
    Speed,
    SpeedPerForce,
    Time,
)


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
    unit: str | None = Field(
        default=None, description="unit of the length in the file; default: what the file says, or m"
    )
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
        one_of(self, "time_column", "sample_interval", at_least=0)
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
        one_of(self, "gap", "table")
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
    """A controller of the user's own: Python code that runs with all the rights of who runs the case.

    It is called with a `cablesim.control.Measurement` and returns a payout speed [m/s].  A class is
    made anew for each run.  The code runs when the case is run; other commands only read it.
    """

    kind: Literal["function"] = Field(description="a Python function or class of your own")
    function: str = Field(
        min_length=1,
        description="file.py:name, relative to the case file, or package.module:name of a module below the "
        "folder of the case or of an installed package that lists it under the entry points "
        "cablesim.controllers",
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
