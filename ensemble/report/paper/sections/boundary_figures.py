"""Phase diagrams with the published ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ensemble.figures.style import BLACK, GRAY, MARKS, STYLE, WIDTH
from ensemble.figures.symbols import DISTANCE, quantity
from ensemble.report.paper.comparison import Interval
from ensemble.report.paper.least_squares import StraightLineFit
from solver.analysis.run import Outcome
from solver.flows import Shear


@dataclass(frozen=True)
class BoundaryDiagram:
    """A phase diagram in the plane of shear rate and Hamaker constant.

    Attributes
    ----------
    distance : float
        Adhesion distance.
    runs : sequence of (float, float, Outcome)
        Shear rate, Hamaker constant and outcome of each run.
    brackets : mapping of float to (float, float)
        Brackets of the critical Hamaker constant by shear rate.
    line : StraightLineFit or None
        The line through them.
    published_brackets : mapping of float to (float, float)
        Published brackets by shear rate.
    published_line : (float, float)
        Intercept and slope of the published line.
    """

    distance: float
    runs: Sequence[tuple[float, float, Outcome]]
    brackets: Mapping[float, Interval]
    line: StraightLineFit | None
    published_brackets: Mapping[float, Interval]
    published_line: tuple[float, float]


@matplotlib.rc_context(STYLE)
def boundary_diagrams(diagrams: Sequence[BoundaryDiagram]) -> Figure:
    """Draw phase diagrams side by side.

    Parameters
    ----------
    diagrams : sequence of BoundaryDiagram

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    for axes, diagram in zip(figure.subplots(1, len(diagrams), squeeze=False)[0], diagrams, strict=True):
        _draw(axes, diagram)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _draw(axes: Axes, diagram: BoundaryDiagram) -> None:
    axes.set(
        title=f"${DISTANCE.symbol}$ = {diagram.distance:g}",
        xlabel=quantity("flow.rate", Shear).label,
        ylabel=r"Hamaker constant, $\mathcal{H}$",
    )
    for outcome, mark in MARKS.items():
        places = [(rate, hamaker) for rate, hamaker, result in diagram.runs if result is outcome]
        if places:
            axes.plot(
                *np.array(places).T,
                mark.shape,
                color=mark.face,
                markeredgecolor=mark.edge,
                markersize=5,
                alpha=0.7,
                label=str(outcome),
            )
    draw_brackets(axes, diagram.published_brackets, GRAY, "published bracket", width=5.0)
    draw_brackets(axes, diagram.brackets, BLACK, "bracket")
    rates = np.array([0.0, max([*diagram.brackets, *diagram.published_brackets])])
    intercept, slope = diagram.published_line
    axes.plot(rates, intercept + slope * rates, color=GRAY, linestyle="--", label="published line")
    if diagram.line is not None:
        axes.plot(rates, diagram.line.intercept + diagram.line.slope * rates, color=BLACK, label="line")
    axes.set(xlim=(0, None), ylim=(0, None))


def draw_brackets(
    axes: Axes, brackets: Mapping[float, Interval], color: str, label: str, width: float = 1.0
) -> None:
    """Draw brackets as vertical bars.

    Parameters
    ----------
    axes : Axes
    brackets : mapping of float to (float, float)
        Brackets by their abscissa.
    color, label : str
    width : float
        Width of the bars, in points.  Bars wider than 1 are pale and have no caps.
    """
    ends = np.array(list(brackets.values())).reshape(-1, 2)
    axes.errorbar(
        list(brackets),
        ends.mean(axis=1),
        yerr=np.ptp(ends, axis=1) / 2,
        fmt="none",
        ecolor=color,
        elinewidth=width,
        capsize=0 if width > 1 else 4,
        alpha=0.6 if width > 1 else 1.0,
        label=label,
    )
