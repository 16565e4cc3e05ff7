"""Tables for people: boundaries, runs, and lists of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich import box
from rich.console import Group
from rich.markup import escape
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from rich.console import RenderableType

    from ensemble.config.measured import Measured
    from ensemble.search.boundary import Boundary, BoundaryPoint, OutcomeChange
    from ensemble.store.columns import ListColumn

_ABSENT = "–"
_WHOLE_CELL = 20  # a cell of so many characters is not divided, a longer one between words
# A terminal may have 80 columns.
_LEAN: dict[str, Any] = {"box": box.SIMPLE_HEAD, "pad_edge": False, "padding": (0, 1, 0, 0)}


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
    return _ABSENT if scanned is None else f"{scanned.values}, unseen ≤ ×{scanned.widest_unseen:.3g}"


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
    table = Table(*headings, title=escape(boundary.name))
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


def for_people(table: Table) -> RenderableType:
    """Return a table without the columns that say nothing or the same in every row.

    What is the same in all of several rows is said once, below the table.

    Parameters
    ----------
    table : Table
        Its cells are text.

    Returns
    -------
    renderable of rich
        The numbers are in one piece if the terminal is wide enough for the longest cells.
    """
    several = table.row_count > 1 and table.show_header
    kept, common = [], []
    for column in table.columns:
        cells = [plain(cell) for cell in column.cells]
        if several and len(set(cells)) == 1:
            if cells[0] != _ABSENT:
                common.append(f"{plain(column.header)}: {cells[0]}")
        elif not table.show_header or set(cells) != {_ABSENT}:
            kept.append((column, cells))
    lean = Table(title=table.title, show_header=table.show_header, **_LEAN)
    for column, cells in kept:
        lean.add_column(column.header, overflow="fold", min_width=_whole_width(cells))
    for row in zip(*(column.cells for column, _ in kept), strict=True):
        lean.add_row(*row)
    return Group(lean, Text(f"All rows: {'; '.join(common)}")) if common else lean


def _whole_width(cells: Sequence[str]) -> int:
    """Return the width in which no short cell is divided, and no long one within a word."""
    parts = [cell if len(cell) <= _WHOLE_CELL else max(cell.split(), key=len) for cell in cells]
    return min(max(map(len, parts), default=0), _WHOLE_CELL)


def plain(cell: Any) -> str:
    """Return a cell of a table without its markup.

    Parameters
    ----------
    cell : str or Text

    Returns
    -------
    str
    """
    return Text.from_markup(cell).plain if isinstance(cell, str) else str(cell)


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
    rows = [
        [list_cell(column.value(document))[: column.width] for column in columns] for document in documents
    ]
    table = Table(**_LEAN)
    for number, column in enumerate(columns):
        if number == 0:  # a key is there to be copied: other columns give way first
            table.add_column(column.heading, no_wrap=True, overflow="ignore")
        else:
            width = _whole_width([row[number] for row in rows])
            table.add_column(column.heading, overflow="fold", min_width=width)
    for row in rows:
        table.add_row(*map(escape, row))
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
    return _number(value)


def _leaves(document: Mapping[str, Any], prefix: str = "") -> list[tuple[str, Any]]:
    leaves = []
    for name, value in document.items():
        path = f"{prefix}{name}"
        if isinstance(value, Mapping):
            leaves += _leaves(value, f"{path}.")
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            for index, element in enumerate(value):
                leaves += _leaves(element, f"{path}.{index}.")
        else:
            leaves.append((path, value))
    return leaves


def _number(value: Any) -> str:
    if value is None:
        return _ABSENT
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list):
        return ", ".join(map(_number, value)) or _ABSENT
    return f"{value:.6g}" if isinstance(value, float) else str(value)
