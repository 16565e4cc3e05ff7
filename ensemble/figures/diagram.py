"""The phase diagram of a study: every run, the brackets of the boundary and a straight line through it."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ensemble.figures.style import BLACK, GRAY, MARKS, STYLE, WIDTH
from ensemble.figures.symbols import Quantity, describe, quantity
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.search.critical_value import Status
from ensemble.search.line import Line, line_through
from solver.analysis.run import Array, Outcome
from solver.scene import Scene


@matplotlib.rc_context(STYLE)
def phase_diagram(boundary: Boundary, runs: Sequence[tuple[float, float, Outcome]]) -> Figure:
    """Draw where in the plane of two parameters vesicles stay together.

    Parameters
    ----------
    boundary : Boundary
        Its sweep parameter is drawn on x, its searched parameter on y.
    runs : sequence of (sweep value, searched value, outcome)
        Every run is one mark.

    Returns
    -------
    Figure
        The artists' group ids are ``run <outcome>``, ``bracket``, ``boundary`` and ``fit``.
    """
    swept = boundary.study["sweep"]["parameter"]
    searched = boundary.study["search"]["parameter"]
    scene = Scene.model_validate(boundary.study["scene"])
    x, y = quantity(swept, scene.flow), quantity(searched, scene.flow)

    figure = Figure(figsize=(WIDTH, 4.0), layout="constrained")
    axes = figure.add_subplot(xlabel=x.label, ylabel=y.label)
    axes.set_title(describe(scene, without=(swept, searched)), pad=10)
    _draw_runs(axes, runs)
    points = sorted(boundary.points, key=lambda point: point.parameters[swept])
    known = [point for point in points if point.critical_value is not None]
    if known:
        _draw_brackets(axes, known, swept)
        _draw_boundary(axes, known, swept, y)
    converged = [point for point in known if point.status == Status.CONVERGED]
    if (line := line_through(boundary)) is not None:
        _draw_fit(axes, line, [point.parameters[swept] for point in converged], x, y)
    axes.margins(0.06)
    if axes.get_legend_handles_labels()[0]:
        figure.legend(loc="outside right center")
    return figure


def _draw_runs(axes: Axes, runs: Sequence[tuple[float, float, Outcome]]) -> None:
    for outcome, mark in MARKS.items():
        chosen = np.array([(sweep, value) for sweep, value, result in runs if result == outcome])
        if chosen.size:
            axes.plot(
                *chosen.T,
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


def _draw_brackets(axes: Axes, known: Sequence[BoundaryPoint], swept: str) -> None:
    ends = np.array([point.bracket for point in known], dtype=float)
    certified = sum(point.certified for point in known)
    _, _, (bars,) = axes.errorbar(
        [point.parameters[swept] for point in known],
        ends.mean(axis=1),
        yerr=np.ptp(ends, axis=1) / 2,
        fmt="none",
        ecolor=BLACK,
        elinewidth=1.0,
        capsize=5.5,
        capthick=1.0,
        zorder=3,
        label=f"bracket ({certified} of {len(known)} certified)",
    )
    bars.set_gid("bracket")


def _draw_boundary(axes: Axes, known: Sequence[BoundaryPoint], swept: str, y: Quantity) -> None:
    axes.plot(
        *_critical_values(known, swept),
        color=GRAY,
        zorder=1.5,
        label=f"critical value ${y.critical}$",
        gid="boundary",
    )


def _draw_fit(axes: Axes, line: Line, sweep: Sequence[float], x: Quantity, y: Quantity) -> None:
    sign = "−" if line.intercept < 0 else "+"
    ends = np.array([min(sweep), max(sweep)])
    axes.plot(
        ends,
        line.intercept + line.slope * ends,
        color=BLACK,
        linestyle=(0, (4, 3)),
        zorder=1.6,
        label=f"fit, ${y.critical}$ = {line.slope:.3g} ${x.symbol}$ {sign} {abs(line.intercept):.2g}",
        gid="fit",
    )


def _critical_values(known: Sequence[BoundaryPoint], swept: str) -> tuple[Array, Array]:
    sweep = np.array([point.parameters[swept] for point in known])
    return sweep, np.array([point.critical_value for point in known], dtype=float)
