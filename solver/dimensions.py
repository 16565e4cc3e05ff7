"""What the numbers of scenes and runs measure, and how a number with a unit becomes one without.

A `Dimension` is metadata of a field: ``rate: Annotated[float, RATE]``.  Such a field takes a number, which
is in the units of the scene, or a text like ``"0.5 1/s"``.  A text is converted when the field is validated,
with the units that the validation's context holds under `UNITS`.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Annotated, Any, Protocol, get_args, get_origin

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, ValidationInfo
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

UNITS = "units"  # key of the units of a scene in the context of a validation

# Products and quotients of named units with small powers.  More would let a text cost any time.  What two
# adjacent repetitions could both match would cost the square of its length.
_NUMBER = r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?"
_NAME = r"[^\W\d_]+(?:(?:\^|\*\*)-?\d)?"
_QUANTITY = re.compile(rf"({_NUMBER})\s*((?:1?\s*/\s*)?{_NAME}(?:\s*[*·/ ]\s*{_NAME}){{0,5}})")
_BEGINNING = re.compile(rf"\s*{_NUMBER}\s*(?:1\s*)?[^\d\s.]")
_DECIMAL_COMMA = re.compile(r"(?<=\d),(?=\d)")
_LONGEST = 100  # characters of a number with a unit

# Pint keeps what it has made of each unit, over a kilobyte.  Its registry takes a fifth of a second to make.
_MOST_UNITS = 200

# Conversion leaves a round-off that would make the key of a scene another one than that of its twin.
_DIGITS = 14


class Scales(Protocol):
    """The units of a scene."""

    def scale(self, dimension: Dimension) -> float:
        """Return the unit of a dimension.

        Parameters
        ----------
        dimension : Dimension

        Returns
        -------
        float
            In SI units.
        """


@dataclass(frozen=True)
class Dimension:
    """What a number measures, as powers of a scene's units of length, time and bending modulus.

    Attributes
    ----------
    name : str
    si : str
        Its SI unit.
    length, time, bending_modulus : int
        Powers of the units R, μR³/κ and κ.
    """

    name: str
    si: str
    length: int = 0
    time: int = 0
    bending_modulus: int = 0

    @property
    def symbol(self) -> str:
        """Unit in terms of μ, R and κ, such as ``mu R^3 kappa^-1``; that of the SI if it has none."""
        powers = {
            "mu": self.time,
            "R": self.length + 3 * self.time,
            "kappa": self.bending_modulus - self.time,
        }
        factors = [name if power == 1 else f"{name}^{power}" for name, power in powers.items() if power]
        return " ".join(factors) or self.si

    @property
    def is_pure(self) -> bool:
        """Whether it is the same number in all units."""
        return not (self.length or self.time or self.bending_modulus)

    def number(self, text: str, units: Scales | None) -> float:
        """Convert a number with a unit to the units of a scene.

        Parameters
        ----------
        text : str
            Such as ``0.5 1/s``.
        units : Scales or None
            None if the scene has not said what its units are.

        Returns
        -------
        float

        Raises
        ------
        ValueError
            If it is no such number, or of another dimension; names the unit expected.
        """
        value = si_value(text, self.si, self.name)
        if self.is_pure:
            return value
        if units is None:
            raise ValueError(
                "a unit needs those of the scene: units.radius (or units.length), units.bending_modulus and "
                "units.viscosity"
            )
        return rounded(value / units.scale(self))

    def validate(self, value: Any, handler: Callable[[Any], Any], info: ValidationInfo) -> Any:
        """Convert what a field is given if it has a unit, and go on with the field's own checks.

        Parameters
        ----------
        value : object
        handler : callable
            Those checks.
        info : ValidationInfo
            Of pydantic; its context may have the units.

        Returns
        -------
        object
            What the handler returns.

        Raises
        ------
        PydanticCustomError
            If it cannot be converted.
        """
        try:
            number = self._converted(value, (info.context or {}).get(UNITS))
        except ValueError as error:
            raise PydanticCustomError("quantity", "{reason}", {"reason": str(error)}) from None
        return handler(number)

    def _converted(self, value: Any, units: Scales | None) -> Any:
        if isinstance(value, dict):  # a distribution: all its parameters but the kind have this dimension
            return {
                name: each if name == "kind" else self._converted(each, units) for name, each in value.items()
            }
        return self.number(value, units) if isinstance(value, str) and _has_unit(value) else value

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        """Convert text with a unit before the field's own checks."""
        return core_schema.with_info_wrap_validator_function(self.validate, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Describe the number, or the text of one with a unit; ``x-unit`` is the unit of the number."""
        return or_quantity(handler(schema), handler.mode) | {"x-unit": self.symbol}


def or_quantity(number: JsonSchemaValue, mode: str) -> JsonSchemaValue:
    """Return the JSON schema of a number that may be given with a unit.

    Parameters
    ----------
    number : dict
        Its own schema.
    mode : str
        Of the schema: numbers are written without units.

    Returns
    -------
    dict
    """
    if mode == "serialization":
        return number
    quantity = {"type": "string", "maxLength": _LONGEST, "pattern": f"^{_BEGINNING.pattern}"}
    return {"anyOf": [number, quantity]}


LENGTH = Dimension("length", "m", length=1)
TIME = Dimension("time", "s", time=1)
RATE = Dimension("rate", "1/s", time=-1)
BENDING_MODULUS = Dimension("bending modulus", "J", bending_modulus=1)
ENERGY_PER_DEPTH = Dimension("energy per depth", "J/m", length=-1, bending_modulus=1)
TENSION = Dimension("tension", "N/m", length=-2, bending_modulus=1)
ADHESION_ENERGY = Dimension("adhesion energy per area", "J/m^2", length=-2, bending_modulus=1)
HAMAKER = Dimension("Hamaker constant", "Pa", length=-3, bending_modulus=1)
FORCE_PER_AREA = Dimension("force per area", "Pa", length=-3, bending_modulus=1)
ANGLE = Dimension("angle", "rad")
NUMBER = Dimension("number", "1")

# Those that depend on the units of a scene.
DIMENSIONS = (LENGTH, TIME, RATE, BENDING_MODULUS, ENERGY_PER_DEPTH, TENSION, ADHESION_ENERGY, HAMAKER)


def si_value(text: str, si: str, name: str) -> float:
    """Return a number with a unit in a unit of the SI.

    Parameters
    ----------
    text : str
        Such as ``1 mPa*s``.
    si : str
        The unit in which it is returned.
    name : str
        What it measures, for messages.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If it is no number with a unit, or of another dimension.
    """
    example = f"must be a number with a unit of {name}, such as '0.5 {si}'"
    match = _quantity(text)
    if match is None:
        raise ValueError(decimal_point_wanted(text) or example)
    from pint import DimensionalityError, UndefinedUnitError

    number, unit = match.groups()
    unit = f"1 {unit}" if unit.startswith("/") else unit
    try:
        return float(_registry_for(unit).Quantity(float(number), unit.replace("·", "*")).to(si).magnitude)
    except UndefinedUnitError as error:
        raise ValueError(f"{example}: {error}") from None
    except DimensionalityError as error:
        raise ValueError(f"{example}, got {error.dim1}") from None
    except Exception as error:  # units that no product may have, such as those of temperatures with offsets
        raise ValueError(f"{example}: {error}") from None


def decimal_point_wanted(text: str) -> str | None:
    """Say what to write instead of a number with a decimal comma.

    Parameters
    ----------
    text : str
        Such as ``0,5`` or ``0,5 1/s``.

    Returns
    -------
    str or None
        None if it would be no number with a decimal point either.
    """
    if len(text) > _LONGEST or len(_DECIMAL_COMMA.findall(text)) != 1:
        return None
    written = _DECIMAL_COMMA.sub(".", text.strip())
    is_number = re.fullmatch(_NUMBER, written) or _quantity(written)
    return f"write a decimal point: {written!r}" if is_number else None


def is_quantity(text: str) -> bool:
    """Return whether a text is a number with a unit, known or not.

    Parameters
    ----------
    text : str

    Returns
    -------
    bool
    """
    return _quantity(text) is not None


def rounded(value: float) -> float:
    """Return a converted number without the round-off of its conversion.

    Parameters
    ----------
    value : float

    Returns
    -------
    float
        With 14 digits.
    """
    return float(f"{value:.{_DIGITS}g}")


def with_prefix(value: float, si: str) -> tuple[float, str]:
    """Return a value with the prefix of its unit with which it is neither large nor small.

    Parameters
    ----------
    value : float
        In the unit.
    si : str
        Unit of the SI.  Times, rates and bending moduli get no prefix.

    Returns
    -------
    value : float
    unit : str
    """
    if si in (TIME.si, RATE.si, ANGLE.si, BENDING_MODULUS.si):
        return rounded(value), si
    compact = _registry().Quantity(value, si).to_compact()
    return rounded(float(compact.magnitude)), f"{compact.units:~P}"


def dimension_of(annotation: Any) -> Dimension | None:
    """Return the dimension that a type states.

    Parameters
    ----------
    annotation : any
        Of a field, with its metadata.

    Returns
    -------
    Dimension or None
        That of the elements of an array; None if there is none.
    """
    arguments = get_args(annotation)
    if get_origin(annotation) is Annotated:
        stated = [each for each in arguments[1:] if isinstance(each, Dimension)]
        if stated:
            return stated[0]
    return next(filter(None, map(dimension_of, arguments)), None)


def _quantity(text: str) -> re.Match[str] | None:
    return _QUANTITY.fullmatch(text.strip()) if len(text) <= _LONGEST else None


def _has_unit(text: str) -> bool:
    """Return whether a text is meant to have a unit: it begins with a number and is none."""
    if len(text) > _LONGEST or not _BEGINNING.match(text):
        return False
    try:
        float(text)
    except ValueError:
        return True
    return False


_units_seen = set[str]()


def _registry_for(unit: str) -> Any:
    """Return a registry of units, another one after many different units."""
    if len(_units_seen) >= _MOST_UNITS:
        _units_seen.clear()
        _registry.cache_clear()
    _units_seen.add(unit)
    return _registry()


@cache
def _registry() -> Any:
    from pint import UnitRegistry  # a fifth of a second

    return UnitRegistry()
