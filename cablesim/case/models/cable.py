"""The cable and how it is cut into segments.

Depends on: part, quantities.
"""

from __future__ import annotations

from pydantic import Field, model_validator

from cablesim.case.models.part import Part, one_of
from cablesim.case.quantities import (
    Area,
    BendingStiffness,
    Force,
    Length,
    LinearDensity,
    LinearForce,
    Number,
    Time,
)


class Cable(Part):
    """A homogeneous cable.

    The displaced section carries buoyancy.  It follows from the diameter unless `displaced_section` or the
    measured `wet_weight` is given (a porous rope's measured weight counts).  The added mass is that of the
    water around the cable: it goes with the outer section unless `added_mass_section` is given.
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
        default=1.0,
        ge=0,
        description="added mass over the mass of water in `added_mass_section`, across the cable [-]",
    )
    added_mass_tangential: Number = Field(
        default=0.0,
        ge=0,
        description="added mass over the mass of water in `added_mass_section`, along the cable [-]",
    )
    structural_damping: Time = Field(
        default=1e-3, ge=0, description="Kelvin-Voigt time tau of T + tau dT/dt [s]; 0 is allowed but slow"
    )
    minimum_bend_radius: Length | None = Field(
        default=None, gt=0, description="radius below which the cable is harmed [m]; a run warns of less"
    )
    breaking_load: Force | None = Field(
        default=None, gt=0, description="tension that breaks the cable [N]; a run warns of more"
    )
    wet_weight: LinearForce | None = Field(
        default=None,
        description="measured weight in water per metre [N/m], positive when it sinks, 0 when neutral",
    )
    displaced_section: Area | None = Field(
        default=None, ge=0, description="displaced volume per metre [m2]; default pi d^2/4"
    )
    added_mass_section: Area | None = Field(
        default=None,
        ge=0,
        description="section on which the added mass is counted [m2]; default pi d^2/4, the outer one, also "
        "of a porous or composite cable that displaces less",
    )

    @model_validator(mode="after")
    def _one_weight(self) -> Cable:
        one_of(self, "wet_weight", "displaced_section", at_least=0)
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
        one_of(self, "around", "at")
        return self


class Mesh(Part):
    """How the cable is cut into segments."""

    segment_length: Length = Field(gt=0, description="longest segment [m]")
    refine: tuple[Refinement, ...] = Field(default=(), description="places with shorter segments")
