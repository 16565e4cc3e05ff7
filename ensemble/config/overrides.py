"""Changes to a scene or study by dotted path, and one-line messages about documents that are refused.

``vesicles.reduced_area=0.8`` sets a field of every vesicle, ``vesicles.0.angle=1.0`` of the first one; the
vesicles of an arrangement can be changed like listed ones.
"""

from __future__ import annotations

import copy
import re
import reprlib
import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic import TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from solver.scene import Arrangement

Location = tuple[str | int, ...]

_BARE_WORD = re.compile(r"[A-Za-z_][\w.-]*")


def parse_override(text: str) -> tuple[str, Any]:
    """Split ``path=value``, where the value is TOML or a bare word that stands for a string.

    Parameters
    ----------
    text : str
        For example ``flow.rate=0.5``, ``vesicles.0.center=[1.5, 0.0]`` or ``flow.kind=shear``.

    Returns
    -------
    path : str
    value : object

    Raises
    ------
    ValueError
        If there is no ``=``, no path, or the value is neither TOML nor a bare word.
    """
    path, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not path:
        raise ValueError(f"{text!r} — expected key.path=value")
    try:
        parsed = tomllib.loads(f"value = {value}")
    except tomllib.TOMLDecodeError:
        if _BARE_WORD.fullmatch(value):
            return path, value
        raise ValueError(f"{path}: {value!r} is not a TOML value") from None
    if parsed.keys() != {"value"}:
        raise ValueError(f"{path}: {value!r} is more than one TOML value")
    return path, parsed["value"]


def locations(document: Mapping[str, Any], path: str) -> tuple[Location, ...]:
    """Find the places in a document that a dotted path names, whether or not they hold anything yet.

    Parameters
    ----------
    document : mapping
        Nested tables (mappings) and arrays (sequences), as read from TOML.
    path : str
        Names and array indices joined by dots.  A name met in an array stands for that name in all
        of its elements.

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
    found: list[tuple[Location, Any]] = [((), document)]
    for part in parts:
        found = [place for location, node in found for place in _enter(location, node, part)]
    return tuple(location for location, _ in found)


def _enter(location: Location, node: Any, part: str) -> list[tuple[Location, Any]]:
    if node is None:  # a table that is not there yet
        return [((*location, part), None)]
    if isinstance(node, Mapping):
        return [((*location, part), node.get(part))]
    if not _is_array(node):
        raise ValueError(f"{dotted(location)}: {reprlib.repr(node)} — has no field {part!r}")
    if not part.isdecimal():
        return [
            place for index, element in enumerate(node) for place in _enter((*location, index), element, part)
        ]
    index = int(part)
    if index >= len(node):
        raise ValueError(f"{dotted((*location, index))}: no such element, there are {len(node)}")
    return [((*location, index), node[index])]


def _is_array(node: Any) -> bool:
    return isinstance(node, Sequence) and not isinstance(node, str)


def override(document: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a document with the values at some dotted paths replaced.

    Tables on the way that do not exist are made; what the document may contain is for its model to say.

    Parameters
    ----------
    document : mapping
        As for `locations`.
    changes : mapping from dotted path to value
        Applied in order, except that an arrangement is changed before its vesicles are.

    Raises
    ------
    ValueError
        As `locations`.
    """
    changed: dict[str, Any] = _editable(document)
    for path, value in sorted(changes.items(), key=lambda change: "vesicles" in change[0].split(".")):
        _list_vesicles(changed, path)
        for location in locations(changed, path):
            *outer, last = location
            node: Any = changed
            for key in outer:
                if isinstance(node, dict) and node.get(key) is None:
                    node[key] = {}
                node = node[key]
            node[last] = copy.deepcopy(value)
    return changed


def _list_vesicles(document: dict[str, Any], path: str) -> None:
    """Replace the arrangement of the scene whose vesicles a dotted path names by these vesicles."""
    node: Any = document
    for part in path.split("."):
        if not isinstance(node, dict):
            return
        if part == "vesicles" and part not in node and node.get("arrangement") is not None:
            arrangement = node.pop("arrangement")
            try:
                arranged = TypeAdapter(Arrangement).validate_python(arrangement)
            except ValidationError as error:
                raise ValueError(f"arrangement: {explain(error, arrangement)}") from error
            node[part] = [vesicle.model_dump() for vesicle in arranged.vesicles()]
        node = node.get(part)


def _editable(node: Any) -> Any:
    if isinstance(node, Mapping):
        return {key: _editable(element) for key, element in node.items()}
    if _is_array(node):
        return [_editable(element) for element in node]
    return node


def value_at(document: Any, location: Location) -> Any:
    """Return what a document holds at a location, None where it holds nothing."""
    node = document
    for key in location:
        try:
            node = node[key]
        except (KeyError, IndexError, TypeError):
            return None
    return node


def dotted(location: Location) -> str:
    """Write a location as a dotted path."""
    return ".".join(str(part) for part in location)


def explain(error: ValidationError, document: Mapping[str, Any]) -> str:
    """Say on one line why a document was refused: fields, offending values, what is allowed.

    Parameters
    ----------
    error : ValidationError
        Raised by validating the document.
    document : mapping

    Returns
    -------
    str
        For example ``vesicles.0.reduced_area: 1.2 — input should be less than or equal to 1``; several
        problems are separated by semicolons.
    """
    return describe(error.errors(include_url=False), document)


def describe(problems: Sequence[ErrorDetails], document: Mapping[str, Any]) -> str:
    """Say on one line what pydantic found wrong with a document, as `explain` does."""
    # Refused elements make pydantic complain about the array around them, too: that is no news.
    around = {problem["loc"][:depth] for problem in problems for depth in range(len(problem["loc"]))}
    # What is said several times about one value are the alternatives that it could be.
    messages: dict[str, list[str]] = {}
    for problem in problems:
        if problem["loc"] not in around:
            message = problem["msg"].removeprefix("Value error, ")
            said = messages.setdefault(_subject(problem, document), [])
            said.append(message[:1].lower() + message[1:])
    return "; ".join(subject + ", or ".join(said) for subject, said in messages.items())


def _subject(problem: ErrorDetails, document: Mapping[str, Any]) -> str:
    """What a message is about: a field, and its value."""
    location = _without_tags(problem["loc"], document)
    subject = f"{dotted(location)}: " if location else ""
    # For a missing field, or a check on several, the input is the table around it: no value to show.
    if not isinstance(problem["input"], Mapping) and problem["type"] != "missing":
        subject += f"{reprlib.repr(problem['input'])} — "
    return subject


def _without_tags(location: Location, document: Mapping[str, Any]) -> Location:
    """Drop the names of union members, which pydantic puts after values and between tables and fields."""
    kept: list[str | int] = []
    for part in location:
        node = value_at(document, tuple(kept))
        if isinstance(node, str | int | float):
            break
        is_tag = isinstance(node, Mapping) and part not in node and part in node.values()
        if not is_tag:
            kept.append(part)
    return tuple(kept)
