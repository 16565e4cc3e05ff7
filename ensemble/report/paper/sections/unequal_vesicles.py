"""Past the paper: the critical adhesion strength against reduced area, and pairs of unequal vesicles.

The paper leaves both to future work (Quaife et al. 2019, secs. V and VI).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import matplotlib
import numpy as np
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ensemble.figures.membranes import add_tension_bar, frame_lines, membrane_segments
from ensemble.figures.style import BLACK, STYLE, WIDTH
from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.paper.comparison import (
    Comparison,
    compare_intervals,
    compare_words,
    runs_of,
    study_runs,
)
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import (
    Section,
    SectionContent,
    SectionFigure,
    SectionGenerator,
    SectionPlan,
)
from ensemble.report.paper.sections.boundary_figures import draw_brackets
from solver.analysis.run import Run

_BY_AREA = "critical-hamaker-reduced-area"
_QUICK: Final = {"sweep.values": [0.8, 0.9], "search.tolerance": 0.05}
_CONTACT_DISTANCES = 1.5  # adhesion distances within which membranes count as touching

# Changes to `doublet-quiescent` for strong adhesion, and for each pair of unequal vesicles.
_STRONG: Final[dict[str, Any]] = {
    "adhesion.hamaker": 5.0,
    "adhesion.distance": 0.2,
    "numerics.points": "auto",
    "horizon": 1000.0,
}
_AT_REST: Final[dict[str, dict[str, Any]]] = {
    "reduced area 0.6 and 0.98": {"vesicles.0.reduced_area": 0.6, "vesicles.1.reduced_area": 0.98},
    "the same, the second half as long": {
        "vesicles.0.reduced_area": 0.6,
        "vesicles.1.reduced_area": 0.98,
        "vesicles.1.length": math.pi,
        "vesicles.1.center": [0.6, 0.0],
    },
    "reduced area 0.7, the second ten times as stiff": {
        "vesicles.reduced_area": 0.7,
        "vesicles.1.bending_modulus": 10.0,
    },
}
# Changes to the scene of `critical-hamaker` at shear rate 0.5.
_IN_SHEAR: Final[dict[str, dict[str, Any]]] = {
    "reduced area 0.8 and 0.98": {
        "scene.vesicles.0.reduced_area": 0.8,
        "scene.vesicles.1.reduced_area": 0.98,
    },
    "the second three quarters as long": {"scene.vesicles.1.length": 1.5 * math.pi},
    "the second five times as stiff": {"scene.vesicles.1.bending_modulus": 5.0},
}


def _cases_at_rest() -> dict[str, Case]:
    return {name: Case.of("doublet-quiescent", _STRONG | changes) for name, changes in _AT_REST.items()}


def _studies_in_shear() -> dict[str, StudyCase]:
    return {
        name: StudyCase.of(
            "critical-hamaker",
            {"name": f"critical-hamaker, {name}", "sweep.values": [0.5], "search.tolerance": 0.02} | changes,
        )
        for name, changes in _IN_SHEAR.items()
    }


def _generate(quick: bool) -> SectionGenerator:
    by_area = StudyCase.of(_BY_AREA, _QUICK if quick else {})
    cases = _cases_at_rest()
    if quick:
        cases = dict(list(cases.items())[:1])
    studies = {} if quick else _studies_in_shear()
    results = yield SectionPlan(list(cases.values()), [by_area, *studies.values()])
    runs = {name: results.run(case) for name, case in cases.items() if not results.failed(case)}
    return SectionContent(
        [
            "The paper expects the critical Hamaker constant to fall with the reduced area, since the "
            "contact region would shrink, and leaves it to future work.",
            _area_figure(results, by_area),
            [*_area_comparisons(results, by_area), _trend_comparison(results, by_area)],
            "Vesicles of unequal reduced area, length or bending modulus are the paper's future work as "
            "well.  At rest (H = 5, δ = 0.2) the more deflated of two vesicles bends around the other.",
            SectionFigure(
                "shapes", "Unequal pairs at equilibrium, colored by tension.", _shapes_figure(runs)
            ),
            [_contact_comparison(name, run, cases[name]) for name, run in runs.items()],
            *(
                [[_unequal_comparison(results, name, study) for name, study in studies.items()]]
                if studies
                else []
            ),
        ]
    )


def _area_comparisons(results: Results, study: StudyCase) -> list[Comparison]:
    brackets = results.brackets(study)
    return [
        compare_intervals(
            f"H_c, reduced area {area:g}",
            None,
            brackets.get(area),
            study_runs(study, point.runs),
            note=point.status,
        )
        for area, point in sorted(results.points(study).items())
    ]


def _trend_comparison(results: Results, study: StudyCase) -> Comparison:
    steps = np.diff([low for low, _ in results.brackets(study).values()])
    rises, falls = np.any(steps < 0), np.any(steps > 0)
    trend = "is not monotone" if rises and falls else "rises" if rises else "falls" if falls else "is level"
    return compare_words("H_c as the reduced area falls", "falls", trend, study_runs(study))


def contact_fractions(run: Run) -> tuple[float, float]:
    """Return the fractions of both membranes that touch the other one in the last frame.

    Membranes count as touching within 1.5 adhesion distances.

    Parameters
    ----------
    run : Run
        A run of two vesicles with adhesion.

    Returns
    -------
    first : float
        Between 0 and 1.
    second : float
        Between 0 and 1.
    """
    assert run.scene.adhesion
    ends, _ = membrane_segments(
        run.scene, run.frames.tangent_angle[-1], run.frames.center[-1], run.frames.tension[-1]
    )
    first, second = ends[:, :, 0]
    distance = np.linalg.norm(first[:, None] - second, axis=-1)
    near = distance < _CONTACT_DISTANCES * run.scene.adhesion.distance
    return float(near.any(axis=1).mean()), float(near.any(axis=0).mean())


def _contact_comparison(name: str, run: Run, case: Case) -> Comparison:
    first, second = contact_fractions(run)
    return compare_words(
        f"{name}: touching share of the two membranes",
        None,
        f"{first:.0%} and {second:.0%}",
        runs_of(case),
        note=str(run.outcome),
    )


def _unequal_comparison(results: Results, name: str, study: StudyCase) -> Comparison:
    (point,) = results.points(study).values()
    return compare_intervals(
        f"H_c at shear rate 0.5, {name}",
        None,
        next(iter(results.brackets(study).values()), None),
        study_runs(study, point.runs),
        note=point.status,
    )


@matplotlib.rc_context(STYLE)
def _area_figure(results: Results, study: StudyCase) -> SectionFigure:
    figure = Figure(figsize=(0.6 * WIDTH, 3.0), layout="constrained")
    axes = figure.add_subplot(
        xlabel=r"reduced area $\Delta A$", ylabel=r"critical Hamaker constant, $\mathcal{H}_c$"
    )
    brackets = results.brackets(study)
    axes.plot(list(brackets), [sum(ends) / 2 for ends in brackets.values()], color=BLACK, linewidth=0.8)
    draw_brackets(axes, brackets, BLACK, "bracket")
    return SectionFigure(
        "reduced-area",
        "Critical Hamaker constant against reduced area, shear rate 0.5, δ = 0.4.",
        figure,
        study.command,
    )


@matplotlib.rc_context(STYLE)
def _shapes_figure(runs: Mapping[str, Run]) -> Figure:
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    for axes, (name, run) in zip(figure.subplots(1, len(runs), squeeze=False)[0], runs.items(), strict=True):
        lines = frame_lines(run, -1, Normalize(), 1.8)
        axes.add_collection(lines)
        axes.set(xlim=(-2.4, 2.4), ylim=(-2.0, 2.0), aspect="equal")
        axes.set_title(name, fontsize="small")
        axes.set_axis_off()
        add_tension_bar(figure, lines, axes, shrink=0.7)
    return figure


SECTION = Section("unequal", "Past the paper: reduced area and unequal vesicles", _generate)
