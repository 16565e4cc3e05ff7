"""Filters ``path op value``, such as ``flow.rate>=0.5``: checked against a model, evaluated in SQL."""

from __future__ import annotations

import math
import operator
import re
import reprlib
from collections.abc import Callable, Sequence
from dataclasses import is_dataclass
from datetime import datetime
from typing import Any, Literal, Union, get_args, get_origin

from pydantic import BaseModel, TypeAdapter, ValidationError
from sqlalchemy import JSON, Column, ColumnElement, String, and_, case, column, false, func, select
from sqlalchemy.ext.compiler import compiles
from sqlalchemy.orm import InstrumentedAttribute
from sqlalchemy.sql.compiler import SQLCompiler
from sqlalchemy.sql.functions import GenericFunction

from ensemble.errors import StoreInputError
from ensemble.store.listing import ParameterRange
from ensemble.store.record_fields import EACH, Field, Fields, Location, alternatives, field_at
from ensemble.timestamp import timestamp_text

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

_ROUNDING = 1e-12

Comparison = Callable[[Any], ColumnElement[bool]]
JsonColumn = InstrumentedAttribute[Any] | Column[Any]


class json_type(GenericFunction[str]):  # noqa: N801  SQLAlchemy takes the name of the function from it
    """Type of a JSON value, as the database names it."""

    type = String()
    inherit_cache = True


@compiles(json_type, "postgresql")
def _json_typeof(function: json_type, compiler: SQLCompiler, **options: Any) -> str:
    return f"json_typeof({compiler.process(function.clauses, **options)})"


class json_elements(GenericFunction[Any]):  # noqa: N801  as above
    """The elements of a JSON array as rows with a column ``value``."""

    type = JSON()
    inherit_cache = True


@compiles(json_elements)
def _json_each(function: json_elements, compiler: SQLCompiler, **options: Any) -> str:
    return f"json_each({compiler.process(function.clauses, **options)})"


@compiles(json_elements, "postgresql")
def _json_array_elements(function: json_elements, compiler: SQLCompiler, **options: Any) -> str:
    return f"json_array_elements({compiler.process(function.clauses, **options)})"


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


