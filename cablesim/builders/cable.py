"""The cable and its mesh rules from a case.

Depends on: review, case, scene.
"""

from __future__ import annotations

import math

from cablesim import scene
from cablesim.builders.review import Review
from cablesim.case import models
from cablesim.case.errors import Location, suggestion

SEGMENTS_LIMIT = 200_000
"""Most segments of a mesh."""


def build_cable(review: Review) -> scene.Cable:
    """Make the cable."""
    given = review.case.cable
    section, weight = _section_and_weight(review)
    return scene.Cable(
        length=given.length,
        diameter=given.diameter,
        mass_per_length=given.mass_per_length,
        displaced_section=section,
        added_mass_section=added_mass_section(given),
        wet_weight=weight,
        axial_stiffness=given.axial_stiffness,
        bending_stiffness=given.bending_stiffness,
        drag_normal=given.drag_normal,
        drag_tangential=given.drag_tangential,
        added_mass_normal=given.added_mass_normal,
        added_mass_tangential=given.added_mass_tangential,
        structural_damping=given.structural_damping,
        minimum_bend_radius=given.minimum_bend_radius,
        breaking_load=given.breaking_load,
    )


def outer_section(cable: models.Cable) -> float:
    """Section of the circle of the outer diameter [m2]."""
    return math.pi * cable.diameter**2 / 4


def added_mass_section(cable: models.Cable) -> float:
    """Section on which the added mass is counted [m2]."""
    return outer_section(cable) if cable.added_mass_section is None else cable.added_mass_section


def _section_and_weight(review: Review) -> tuple[float, float]:
    """Displaced section [m2] and weight in water [N/m]; each follows from the other."""
    cable, density, gravity = review.case.cable, review.case.water.density, review.case.gravity
    circle = outer_section(cable)
    if cable.wet_weight is None:
        section = circle if cable.displaced_section is None else cable.displaced_section
        return section, (cable.mass_per_length - density * section) * gravity
    where: Location = ("cable", "wet_weight")
    if gravity == 0:
        if cable.wet_weight != 0:
            raise review.refuse(where, "is a weight without gravity", "Leave it out, or set `gravity`.")
        return circle, 0.0
    weight_in_air = cable.mass_per_length * gravity
    if density == 0:
        raise review.refuse(
            where,
            "has no meaning in vacuum (water.density is 0)",
            f"Leave it out: the cable weighs {weight_in_air:.4g} N/m.",
        )
    section = (weight_in_air - cable.wet_weight) / (gravity * density)
    if section < -1e-9 * circle:
        raise review.refuse(
            where,
            f"is more than the weight in air, {weight_in_air:.4g} N/m",
            "Check it against `mass_per_length`; in water the cable cannot be heavier.",
        )
    return max(section, 0.0), cable.wet_weight


def build_mesh_rules(review: Review) -> scene.MeshRules:
    """Make the rules of the mesh, for the whole cable; refuse too few and too many segments."""
    given, length = review.case.mesh, review.case.cable.length
    where: Location = ("mesh", "segment_length")
    if given.segment_length > length / 3 * (1 + 1e-9):
        review.note(
            where,
            f"is longer than a third of the cable, {length:g} m",
            f"Give {length / 3:.3g} m or less; a tenth or less for a shape worth looking at.",
        )
    rules = []
    count = length / given.segment_length
    for index, refinement in enumerate(given.refine):
        with review.collect():
            rule = _refinement(review, refinement, ("mesh", "refine", index))
            count += min(2 * rule.within, length) / rule.segment_length
            rules.append(rule)
    if count > SEGMENTS_LIMIT:
        review.note(
            where,
            f"makes {count:.3g} segments with the refinements, more than {SEGMENTS_LIMIT}",
            f"Give longer segments: {length / SEGMENTS_LIMIT:.2g} m at the least.",
        )
    return scene.MeshRules(segment_length=given.segment_length, refinements=tuple(rules))


def _refinement(review: Review, given: models.Refinement, where: Location) -> scene.Refinement:
    length, longest = review.case.cable.length, review.case.mesh.segment_length
    if given.segment_length > longest:
        review.note(
            (*where, "segment_length"),
            f"is longer than mesh.segment_length, {longest:g} m",
            "A refinement makes segments shorter.",
        )
    if given.around is not None:
        places = {attachment.name: attachment.at for attachment in review.case.attachments}
        if given.around not in places:
            raise review.refuse(
                (*where, "around"), "is no attachment of this case", suggestion(given.around, places)
            )
        position = places[given.around]
    else:
        position = given.at if given.at is not None else 0.0
        if position > length:
            raise review.refuse(
                (*where, "at"), f"is beyond the cable, {length:g} m", f"Give 0 to {length:g} m."
            )
    return scene.Refinement(position=position, within=given.within, segment_length=given.segment_length)
