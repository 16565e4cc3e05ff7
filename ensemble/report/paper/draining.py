"""Draining in quiescent fluid: how long two vesicles take to come together (paper, section III.A)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ensemble.figures.style import BLUE, GRAY, GREEN, ORANGE, PURPLE, STYLE, VERMILLION, WIDTH
from ensemble.report.paper.case import Case
from ensemble.report.paper.comparison import Row, number
from ensemble.report.paper.fit import PowerLaw, power_law
from ensemble.report.paper.published import published
from ensemble.report.paper.section import Chapter, Course, Drawing, Plan, Section
from solver.run import Run

_HAMAKER, _DISTANCE = 0.1, 0.4  # where the other of the two is varied
_HAMAKERS = (0.1, 0.2, 0.3, 0.4, 0.5)
_DISTANCES = (0.2, 0.25, 0.3, 0.35, 0.4)
_MODULI = (1.0, 0.1)
_NEAR = 0.01  # of the equilibrium energy
_COLORS = (BLUE, GREEN, ORANGE, VERMILLION, PURPLE)


class _Pair(NamedTuple):
    """What is varied."""

    hamaker: float
    distance: float
    modulus: float

    @property
    def case(self) -> Case:
        return Case.of(
            "doublet-draining",
            {
                "adhesion.hamaker": self.hamaker,
                "adhesion.distance": self.distance,
                "vesicles.bending_modulus": self.modulus,
            },
        )


def draining_time(run: Run) -> float:
    """Time from which on the adhesion energy is within 1% of its value at the end."""
    energy = run.series["adhesion_energy"]
    away = np.flatnonzero(np.abs(energy / energy[-1] - 1) > _NEAR)
    return float(run.series["time"][away[-1] + 1]) if away.size else 0.0


def _by_distance(modulus: float) -> list[_Pair]:
    return [_Pair(_HAMAKER, distance, modulus) for distance in _DISTANCES]


def _by_hamaker(modulus: float) -> list[_Pair]:
    return [_Pair(hamaker, _DISTANCE, modulus) for hamaker in _HAMAKERS]


def _course(quick: bool) -> Course:
    moduli = _MODULI[:1] if quick else _MODULI
    pairs = [pair for modulus in moduli for pair in (*_by_distance(modulus), *_by_hamaker(modulus))]
    results = yield Plan([pair.case for pair in pairs])
    runs = {pair: results.run(pair.case) for pair in pairs if not results.failed(pair.case)}
    times = {pair: draining_time(run) for pair, run in runs.items()}
    content: list[str | list[Row] | Drawing] = [_INTRODUCTION]
    content += [_energy_drawing(runs, times, modulus) for modulus in moduli]
    content += [
        _time_rows(times, moduli),
        _scaling_drawing(times, moduli),
        _exponent_rows(times, moduli),
    ]
    return Chapter(content)


_INTRODUCTION = (
    "Two vesicles at rest are drawn together by their adhesion; the time until the adhesion energy is "
    "within 1% of its equilibrium value is read off.  The paper states neither the reduced area nor, "
    "beyond *a distance of twice the vesicle radius*, the start: here the reduced area is 0.95 and the "
    "membranes lie 0.58 apart."
)


def _time_rows(times: Mapping[_Pair, float], moduli: tuple[float, ...]) -> list[Row]:
    values = published()["draining"]
    known = {(_HAMAKER, distance): time for distance, time in values["times_by_distance"]}
    rows = []
    for modulus in moduli:
        for distance in sorted({distance for _, distance in known} | set(_DISTANCES)):
            pair = _Pair(_HAMAKER, distance, modulus)
            rows.append(_time_row(pair, known.get((_HAMAKER, distance)), times))
        for hamaker, time in values["times_by_hamaker"]:
            rows.append(_time_row(_Pair(hamaker, _DISTANCE, modulus), time, times))
    return rows


def _time_row(pair: _Pair, time: float | None, times: Mapping[_Pair, float]) -> Row:
    name = f"time to 1%, H = {pair.hamaker:g}, δ = {pair.distance:g}, κ = {pair.modulus:g}"
    return number(name, time, times.get(pair), [pair.case])


def _laws(times: Mapping[_Pair, float], modulus: float) -> dict[str, PowerLaw]:
    """Power laws in δ and in H."""
    ways = {"δ": (_by_distance(modulus), "distance"), "H": (_by_hamaker(modulus), "hamaker")}
    found = {}
    for symbol, (pairs, varied) in ways.items():
        made = [pair for pair in pairs if pair in times]
        if len(made) >= 3:
            found[symbol] = power_law(
                [getattr(pair, varied) for pair in made], [times[pair] for pair in made]
            )
    return found


def _exponent_rows(times: Mapping[_Pair, float], moduli: tuple[float, ...]) -> list[Row]:
    estimates = {
        "δ": published()["draining"]["exponent_distance"],
        "H": published()["draining"]["exponent_hamaker"],
    }
    return [
        number(
            f"exponent of the time in {symbol}, κ = {modulus:g}",
            estimates[symbol],
            law.exponent,
            runs=[pair.case.key for pair in pairs if pair in times],
            unit="",
            note=f"{law}",
        )
        for modulus in moduli
        for symbol, law in _laws(times, modulus).items()
        for pairs in [_by_distance(modulus) if symbol == "δ" else _by_hamaker(modulus)]
    ]


@matplotlib.rc_context(STYLE)
def _energy_drawing(runs: Mapping[_Pair, Run], times: Mapping[_Pair, float], modulus: float) -> Drawing:
    figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
    left, right = figure.subplots(1, 2)
    fixed = rf"$\mathcal{{H}}$ = {_HAMAKER:g}", rf"$\delta$ = {_DISTANCE:g}"
    for axes, pairs, symbol, varied, title in (
        (left, _by_distance(modulus), r"\delta", "distance", fixed[0]),
        (right, _by_hamaker(modulus), r"\mathcal{H}", "hamaker", fixed[1]),
    ):
        made = [pair for pair in pairs if pair in runs]
        for color, pair in zip(_COLORS, made, strict=False):
            _draw_energy(axes, runs[pair], times[pair], color, f"${symbol}$ = {getattr(pair, varied):g}")
        axes.set(
            title=title, xlabel="time $t$", ylabel=r"$1 - E_{\mathrm{adh}}/E_{\mathrm{adh}}^{\mathrm{eq}}$"
        )
        axes.set(xlim=(0, 1.25 * max((times[pair] for pair in made), default=1.0)), ylim=(-0.03, 1.03))
        axes.legend(loc="upper right")
    return Drawing(
        f"energy-{modulus:g}",
        f"Scaled adhesion energy against time, bending modulus κ = {modulus:g}; arrows: within 1%.",
        figure,
    )


def _draw_energy(axes: Axes, run: Run, time: float, color: str, label: str) -> None:
    energy = run.series["adhesion_energy"]
    axes.plot(run.series["time"], 1 - energy / energy[-1], color=color, label=label)
    arrow = {"arrowstyle": "->", "color": color, "linewidth": 1.0}
    axes.annotate("", (time, 0.01), (time, 0.16), arrowprops=arrow)


@matplotlib.rc_context(STYLE)
def _scaling_drawing(times: Mapping[_Pair, float], moduli: tuple[float, ...]) -> Drawing:
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    values = published()["draining"]
    for axes, symbol, sign, by, varied, reference in (
        (left, r"\delta", "δ", _by_distance, "distance", values["times_by_distance"]),
        (right, r"\mathcal{H}", "H", _by_hamaker, "hamaker", values["times_by_hamaker"]),
    ):
        for color, modulus in zip(_COLORS, moduli, strict=False):
            made = [pair for pair in by(modulus) if pair in times]
            at = np.array([getattr(pair, varied) for pair in made])
            axes.plot(at, [times[pair] for pair in made], "o", color=color, markersize=4)
            law = _laws(times, modulus).get(sign)
            if law:
                power = rf"{symbol}^{{{law.exponent:.2f} \pm {law.error:.2f}}}"
                label = rf"$\kappa_b$ = {modulus:g}: $t \propto {power}$"
                axes.plot(at, law.prefactor * at**law.exponent, color=color, label=label)
        axes.plot(*np.array(reference).T, "D", color=GRAY, markerfacecolor="white", label="published")
        axes.set(xscale="log", yscale="log", xlabel=f"${symbol}$", ylabel="time to within 1%")
        ticks = _DISTANCES[::2] if sign == "δ" else (0.1, 0.2, 0.5)
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.legend(loc="lower left")
    return Drawing("scaling", "Draining times with fitted power laws; exponents with 95% confidence.", figure)


SECTION = Section("draining", "Draining in quiescent fluid", _course)
