"""Dotted paths: names of fields in nested documents, such as ``flow.rate`` or ``vesicles.0.angle``."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping, Sequence
from typing import Any

from solver.scene import Scene

Location = tuple[str | int, ...]


def locations(document: Mapping[str, Any], path: str) -> tuple[Location, ...]:
    """Return the places in a document that a dotted path names, whether or not they hold a value yet.

    Parameters
    ----------
    document : mapping
        Nested tables (mappings) and arrays (sequences), as read from TOML.
    path : str
        Names and array indices joined by dots.  A name that is applied to an array stands for that name in
        each of its elements.

    Returns
    -------
    tuple of tuples
        Keys and indices from the outside in, one tuple for each place.

    Raises
    ------
    ValueError
        If a part of the path is empty, is an index outside the array, or lies inside a plain value.
    """
    parts = path.split(".")
    if not all(parts):
        raise ValueError(f"{path!r} — expected names joined by single dots")
    places: list[tuple[Location, Any]] = [((), document)]
    for part in parts:
        places = [place for location, node in places for place in _enter(location, node, part)]
    return tuple(location for location, _ in places)


def _enter(location: Location, node: Any, part: str) -> list[tuple[Location, Any]]:
    if node is None:  # a table that is not there yet
        return [((*location, part), None)]
    if isinstance(node, Mapping):
        return [((*location, part), node.get(part))]
    if not is_array(node):
        raise ValueError(f"{dotted(location)}: {reprlib.repr(node)} — has no field {part!r}")
    if not part.isdecimal():
        return [
            place for index, element in enumerate(node) for place in _enter((*location, index), element, part)
        ]
    index = int(part)
    if index >= len(node):
        raise ValueError(f"{dotted((*location, index))}: no such element, there are {len(node)}")
    return [((*location, index), node[index])]


def is_array(node: Any) -> bool:
    """Return whether a part of a document is an array.

    Parameters
    ----------
    node : object
        A value, table or array.

    Returns
    -------
    bool
    """
    return isinstance(node, Sequence) and not isinstance(node, str)


def value_at(document: Any, location: Location) -> Any:
    """Return the value at a location of a document.

    Parameters
    ----------
    document : mapping or sequence
        Nested tables and arrays.
    location : tuple
        Keys and indices from the outside in.

    Returns
    -------
    object
        None if the document has no such place.
    """
    node = document
    for key in location:
        try:
            node = node[key]
        except (KeyError, IndexError, TypeError):
            return None
    return node


def dotted(location: Location) -> str:
    """Write a location as a dotted path.

    Parameters
    ----------
    location : tuple
        Keys and indices from the outside in.

    Returns
    -------
    str
    """
    return ".".join(str(part) for part in location)


def parameter_value(scene: Scene, path: str) -> float:
    """Return the number at a dotted path of a scene.

    Parameters
    ----------
    scene : Scene
        The scene that has the parameter.
    path : str
        Dotted path.  It may name several places, which must then hold the same number.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If there is no number at the path, or there are different ones.
    """
    return number_at(scene.model_dump(), path)


def number_at(document: Mapping[str, Any], path: str) -> float:
    """Return the number at a dotted path of a document.

    Parameters
    ----------
    document : mapping
        Nested tables and arrays.
    path : str
        Dotted path.  It may name several places, which must then hold the same number.

    Returns
    -------
    float

    Raises
    ------
    ValueError
        If there is no number at the path, or there are different ones.
    """
    values = {value_at(document, location) for location in locations(document, path)}
    (value, *others) = values
    if others or not isinstance(value, int | float):
        raise ValueError(f"{path}: the scene must hold exactly one number there")
    return value
