"""Tables of branches of steady states, for people."""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Column, Table

if TYPE_CHECKING:
    from ensemble.search.branch_summary import BranchPointRecord, BranchSummary

_ABSENT = "–"


def branch_table(summary: BranchSummary) -> Table:
    """Return a table of a branch: a row for each point, and for each fold and crossing in its place.

    Parameters
    ----------
    summary : BranchSummary

    Returns
    -------
    Table
    """
    headings = [summary.parameter, "", "outcome", "stable", "growth", "inclination", "gap"]
    table = Table(*(Column(heading, overflow="fold") for heading in headings), title=escape(summary.key))
    rows = [
        *((point, "") for point in summary.branch),
        *((point, "fold") for point in summary.folds),
        *((point, "crossing") for point in summary.crossings),
    ]
    measured = [summary.measured_value(point) for point, _ in rows]
    has_units = any(value is not None for value in measured)
    if has_units:
        table.add_column(f"{summary.parameter} with its unit", overflow="fold")
    for (point, name), value in zip(rows, measured, strict=True):
        table.add_row(*_cells(point, name), *([str(value)] if has_units else []))
    return table


def _cells(point: BranchPointRecord, name: str) -> list[str]:
    state = point.state
    real, imaginary = state.eigenvalues[0]
    growth = f"{real:.3g}" + (f" ± {abs(imaginary):.3g}i" if imaginary else "")
    return [
        f"{point.value:.10g}",
        name,
        state.outcome,
        _ABSENT if name else ("yes" if state.stable else "no"),
        growth,
        _ABSENT if state.inclination_angle is None else f"{state.inclination_angle:.4f}°",
        _ABSENT if state.gap is None else f"{state.gap:.5g}",
    ]
