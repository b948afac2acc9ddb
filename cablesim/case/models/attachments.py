"""Buoys, ballasts, bodies and IMUs on the cable.

Depends on: part, quantities.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from cablesim.case.models.part import Part, one_of
from cablesim.case.quantities import Angle, Area, Length, Mass, Number, Volume


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
        one_of(self, "quaternion", "rotation_vector")
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
