"""Tables for people: boundaries, runs, and lists of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.markup import escape
from rich.table import Column, Table

if TYPE_CHECKING:
    from ensemble.config.measured import Measured
    from ensemble.search.boundary import Boundary, BoundaryPoint, OutcomeChange
    from ensemble.store.columns import ListColumn

_ABSENT = "–"


def boundary_columns(points: Sequence[BoundaryPoint]) -> list[str]:
    """Return the headings of the columns that `boundary_cells` fills.

    Parameters
    ----------
    points : sequence of BoundaryPoint
        At least one point of the boundary.

    Returns
    -------
    list of str
    """
    others = ["other changes"] if any(point.other_changes for point in points) else []
    confirmed = ["confirmed"] if any(point.confirmed for point in points) else []
    headings = ["critical value", "bracket", "outcomes", "status", *others, "scanned", *confirmed]
    return [*points[0].parameters, *headings, "certified by", "runs"]


def boundary_cells(point: BoundaryPoint, columns: Sequence[str]) -> list[str]:
    """Return one point of a boundary as the cells of a row.

    Parameters
    ----------
    point : BoundaryPoint
        The point.
    columns : sequence of str
        From `boundary_columns`.

    Returns
    -------
    list of str
    """
    cells = {name: _number(value) for name, value in point.parameters.items()} | {
        "critical value": _number(point.critical_value),
        "bracket": bracket_text(point),
        "outcomes": " | ".join(outcome or "?" for outcome in point.outcomes),
        "status": point.status,
        "other changes": "; ".join(map(_change, point.other_changes)) or _ABSENT,
        "scanned": _scanned(point),
        "confirmed": _confirmed(point),
        "certified by": _certifying_numerics(point),
        "runs": str(len(point.runs)),
    }
    return [cells[column] for column in columns]


def place_text(parameters: Mapping[str, float]) -> str:
    """Write the swept parameters of a point.

    Parameters
    ----------
    parameters : mapping of str to float
        Values by dotted path.

    Returns
    -------
    str
        Such as ``flow.rate 0.5, vesicles.reduced_area 0.9``.
    """
    return ", ".join(f"{name} {value:g}" for name, value in parameters.items())


def bracket_text(point: BoundaryPoint) -> str:
    """Write the two ends of a bracket, with a question mark where an end is unknown.

    Parameters
    ----------
    point : BoundaryPoint
        The point that has the bracket.

    Returns
    -------
    str
    """
    return " – ".join("?" if end is None else f"{end:.6g}" for end in point.bracket)


def _change(change: OutcomeChange) -> str:
    low, high = change.bracket
    return f"{low:.6g} – {high:.6g} ({' | '.join(change.outcomes)})"


def _scanned(point: BoundaryPoint) -> str:
    """Say how many values were looked at beside the brackets, and how wide an unseen window may be."""
    scanned = point.scanned
    return _ABSENT if scanned is None else f"{scanned.values} values, unseen ≤ ×{scanned.widest_unseen:.3g}"


def _confirmed(point: BoundaryPoint) -> str:
    """Say how many of the sensitive runs came out the same at finer numerics."""
    agreeing = sum(each.outcome == each.finer_outcome for each in point.confirmed)
    return f"{agreeing} of {len(point.confirmed)}" if point.confirmed else _ABSENT


def _certifying_numerics(point: BoundaryPoint) -> str:
    numerics = point.certified_by
    return _ABSENT if numerics is None else f"{numerics.points} points, {numerics.tolerance:g}"


def boundary_table(boundary: Boundary) -> Table:
    """Return a table of a boundary, with a row for each of its points.

    Parameters
    ----------
    boundary : Boundary
        The boundary.

    Returns
    -------
    Table
    """
    columns, measured = boundary_columns(boundary.points), boundary.measured()
    units = {name.replace("_", " "): each.unit for of_point in measured for name, each in of_point.items()}
    headings = [*columns, *(f"{name} ({unit})" for name, unit in units.items())]
    table = Table(*map(_folded, headings), title=escape(boundary.name))
    for point, of_point in zip(boundary.points, measured, strict=True):
        values = {name.replace("_", " "): each.value for name, each in of_point.items()}
        table.add_row(*boundary_cells(point, columns), *(_range(values.get(name)) for name in units))
    return table


def _range(value: Any) -> str:
    return " – ".join(map(_number, value)) if isinstance(value, list) else _number(value)


def fields_table(document: Mapping[str, Any], measured: Mapping[str, Measured] | None = None) -> Table:
    """Return a table of a document, with a row for each of its fields; those of inner tables by dotted path.

    Parameters
    ----------
    document : mapping
        Nested tables, such as the results of a run.
    measured : mapping of str to Measured, optional
        The numbers with their units, by dotted path; if there are any, they are a column.

    Returns
    -------
    Table
    """
    table = Table(show_header=False)
    for name, value in _leaves(document):
        cells = [name, _number(value)]
        if measured:
            cells.append(str(measured[name]) if name in measured else "")
        table.add_row(*cells)
    return table


def list_table(columns: Sequence[ListColumn], documents: Iterable[Mapping[str, Any]]) -> Table:
    """Return a table of records, with a row for each.

    Parameters
    ----------
    columns : sequence of ListColumn
        The first one holds the key.
    documents : iterable of mapping
        The records.

    Returns
    -------
    Table
    """
    first, *others = (column.heading for column in columns)
    table = Table(_whole(first), *map(_folded, others))
    for document in documents:
        table.add_row(*(escape(list_cell(column.value(document))[: column.width]) for column in columns))
    return table


def list_cell(value: Any) -> str:
    """Write a value of a list.

    Parameters
    ----------
    value : object
        JSON data.

    Returns
    -------
    str
    """
    return ", ".join(map(_number, value)) if isinstance(value, list) else _number(value)


def _folded(heading: str) -> Column:
    # Nothing is cut: what does not fit goes on in the next line.
    return Column(heading, overflow="fold")


def _whole(heading: str) -> Column:
    # A key is there to be copied: other columns give way first.
    return Column(heading, no_wrap=True, overflow="ignore")


def _leaves(document: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    leaves = []
    for name, value in document.items():
        leaves += (
            _leaves(value, f"{prefix}{name}.") if isinstance(value, Mapping) else [(f"{prefix}{name}", value)]
        )
    return leaves


def _number(value: Any) -> str:
    if value is None:
        return _ABSENT
    return f"{value:.6g}" if isinstance(value, float) else str(value)
