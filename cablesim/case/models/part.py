"""What all parts of a case have in common.

Depends on: nothing of ours.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict
from pydantic_core import PydanticCustomError


class Part(BaseModel):
    """What all parts of a case have in common: frozen, and no unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def one_of(part: BaseModel, *names: str, at_least: int = 1) -> None:
    """Refuse a part that gives more than one of `names`, or fewer than `at_least`."""
    given = [name for name in names if getattr(part, name) is not None]
    if len(given) > 1:
        raise PydanticCustomError(
            "one_of",
            "{message}",
            {
                "message": f"gives {' and '.join(f'`{name}`' for name in given)}, which exclude each other",
                "remedy": "Keep one of them.",
            },
        )
    if len(given) < at_least:
        listed = " nor ".join(f"`{name}`" for name in names)
        raise PydanticCustomError(
            "one_of", "{message}", {"message": f"gives neither {listed}", "remedy": "Add one of them."}
        )
