"""Bodies and sensors on the cable of a case.

Depends on: review, case, scene.
"""

from __future__ import annotations

import math

import numpy as np

from cablesim import scene
from cablesim.builders.review import Review
from cablesim.case import models
from cablesim.case.errors import Location
from cablesim.scene import Vector


def build_attachments(review: Review) -> tuple[tuple[scene.Attachment, ...], tuple[scene.Imu, ...]]:
    """Make the bodies and the sensors on the cable, drum included."""
    bodies: list[scene.Attachment] = []
    imus: list[scene.Imu] = []
    names: set[str] = set()
    closest = review.case.mesh.segment_length / 1000
    for index, given in enumerate(review.case.attachments):
        where: Location = ("attachments", index)
        if given.name in names:
            review.note((*where, "name"), "is taken by an attachment before", "Give each its own name.")
        names.add(given.name)
        if given.at > review.case.cable.length:
            review.note(
                (*where, "at"),
                f"is beyond the cable, {review.case.cable.length:g} m",
                "Move it, or make the cable longer; `at` is counted from end A.",
            )
        if isinstance(given, models.Imu):
            with review.collect():
                mounting = _mounting(review, given.mounting, (*where, "mounting"))
                imus.append(scene.Imu(name=given.name, position=given.at, mounting=mounting))
            continue
        for other in bodies:
            if abs(other.position - given.at) < max(closest, 1e-9):
                review.note(
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


def _mounting(review: Review, given: models.Mounting | None, where: Location) -> Vector:
    if given is None:
        return np.array([0.0, 0.0, 0.0, 1.0])
    if given.rotation_vector is not None:
        vector = np.array(given.rotation_vector)
        angle = float(np.linalg.norm(vector))
        return np.append(vector * (0.5 * np.sinc(angle / (2 * np.pi))), math.cos(angle / 2))
    quaternion = np.array(given.quaternion, dtype=float)
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1) > 0.01:
        raise review.refuse(
            (*where, "quaternion"),
            f"has the norm {norm:g}, not 1",
            "Give a unit quaternion with the scalar last, [0, 0, 0, 1] for no rotation.",
        )
    return quaternion / norm
