"""Phase diagrams beside the published ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ensemble.figures.style import BLACK, GRAY, MARKS, STYLE, WIDTH
from ensemble.figures.symbols import DISTANCE, quantity
from ensemble.report.paper.power_laws import Line
from solver.analysis.run import Outcome
from solver.flows import Shear

_CRITICAL = r"\mathcal{H}_c"


@dataclass(frozen=True)
class Diagram:
    """One phase diagram: runs (shear rate, Hamaker constant, outcome), brackets by shear rate, and lines.

    The published line is its intercept and slope.
    """

    distance: float
    runs: Sequence[tuple[float, float, Outcome]]
    brackets: Mapping[float, tuple[float, float]]
    line: Line | None
    published_brackets: Mapping[float, tuple[float, float]]
    published_line: tuple[float, float]


@matplotlib.rc_context(STYLE)
def diagrams(drawn: Sequence[Diagram]) -> Figure:
    """Draw phase diagrams side by side."""
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    for axes, diagram in zip(figure.subplots(1, len(drawn), squeeze=False)[0], drawn, strict=True):
        _draw(axes, diagram)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _draw(axes: Axes, diagram: Diagram) -> None:
    axes.set(
        title=f"${DISTANCE.symbol}$ = {diagram.distance:g}",
        xlabel=quantity("flow.rate", Shear).label,
        ylabel=r"Hamaker constant, $\mathcal{H}$",
    )
    for outcome, mark in MARKS.items():
        at = [(rate, hamaker) for rate, hamaker, result in diagram.runs if result is outcome]
        if at:
            axes.plot(
                *np.array(at).T,
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
    axes: Axes, brackets: Mapping[float, tuple[float, float]], color: str, label: str, width: float = 1.0
) -> None:
    """Draw brackets as bars at their abscissas."""
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
