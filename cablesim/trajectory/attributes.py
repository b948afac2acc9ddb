"""Global attributes of a trajectory, after the conventions CF and ACDD.

Depends on: scene.
"""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from importlib.metadata import version

from numpy.typing import NDArray

from cablesim.scene import Scene

CONVENTIONS = "CF-1.11, ACDD-1.3"

OF_THE_USER = (
    "acknowledgement",
    "comment",
    "contributor_name",
    "contributor_role",
    "creator_email",
    "creator_institution",
    "creator_name",
    "creator_type",
    "creator_url",
    "id",
    "institution",
    "keywords",
    "license",
    "metadata_link",
    "naming_authority",
    "processing_level",
    "program",
    "project",
    "publisher_email",
    "publisher_institution",
    "publisher_name",
    "publisher_type",
    "publisher_url",
    "references",
    "summary",
)
"""Attributes of CF and ACDD that only the user can know, or may know better."""

_KEYWORDS = "cable dynamics, tether, umbilical, underwater vehicle, simulation"


def global_attributes(
    scene: Scene, times: NDArray, skipped: Mapping[str, str], of_the_run: Mapping[str, object]
) -> dict[str, object]:
    """Attributes of the dataset of a run.

    Parameters
    ----------
    scene : Scene
        What was simulated.
    times : ndarray, shape (k,)
        Output times [s].
    skipped : mapping
        What was left out, and in which words.
    of_the_run : mapping
        Status and statistics of the run.
    """
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    program = f"cablesim {version('cablesim')}"
    return {
        "Conventions": CONVENTIONS,
        "title": scene.name,
        "summary": scene.description or f"A cable in water, simulated from the case {scene.name!r}.",
        "keywords": _KEYWORDS,
        "source": program,
        "product_version": version("cablesim"),
        "date_created": now,
        "history": f"{now} simulated by {program}",
        "time_coverage_duration": f"PT{times[-1] - times[0]:.9g}S",
        "time_coverage_resolution": f"PT{scene.output.interval:.9g}S",
        **of_the_run,
        "skipped": "; ".join(f"{name}: {words}" for name, words in skipped.items()),
        "case": scene.source,
        **scene.output.attributes,
    }