def condition(text: str, document: JsonColumn, fields: Fields) -> ColumnElement[bool]:
    """Turn a filter into a condition on a JSON column.

    A record without the quantity meets no comparison but ``= null``.  A name that is applied to an array must
    meet it in each of its elements.

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
    field = field_at(path, fields, "where")
    return _in_each(document, field.location, _comparison(path, sign, value, field))


def _in_each(document: Any, location: Location, met: Comparison) -> ColumnElement[bool]:
    """Demand that what is at a location meets a comparison, or that it does in each element of an array."""
    if EACH not in location:
        return met(document[location])
    place = location.index(EACH)
    elements = json_elements(document[location[:place]]).table_valued(column("value", JSON))
    inner = _in_each(elements.c.value, location[place + 1 :], met)
    unmet = select(1).select_from(elements).where(~func.coalesce(inner, false()))
    return and_(select(1).select_from(elements).exists(), ~unmet.exists())


def _comparison(path: str, sign: str, value: str, field: Field) -> Comparison:
    """Return what compares an element of a document with the value of a filter."""
    compare = COMPARISONS[sign]
    if value == "null":
        if sign == "=":
            return lambda element: element.as_string().is_(None)
        if sign == "!=":
            return lambda element: element.as_string().is_not(None)

    kinds = set(alternatives(field.annotation))
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
        return lambda element: _of_kind(element, NUMBERS, compare(element.as_float(), float(value)))
    if kinds == {datetime}:
        moment = timestamp_text(_parse(value, path, datetime))
        return lambda element: compare(element.as_string(), moment)
    if sign not in EQUALITIES:
        raise StoreInputError(f"where: {path} is not a number and compares by = or != only")
    if kinds == {bool}:
        flag = _parse(value, path, bool)
        return lambda element: _of_kind(element, BOOLEANS, compare(element.as_boolean(), flag))
    word = str(_parse(value, path, _joined(kinds)))
    return lambda element: compare(element.as_string(), word)


def conditions(where: Sequence[str], document: JsonColumn, fields: Fields) -> list[ColumnElement[bool]]:
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


def without_reports(where: Sequence[str]) -> tuple[str, ...]:
    """Return filters that leave out runs made for reports, unless one of them asks for these.

    Parameters
    ----------
    where : sequence of str
        Filters of runs, as `condition` takes them.

    Returns
    -------
    tuple of str

    Raises
    ------
    StoreInputError
        If a filter is malformed.
    """
    asks = any(_parts(text)[0] == "report" for text in where)
    return tuple(where) if asks else (*where, "report=null")


def compared_fields(where: Sequence[str]) -> tuple[str, ...]:
    """Return the fields whose values filters compare, for a list that shows them.

    Parameters
    ----------
    where : sequence of str
        Filters, as `condition` takes them.

    Returns
    -------
    tuple of str
        Their dotted paths, each once; without those of which a filter asks only whether there is a value.

    Raises
    ------
    StoreInputError
        If a filter is malformed.
    """
    parts = map(_parts, where)
    return tuple(dict.fromkeys(path for path, _, value in parts if value != "null"))


def within(values: ParameterRange, document: JsonColumn, fields: Fields) -> ColumnElement[bool]:
    """Turn a range of a number into a condition on a JSON column.

    Parameters
    ----------
    values : ParameterRange
    document : column
        JSON of the records.
    fields : mapping of str to Field
        The fields with which a path may begin.

    Returns
    -------
    ColumnElement of bool
        It also holds for values beyond the range by a rounding error: a database may read a number off by one
        bit.
    """
    path, low, high = values
    low, high = low - _ROUNDING * abs(low), high + _ROUNDING * abs(high)
    location = field_at(path, fields, "where").location
    return _in_each(
        document, location, lambda element: _of_kind(element, NUMBERS, element.as_float().between(low, high))
    )


def number(path: str, document: JsonColumn, fields: Fields) -> ColumnElement[Any]:
    """Return the number at a path of a JSON column, null where there is none.

    Parameters
    ----------
    path : str
        Dotted path; of the elements of an array the first counts.
    document : column
        JSON of the records.
    fields : mapping of str to Field
        The fields with which a path may begin.

    Returns
    -------
    ColumnElement
    """
    return _number(_first(document, field_at(path, fields, "where")))


def _first(document: JsonColumn, field: Field) -> Any:
    return document[tuple(0 if part == EACH else part for part in field.location)]


def _number(element: Any) -> ColumnElement[Any]:
    return case((json_type(element).in_(NUMBERS), element.as_float()), else_=None)


def order(text: str, document: JsonColumn, fields: Fields) -> list[ColumnElement[Any]]:
    """Turn a field into what sorts records by it; those without the quantity come last.

    Parameters
    ----------
    text : str
        Dotted path; with ``-`` before it, the largest value comes first.
    document : column
        JSON of the records.
    fields : mapping of str to Field
        The fields with which a path may begin.

    Returns
    -------
    list of ColumnElement
        For ``ORDER BY``.

    Raises
    ------
    StoreInputError
        If the field is unknown, or holds other fields.
    """
    path = text.removeprefix("-")
    field = field_at(path, fields, "sort")
    kinds = set(alternatives(field.annotation))
    if any(_is_group(kind) for kind in kinds):
        raise StoreInputError(f"sort: {path} is a group of fields; name one of them")
    element = _first(document, field)
    keys: list[ColumnElement[Any]] = [_number(element)] if kinds & {float, int, Any} else []
    keys += [element.as_string()] if kinds - {float, int} else []
    return [
        ordering
        for key in keys
        for ordering in (key.is_(None), key.desc() if text.startswith("-") else key.asc())
    ]
