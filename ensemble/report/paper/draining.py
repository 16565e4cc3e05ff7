"""Draining in quiescent fluid: how long two vesicles take to come together (paper, section III.A)."""

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
from ensemble.report.paper.comparison import Row, number
from ensemble.report.paper.power_laws import PowerLaw, power_law
from ensemble.report.paper.published import published
from ensemble.report.paper.section import Chapter, Course, Drawing, Section, SectionPlan
from solver.analysis.run import Run

_HAMAKER, _DISTANCE = 0.1, 0.4  # where the other of the two is varied
_HAMAKERS = (0.1, 0.2, 0.3, 0.4, 0.5)
_DISTANCES = (0.2, 0.25, 0.3, 0.35, 0.4)
_OF_THE_FORCE = {"δ": -2.0, "H": -1.0}  # exponents if vesicles keep their shapes and the pull drags them
_NEAR = 0.01  # of the equilibrium energy
_COLORS = (BLUE, GREEN, ORANGE, VERMILLION, PURPLE)


class _Setting(NamedTuple):
    """What the paper leaves open: the bending modulus, and how far apart the centers are at the start."""

    modulus: float
    separation: float

    def __str__(self) -> str:
        return f"κ = {self.modulus:g}, centers {self.separation:g} apart"

    @property
    def label(self) -> str:
        """The same for a figure."""
        return rf"$\kappa_b$ = {self.modulus:g}, start {self.separation:g}"


_SETTINGS = (_Setting(1.0, 2.2), _Setting(0.1, 2.2), _Setting(1.0, 3.0))


class _Pair(NamedTuple):
    """What is varied."""

    hamaker: float
    distance: float
    setting: _Setting

    @property
    def case(self) -> Case:
        half = self.setting.separation / 2
        return Case.of(
            "doublet-draining",
            {
                "adhesion.hamaker": self.hamaker,
                "adhesion.distance": self.distance,
                "vesicles.bending_modulus": self.setting.modulus,
                "vesicles.0.center": [-half, 0.0],
                "vesicles.1.center": [half, 0.0],
            },
        )


def draining_time(run: Run) -> float:
    """Time from which on the adhesion energy is within 1% of its value at the end."""
    energy = run.series["adhesion_energy"]
    away = np.flatnonzero(np.abs(energy / energy[-1] - 1) > _NEAR)
    return float(run.series["time"][away[-1] + 1]) if away.size else 0.0


def _by_distance(setting: _Setting) -> list[_Pair]:
    return [_Pair(_HAMAKER, distance, setting) for distance in _DISTANCES]


def _by_hamaker(setting: _Setting) -> list[_Pair]:
    return [_Pair(hamaker, _DISTANCE, setting) for hamaker in _HAMAKERS]


def _course(quick: bool) -> Course:
    settings = _SETTINGS[:1] if quick else _SETTINGS
    pairs = [pair for setting in settings for pair in (*_by_distance(setting), *_by_hamaker(setting))]
    results = yield SectionPlan([pair.case for pair in pairs])
    runs = {pair: results.run(pair.case) for pair in pairs if not results.failed(pair.case)}
    times = {pair: draining_time(run) for pair, run in runs.items()}
    content: list[str | list[Row] | Drawing] = [_INTRODUCTION]
    content += [_energy_drawing(runs, times, setting) for setting in settings]
    content += [
        _time_rows(times, settings),
        _SCALING_TEXT,
        _scaling_drawing(times, settings),
        _exponent_rows(times, settings),
    ]
    return Chapter(content)


_INTRODUCTION = (
    "Two vesicles of reduced area 0.95 at rest are drawn together by their adhesion; the time until the "
    "adhesion energy is within 1% of its equilibrium value is read off.  The paper states neither the "
    "reduced area nor, beyond *a distance of twice the vesicle radius*, the start, and the energies of "
    "one of its panels imply a bending modulus of 0.1: hence several settings."
)
_SCALING_TEXT = (
    "Past the paper: which power laws do the runs follow?  Where vesicles keep their shapes, the "
    "attraction between them is the integral of the pair force, proportional to Hδ² beyond δ, and drag in "
    "viscous fluid gives t ∝ 1/(Hδ²).  The lubrication estimate of flattened vesicles is t ∝ H^(−1/3) "
    "δ^(−5/3).  *Published* exponents are those of the estimate; the published times themselves follow "
    "δ^−1.66 and H^−0.33."
)


def _time_rows(times: Mapping[_Pair, float], settings: tuple[_Setting, ...]) -> list[Row]:
    values = published()["draining"]
    known = {(_HAMAKER, distance): time for distance, time in values["times_by_distance"]}
    rows = []
    for setting in settings:
        for distance in sorted({distance for _, distance in known} | set(_DISTANCES)):
            pair = _Pair(_HAMAKER, distance, setting)
            rows.append(_time_row(pair, known.get((_HAMAKER, distance)), times))
        for hamaker, time in values["times_by_hamaker"]:
            rows.append(_time_row(_Pair(hamaker, _DISTANCE, setting), time, times))
    return rows


