"""Figures of a doublet in a fluid trap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from ensemble.figures.style import (
    BLACK,
    BLUE,
    GRAY,
    GREEN,
    MARKS,
    ORANGE,
    PURPLE,
    SKY,
    STYLE,
    VERMILLION,
    WIDTH,
)
from ensemble.report.paper.comparison import published
from ensemble.search.boundary import BoundaryPoint
from ensemble.store.run_record import RunSummary
from solver.analysis.averages import pair_inclination
from solver.analysis.run import Outcome, Run

_COLORS = (BLUE, GREEN, ORANGE, VERMILLION, PURPLE, SKY, BLACK)
_LARGEST_RATE = 0.19  # in the phase diagram; at higher rates there are only separated pairs
_BOX = 0.012  # half the width of a published bracket, in reduced area

Place = tuple[float, float]  # reduced area and rate


@matplotlib.rc_context(STYLE)
def angles(turning: Sequence[Run], grid: Mapping[Place, RunSummary]) -> Figure:
    """Draw the inclination angle as the paper defines it (Quaife et al. 2019, fig. 7).

    Parameters
    ----------
    turning : sequence of Run
        Runs in a trap, whose angle is drawn against time on the left.
    grid : mapping of (float, float) to RunSummary
        Runs by reduced area and rate.  Final angles of pairs that are held side by side are drawn against the
        rate on the right.

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(WIDTH, 3.1), layout="constrained")
    left, right = figure.subplots(1, 2)
    for color, run in zip(_COLORS, turning, strict=False):
        assert run.scene.flow is not None
        angle = pair_inclination(run.series["center_angle"])
        left.plot(run.series["time"], angle, color=color, label=rf"$\dot\epsilon$ = {run.scene.flow.rate:g}")
    left.set(
        xlabel="time $t$",
        ylabel=r"inclination angle $\theta$ (deg)",
        xscale="log",
        xlim=(5, None),
        ylim=(85, 185),
    )
    left.legend(loc="lower left")
    for color, area in zip(_COLORS, sorted({area for area, _ in grid}), strict=False):
        bound = sorted(
            (rate, summary.inclination_angle)
            for (at, rate), summary in grid.items()
            if at == area and summary.outcome is Outcome.BOUND and summary.inclination_angle is not None
        )
        if bound:
            right.plot(*np.array(bound).T, "o-", color=color, markersize=3.5, label=rf"$\Delta A$ = {area:g}")
    right.set(
        xlabel=r"extension rate $\dot\epsilon$",
        ylabel=r"final angle $\theta$ (deg)",
        xlim=(0, None),
        ylim=(85, 185),
    )
    right.legend(ncols=2)
    return figure


@matplotlib.rc_context(STYLE)
def phase_diagram(
    grid: Mapping[Place, RunSummary],
    searched: Mapping[Place, Outcome],
    side_by_side: Mapping[float, BoundaryPoint],
    separation: Mapping[float, BoundaryPoint],
) -> Figure:
    """Draw outcomes and the brackets of both transitions, as in Quaife et al. 2019, fig. 10(c).

    Parameters
    ----------
    grid : mapping of (float, float) to RunSummary
        Runs by reduced area and rate; each is a large mark.
    searched : mapping of (float, float) to Outcome
        Outcomes of the runs of the searches; each is a small mark.
    side_by_side, separation : mapping of float to BoundaryPoint
        The end of side by side and the separation of the pair, by reduced area.

    Returns
    -------
    Figure
        With the published brackets of the first transition.
    """
    figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
    axes = figure.add_subplot(xlabel=r"reduced area $\Delta A$", ylabel=r"extension rate $\dot\epsilon$")
    _draw_outcomes(axes, grid, searched)
    _draw_boundary(axes, side_by_side, "-", "end of side by side")
    _draw_boundary(axes, separation, "--", "separation")
    _draw_published_brackets(axes)
    axes.set_ylim(0, _LARGEST_RATE)
    figure.legend(loc="outside right center")
    return figure


def _draw_outcomes(axes: Axes, grid: Mapping[Place, RunSummary], searched: Mapping[Place, Outcome]) -> None:
    for outcome, mark in MARKS.items():
        runs = {place: summary for place, summary in grid.items() if summary.outcome == outcome}
        if runs:
            area, rate = zip(*runs, strict=True)
            axes.scatter(
                area,
                rate,
                s=[_mark_size(summary) for summary in runs.values()],
                marker=mark.shape,
                facecolor=mark.face,
                linewidth=mark.edge_width,
                edgecolor=mark.edge,
                label=str(outcome),
            )
        places = [place for place, result in searched.items() if result == outcome]
        if places:
            axes.plot(*np.array(places).T, ".", color=mark.color, markersize=2.5, alpha=0.7)


def _mark_size(summary: RunSummary) -> float:
    """Return the area of a mark, in square points; for a pair held side by side it grows with its angle."""
    if summary.outcome is not Outcome.BOUND or summary.inclination_angle is None:
        return 30.0
    return 6 + 1.1 * (summary.inclination_angle - 90)


def _draw_boundary(axes: Axes, points: Mapping[float, BoundaryPoint], style: str, label: str) -> None:
    closed = sorted((area, *point.bracket) for area, point in points.items() if None not in point.bracket)
    if not closed:
        return
    area, low, high = np.array(closed, dtype=float).T
    middle = np.sqrt(low * high)
    axes.errorbar(
        area,
        middle,
        yerr=[middle - low, high - middle],
        color=BLACK,
        linestyle=style,
        linewidth=0.9,
        capsize=4,
        label=label,
    )


def _draw_published_brackets(axes: Axes) -> None:
    for index, (area, low, high) in enumerate(published()["trap"]["critical_extension_rate"]):
        axes.add_patch(
            Rectangle(
                (area - _BOX, low),
                2 * _BOX,
                high - low,
                fill=False,
                edgecolor=GRAY,
                linewidth=1.2,
                label="published bracket" if index == 0 else None,
            )
        )
