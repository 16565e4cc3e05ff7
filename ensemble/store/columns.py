"""The columns of a list of records: what is shown of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from ensemble.store.record_fields import EACH, Fields, Location, field_at


class ListColumn(NamedTuple):
    """A column of a list.

    Attributes
    ----------
    heading : str
    value : callable
        What is shown of a document; None if it lacks it.
    width : int or None
        How many characters of it are enough for people; None for all.
    """

    heading: str
    value: Callable[[Mapping[str, Any]], Any]
    width: int | None = None


def column_of(path: str, fields: Fields, heading: str | None = None, asked: str = "columns") -> ListColumn:
    """Return the column that shows a field.

    Parameters
    ----------
    path : str
        Dotted path.  A name that is applied to an array shows that of each element, or once if all are equal.
    fields : mapping of str to Field
        The fields with which a path may begin.
    heading : str, optional
        Left out, the path.
    asked : str
        What asks for the field, for messages.

    Returns
    -------
    ListColumn

    Raises
    ------
    StoreInputError
        If there is no such field.
    """
    location = field_at(path, fields, asked).location
    return ListColumn(path if heading is None else heading, lambda document: _shown(document, location))


def columns_of(paths: Sequence[str], fields: Fields) -> tuple[ListColumn, ...]:
    """Return the columns that show some fields; see `column_of`.

    Parameters
    ----------
    paths : sequence of str
        Dotted paths.
    fields : mapping of str to Field
        The fields with which a path may begin.

    Returns
    -------
    tuple of ListColumn
    """
    return tuple(column_of(path, fields) for path in paths)


def _shown(document: Any, location: Location) -> Any:
    found = values_at(document, location)
    if EACH not in location:
        return found[0] if found else None
    return found[0] if found and all(value == found[0] for value in found) else found


def values_at(document: Any, location: Location) -> list[Any]:
    """Return the values at a location of a document; several where it names each element of an array.

    Parameters
    ----------
    document : object
        JSON data.
    location : tuple of str or int
        As `Field` has it.

    Returns
    -------
    list
        Empty if the document has no such place.
    """
    nodes = [document]
    for part in location:
        if part == EACH:
            nodes = [element for node in nodes if isinstance(node, list) for element in node]
        else:
            nodes = [inner for node in nodes if (inner := _inside(node, part)) is not None]
    return nodes


def _inside(node: Any, part: str | int) -> Any:
    try:
        return node[part]
    except (KeyError, IndexError, TypeError):
        return None
