"""What can be computed but should make its reader look twice: one function a check, one sentence a find.

Depends on: scene, trajectory.

Checks of `before` need the scene only, those of `after` the states of a run; `recordings` looks at
measurements as they are read.  A sentence says what is odd, where, how much, and what to do.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import xarray as xr

ATTRIBUTE = "warnings"


def warnings_of(dataset: xr.Dataset) -> tuple[str, ...]:
    """Sentences on what is odd about a run, from the attributes of its dataset."""
    return tuple(str(dataset.attrs.get(ATTRIBUTE, "")).splitlines())
