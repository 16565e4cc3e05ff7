"""Doublets in shear: how they turn, and how long a turn takes (paper, section V)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from ensemble.report.paper import shear_figures
from ensemble.report.paper.case import Case
from ensemble.report.paper.comparison import Row, number, words
from ensemble.report.paper.filmstrip import filmstrip
from ensemble.report.paper.published import published
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import Chapter, Course, Drawing, Section, SectionPlan
from ensemble.report.paper.shear_doublet import Doublet, period
from ensemble.report.paper.shear_figures import Curve
from solver.analysis.run import Run

_WEAK, _STRONG = 0.7, 2.1  # Hamaker constants of the published snapshots; their periods are nearly the same
_SHOWN_TIMES = tuple(float(time) for time in range(0, 60, 6))
_SLIDES = 1.5  # variation of the center distance in a turn from which on a doublet slides
_HAMAKERS = tuple(step / 10 for step in range(1, 11))  # of the distance curves
_ALLOWED = 1.0  # percent, of published periods
_ALLOWED_INDEPENDENT = 0.1
_NEAR_RESONANCE = (2.0, 2.05, 2.15, 2.2)  # Hamaker constants, at the usual rate and distance
# Hamaker constant and shear rate at the resonance, and the reduced areas tried there.
_RESONANT = ((2.1, 0.5), (3.1, 0.75))
_AREAS = (0.9, 0.9044, 0.908, 0.912)
_AREA_TOLERANCE = 0.01  # of the published runs' step control, relative


def _curves(quick: bool) -> list[Curve]:
    """The published ones, with no computed periods yet."""
    found = [
        Curve(table["rate"], table["distance"], dict(table["curve"]))
        for table in published()["shear"]["periods"]
    ]
    if quick:
        found = [curve._replace(published=dict(list(curve.published.items())[::5])) for curve in found[:3:2]]
    return found


def _course(quick: bool) -> Course:
    curves = _curves(quick)
    kinds = (False, True)
    doublets = [
        *(
            Doublet(at, curve.rate, curve.distance, kind)
            for curve in curves
            for at in curve.published
            for kind in kinds
        ),
        *(Doublet(at, as_published=kind) for at in (() if quick else _NEAR_RESONANCE) for kind in kinds),
        *(Doublet(hamaker, rate) for rate, hamaker, _, _ in published()["shear"]["aspect_ratios"]),
        *(Doublet(hamaker, rate) for rate, hamaker, _ in published()["independent"]["periods"]),
    ]
    shown = [Doublet(_WEAK), Doublet(_STRONG)]
    colliding = [Doublet(hamaker) for hamaker in (_HAMAKERS[1::3] if quick else _HAMAKERS)]
    doublets = list(dict.fromkeys([*doublets, *shown, *colliding]))
    resonant = {} if quick else {at: [_of_area(*at, area) for area in _AREAS] for at in _RESONANT}
    results = yield SectionPlan(
        [*(doublet.case for doublet in doublets), *(case for cases in resonant.values() for case in cases)]
    )
    periods = {doublet: value for doublet in sorted(doublets) if (value := period(results, doublet))}
    curves = [curve.filled(periods) for curve in curves]
    runs = {doublet.hamaker: results.run(doublet.case) for doublet in shown}
    return Chapter(
        [
            "The weak doublet slides open in every half turn; the strong one tumbles as one body.",
            Drawing(
                "snapshots",
                "A weakly and a strongly adhering doublet, shear rate 0.5, δ = 0.4, colored by tension.",
                filmstrip({rf"$\mathcal{{H}}$ = {at:g}": run for at, run in runs.items()}, _SHOWN_TIMES),
            ),
            _motion_rows(runs),
            Drawing(
                "distance",
                "Distance between the membranes for Hamaker constants from 0.1 to 1.0, shear rate 0.5, "
                "δ = 0.4: vermillion where the pair separates, blue where it stays together.",
                shear_figures.distances({at.hamaker: results.run(at.case) for at in colliding}),
            ),
            "Periods fall as adhesion grows, except at a resonance: where sliding turns into tumbling, the "
            "doublet lingers between the two.  Where that is depends on the shape, and the published "
            "vesicles were not quite those of the text (reduced area 0.9044, length 0.99755·2π).  Both are "
            f"run; the published ones are listed wherever 0.9 deviates by more than {_ALLOWED:g} %.",
            Drawing(
                "period",
                "Period against the Hamaker constant.  Solid: reduced area 0.9 exactly; dashed: the vesicles "
                "of the published runs; diamonds: published.",
                shear_figures.periods(curves),
            ),
            *(part for curve in curves for part in (_title(curve), _period_rows(curve))),
            *_resonance_parts(results, resonant),
            "Effective aspect ratios (published table), and periods that another code converged to 1e-4.",
            [*_table_rows(results), *_independent_rows(results)],
        ]
    )


def _of_area(hamaker: float, rate: float, reduced_area: float) -> Case:
    """A doublet of the published runs' length and another reduced area."""
    return Doublet(hamaker, rate, as_published=True).case.but({"vesicles.reduced_area": reduced_area})


