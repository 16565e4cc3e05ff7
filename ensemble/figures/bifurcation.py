"""The bifurcation diagram: stable and unstable parts of branches of steady states, folds and crossings."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby, pairwise
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ensemble.figures.style import BLACK, MARKS, STYLE, VERMILLION, WIDTH
from ensemble.figures.symbols import AxisUnit, describe, quantity
from ensemble.search.branch_summary import BranchPointRecord, BranchSummary
from solver.analysis.run import Outcome
from solver.dimensions import ENERGY_PER_DEPTH, LENGTH, RATE, Dimension

Measured = Callable[[BranchPointRecord], float]

# What is drawn against the parameter: the first of which all points have a value.
_RESPONSES: tuple[tuple[str, Dimension | None, Measured], ...] = (
    ("inclination (degrees)", None, lambda point: _number(point.state.inclination_angle)),
    ("gap, $d$", LENGTH, lambda point: _number(point.state.gap)),
    ("bending energy, $E_b$", ENERGY_PER_DEPTH, lambda point: point.state.energy.bending),
)


@matplotlib.rc_context(STYLE)
def bifurcation_diagram(branches: Sequence[BranchSummary]) -> Figure:
    """Draw branches against their parameter, with the growth rates that decide their stability below.

    Parameters
    ----------
    branches : sequence of BranchSummary
        At least one, all in the same parameter.

    Returns
    -------
    Figure
        The group ids of its artists are ``stable``, ``unstable``, ``fold`` and ``crossing``.
    """
    first = branches[0]
    label, dimension, response = _response(branches)
    scene = first.scene
    along, up, rate = (
        AxisUnit.at(first.parameter, scene),
        AxisUnit.of(dimension, scene),
        AxisUnit.of(RATE, scene),
    )
    figure = Figure(figsize=(WIDTH, 5.2), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    upper.set_title(describe(first.scene, without=(first.parameter,)), pad=10)
    upper.set_ylabel(up.label(label))
    lower.set_xlabel(along.label(quantity(first.parameter, scene.flow).label))
    lower.set_ylabel(rate.label("fastest growth rate"))
    lower.axhline(0, color=BLACK, linewidth=0.6)
    for branch in branches:
        for axes, measured, unit in ((upper, response, up), (lower, _fastest_growth, rate)):
            _draw_branch(_Plane(axes, measured, along, unit), branch)
            _draw_special(_Plane(axes, measured, along, unit), branch)
    handles, labels = upper.get_legend_handles_labels()
    unique = dict(zip(labels, handles, strict=True))
    figure.legend(unique.values(), unique.keys(), loc="outside right upper")
    upper.margins(0.06)
    return figure


def _response(branches: Sequence[BranchSummary]) -> tuple[str, Dimension | None, Measured]:
    points = [point for branch in branches for point in branch.branch]
    return next(
        (label, dimension, measured)
        for label, dimension, measured in _RESPONSES
        if not any(math.isnan(measured(point)) for point in points)
    )


def _number(value: float | None) -> float:
    return math.nan if value is None else value


def _fastest_growth(point: BranchPointRecord) -> float:
    return point.state.eigenvalues[0][0]


class _Plane(NamedTuple):
    """Axes, what is drawn in them against the parameter, and the units of both."""

    axes: Axes
    measured: Measured
    along: AxisUnit
    up: AxisUnit

    def place(self, point: BranchPointRecord) -> tuple[float, float]:
        return self.along.size * point.value, self.up.size * self.measured(point)


def _draw_branch(plane: _Plane, branch: BranchSummary) -> None:
    """Draw each part between changes of stability or of outcome as one line."""
    parts = groupby(_pieces(branch), key=lambda piece: (piece.stable, piece.outcome))
    for (stable, outcome), pieces in parts:
        listed = list(pieces)
        points = [listed[0].start, *(piece.end for piece in listed)]
        plane.axes.plot(
            *zip(*map(plane.place, points), strict=True),
            color=MARKS[outcome].color,
            linestyle="-" if stable else (0, (3, 2)),
            linewidth=1.8 if stable else 1.2,
            label=f"{outcome}, {'stable' if stable else 'unstable'}",
            gid="stable" if stable else "unstable",
        )


class _Piece(NamedTuple):
    """What lies between two neighboring points."""

    start: BranchPointRecord
    end: BranchPointRecord
    stable: bool
    outcome: Outcome


def _pieces(branch: BranchSummary) -> Iterator[_Piece]:
    """Yield the pieces of a branch; one in which stability changes is cut at the fold or the crossing."""
    special = [*branch.folds, *branch.crossings]
    for start, end in pairwise(branch.branch):
        if start.state.stable != end.state.stable and special:
            middle = min(special, key=lambda point: _detour(start, point, end))
            yield _Piece(start, middle, start.state.stable, start.state.outcome)
            yield _Piece(middle, end, end.state.stable, end.state.outcome)
        else:
            yield _Piece(start, end, end.state.stable, end.state.outcome)


def _detour(start: BranchPointRecord, middle: BranchPointRecord, end: BranchPointRecord) -> float:
    """Return how far it is from one point to another by way of a third, in value and bending energy."""
    places = [np.array([point.value, point.state.energy.bending]) for point in (start, middle, end)]
    return float(sum(np.linalg.norm(b - a) for a, b in pairwise(places)))


def _draw_special(plane: _Plane, branch: BranchSummary) -> None:
    for name, points, shape in (("fold", branch.folds, "D"), ("crossing", branch.crossings, "o")):
        for point in points:
            plane.axes.plot(
                *plane.place(point),
                linestyle="none",
                marker=shape,
                markersize=6,
                color=VERMILLION,
                markerfacecolor="white",
                markeredgewidth=1.3,
                zorder=4,
                label=f"{name}, {plane.along.text(point.value, 8)}",
                gid=name,
            )
