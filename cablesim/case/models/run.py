"""How long a run is, how the integrator works, and what is kept.

Depends on: part, quantities.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, Tag, model_validator

from cablesim.case.models.part import Part, one_of
from cablesim.case.quantities import Length, Number, Rate, Time


class Simulation(Part):
    """How long, and how the integrator is told to work."""

    duration: Time = Field(gt=0, description="length of the run [s]")
    relative_tolerance: Number = Field(default=5e-6, ge=1e-10, le=1e-1, description="rtol of IDA [-]")
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
    mesh_damping: Number = Field(
        default=0.2,
        ge=0,
        description="least damping of axial waves of two segments, over the critical one [-]; it vanishes as "
        "segments get shorter, and 0 leaves cable.structural_damping alone",
    )
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
        one_of(self, "count", "spacing")
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
    precision: Literal["double", "single"] = Field(
        default="double", description="of the numbers kept; single (7 digits) halves memory and file"
    )
    attributes: dict[str, Annotated[str, Field(min_length=1)]] = Field(
        default_factory=dict,
        description="global attributes of the file after ACDD, such as creator_name, institution, license",
    )
