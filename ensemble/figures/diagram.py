"""The phase diagram of a study: its runs, the brackets of the boundary, and a straight line through them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ensemble.figures.style import ALL_MARKS, BLACK, GRAY, STYLE, VERMILLION, WIDTH
from ensemble.figures.symbols import AxisUnit, Quantity, axis_label, describe, number_text, quantity
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.search.critical_value import SearchStatus
from ensemble.search.line import Line, line_through
from solver.analysis.run import Array

_NARROW = 5.0  # inches


@matplotlib.rc_context(STYLE)
def phase_diagram(
    boundary: Boundary, runs: Sequence[tuple[float, float, str]], width: float = WIDTH
) -> Figure:
    """Draw the runs and the boundary of a study in the plane of its two parameters.

    Parameters
    ----------
    boundary : Boundary
        Its swept parameter, which is the only one, is drawn along x, its searched parameter along y.
    runs : sequence of (float, float, Outcome)
        Swept value, searched value and outcome of each run.
    width : float
        Inches.  The legend of a narrow figure stands below it.

    Returns
    -------
    Figure
        The group ids of its artists are ``run <outcome>``, ``bracket``, ``certified bracket``,
        ``other change``, ``boundary`` and ``fit``.
    """
    (swept,) = boundary.swept
    searched = boundary.searched
    scene = boundary.scene
    plane = _Plane(
        x=quantity(swept, scene.flow),
        y=quantity(searched, scene.flow),
        across=AxisUnit.at(swept, scene).size,
        up=AxisUnit.at(searched, scene).size,
        swept=swept,
    )

    figure = Figure(figsize=(width, 4.0), layout="constrained")
    axes = figure.add_subplot(xlabel=axis_label(swept, scene), ylabel=axis_label(searched, scene))
    axes.set_title(describe(scene, without=(swept, searched)), pad=10, wrap=True)
    _draw_runs(axes, runs, plane)
    points = sorted(boundary.points, key=lambda point: point.parameters[swept])
    bracketed = [point for point in points if point.critical_value is not None]
    if bracketed:
        _draw_brackets(axes, bracketed, plane)
        _draw_boundary(axes, bracketed, plane)
    _draw_other_changes(axes, points, plane)
    converged = [point for point in bracketed if point.status == SearchStatus.CONVERGED]
    if (line := line_through(boundary)) is not None:
        _draw_fit(axes, line, [point.parameters[swept] for point in converged], plane)
    axes.margins(0.06)
    if axes.get_legend_handles_labels()[0]:
        if width < _NARROW:
            figure.legend(loc="outside lower center", ncols=2)
        else:
            figure.legend(loc="outside right center")
    return figure


class _Plane(NamedTuple):
    """The two parameters of a diagram, the sizes of their units, and the path of the swept one."""

    x: Quantity
    y: Quantity
    across: float
    up: float
    swept: str

    def places(self, points: Sequence[BoundaryPoint]) -> Array:
        return self.across * np.array([point.parameters[self.swept] for point in points])


def _draw_runs(axes: Axes, runs: Sequence[tuple[float, float, str]], plane: _Plane) -> None:
    for outcome, mark in ALL_MARKS.items():
        found = [(sweep, value) for sweep, value, result in runs if result == outcome]
        places = np.array(found) * (plane.across, plane.up) if found else np.array([])
        if places.size:
            axes.plot(
                *places.T,
                linestyle="none",
                marker=mark.shape,
                color=mark.color,
                markerfacecolor=mark.face,
                markeredgecolor=mark.edge,
                markeredgewidth=mark.edge_width,
                markersize=6.5,
                label=str(outcome),
                gid=f"run {outcome}",
            )


def _draw_other_changes(axes: Axes, points: Sequence[BoundaryPoint], plane: _Plane) -> None:
    """Draw the brackets of changes that are not the answer, where a point has several."""
    places = [
        (point.parameters[plane.swept], *change.bracket) for point in points for change in point.other_changes
    ]
    if places:
        sweep, low, high = (np.array(places) * (plane.across, plane.up, plane.up)).T
        _bars(axes, sweep, low, high, VERMILLION, "another change of the outcome").set_gid("other change")


def _bars(
    axes: Axes, sweep: Array, low: Array, high: Array, color: str, label: str, bold: bool = False
) -> LineCollection:
    _, _, (bars,) = axes.errorbar(
        sweep,
        (low + high) / 2,
        yerr=(high - low) / 2,
        fmt="none",
        ecolor=color,
        elinewidth=2.6 if bold else 1.0,
        capsize=8.0 if bold else 5.0,
        capthick=1.3 if bold else 1.0,
        zorder=3,
        label=label,
    )
    return bars


def _draw_brackets(axes: Axes, bracketed: Sequence[BoundaryPoint], plane: _Plane) -> None:
    for label, is_certified in (("bracket", False), ("certified bracket", True)):
        points = [point for point in bracketed if point.certified == is_certified]
        if points:
            low, high = plane.up * np.array([point.bracket for point in points], dtype=float).T
            _bars(axes, plane.places(points), low, high, BLACK, label, is_certified).set_gid(label)


def _draw_boundary(axes: Axes, bracketed: Sequence[BoundaryPoint], plane: _Plane) -> None:
    critical = plane.up * np.array([point.critical_value for point in bracketed], dtype=float)
    axes.plot(
        plane.places(bracketed),
        critical,
        color=GRAY,
        zorder=1.5,
        label=f"critical value ${plane.y.critical}$",
        gid="boundary",
    )


def _draw_fit(axes: Axes, line: Line, sweep: Sequence[float], plane: _Plane) -> None:
    sign = "−" if line.intercept < 0 else "+"
    slope = number_text(line.slope * plane.up / plane.across, 3)
    intercept = number_text(abs(line.intercept) * plane.up, 2)
    ends = np.array([min(sweep), max(sweep)])
    axes.plot(
        plane.across * ends,
        plane.up * (line.intercept + line.slope * ends),
        color=BLACK,
        linestyle=(0, (4, 3)),
        zorder=1.6,
        label=f"fit, ${plane.y.critical}$ = {slope} ${plane.x.symbol}$ {sign} {intercept}",
        gid="fit",
    )
