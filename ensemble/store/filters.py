"""Filters ``path op value``, such as ``flow.rate>=0.5``: checked against a model, evaluated in SQL."""

from __future__ import annotations

import math
import operator
import re
import reprlib
import types
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, is_dataclass
from datetime import datetime
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel, TypeAdapter, ValidationError
from pydantic.fields import FieldInfo
from sqlalchemy import ColumnElement, String, case, false
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.orm import InstrumentedAttribute
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.functions import GenericFunction

from ensemble.errors import StoreInputError
from ensemble.timestamp import timestamp_text
from solver.registry import RegisteredNames, Registry

COMPARISONS = {
    "=": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
EQUALITIES = ("=", "!=")
PATH = re.compile(r"\w+(?:\.\w+)*")
_SIGN = re.compile(r"<=|>=|!=|=|<|>")
# The names that databases have for the types of JSON.
NUMBERS = ("number", "integer", "real")
BOOLEANS = ("boolean", "integer")  # SQLite reads true and false as 1 and 0


@dataclass(frozen=True)
class Field:
    """A field of a record.

    Attributes
    ----------
    location : tuple of str or int
        Keys and indices that lead to it in the JSON document.
    annotation : any
        Its type.
    """

    location: tuple[str | int, ...]
    annotation: Any


Fields = Mapping[str, Field]


def model_fields(model: type[BaseModel], *prefix: str) -> dict[str, Field]:
    """Return the top-level fields of a model.

    Parameters
    ----------
    model : type of BaseModel
    *prefix : str
        Keys that lead to the JSON of the model in a document.

    Returns
    -------
    dict of str to Field
    """
    return {name: Field((*prefix, name), _declared_type(info)) for name, info in model.model_fields.items()}


def _declared_type(info: FieldInfo) -> Any:
    """Return the type of a field together with its registry, which pydantic keeps apart from the type."""
    registries = [each for each in info.metadata if isinstance(each, Registry | RegisteredNames)]
    return Annotated[info.annotation, registries[0]] if registries else info.annotation


def _document_name(name: str, annotation: Any) -> str:
    """Return the name that a field of a dataclass has in documents."""
    metadata = get_args(annotation)[1:] if get_origin(annotation) is Annotated else ()
    return next((each.alias for each in metadata if isinstance(each, FieldInfo) and each.alias), name)


def _alternatives(annotation: Any) -> Iterator[Any]:
    """Yield the types that a value may have: unions are taken apart, registries looked up, None left out."""
    origin = get_origin(annotation)
    if origin is Annotated:
        kind, *metadata = get_args(annotation)
        match metadata[0]:
            case Registry() as models:
                yield from models
            case RegisteredNames() as names:
                yield Literal[tuple(names)]
            case _:
                yield from _alternatives(kind)
    elif origin in (Union, types.UnionType):
        for member in get_args(annotation):
            yield from _alternatives(member)
    elif annotation is not types.NoneType:
        yield annotation


def _members(annotation: Any, segment: str) -> Iterator[tuple[str | int, Any]]:
    """Yield the key in the JSON document, and the type, of what a segment names inside a value."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is dict:
        yield segment, arguments[1]
    elif origin in (list, tuple):
        if segment.isdecimal():
            repeated = origin is list or arguments[-1] is Ellipsis
            if repeated or int(segment) < len(arguments):
                yield int(segment), arguments[0 if repeated else int(segment)]
    elif is_dataclass(annotation):
        for name, kind in get_type_hints(annotation, include_extras=True).items():
            if segment == _document_name(name, kind):
                yield segment, kind
    elif isinstance(annotation, type) and issubclass(annotation, BaseModel):
        if segment in annotation.model_fields:
            yield segment, _declared_type(annotation.model_fields[segment])
    elif annotation is Any:
        yield segment, Any


def _resolve(path: str, fields: Fields) -> Field:
    first, *rest = path.split(".")
    if first not in fields:
        raise StoreInputError(f"where: unknown field {path!r}; fields are {', '.join(sorted(fields))}")
    field = fields[first]
    for segment in rest:
        members = [member for kind in _alternatives(field.annotation) for member in _members(kind, segment)]
        if not members:
            hint = " (name one by its index, as in vesicles.0)" if _is_sequence(field.annotation) else ""
            raise StoreInputError(f"where: unknown field {path!r}: there is no {segment!r}{hint}")
        field = Field((*field.location, members[0][0]), Union[tuple(kind for _, kind in members)])  # noqa: UP007
    return field


def _is_sequence(annotation: Any) -> bool:
    return any(get_origin(kind) in (list, tuple) for kind in _alternatives(annotation))


class json_type(GenericFunction[str]):  # noqa: N801  SQLAlchemy takes the name of the function from it
    """Type of a JSON value, as the database names it."""

    type = String()
    inherit_cache = True


@compiles(json_type, "postgresql")
def _json_typeof(function: json_type, compiler: SQLCompiler, **options: Any) -> str:
    return f"json_typeof({compiler.process(function.clauses, **options)})"


def _of_kind(
    element: ColumnElement[Any], kinds: Sequence[str], comparison: ColumnElement[bool]
) -> ColumnElement[bool]:
    """Compare only values of these types: a server would fail to convert text such as "NaN"."""
    return case((json_type(element).in_(kinds), comparison), else_=false())


def _parse(text: str, path: str, annotation: Any) -> Any:
    try:
        return TypeAdapter(annotation).validate_strings(text)
    except ValidationError as error:
        reason = error.errors()[0]["msg"]
        raise StoreInputError(f"where: {text!r} is no value of {path}: {reason}") from error


def _apparent_type(text: str) -> type:
    """Return the type of a value that is compared with a field of no declared type."""
    for kind in (float, bool):
        try:
            TypeAdapter(kind).validate_strings(text)
        except ValidationError:
            continue
        return kind
    return str


def _joined(kinds: set[Any]) -> Any:
    """Return a union of types; literals become one, so that a message lists everything that is allowed."""
    if all(get_origin(kind) is Literal for kind in kinds):
        return Literal[tuple(sorted(word for kind in kinds for word in get_args(kind)))]
    return Union[tuple(kinds)]  # noqa: UP007


def _is_group(kind: Any) -> bool:
    is_model = isinstance(kind, type) and issubclass(kind, BaseModel)
    return is_model or is_dataclass(kind) or get_origin(kind) in (list, tuple, dict)


def _parts(text: str) -> tuple[str, str, str]:
    """Split a filter into path, sign and value, in a time proportional to its length."""
    sign = _SIGN.search(text)
    if sign is not None:
        path, value = text[: sign.start()].strip(), text[sign.end() :].strip()
        # PostgreSQL knows no text with a null character.
        if PATH.fullmatch(path) and value and value[0] not in "=<>" and not {"\n", "\0"} & set(value):
            return path, sign[0], value
    raise StoreInputError(
        f"where: {reprlib.repr(text)} is not of the form path op value, op one of = != < <= > >="
    )


def condition(text: str, document: InstrumentedAttribute[Any], fields: Fields) -> ColumnElement[bool]:
    """Turn a filter into a condition on a JSON column.

    A record without the quantity meets no comparison but ``= null``.

    Parameters
    ----------
    text : str
        ``path op value`` with op one of = != < <= > >=; text, true/false and null compare by = and != only.
    document : column
        JSON of the records.
    fields : mapping of str to Field
        The fields with which a path may begin.

    Returns
    -------
    ColumnElement of bool

    Raises
    ------
    StoreInputError
        If the filter is malformed, the field is unknown, or the value does not have its type.
    """
    path, sign, value = _parts(text)
    field = _resolve(path, fields)
    element, compare = document[field.location], COMPARISONS[sign]
    if value == "null" and sign in EQUALITIES:
        stored = element.as_string()
        return stored.is_(None) if sign == "=" else stored.is_not(None)

    kinds = set(_alternatives(field.annotation))
    if kinds == {Any}:
        kinds = {_apparent_type(value)}
    if any(_is_group(kind) for kind in kinds):
        raise StoreInputError(f"where: {path} is a group of fields; compare one of them, or {path}=null")
    words = {word for kind in kinds if get_origin(kind) is Literal for word in get_args(kind)}
    numbers = kinds & {float, int}
    if numbers and value not in words:
        _parse(value, path, Union[tuple(numbers)])  # noqa: UP007
        if not math.isfinite(float(value)):
            raise StoreInputError(f"where: {value!r} is no value of {path}: it must be finite")
        # Compared as documents are, in double precision: SQL has no integers as long as Python's.
        return _of_kind(element, NUMBERS, compare(element.as_float(), float(value)))
    if kinds == {datetime}:
        return compare(element.as_string(), timestamp_text(_parse(value, path, datetime)))
    if sign not in EQUALITIES:
        raise StoreInputError(f"where: {path} is not a number and compares by = or != only")
    if kinds == {bool}:
        return _of_kind(element, BOOLEANS, compare(element.as_boolean(), _parse(value, path, bool)))
    return compare(element.as_string(), str(_parse(value, path, _joined(kinds))))


def conditions(
    where: Sequence[str], document: InstrumentedAttribute[Any], fields: Fields
) -> list[ColumnElement[bool]]:
    """Turn several filters, all of which a record must meet, into conditions on a JSON column.

    Parameters
    ----------
    where : sequence of str
        Filters as `condition` takes them.
    document : column
        JSON of the records.
    fields : mapping of str to Field
        The fields with which a path may begin.

    Returns
    -------
    list of ColumnElement of bool
    """
    return [condition(text, document, fields) for text in where]
