"""The case as a whole: read from YAML or made in Python, checked, written back, published as a schema.

Depends on: errors, explain, models, read.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import AfterValidator, Field, PrivateAttr, ValidationError
from pydantic_core import PydanticCustomError

from cablesim.case import models
from cablesim.case.errors import CaseError, Location, Origin, Problem
from cablesim.case.explain import explain
from cablesim.case.quantities import Acceleration
from cablesim.case.read import read_yaml, write_yaml


def _on_one_line(name: str) -> str:
    """Refuse what would end up in names of files and on terminals."""
    if not name.isprintable():
        remedy = "Write letters, digits, signs and spaces."
        raise PydanticCustomError(
            "name", "{message}", {"message": "has letters that cannot be shown", "remedy": remedy}
        )
    return name


class Case(models.Part):
    """One simulation as its user describes it.

    A case is made by `load_case` from a file, by `Case.from_dict` from plain data (both with readable
    errors), or directly, ``Case(name=..., cable=..., ...)``.  Fields hold SI floats.

    Two cases are equal when their contents are, wherever they came from.
    """

    name: Annotated[str, AfterValidator(_on_one_line)] = Field(
        min_length=1, description="short name, used for result files and titles"
    )
    description: str = Field(default="", description="what the case shows and where its numbers come from")
    gravity: Acceleration = Field(default=9.81, ge=0, description="acceleration along -z [m/s2]")
    water: models.Water = Field(default=models.Water(), description="the water around the cable")
    cable: models.Cable = Field(description="the cable")
    mesh: models.Mesh = Field(description="how the cable is cut into segments")
    attachments: tuple[models.Attachment, ...] = Field(
        default=(), description="buoys, ballasts, bodies and IMUs on the cable"
    )
    ends: models.Ends = Field(description="what the two ends of the cable do")
    winch: models.Winch | None = Field(
        default=None, description="a winch at end B that pays cable out and reels it in; default: none"
    )
    initial: models.Initial = Field(
        default=models.EquilibriumStart(), description="shape at t = 0; default: equilibrium"
    )
    simulation: models.Simulation = Field(description="how long, and how the integrator works")
    output: models.Output = Field(default=models.Output(), description="what is kept of the run")

    _origin: Origin = PrivateAttr(default_factory=lambda: Origin(directory=Path.cwd()))

    def __eq__(self, other: object) -> bool:
        return type(other) is type(self) and self.__dict__ == other.__dict__

    def __hash__(self) -> int:
        return hash((type(self), self.to_yaml()))

    @classmethod
    def from_dict(
        cls,
        data: Mapping[str, Any],
        *,
        directory: str | Path | None = None,
        file: str | None = None,
        lines: Mapping[Location, int] | None = None,
    ) -> Case:
        """Make a case from plain data, as it would stand in a file.

        Parameters
        ----------
        data : mapping
            Keys and values of a case file.
        directory : path, optional
            Where relative paths in the case start; default: the working directory.
        file : str, optional
            Name of the file that the data comes from, for messages.
        lines : mapping, optional
            Line (from 1) of each part in that file, by its path as a tuple of keys and indices.

        Raises
        ------
        CaseError
            With everything that is wrong.
        """
        place = Path.cwd() if directory is None else Path(directory)
        return cls._checked(data, Origin(directory=place, file=file, lines=lines, raw=data))

    @classmethod
    def from_yaml(cls, text: str, *, directory: str | Path | None = None, file: str | None = None) -> Case:
        """Make a case from YAML text.

        Parameters
        ----------
        text : str
            A case file's contents.
        directory : path, optional
            Where relative paths in the case start; default: the working directory.
        file : str, optional
            Name of the file for messages.

        Raises
        ------
        CaseError
            With everything that is wrong, and the lines.
        """
        data, lines = read_yaml(text, file)
        return cls.from_dict(data, directory=directory, file=file, lines=lines)

    @classmethod
    def _checked(cls, data: Any, origin: Origin) -> Case:
        if not isinstance(data, Mapping):
            what = "is empty" if data is None else "is not a group of keys"
            raise CaseError([origin.problem((), f"the case {what}", "Write keys such as `name:`, `cable:`.")])
        try:
            case = cls.model_validate(dict(data))
        except ValidationError as error:
            raise CaseError(explain(error, cls, origin)) from None
        case._origin = origin
        return case

    @property
    def directory(self) -> Path:
        """Where relative paths in the case start."""
        return self._origin.directory

    @property
    def file(self) -> str | None:
        """The file the case was read from."""
        return self._origin.file

    def problem(self, location: Location, message: str, remedy: str, received: Any = ...) -> Problem:
        """Make a problem at a place of this case, with the line it stands on.

        Parameters
        ----------
        location : tuple of str and int
            Keys and indices, for instance ``("attachments", 2, "at")``.
        message, remedy : str
            What is wrong, and what to do about it.
        received : object, optional
            The value to repeat; default: as the user wrote it there; ``None``: nothing.
        """
        if received is ... and self._origin.raw is None:
            received = _value_at(self, location)
        return self._origin.problem(location, message, remedy, received)

    def to_yaml(self) -> str:
        """Write the case in SI units with all its defaults; the text loads back equal."""
        return write_yaml(self.model_dump(mode="json", exclude_none=True))


def _value_at(part: Any, location: Location) -> Any:
    """Look up the value at a place of a case made in Python; ``None`` for a whole part."""
    for item in location:
        part = part[item] if isinstance(item, int) else getattr(part, item, None)
    return None if isinstance(part, models.Part) else part


def load_case(path: str | Path) -> Case:
    """Read a case file.

    Parameters
    ----------
    path : path
        YAML file; relative paths in it start from its directory.

    Raises
    ------
    CaseError
        If it cannot be read, with everything that is wrong with it at once.
    """
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        reason = f"cannot be read: {error.strerror or error}"
    except UnicodeDecodeError:
        reason = "is not text in UTF-8"
    else:
        return Case.from_yaml(text, directory=path.resolve().parent, file=str(path))
    raise CaseError([Problem(path="", message=reason, remedy="Name a case file (YAML).", file=str(path))])


def case_schema() -> dict[str, Any]:
    """JSON Schema (draft 2020-12) of a case file, for editors and other front ends."""
    schema = Case.model_json_schema()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "cablesim case",
        **{key: value for key, value in schema.items() if key != "title"},
    }
