"""The fields of the records of a store by dotted paths, such as ``flow.rate`` or ``vesicles.0.angle``."""

from __future__ import annotations

import types
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, is_dataclass
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin, get_type_hints

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from ensemble.errors import StoreInputError
from solver.registry import RegisteredNames, Registry

EACH: Final = "*"  # no field has this name

Location = tuple[str | int, ...]


@dataclass(frozen=True)
class Field:
    """A field of a record.

    Attributes
    ----------
    location : tuple of str or int
        Keys and indices that lead to it in the JSON document; `EACH` for every element of an array.
    annotation : any
        Its type.
    """

    location: Location
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


def alternatives(annotation: Any) -> Iterator[Any]:
    """Yield the types that a value may have: unions are taken apart, registries looked up, None left out.

    Parameters
    ----------
    annotation : any
        A type.

    Yields
    ------
    any
        A type.
    """
    origin = get_origin(annotation)
    if origin is Annotated:
        kind, *metadata = get_args(annotation)
        match metadata[0]:
            case Registry() as models:
                yield from models
            case RegisteredNames() as names:
                yield Literal[tuple(names)]
            case _:
                yield from alternatives(kind)
    elif origin in (Union, types.UnionType):
        for member in get_args(annotation):
            yield from alternatives(member)
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


def field_at(path: str, fields: Fields, asked: str) -> Field:
    """Return what a dotted path names in a record.

    Parameters
    ----------
    path : str
        As ``--set`` takes it: a name that is applied to an array stands for that name in each element.
    fields : mapping of str to Field
        The fields with which a path may begin.
    asked : str
        Where the path was given, for messages: such as ``where``.

    Returns
    -------
    Field

    Raises
    ------
    StoreInputError
        If there is no such field.
    """
    first, *rest = path.split(".")
    if first not in fields:
        raise StoreInputError(f"{asked}: unknown field {path!r}; fields are {', '.join(sorted(fields))}")
    field = fields[first]
    for segment in rest:
        if is_sequence(field.annotation) and not segment.isdecimal():
            elements = [get_args(kind)[0] for kind in alternatives(field.annotation) if get_args(kind)]
            field = Field((*field.location, EACH), Union[tuple(elements)])  # noqa: UP007
        members = [member for kind in alternatives(field.annotation) for member in _members(kind, segment)]
        if not members:
            raise StoreInputError(f"{asked}: unknown field {path!r}: there is no {segment!r}")
        field = Field((*field.location, members[0][0]), Union[tuple(kind for _, kind in members)])  # noqa: UP007
    return field


def is_sequence(annotation: Any) -> bool:
    """Tell whether a value of this type is an array.

    Parameters
    ----------
    annotation : any
        A type.

    Returns
    -------
    bool
    """
    return any(get_origin(kind) in (list, tuple) for kind in alternatives(annotation))
