"""Figures of doublets in shear."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple, Self

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ensemble.figures.style import BLUE, GRAY, GREEN, ORANGE, PURPLE, STYLE, VERMILLION, WIDTH
from ensemble.figures.symbols import DISTANCE, quantity
from ensemble.report.paper.comparison import published
from ensemble.report.paper.sections.shear_cases import ShearDoublet
from solver.analysis.run import Array, Outcome, Run
from solver.flows import Shear

_COLORS = (BLUE, GREEN, ORANGE, PURPLE)
_H = r"\mathcal{H}"
_RATE = quantity("flow.rate", Shear)


class PeriodCurve(NamedTuple):
    """Periods by Hamaker constant at one shear rate and adhesion distance.

    Attributes
    ----------
    rate, distance : float
        Shear rate and adhesion distance.
    published : mapping of float to float
        Published periods.
    exact : mapping of float to float
        Computed periods of vesicles of reduced area 0.9.
    as_published : mapping of float to float
        Computed periods of the published vesicles.
    """

    rate: float
    distance: float
    published: Mapping[float, float]
    exact: Mapping[float, float] = {}
    as_published: Mapping[float, float] = {}

    def with_computed(self, periods: Mapping[ShearDoublet, float]) -> Self:
        """Return the curve with the computed periods that belong to it.

        Parameters
        ----------
        periods : mapping of ShearDoublet to float
            All computed periods.

        Returns
        -------
        PeriodCurve
            With periods by ascending Hamaker constant.
        """
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
    """Draw the gap of runs against time (as in Quaife et al. 2019, fig. 13a).

    Parameters
    ----------
    runs : mapping of float to Run
        Runs by their Hamaker constant.

    Returns
    -------
    Figure
    """
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
def periods(curves: Sequence[PeriodCurve]) -> Figure:
    """Draw periods against the Hamaker constant (as in Quaife et al. 2019, fig. 13b).

    Parameters
    ----------
    curves : sequence of PeriodCurve

    Returns
    -------
    Figure
    """
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


def _columns(values: Mapping[float, float]) -> Array:
    return np.array(sorted(values.items())).reshape(-1, 2).T