def opening(run: Run) -> float:
    """How far a doublet slides in its last turn: largest over smallest distance between the centers."""
    distance = run.series["center_distance"][run.series["time"] >= run.time - (run.period or run.time)]
    return float(distance.max() / distance.min())


def _motion_rows(runs: Mapping[float, Run]) -> list[Row]:
    rows = []
    for hamaker, motion in ((_WEAK, "slides"), (_STRONG, "tumbles")):
        run, case = runs[hamaker], Doublet(hamaker).case
        rows.append(
            words(
                f"motion, H = {hamaker:g}",
                motion,
                "slides" if opening(run) > _SLIDES else "tumbles",
                [case],
                note=f"the center distance varies by a factor of {opening(run):.2f} in a turn",
            )
        )
    return rows


def _title(curve: Curve) -> str:
    return f"### Periods at shear rate {curve.rate:g}, δ = {curve.distance:g}"


def _period_rows(curve: Curve) -> list[Row]:
    rows = []
    for hamaker, turn in curve.published.items():
        for kind, computed in ((False, curve.exact), (True, curve.as_published)):
            vesicles = ", published vesicles" if kind else ""
            case = Doublet(hamaker, curve.rate, curve.distance, kind).case
            name = f"shear rate {curve.rate:g}, δ = {curve.distance:g}, H = {hamaker:g}{vesicles}"
            row = number(name, turn, computed.get(hamaker), [case], allowed=_ALLOWED)
            rows.append(row)
            if row.agrees:
                break
    return rows


def _resonance_parts(
    results: Results, resonant: Mapping[tuple[float, float], Sequence[Case]]
) -> list[str | list[Row]]:
    rows = []
    for (hamaker, rate), cases in resonant.items():
        table = next(table for table in published()["shear"]["periods"] if table["rate"] == rate)
        turn = dict(table["curve"])[hamaker]
        known = [
            (area, value)
            for area, case in zip(_AREAS, cases, strict=True)
            if (value := results.summary(case).period)
        ]
        rows.append(
            number(
                f"reduced area with the published period, H = {hamaker:g}, shear rate {rate:g}",
                published()["settings"]["reduced_area"],
                area_of_period(known, turn),
                cases,
                allowed=100 * _AREA_TOLERANCE,
                note="periods "
                + ", ".join(f"{value:.2f} at {area:g}" for area, value in known)
                + f"; published {turn:g}",
            )
        )
    if not rows:
        return []
    return [
        "At the resonance itself the period depends strongly on the reduced area, and the published runs let "
        "it drift by up to 1 %.  Compared here is the reduced area at which the published period comes out.",
        rows,
    ]


def area_of_period(known: Sequence[tuple[float, float]], turn: float) -> float | None:
    """Reduced area with a period, linear between known (area, period); None beyond them."""
    for (area, value), (next_area, next_value) in pairwise(known):
        if min(value, next_value) <= turn <= max(value, next_value):
            return area + (next_area - area) * (turn - value) / (next_value - value)
    return None


def _table_rows(results: Results) -> list[Row]:
    rows = []
    for rate, hamaker, turn, ratio in published()["shear"]["aspect_ratios"]:
        doublet = Doublet(hamaker, rate)
        summary = results.summary(doublet.case)
        name = f"H = {hamaker:g}, shear rate {rate:g}"
        rows += [
            number(f"period, {name}", turn, summary.period, [doublet.case], allowed=_ALLOWED),
            number(
                f"λ_eff, {name}",
                ratio,
                summary.effective_aspect_ratio,
                [doublet.case],
                note=f"eq. 9 gives {jeffery_ratio(turn, rate):.2f} for the published period",
            ),
        ]
    return rows


def jeffery_ratio(turn: float, rate: float) -> float:
    """Aspect ratio of the ellipse that turns once in this time (Jeffery; paper, eq. 9)."""
    half_sum = turn * rate / (4 * math.pi)
    return half_sum + math.sqrt(half_sum**2 - 1)


def _independent_rows(results: Results) -> list[Row]:
    return [
        number(
            f"period by another code, H = {hamaker:g}, shear rate {rate:g}",
            turn,
            period(results, Doublet(hamaker, rate)),
            [Doublet(hamaker, rate).case],
            allowed=_ALLOWED_INDEPENDENT,
        )
        for rate, hamaker, turn in published()["independent"]["periods"]
    ]


SECTION = Section("shear", "Doublets in shear flow", _course)