def _time_row(pair: _Pair, time: float | None, times: Mapping[_Pair, float]) -> Row:
    name = f"time to 1%, H = {pair.hamaker:g}, δ = {pair.distance:g}, {pair.setting}"
    return number(name, time, times.get(pair), [pair.case])


def _laws(times: Mapping[_Pair, float], setting: _Setting) -> dict[str, PowerLaw]:
    """Power laws in δ and in H."""
    ways = {"δ": (_by_distance(setting), "distance"), "H": (_by_hamaker(setting), "hamaker")}
    found = {}
    for symbol, (pairs, varied) in ways.items():
        made = [pair for pair in pairs if pair in times]
        if len(made) >= 3:
            found[symbol] = power_law(
                [getattr(pair, varied) for pair in made], [times[pair] for pair in made]
            )
    return found


def _exponent_rows(times: Mapping[_Pair, float], settings: tuple[_Setting, ...]) -> list[Row]:
    values = published()["draining"]
    estimates = {"δ": values["exponent_distance"], "H": values["exponent_hamaker"]}
    rows = []
    for setting in settings:
        for symbol, law in _laws(times, setting).items():
            pairs = _by_distance(setting) if symbol == "δ" else _by_hamaker(setting)
            keys = [pair.case.key for pair in pairs if pair in times]
            name = f"exponent in {symbol}, {setting}"
            force = _OF_THE_FORCE[symbol]
            nearer = (
                "lubrication"
                if abs(law.exponent - estimates[symbol]) < abs(law.exponent - force)
                else "force"
            )
            note = f"{law}; nearer to that of the {nearer}"
            rows.append(number(name, estimates[symbol], law.exponent, runs=keys, unit="", note=note))
    return rows


@matplotlib.rc_context(STYLE)
def _energy_drawing(runs: Mapping[_Pair, Run], times: Mapping[_Pair, float], setting: _Setting) -> Drawing:
    figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
    left, right = figure.subplots(1, 2)
    fixed = rf"$\mathcal{{H}}$ = {_HAMAKER:g}", rf"$\delta$ = {_DISTANCE:g}"
    for axes, pairs, symbol, varied, title in (
        (left, _by_distance(setting), r"\delta", "distance", fixed[0]),
        (right, _by_hamaker(setting), r"\mathcal{H}", "hamaker", fixed[1]),
    ):
        made = [pair for pair in pairs if pair in runs]
        for color, pair in zip(_COLORS, made, strict=False):
            _draw_energy(axes, runs[pair], times[pair], color, f"${symbol}$ = {getattr(pair, varied):g}")
        axes.set(
            title=title, xlabel="time $t$", ylabel=r"$1 - E_{\mathrm{adh}}/E_{\mathrm{adh}}^{\mathrm{eq}}$"
        )
        axes.set(xlim=(0, 1.25 * max((times[pair] for pair in made), default=1.0)), ylim=(-0.03, None))
        axes.legend(loc="upper right")
    return Drawing(
        f"energy-{setting.modulus:g}-{setting.separation:g}",
        f"Scaled adhesion energy against time, {setting}; arrows: within 1%.",
        figure,
    )


def _draw_energy(axes: Axes, run: Run, time: float, color: str, label: str) -> None:
    energy = run.series["adhesion_energy"]
    axes.plot(run.series["time"], 1 - energy / energy[-1], color=color, label=label)
    arrow = {"arrowstyle": "->", "color": color, "linewidth": 1.0}
    axes.annotate("", (time, 0.01), (time, 0.16), arrowprops=arrow)


@matplotlib.rc_context(STYLE)
def _scaling_drawing(times: Mapping[_Pair, float], settings: tuple[_Setting, ...]) -> Drawing:
    figure = Figure(figsize=(WIDTH, 3.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    values = published()["draining"]
    for axes, symbol, sign, by, varied, reference in (
        (left, r"\delta", "δ", _by_distance, "distance", values["times_by_distance"]),
        (right, r"\mathcal{H}", "H", _by_hamaker, "hamaker", values["times_by_hamaker"]),
    ):
        for color, setting in zip(_COLORS, settings, strict=False):
            made = [pair for pair in by(setting) if pair in times]
            at = np.array([getattr(pair, varied) for pair in made])
            axes.plot(at, [times[pair] for pair in made], "o", color=color, markersize=4)
            law = _laws(times, setting).get(sign)
            if law:
                power = rf"{symbol}^{{{law.exponent:.2f} \pm {law.error:.2f}}}"
                label = rf"{setting.label}: $t \propto {power}$"
                axes.plot(at, law.prefactor * at**law.exponent, color=color, label=label)
        axes.plot(*np.array(reference).T, "D", color=GRAY, markerfacecolor="white", label="published")
        axes.set(xscale="log", yscale="log", xlabel=f"${symbol}$", ylabel="time to within 1%")
        ticks = _DISTANCES[::2] if sign == "δ" else (0.1, 0.2, 0.5)
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
        axes.legend(loc="lower left", bbox_to_anchor=(0, 1), borderaxespad=0.2)
    return Drawing("scaling", "Draining times with fitted power laws; exponents with 95% confidence.", figure)


SECTION = Section("draining", "Draining in quiescent fluid", _course)
