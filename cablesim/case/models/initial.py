"""Shapes at t = 0.

Depends on: part, measured, quantities.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from cablesim.case.models.measured import Cell, MeasuredOrigin
from cablesim.case.models.part import Part, one_of
from cablesim.case.quantities import Direction, Length, Point, Speed, Time, Velocity


class MovingStart(Part):
    """What all shapes of which the case may say how they move have in common."""

    velocity: Velocity | None = Field(
        default=None,
        description="velocity of the whole cable at the start [m/s]; default: at rest between its ends, or "
        "linear from the velocity of one held end to that of the other",
    )
    velocities: tuple[tuple[Length, Speed, Speed, Speed], ...] | None = Field(
        default=None,
        min_length=1,
        description="the same along the cable: rows [s, vx, vy, vz] in m and m/s, s increasing from end A, "
        "linear in between, end values beyond",
    )

    @model_validator(mode="after")
    def _one_velocity(self) -> MovingStart:
        one_of(self, "velocity", "velocities", at_least=0)
        return self


class EquilibriumStart(MovingStart):
    """Start from the rest shape of the scene."""

    shape: Literal["equilibrium"] = Field(default="equilibrium", description="rest shape of the scene")
    through: tuple[Point, ...] | None = Field(
        default=None, min_length=2, description="polyline from A to B where the search starts [m]"
    )


class TautStart(MovingStart):
    """Start from a straight cable."""

    shape: Literal["taut"] = Field(description="straight cable")
    direction: Direction | None = Field(
        default=None, description="from A to B; needed only when an end is free"
    )
    stretched: bool = Field(
        default=True,
        description="with the tension that ends, loads and motion ask for; false: unstretched, with none",
    )


class CatenaryStart(MovingStart):
    """Start from the elastic catenary between the two ends."""

    shape: Literal["catenary"] = Field(
        description="elastic catenary between the ends, attachments and bending left out"
    )


class MarkersStart(MovingStart):
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
    unit: str | None = Field(
        default=None, description="unit of the positions in the file; default: what the file says, or m"
    )
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
        one_of(self, "arc", "file")
        one_of(self, "positions", "file")
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
