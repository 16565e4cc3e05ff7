"""Changes to a document by dotted path.

``vesicles.reduced_area=0.8`` sets a field of every vesicle, ``vesicles.0.angle=1.0`` of the first one.  The
vesicles of an arrangement can be changed in the same way as listed ones.
"""

from __future__ import annotations

import copy
import json
import re
import tomllib
from collections.abc import Mapping
from typing import Any

from pydantic import TypeAdapter

from ensemble.config.dotted_paths import is_array, locations, value_at
from ensemble.config.validation import validated
from solver.dimensions import is_quantity
from solver.scene import Arrangement

# Of two fields either one is given: to set one takes the other out of the document.
_EITHER = {"hamaker": "adhesion_energy", "adhesion_energy": "hamaker"}

LONGEST_NAME = 100  # characters of the name of a document

_BARE_WORD = re.compile(r"[A-Za-z_][\w.-]*")


def parse_override(text: str) -> tuple[str, Any]:
    """Split ``path=value`` into the path and the value.

    Parameters
    ----------
    text : str
        For example ``flow.rate=0.5``, ``vesicles.0.center=[1.5, 0.0]`` or ``flow.kind=shear``.  The value is
        TOML, or a bare word or a number with a unit that stand for a string.

    Returns
    -------
    path : str
        Dotted path of a field.
    value : object
        What the field becomes.

    Raises
    ------
    ValueError
        If there is no ``=``, no path, or the value is none of these.
    """
    path, equals, value = (part.strip() for part in text.partition("="))
    if not equals or not path:
        raise ValueError(f"{text!r} — expected key.path=value")
    try:
        parsed = tomllib.loads(f"value = {value}")
    except tomllib.TOMLDecodeError:
        if _BARE_WORD.fullmatch(value) or is_quantity(value):
            return path, value
        raise ValueError(f"{path}: {value!r} is not a TOML value") from None
    if parsed.keys() != {"value"}:
        raise ValueError(f"{path}: {value!r} is more than one TOML value")
    return path, parsed["value"]


def override(document: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return a copy of a document with the values at some dotted paths replaced.

    Tables that do not exist yet are added.  Whether the document may contain them is decided later, when its
    model validates it.  A document that has a name is then called after it and the changes, as far as they
    fit; units change nothing, so they are not among them.

    Parameters
    ----------
    document : mapping
        Nested tables and arrays, as read from TOML.
    changes : mapping from dotted path to value
        Applied in order, except that an arrangement is changed before its vesicles are.

    Returns
    -------
    dict

    Raises
    ------
    ValueError
        If a part of a path is empty, is an index outside an array, or lies inside a plain value.
    """
    changed: dict[str, Any] = _editable(document)
    for path in changes:
        _make_room(changed, path)
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
    if isinstance(document.get("name"), str) and "name" not in changes:
        changed["name"] = _name_with_changes(document, changes)
    return changed


def _make_room(document: dict[str, Any], path: str) -> None:
    """Take out what a field that is set stands instead of; the model refuses both in one set of changes."""
    outer, _, last = path.rpartition(".")
    if last in _EITHER and outer:
        for location in locations(document, outer):
            node = value_at(document, location)
            if isinstance(node, dict):
                node.pop(_EITHER[last], None)


def _name_with_changes(document: Mapping[str, Any], changes: Mapping[str, Any]) -> str:
    made = (
        f"{path}={json.dumps(value, default=str)}"
        for path, value in sorted(changes.items())
        if not _has(document, path, value) and "units" not in path.split(".")
    )
    name = ", ".join((document["name"], *made))
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME - 1]}…"


def _has(document: Mapping[str, Any], path: str, value: Any) -> bool:
    """Return whether a document has this value wherever a dotted path leads."""
    try:
        places = locations(document, path)
    except ValueError:
        return False
    return bool(places) and all(value_at(document, place) == value for place in places)


def _list_vesicles(document: dict[str, Any], path: str) -> None:
    """Replace the arrangement of the scene whose vesicles a dotted path names by these vesicles."""
    node: Any = document
    for part in path.split("."):
        if not isinstance(node, dict):
            return
        if part == "vesicles" and part not in node and node.get("arrangement") is not None:
            try:
                arrangement = validated(TypeAdapter(Arrangement), node.pop("arrangement"), node.get("units"))
            except ValueError as error:
                raise ValueError(f"arrangement: {error}") from error
            node[part] = [vesicle.model_dump() for vesicle in arrangement.vesicles()]
        node = node.get(part)


def _editable(node: Any) -> Any:
    if isinstance(node, Mapping):
        return {key: _editable(element) for key, element in node.items()}
    if is_array(node):
        return [_editable(element) for element in node]
    return node
