"""Past the paper: the critical adhesion strength against reduced area, and pairs of unequal vesicles."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from ensemble.figures.membranes import membrane_segments
from ensemble.figures.style import BLACK, STYLE, TENSION_COLORS, WIDTH
from ensemble.report.paper.boundary_figures import draw_brackets
from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.paper.comparison import Row, bracket, words
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import Chapter, Course, Drawing, Section, SectionPlan
from solver.analysis.run import Run

_BY_AREA = "critical-hamaker-reduced-area"
_QUICK: Final = {"sweep.values": [0.8, 0.9], "search.tolerance": 0.05}

# Changes to `doublet-quiescent` by what distinguishes the first vesicle from the second, strongly adhering.
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


def _at_rest() -> dict[str, Case]:
    return {name: Case.of("doublet-quiescent", _STRONG | changes) for name, changes in _AT_REST.items()}


def _in_shear() -> dict[str, StudyCase]:
    return {
        name: StudyCase.of(
            "critical-hamaker",
            {"name": f"critical-hamaker, {name}", "sweep.values": [0.5], "search.tolerance": 0.02} | changes,
        )
        for name, changes in _IN_SHEAR.items()
    }


def _course(quick: bool) -> Course:
    by_area = StudyCase.of(_BY_AREA, _QUICK if quick else {})
    shapes = dict(list(_at_rest().items())[:1]) if quick else _at_rest()
    studies = {} if quick else _in_shear()
    results = yield SectionPlan(list(shapes.values()), [by_area, *studies.values()])
    runs = {name: results.run(case) for name, case in shapes.items() if not results.failed(case)}
    return Chapter(
        [
            "The paper expects the critical Hamaker constant to fall with the reduced area, since the "
            "contact region would shrink, and leaves it to future work.",
            _area_drawing(results, by_area),
            [*_area_rows(results, by_area), _trend_row(results, by_area)],
            "Vesicles of unequal reduced area, length or bending modulus are the paper's future work as "
            "well.  At rest (H = 5, δ = 0.2) the slacker of two vesicles bends around the other.",
            Drawing("shapes", "Unequal pairs at equilibrium, colored by tension.", _shapes(runs)),
            [_wrapping_row(name, run, shapes[name]) for name, run in runs.items()],
            *([[_unequal_row(results, name, study) for name, study in studies.items()]] if studies else []),
        ]
    )


def _area_rows(results: Results, study: StudyCase) -> list[Row]:
    brackets = results.brackets(study)
    return [
        bracket(
            f"H_c, reduced area {area:g}", None, brackets.get(area), study, runs=point.runs, note=point.status
        )
        for area, point in sorted(results.points(study).items())
    ]


def _trend_row(results: Results, study: StudyCase) -> Row:
    steps = np.diff([low for low, _ in results.brackets(study).values()])
    rises, falls = np.any(steps < 0), np.any(steps > 0)
    trend = "is not monotone" if rises and falls else "rises" if rises else "falls" if falls else "is level"
    return words("H_c as the reduced area falls", "falls", trend, study)


def contact_share(run: Run) -> tuple[float, float]:
    """Share of either membrane that lies within 1.5 adhesion distances of the other at the end."""
    assert run.scene.adhesion
    ends, _ = membrane_segments(
        run.scene, run.frames.tangent_angle[-1], run.frames.center[-1], run.frames.tension[-1]
    )
    first, second = ends[:, :, 0]
    distance = np.linalg.norm(first[:, None] - second, axis=-1)
    near = distance < 1.5 * run.scene.adhesion.distance
    return float(near.any(axis=1).mean()), float(near.any(axis=0).mean())


def _wrapping_row(name: str, run: Run, case: Case) -> Row:
    first, second = contact_share(run)
    return words(
        f"{name}: touching share of the two membranes",
        None,
        f"{first:.0%} and {second:.0%}",
        [case],
        note=str(run.outcome),
    )


def _unequal_row(results: Results, name: str, study: StudyCase) -> Row:
    (point,) = results.points(study).values()
    found = next(iter(results.brackets(study).values()), None)
    return bracket(f"H_c at shear rate 0.5, {name}", None, found, study, runs=point.runs, note=point.status)


@matplotlib.rc_context(STYLE)
def _area_drawing(results: Results, study: StudyCase) -> Drawing:
    figure = Figure(figsize=(0.6 * WIDTH, 3.0), layout="constrained")
    axes = figure.add_subplot(
        xlabel=r"reduced area $\Delta A$", ylabel=r"critical Hamaker constant, $\mathcal{H}_c$"
    )
    brackets = results.brackets(study)
    axes.plot(list(brackets), [sum(ends) / 2 for ends in brackets.values()], color=BLACK, linewidth=0.8)
    draw_brackets(axes, brackets, BLACK, "bracket")
    return Drawing(
        "reduced-area",
        "Critical Hamaker constant against reduced area, shear rate 0.5, δ = 0.4.",
        figure,
        study.command,
    )


@matplotlib.rc_context(STYLE)
def _shapes(runs: Mapping[str, Run]) -> Figure:
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    for axes, (name, run) in zip(figure.subplots(1, len(runs), squeeze=False)[0], runs.items(), strict=True):
        frames = run.frames
        ends, tension = membrane_segments(
            run.scene, frames.tangent_angle[-1], frames.center[-1], frames.tension[-1]
        )
        lines = LineCollection(
            list(ends.reshape(-1, 2, 2)), cmap=TENSION_COLORS, linewidths=1.8, capstyle="round"
        )
        lines.set_array(tension.ravel())
        axes.add_collection(lines)
        axes.set(xlim=(-2.4, 2.4), ylim=(-2.0, 2.0), aspect="equal")
        axes.set_title(name, fontsize="small")
        axes.set_axis_off()
        figure.colorbar(lines, ax=axes, location="bottom", shrink=0.7, aspect=25, label=r"tension $\sigma$")
    return figure


SECTION = Section("unequal", "Past the paper: reduced area and unequal vesicles", _course)
