"""Small real results for the tests of what comes after a run."""

import functools

from cablesim import Case, simulate
from cablesim.starters import starter_text

CHANGES = {
    "sway": ("duration: 10 s", "duration: 1 s"),
    "tow": ("duration: 180 s", "duration: 30 s"),
    "buoys": ("duration: 60 s", "duration: 4 s"),
}


def short_case(kind):
    """Text of a starter with a short duration, and markers."""
    text = starter_text(kind, "case.yaml", kind).replace(*CHANGES[kind])
    return text + "  markers: {count: 5}\n"


@functools.cache
def _computed(kind):
    return simulate(Case.from_yaml(short_case(kind)))


def result(kind):
    """Result of a starter: sway (in space), tow (in a plane, one body), buoys (in space, two bodies)."""
    return _computed(kind).copy(deep=True)
