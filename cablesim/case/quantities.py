"""Numbers with units at the border of a case; plain SI floats inside.

Depends on: nothing of ours.

A plain number is SI; a string carries its unit, ``"4 mm"``.  pint is imported when the first
string is met: a case in plain numbers does not pay for it.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

_NUMBER_AND_UNIT = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*")
_UNIT = re.compile(r"(?:1/)?[A-Za-zµμ°][A-Za-zµμ°\d\s*/^·²³⁻¹-]*")

_LARGEST = 1e30  # of anything in a case; squares and cubes of it are still finite


class UnitError(ValueError):
    """A value whose unit is missing, unknown or of the wrong kind.

    Attributes
    ----------
    message, remedy : str
        What is wrong, and what to write instead.
    """

    def __init__(self, message: str, remedy: str) -> None:
        super().__init__(f"{message}. {remedy}")
        self.message = message
        self.remedy = remedy


# Everyday units, so that a usual case does not wait 0.37 s for pint; a test holds them against pint.
_EVERYDAY: dict[str, dict[str, float]] = {
    "m": {"m": 1.0, "cm": 0.01, "mm": 0.001, "km": 1000.0},
    "m**2": {"m^2": 1.0, "m2": 1.0, "cm^2": 1e-4, "mm^2": 1e-6},
    "m**3": {"m^3": 1.0, "cm^3": 1e-6, "L": 1e-3, "mL": 1e-6},
    "kg": {"kg": 1.0, "g": 0.001},
    "s": {"s": 1.0, "seconds": 1.0, "ms": 0.001, "min": 60.0, "h": 3600.0, "hours": 3600.0, "days": 86400.0},
    "m/s": {"m/s": 1.0, "cm/s": 0.01, "mm/s": 0.001},
    "m/s**2": {"m/s^2": 1.0, "m/s2": 1.0},
    "rad": {"rad": 1.0, "deg": math.pi / 180},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180},
    "1/s": {"1/s": 1.0},
    "kg/m**3": {"kg/m^3": 1.0, "kg/m3": 1.0},
    "kg/m": {"kg/m": 1.0, "g/m": 0.001},
    "N": {"N": 1.0, "kN": 1000.0, "mN": 0.001},
    "N/m": {"N/m": 1.0, "mN/m": 0.001},
    "m/s/N": {"m/s/N": 1.0, "cm/s/N": 0.01, "mm/s/N": 0.001},
    "m/s**2/N": {"m/s^2/N": 1.0, "m/s2/N": 1.0, "cm/s^2/N": 0.01, "mm/s^2/N": 0.001},
    "N*m**2": {"N m^2": 1.0, "N*m^2": 1.0, "N m2": 1.0},
}


@cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry()


@cache
def _factor(unit: str, target: str) -> float | str | None:
    """Factor from `unit` to `target`; text naming the dimension if it differs; None if unknown."""
    everyday = _EVERYDAY[target].get(unit)
    if everyday is not None:
        return everyday
    registry = _registry()
    for spelling in (unit, re.sub(r"([A-Za-zµμ])(-?\d)", r"\1**\2", unit)):
        # Whatever pint's tokenizer trips over (it raises six kinds of error), the unit is unknown.
        try:
            parsed = registry.parse_units(spelling)
            one = registry.Quantity(1.0, parsed)
            if one.check(registry.Unit(target).dimensionality):
                return float(one.to(target).magnitude)
            return str(parsed.dimensionality)
        except Exception:
            continue
    return None


@dataclass(frozen=True)
class Quantity:
    """Annotation that makes a pydantic float accept a number (SI) or a string with a unit.

    Attributes
    ----------
    name : str
        What it is, for messages: ``length``.
    unit : str
        SI unit in which the float is kept, as pint spells it; empty for a pure number.
    example : str
        A value with a unit, for messages and for the schema.
    """

    name: str
    unit: str
    example: str

    def parse(self, value: Any) -> float:
        """Convert what was written to SI.

        Raises
        ------
        UnitError
            For a missing, unknown or unfitting unit, and for anything that is no number.
        """
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise UnitError(f"is no {self.name}", self._remedy())
        try:
            number = self._parse_text(value) if isinstance(value, str) else float(value)
        except OverflowError:  # a whole number of more than 308 digits
            number = math.inf
        if not math.isfinite(number):
            raise UnitError("is not finite", self._remedy())
        if abs(number) > _LARGEST:
            raise UnitError(f"is more than {_LARGEST:g} {self.unit}".rstrip(), self._remedy())
        return number

    def _parse_text(self, text: str) -> float:
        match = _NUMBER_AND_UNIT.fullmatch(text)
        if match is None:
            raise UnitError(f"is no {self.name}", self._remedy())
        number, unit = float(match[1]), match[2]
        if not unit:
            raise UnitError("is text without a unit", self._remedy())
        if not self.unit:
            raise UnitError(f"is a pure number and takes no unit, not '{unit}'", self._remedy())
        factor = _factor(unit, self.unit) if _UNIT.fullmatch(unit) else None
        if factor is None:
            raise UnitError(f"has the unknown unit '{unit}'", self._remedy())
        if isinstance(factor, str):
            raise UnitError(f"has a unit of {factor}, not of a {self.name} [{self.unit}]", self._remedy())
        divisor = round(1 / factor)  # 60 cm^3 are 6e-05 m^3 and not 5.9999999999999995e-05
        return number / divisor if abs(divisor * factor - 1) < 1e-12 else number * factor

    def _remedy(self) -> str:
        if not self.unit:
            return f"Give a plain number such as {self.example}."
        return f"Give a plain number in {self.unit} or text such as '{self.example}'."

    def _validate(self, value: Any) -> float:
        try:
            return self.parse(value)
        except UnitError as error:
            raise PydanticCustomError(
                "quantity", "{message}", {"message": error.message, "remedy": error.remedy}
            ) from None

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Run the conversion before pydantic's own check of the float."""
        return core_schema.no_info_before_validator_function(self._validate, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> Any:
        """Publish a number, or a string with a unit."""
        number = handler(schema)
        if not self.unit:
            return number
        text = {"type": "string", "pattern": r"^\s*[+-]?[0-9.].*[A-Za-z%°]", "examples": [self.example]}
        return {"anyOf": [{**number, "description": f"in {self.unit}"}, text]}


Number = Annotated[float, Quantity("number", "", "1.2")]
Length = Annotated[float, Quantity("length", "m", "4 mm")]
Area = Annotated[float, Quantity("area", "m**2", "6.4 mm^2")]
Volume = Annotated[float, Quantity("volume", "m**3", "65 cm^3")]
Mass = Annotated[float, Quantity("mass", "kg", "50 g")]
Time = Annotated[float, Quantity("time", "s", "10 ms")]
Speed = Annotated[float, Quantity("speed", "m/s", "0.25 m/s")]
Acceleration = Annotated[float, Quantity("acceleration", "m/s**2", "9.81 m/s^2")]
Angle = Annotated[float, Quantity("angle", "rad", "45 deg")]
AngularRate = Annotated[float, Quantity("angular rate", "rad/s", "20 deg/s")]
Rate = Annotated[float, Quantity("rate", "1/s", "10 1/s")]
Density = Annotated[float, Quantity("density", "kg/m**3", "1025 kg/m^3")]
LinearDensity = Annotated[float, Quantity("mass per length", "kg/m", "44.7 g/m")]
Force = Annotated[float, Quantity("force", "N", "10 kN")]
LinearForce = Annotated[float, Quantity("force per length", "N/m", "0.376 N/m")]
SpeedPerForce = Annotated[float, Quantity("speed per force", "m/s/N", "0.05 m/s/N")]
AccelerationPerForce = Annotated[float, Quantity("acceleration per force", "m/s**2/N", "0.1 m/s^2/N")]
BendingStiffness = Annotated[float, Quantity("bending stiffness", "N*m**2", "2.4e-3 N m^2")]

Point = tuple[Length, Length, Length]
Velocity = tuple[Speed, Speed, Speed]
Direction = tuple[Number, Number, Number]


def length_factor(unit: str) -> float:
    """Metres in one `unit`, for recordings kept in millimetres and the like.

    Raises
    ------
    UnitError
        If `unit` is no unit of length.
    """
    return _si_factor(unit, "m", "length", "'m' or 'mm'")


def time_factor(unit: str) -> float:
    """Seconds in one `unit`.

    Raises
    ------
    UnitError
        If `unit` is no unit of time, or one of no fixed length.
    """
    if unit.lower().startswith(("month", "year")):
        raise UnitError("is no time of fixed length", "Name one such as 's' or 'days'.")
    return _si_factor(unit, "s", "time", "'s' or 'h'")


def speed_factor(unit: str) -> float:
    """Metres per second in one `unit`.

    Raises
    ------
    UnitError
        If `unit` is no unit of speed.
    """
    everyday = unit.replace(" s-1", "/s").replace(".s-1", "/s")  # as CF writes it
    return _si_factor(everyday, "m/s", "speed", "'m/s' or 'cm s-1'")


def _si_factor(unit: str, target: str, name: str, examples: str) -> float:
    factor = _factor(unit, target)
    if not isinstance(factor, float):
        raise UnitError(f"is no unit of {name}", f"Name one such as {examples}.")
    return factor
