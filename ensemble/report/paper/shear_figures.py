"""Figures of doublets in shear."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ensemble.figures.style import BLUE, GRAY, GREEN, ORANGE, PURPLE, STYLE, VERMILLION, WIDTH
from ensemble.figures.symbols import DISTANCE, quantity
from ensemble.report.paper.published import published
from ensemble.report.paper.shear_doublet import Doublet
from solver.analysis.run import Outcome, Run
from solver.flows import Shear

_COLORS = (BLUE, GREEN, ORANGE, PURPLE)
_H = r"\mathcal{H}"
_RATE = quantity("flow.rate", Shear)


class Curve(NamedTuple):
    """Periods by Hamaker constant: published, and of the two kinds of vesicles."""

    rate: float
    distance: float
    published: Mapping[float, float]
    exact: Mapping[float, float] = {}
    as_published: Mapping[float, float] = {}

    def filled(self, periods: Mapping[Doublet, float]) -> Self:
        """Return the curve with the computed periods that belong to it, by ascending Hamaker constant."""
        exact, as_published = (
            {
                doublet.hamaker: value
                for doublet, value in sorted(periods.items())
                if doublet[1:] == (self.rate, self.distance, kind)
            }
            for kind in (False, True)
        )
        return self._replace(exact=exact, as_published=as_published)


@matplotlib.rc_context(STYLE)
def distances(runs: Mapping[float, Run]) -> Figure:
    """Draw the gap of runs against time, by their Hamaker constant."""
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    axes = figure.add_subplot(xlabel="time $t$", ylabel="distance between the membranes")
    for rank, (hamaker, run) in enumerate(sorted(runs.items())):
        separated = run.outcome is Outcome.SEPARATED
        shade = 0.35 + 0.65 * rank / max(len(runs) - 1, 1)
        axes.plot(
            run.series["time"],
            run.series["gap"],
            color=VERMILLION if separated else BLUE,
            alpha=1.35 - shade if separated else shade,
            linestyle="--" if separated else "-",
            label=f"{hamaker:g}",
        )
    axes.set(xlim=(0, published()["settings"]["horizon"]), ylim=(0, 3))
    axes.legend(title=f"${_H}$", loc="upper left", bbox_to_anchor=(1, 1))
    return figure


@matplotlib.rc_context(STYLE)
def periods(curves: Sequence[Curve]) -> Figure:
    """Draw periods against the Hamaker constant."""
    figure = Figure(figsize=(WIDTH, 3.6), layout="constrained")
    axes = figure.add_subplot(xlabel=f"Hamaker constant, ${_H}$", ylabel="period")
    for color, curve in zip(_COLORS, curves, strict=False):
        label = f"${_RATE.symbol}$ = {curve.rate:g}, ${DISTANCE.symbol}$ = {curve.distance:g}"
        axes.plot(*_columns(curve.exact), "-", color=color, label=label)
        axes.plot(*_columns(curve.as_published), "--", color=color, linewidth=0.9)
        axes.plot(*_columns(curve.published), "D", color=color, markerfacecolor="white", markersize=4)
    axes.plot([], [], "D", color=GRAY, markerfacecolor="white", markersize=4, label="published")
    axes.plot([], [], "--", color=GRAY, linewidth=0.9, label="published vesicles")
    axes.legend(loc="upper left", bbox_to_anchor=(1, 1))
    return figure


def _columns(values: Mapping[float, float]) -> np.ndarray:
    return np.array(sorted(values.items())).reshape(-1, 2).T
