"""How long two vesicles at rest take to come together (Quaife et al. 2019, sec. III.A, fig. 2)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from ensemble.figures.style import BLUE, GRAY, GREEN, ORANGE, PURPLE, STYLE, VERMILLION, WIDTH
from ensemble.report.paper.case import Case
from ensemble.report.paper.comparison import Comparison, Evidence, compare_numbers, published, runs_of
from ensemble.report.paper.least_squares import PowerLawFit, power_law
from ensemble.report.paper.section import (
    Section,
    SectionContent,
    SectionFigure,
    SectionGenerator,
    SectionPlan,
)
from solver.analysis.run import Run

_HAMAKER, _DISTANCE = 0.1, 0.4  # the value of one while the other is varied
_HAMAKERS = (0.1, 0.2, 0.3, 0.4, 0.5)
_DISTANCES = (0.2, 0.25, 0.3, 0.35, 0.4)
# Exponents if vesicles keep their shapes: attraction ∝ Hδ² balances drag, so t ∝ 1/(Hδ²).
_RIGID_EXPONENTS = {"δ": -2.0, "H": -1.0}
_NEAR = 0.01  # of the equilibrium energy
_COLORS = (BLUE, GREEN, ORANGE, VERMILLION, PURPLE)


class _Assumptions(NamedTuple):
    """What the paper does not state: the bending modulus, and the initial distance of the centers."""

    modulus: float
    separation: float

    def __str__(self) -> str:
        return f"κ = {self.modulus:g}, centers {self.separation:g} apart"

    @property
    def label(self) -> str:
        """The same as a label in a figure."""
        return rf"$\kappa_b$ = {self.modulus:g}, start {self.separation:g}"


_ASSUMPTIONS = (_Assumptions(1.0, 2.2), _Assumptions(0.1, 2.2), _Assumptions(1.0, 3.0))


class _Pair(NamedTuple):
    """Parameters of a run: the adhesion that is varied, and the assumptions."""

    hamaker: float
    distance: float
    assumptions: _Assumptions

    @property
    def case(self) -> Case:
        half = self.assumptions.separation / 2
        return Case.of(
            "doublet-draining",
            {
                "adhesion.hamaker": self.hamaker,
                "adhesion.distance": self.distance,
                "vesicles.bending_modulus": self.assumptions.modulus,
                "vesicles.0.center": [-half, 0.0],
                "vesicles.1.center": [half, 0.0],
            },
        )


_Times = Mapping[_Pair, float]


def draining_time(run: Run) -> float:
    """Return the time from which on the adhesion energy is within 1% of its final value.

    This is the definition of the paper (Quaife et al. 2019, fig. 2).

    Parameters
    ----------
    run : Run
        A run to equilibrium.

    Returns
    -------
    float
    """
    energy = run.series["adhesion_energy"]
    away = np.flatnonzero(np.abs(energy / energy[-1] - 1) > _NEAR)
    return float(run.series["time"][away[-1] + 1]) if away.size else 0.0


def _distance_series(assumptions: _Assumptions) -> list[_Pair]:
    return [_Pair(_HAMAKER, distance, assumptions) for distance in _DISTANCES]


def _hamaker_series(assumptions: _Assumptions) -> list[_Pair]:
    return [_Pair(hamaker, _DISTANCE, assumptions) for hamaker in _HAMAKERS]


def _generate(quick: bool) -> SectionGenerator:
    choices = _ASSUMPTIONS[:1] if quick else _ASSUMPTIONS
    pairs = [pair for choice in choices for pair in (*_distance_series(choice), *_hamaker_series(choice))]
    results = yield SectionPlan([pair.case for pair in pairs])
    runs = {pair: results.run(pair.case) for pair in pairs if not results.failed(pair.case)}
    times = {pair: draining_time(run) for pair, run in runs.items()}
    return SectionContent(
        [
            _INTRODUCTION,
            *(_energy_figure(runs, times, choice) for choice in choices),
            _time_comparisons(times, choices),
            _SCALING_TEXT,
            _scaling_figure(times, choices),
            _exponent_comparisons(times, choices),
        ]
    )


_INTRODUCTION = (
    "Two vesicles of reduced area 0.95 at rest are drawn together by their adhesion.  The draining time is "
    "the time until the adhesion energy is within 1% of its equilibrium value.  The paper states neither "
    "the reduced area nor the start, except as *a distance of twice the vesicle radius*, and the energies "
    "in one of its panels imply a bending modulus of 0.1.  Hence several assumptions are tried."
)
_SCALING_TEXT = (
    "Past the paper: which power laws do the runs follow?  If vesicles keep their shapes, the attraction "
    "between them is the integral of the pair force, proportional to Hδ² at distances beyond δ, and drag in "
    "viscous fluid gives t ∝ 1/(Hδ²).  The lubrication estimate for flattened vesicles is t ∝ H^(−1/3) "
    "δ^(−5/3) (eq. 6).  *Published* exponents are those of this estimate; the published times themselves "
    "follow δ^−1.66 and H^−0.33."
)


def _time_comparisons(times: _Times, choices: tuple[_Assumptions, ...]) -> list[Comparison]:
    values = published()["draining"]
    known = dict(values["times_by_distance"])
    comparisons = []
    for choice in choices:
        for distance in sorted({*known, *_DISTANCES}):
            comparisons.append(
                _time_comparison(_Pair(_HAMAKER, distance, choice), known.get(distance), times)
            )
        for hamaker, time in values["times_by_hamaker"]:
            comparisons.append(_time_comparison(_Pair(hamaker, _DISTANCE, choice), time, times))
    return comparisons


def _time_comparison(pair: _Pair, known: float | None, times: _Times) -> Comparison:
    name = f"time to 1%, H = {pair.hamaker:g}, δ = {pair.distance:g}, {pair.assumptions}"
    return compare_numbers(name, known, times.get(pair), runs_of(pair.case))


def _power_laws(times: _Times, assumptions: _Assumptions) -> dict[str, PowerLawFit]:
    """Return the power laws in δ and in H, where at least three runs did not fail."""
    series = {
        "δ": (_distance_series(assumptions), "distance"),
        "H": (_hamaker_series(assumptions), "hamaker"),
    }
    laws = {}
    for symbol, (pairs, varied) in series.items():
        timed = [pair for pair in pairs if pair in times]
        if len(timed) >= 3:
            laws[symbol] = power_law(
                [getattr(pair, varied) for pair in timed], [times[pair] for pair in timed]
            )
    return laws


def _exponent_comparisons(times: _Times, choices: tuple[_Assumptions, ...]) -> list[Comparison]:
    values = published()["draining"]
    estimates = {"δ": values["exponent_distance"], "H": values["exponent_hamaker"]}
    comparisons = []
    for choice in choices:
        for symbol, law in _power_laws(times, choice).items():
            pairs = _distance_series(choice) if symbol == "δ" else _hamaker_series(choice)
            keys = tuple(pair.case.key for pair in pairs if pair in times)
            to_lubrication = abs(law.exponent - estimates[symbol])
            to_rigid = abs(law.exponent - _RIGID_EXPONENTS[symbol])
            nearer = "lubrication" if to_lubrication < to_rigid else "force"
            comparisons.append(
                compare_numbers(
                    f"exponent in {symbol}, {choice}",
                    estimates[symbol],
                    law.exponent,
                    Evidence(keys),
                    unit="",
                    note=f"{law}; nearer to that of the {nearer}",
                )
            )
    return comparisons


@matplotlib.rc_context(STYLE)
def _energy_figure(runs: Mapping[_Pair, Run], times: _Times, assumptions: _Assumptions) -> SectionFigure:
    figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
    left, right = figure.subplots(1, 2)
    fixed = rf"$\mathcal{{H}}$ = {_HAMAKER:g}", rf"$\delta$ = {_DISTANCE:g}"
    for axes, pairs, symbol, varied, title in (
        (left, _distance_series(assumptions), r"\delta", "distance", fixed[0]),
        (right, _hamaker_series(assumptions), r"\mathcal{H}", "hamaker", fixed[1]),
    ):
        timed = [pair for pair in pairs if pair in runs]
        for color, pair in zip(_COLORS, timed, strict=False):
            _draw_energy(axes, runs[pair], times[pair], color, f"${symbol}$ = {getattr(pair, varied):g}")
        axes.set(
            title=title, xlabel="time $t$", ylabel=r"$1 - E_{\mathrm{adh}}/E_{\mathrm{adh}}^{\mathrm{eq}}$"
        )
        axes.set(xlim=(0, 1.25 * max((times[pair] for pair in timed), default=1.0)), ylim=(-0.03, None))
        axes.legend(loc="upper right")
    return SectionFigure(
        f"energy-{assumptions.modulus:g}-{assumptions.separation:g}",
        f"Scaled adhesion energy against time, {assumptions}; arrows: within 1%.",
        figure,
    )


def _draw_energy(axes: Axes, run: Run, time: float, color: str, label: str) -> None:
    energy = run.series["adhesion_energy"]
    axes.plot(run.series["time"], 1 - energy / energy[-1], color=color, label=label)
    arrow = {"arrowstyle": "->", "color": color, "linewidth": 1.0}
    axes.annotate("", (time, 0.01), (time, 0.16), arrowprops=arrow)


@matplotlib.rc_context(STYLE)
def _scaling_figure(times: _Times, choices: tuple[_Assumptions, ...]) -> SectionFigure:
    figure = Figure(figsize=(WIDTH, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    values = published()["draining"]
    for axes, symbol, sign, series, varied, known in (
        (left, r"\delta", "δ", _distance_series, "distance", values["times_by_distance"]),
        (right, r"\mathcal{H}", "H", _hamaker_series, "hamaker", values["times_by_hamaker"]),
    ):
        for color, choice in zip(_COLORS, choices, strict=False):
            timed = [pair for pair in series(choice) if pair in times]
            at = np.array([getattr(pair, varied) for pair in timed])
            axes.plot(at, [times[pair] for pair in timed], "o", color=color, markersize=4)
            law = _power_laws(times, choice).get(sign)
            if law:
                power = rf"{symbol}^{{{law.exponent:.2f} \pm {law.error:.2f}}}"
                label = rf"{choice.label}: $t \propto {power}$"
                axes.plot(at, law.prefactor * at**law.exponent, color=color, label=label)
        axes.plot(*np.array(known).T, "D", color=GRAY, markerfacecolor="white", label="published")
        axes.set(xscale="log", yscale="log", xlabel=f"${symbol}$", ylabel="time to within 1%")
        ticks = _DISTANCES[::2] if sign == "δ" else (0.1, 0.2, 0.5)
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2)
    return SectionFigure(
        "scaling", "Draining times with fitted power laws; exponents with 95% confidence.", figure
    )


SECTION = Section("draining", "Draining in quiescent fluid", _generate)
