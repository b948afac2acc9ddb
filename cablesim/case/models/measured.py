"""What is picked from a file of measurements: cells of its rows, and a point.

Depends on: part, quantities.
"""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Discriminator, Field, PlainValidator, Tag, WithJsonSchema
from pydantic_core import PydanticCustomError

from cablesim.case.models.part import Part
from cablesim.case.quantities import Point


def _cell(value: Any) -> str | int | float:
    """Accept what can stand in a cell of a table."""
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise PydanticCustomError(
            "cell",
            "{message}",
            {"message": "is neither text nor a number", "remedy": "Give what stands in the column."},
        )
    return value


Cell = Annotated[
    Any, PlainValidator(_cell), WithJsonSchema({"anyOf": [{"type": "string"}, {"type": "number"}]})
]


class MeanOfRows(Part):
    """A point measured as the mean of some rows of the same file."""

    where: dict[str, Cell] = Field(
        min_length=1, description="rows with these values, for instance {point: rod_end}"
    )


def _origin_tag(value: Any) -> str:
    """Tell a point from the mean of rows."""
    return "rows" if isinstance(value, dict | MeanOfRows) else "point"


MeasuredOrigin = Annotated[
    Annotated[Point, Tag("point")] | Annotated[MeanOfRows, Tag("rows")], Discriminator(_origin_tag)
]
