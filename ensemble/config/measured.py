"""Numbers of scenes and answers with their units."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from typing import Any, NamedTuple, get_type_hints

from pydantic import BaseModel

from ensemble.config.dotted_paths import is_array
from solver.dimensions import DIMENSIONS, Dimension, dimension_of, rounded
from solver.scene import Units


class Measured(NamedTuple):
    """A number, or an array of numbers, with its unit.

    Attributes
    ----------
    value : float or list of float
    unit : str
        With a prefix, such as ``µm``.
    """

    value: Any
    unit: str

    def __str__(self) -> str:
        """Write it with six digits."""
        value = self.value if is_array(self.value) else [self.value]
        return f"{', '.join(f'{each:.6g}' for each in value)} {self.unit}"

    @classmethod
    def of(cls, value: Any, dimension: Dimension, units: Units) -> Measured:
        """Convert a number of a scene or of its run.

        Parameters
        ----------
        value : float or sequence of float
        dimension : Dimension
        units : Units

        Returns
        -------
        Measured
        """
        factor, unit = units.shown(dimension)
        if is_array(value):
            return cls([rounded(each * factor) for each in value], unit)
        return cls(rounded(value * factor), unit)

    @classmethod
    def known(cls, value: Any, dimension: Dimension | None, units: Units | None) -> Measured | None:
        """Convert a number of a scene or of its run, if it has a unit and the unit is known.

        Parameters
        ----------
        value : float or sequence of float
        dimension : Dimension or None
            None if it has none.
        units : Units or None
            None if the scene has none.

        Returns
        -------
        Measured or None
        """
        if units is None or dimension is None or dimension.is_pure:
            return None
        return cls.of(value, dimension, units)


def dimension_at(node: Any, path: str) -> Dimension | None:
    """Return the dimension that the field at a dotted path states.

    Parameters
    ----------
    node : model or dataclass
        Such as a `Scene` or the summary of a run.
    path : str
        Dotted path; a name that is applied to an array stands for that name in its elements.

    Returns
    -------
    Dimension or None
        None if there is no such field, or it has none.
    """
    name, _, rest = path.partition(".")
    if is_array(node):
        element = node[int(name) if name.isdecimal() and int(name) < len(node) else 0] if node else None
        return dimension_at(element, rest if name.isdecimal() else path)
    if rest and not isinstance(getattr(node, name, None), int | float | str | None):
        inner = getattr(node, name)
        elements_are_numbers = is_array(inner) and inner and isinstance(inner[0], int | float)
        return stated_dimension(type(node), name) if elements_are_numbers else dimension_at(inner, rest)
    return None if rest else stated_dimension(type(node), name)


def stated_dimension(cls: type, name: str) -> Dimension | None:
    """Return the dimension that a field of a class states.

    Parameters
    ----------
    cls : type
        A model or a dataclass.
    name : str

    Returns
    -------
    Dimension or None
        None if there is no such field, or it has none.
    """
    if issubclass(cls, BaseModel):
        field = cls.model_fields.get(name)
        if field is None:
            return None
        stated = [each for each in field.metadata if isinstance(each, Dimension)]
        return stated[0] if stated else dimension_of(field.annotation)
    if is_dataclass(cls):
        return dimension_of(get_type_hints(cls, include_extras=True).get(name))
    return None


def document_in_units(document: Mapping[str, Any], units: Units | None) -> dict[str, Any]:
    """Return a document as if its scene had other units, or none.

    Parameters
    ----------
    document : mapping
        Of a question about a scene.
    units : Units or None

    Returns
    -------
    dict
    """
    scene = document["scene"] | {"units": None if units is None else units.model_dump(mode="json")}
    return {**document, "scene": scene}


def measured_fields(node: Any, document: Mapping[str, Any], units: Units | None) -> dict[str, Measured]:
    """Return the numbers of a document that have a dimension, with their units.

    Parameters
    ----------
    node : model or dataclass
        Whose fields the document holds.
    document : mapping
        Nested tables.
    units : Units or None
        None if the scene has none.

    Returns
    -------
    dict
        By dotted path; empty without units.
    """
    if units is None:
        return {}
    return measured_values(
        {path: (each, dimension_at(node, path)) for path, each in _numbers(document)}, units
    )


def unit_sizes(node: Any, document: Mapping[str, Any], units: Units | None) -> dict[str, Measured]:
    """Return how much one is of each number of a document that has a dimension.

    Parameters
    ----------
    node : model or dataclass
        Whose fields the document holds.
    document : mapping
        Nested tables.
    units : Units or None
        None if the scene has none.

    Returns
    -------
    dict
        By dotted path; empty without units.
    """
    return measured_values({path: (1.0, dimension_at(node, path)) for path, _ in _numbers(document)}, units)


def measured_values(
    values: Mapping[str, tuple[Any, Dimension | None]], units: Units | None
) -> dict[str, Measured]:
    """Return those of some numbers that have a unit which is known, with it.

    Parameters
    ----------
    values : mapping of str to (float or list of float, Dimension or None)
        By name.
    units : Units or None
        None if the scene has none.

    Returns
    -------
    dict
        By name; empty without units.
    """
    measured = {name: Measured.known(value, dimension, units) for name, (value, dimension) in values.items()}
    return {name: each for name, each in measured.items() if each is not None}


def measured_document(fields: Mapping[str, Measured]) -> dict[str, Any]:
    """Return what is added to the JSON document of an answer: its numbers with their units.

    Parameters
    ----------
    fields : mapping of str to Measured
        By dotted path.

    Returns
    -------
    dict
        Empty if there are none.
    """
    return {"in_units": {path: each._asdict() for path, each in fields.items()}} if fields else {}


def _numbers(node: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the numbers, and the arrays of numbers, of a document by their dotted paths."""
    if isinstance(node, Mapping):
        for name, value in node.items():
            yield from _numbers(value, f"{prefix}.{name}" if prefix else name)
    elif is_array(node) and not all(_is_number(each) for each in node):
        for index, value in enumerate(node):
            yield from _numbers(value, f"{prefix}.{index}")
    elif _is_number(node) or (is_array(node) and node):
        yield prefix, node


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


class Unit(NamedTuple):
    """A unit of a scene.

    Attributes
    ----------
    name : str
        Of what it measures.
    unit : str
        In terms of μ, R and κ.
    one : Measured
        How much one is.
    """

    name: str
    unit: str
    one: Measured


def units_of(units: Units) -> list[Unit]:
    """Return the units of all dimensions.

    Parameters
    ----------
    units : Units

    Returns
    -------
    list of Unit
    """
    return [Unit(each.name, each.symbol, Measured.of(1.0, each, units)) for each in DIMENSIONS]
