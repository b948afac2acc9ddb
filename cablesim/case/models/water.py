"""The water around the cable and its current.

Depends on: part, quantities.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag

from cablesim.case.models.part import Part
from cablesim.case.quantities import Density, Length, Velocity


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
    """The water around the cable.

    Water that differs from place to place or in time accelerates cable and bodies in it: Morison's equation
    with the acceleration dU/dt + (U.grad) U of the undisturbed water where they are.
    """

    density: Density = Field(default=1000.0, ge=0, description="density [kg/m3]; 0 means vacuum")
    surface: Length | None = Field(
        default=None,
        description="height of the surface [m]; a run warns of cable above; default: 0 if all starts below 0",
    )
    current: Current = Field(
        default="none", description="velocity of the water: none, uniform, profile or map"
    )
