"""Checking of documents against their models, and one-line messages about those that are refused."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, TypeVar, overload

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from ensemble.config.dotted_paths import Location, dotted, value_at
from ensemble.config.parameter_values import ONE, SEVERAL
from solver.dimensions import UNITS, decimal_point_wanted
from solver.scene import Units

Validated = TypeVar("Validated")
SomeModel = TypeVar("SomeModel", bound=BaseModel)

# What pydantic says in words of Python.
_WORDS = {"tuple_type": "must be a list", "union_tag_not_found": "needs a kind"}


@overload
def validated(
    model: type[SomeModel], document: Mapping[str, Any], units: Any = None
) -> SomeModel: ...  # numpydoc ignore=GL08
@overload
def validated(
    model: TypeAdapter[Validated], document: Mapping[str, Any], units: Any = None
) -> Validated: ...  # numpydoc ignore=GL08
def validated(
    model: type[BaseModel] | TypeAdapter[Any], document: Mapping[str, Any], units: Any = None
) -> Any:
    """Return what a document describes.

    Parameters
    ----------
    model : type or TypeAdapter
        The model that the document has to fit.
    document : mapping
        Nested tables and arrays, as read from TOML.
    units : mapping or None
        The table ``units`` of the scene of which this is a part; a whole scene has its own.

    Returns
    -------
    object
        An instance of the model.

    Raises
    ------
    ValueError
        If the document does not fit the model; names the fields.
    """
    context = {} if units is None else {UNITS: validated(Units, units)}
    try:
        if isinstance(model, TypeAdapter):
            found = model.validate_python(document, context=context)
        else:
            found = model.model_validate(document, context=context)
    except ValidationError as error:
        raise ValueError(explain(error, document) + _suggestions(error, model)) from error
    _refuse_truth_for_numbers(document, found)
    return found


def _refuse_truth_for_numbers(given: Any, found: Any, location: Location = ()) -> None:
    """Refuse true and false where something else was made of them: pydantic takes them for 1 and 0."""
    if isinstance(given, bool):
        if isinstance(found, int | float) and not isinstance(found, bool):
            raise ValueError(f"{dotted(location)}: {str(given).lower()} — input should be a number")
    elif isinstance(given, Mapping) and isinstance(found, tuple):  # one table stands for an array with it
        for made in found:
            _refuse_truth_for_numbers(given, made, location)
    elif isinstance(given, Mapping):
        for name, value in given.items():
            _refuse_truth_for_numbers(value, getattr(found, str(name), None), (*location, str(name)))
    elif isinstance(given, list | tuple) and isinstance(found, list | tuple):
        for index, (value, made) in enumerate(zip(given, found, strict=False)):
            _refuse_truth_for_numbers(value, made, (*location, index))


def nearest(name: str, names: Iterable[str]) -> str | None:
    """Return which of some names is spelled most like a mistyped one.

    Parameters
    ----------
    name : str
        That was given.
    names : iterable of str
        That exist.

    Returns
    -------
    str or None
        None if no name is similar.
    """
    return next(iter(get_close_matches(name, list(names), n=1)), None)


def _suggestions(error: ValidationError, model: type[BaseModel] | TypeAdapter[Any]) -> str:
    """Say which fields are meant most likely where unknown ones are given."""
    unknown = [str(each["loc"][-1]) for each in error.errors() if each["type"] == "extra_forbidden"]
    if not unknown:
        return ""
    schema = model.json_schema() if isinstance(model, TypeAdapter) else model.model_json_schema()
    tables = [schema, *schema.get("$defs", {}).values()]
    names = {name for table in tables for name in table.get("properties", {})}
    # Those that exist belong to another table; one may be mistyped in several vesicles.
    mistyped = [each for each in dict.fromkeys(unknown) if each not in names]
    similar = [name for name in (nearest(each, sorted(names)) for each in mistyped) if name is not None]
    return f" (did you mean {' and '.join(map(repr, similar))}?)" if similar else ""


def explain(error: ValidationError, document: Mapping[str, Any]) -> str:
    """Say on one line why a document is refused: fields, offending values, what is allowed.

    Parameters
    ----------
    error : ValidationError
        Raised by validating the document.
    document : mapping
        The document that was validated.

    Returns
    -------
    str
        For example ``vesicles.0.reduced_area: 1.2 — input should be less than or equal to 1``.  Several
        problems are separated by semicolons.
    """
    return describe(error.errors(include_url=False), document)


def describe(problems: Sequence[ErrorDetails], document: Mapping[str, Any]) -> str:
    """Say on one line which problems pydantic has found in a document.

    Parameters
    ----------
    problems : sequence of ErrorDetails
        As pydantic lists them.
    document : mapping
        The document that was validated.

    Returns
    -------
    str
        As `explain` returns it.
    """
    # When elements of an array are refused, pydantic refuses the array too: that message adds nothing.
    enclosing = {problem["loc"][:depth] for problem in problems for depth in range(len(problem["loc"]))}
    # Several messages about one value are about the alternatives that it could be.
    messages: dict[str, list[str]] = {}
    for problem in problems:
        if problem["loc"] not in enclosing:
            message = _reason(problem)
            about_subject = messages.setdefault(_subject(problem, document), [])
            about_subject.append(message[:1].lower() + message[1:])
    return "; ".join(subject + ", or ".join(texts) for subject, texts in messages.items())


def _reason(problem: ErrorDetails) -> str:
    given = problem["input"]
    point = decimal_point_wanted(given) if isinstance(given, str) else None
    return point or _WORDS.get(problem["type"], problem["msg"]).removeprefix("Value error, ")


def _subject(problem: ErrorDetails, document: Mapping[str, Any]) -> str:
    """Return what a message is about: a field, and its value."""
    location = _without_tags(problem["loc"], document)
    subject = f"{dotted(location)}: " if location else ""
    # For a missing field, or a check on several, the input is the enclosing table: there is no value to show.
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
        is_kind = isinstance(node, Mapping) and part not in node and part in node.values()
        is_name = part in (ONE, SEVERAL) or "[" in str(part)  # such as str-enum[Outcome]
        is_tag = is_kind or (is_name and value_at(node, (part,)) is None)
        if not is_tag:
            kept.append(part)
    return tuple(kept)
