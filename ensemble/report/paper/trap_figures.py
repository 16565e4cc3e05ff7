"""Figures of a doublet in a trap."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

import matplotlib
import numpy as np
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
from ensemble.report.paper.published import published
from ensemble.search.boundary import BoundaryPoint
from ensemble.store.run_record import RunSummary
from solver.analysis.averages import pair_inclination
from solver.analysis.run import Outcome, Run

_COLORS = (BLUE, GREEN, ORANGE, VERMILLION, PURPLE, SKY, BLACK)
_TOP = 0.19  # of the phase diagram; at higher rates there are only separated pairs
_BOX = 0.012  # half the width of a published bracket, in reduced area
Place = tuple[float, float]  # reduced area and rate


@matplotlib.rc_context(STYLE)
def angles(turning: Sequence[Run], grid: Mapping[Place, RunSummary]) -> Figure:
    """Draw the angle against time, and the final angle of pairs held side by side against the rate."""
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
        held = sorted(
            (rate, summary.inclination_angle)
            for (at, rate), summary in grid.items()
            if at == area and summary.outcome is Outcome.BOUND and summary.inclination_angle is not None
        )
        if held:
            right.plot(*np.array(held).T, "o-", color=color, markersize=3.5, label=rf"$\Delta A$ = {area:g}")
    right.set(
        xlabel=r"extension rate $\dot\epsilon$",
        ylabel=r"final angle $\theta$ (deg)",
        xlim=(0, None),
        ylim=(85, 185),
    )
    right.legend(ncols=2)
    return figure


def _size(summary: RunSummary) -> float:
    """Area of a mark in square points; that of a pair held side by side grows with its angle."""
    if summary.outcome is not Outcome.BOUND or summary.inclination_angle is None:
        return 30.0
    return 6 + 1.1 * (summary.inclination_angle - 90)


@matplotlib.rc_context(STYLE)
def phase_diagram(
    grid: Mapping[Place, RunSummary],
    searched: Iterable[tuple[float, float, Outcome]],
    first: Mapping[float, BoundaryPoint],
    second: Mapping[float, BoundaryPoint],
) -> Figure:
    """Draw the outcomes, and the brackets of both transitions with the published ones of the first."""
    figure = Figure(figsize=(WIDTH, 4.2), layout="constrained")
    axes = figure.add_subplot(xlabel=r"reduced area $\Delta A$", ylabel=r"extension rate $\dot\epsilon$")
    for outcome, mark in MARKS.items():
        shown = {place: summary for place, summary in grid.items() if summary.outcome == outcome}
        if shown:
            area, rate = zip(*shown, strict=True)
            axes.scatter(
                area,
                rate,
                s=[_size(summary) for summary in shown.values()],
                marker=mark.shape,
                facecolor=mark.face,
                linewidth=mark.edge_width,
                edgecolor=mark.edge,
                label=str(outcome),
            )
        found = [(area, rate) for area, rate, made in searched if made == outcome]
        if found:
            axes.plot(*np.array(found).T, ".", color=mark.color, markersize=2.5, alpha=0.7)
    for points, style, label in ((first, "-", "end of side by side"), (second, "--", "separation")):
        known = sorted((at, *point.bracket) for at, point in points.items() if None not in point.bracket)
        if known:
            at, low, high = np.array(known, dtype=float).T
            middle = np.sqrt(low * high)
            axes.errorbar(
                at,
                middle,
                yerr=[middle - low, high - middle],
                color=BLACK,
                linestyle=style,
                linewidth=0.9,
                capsize=4,
                label=label,
            )
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
    axes.set_ylim(0, _TOP)
    figure.legend(loc="outside right center")
    return figure
