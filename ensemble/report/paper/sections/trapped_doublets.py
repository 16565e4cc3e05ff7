"""A doublet in a fluid trap (Quaife et al. 2019, sec. IV, figs. 7 to 10)."""

from __future__ import annotations

from collections.abc import Sequence

from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.paper.comparison import (
    Comparison,
    compare_intervals,
    compare_numbers,
    published,
    runs_of,
    study_runs,
)
from ensemble.report.paper.filmstrip import filmstrip
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import (
    Section,
    SectionContent,
    SectionFigure,
    SectionGenerator,
    SectionPlan,
)
from ensemble.report.paper.sections import trapped_figures
from ensemble.report.paper.sections.trapped_figures import Place
from solver.analysis.run import Outcome

_SHOWN = ((0.7, 0.02), (0.7, 0.07), (0.7, 0.1), (0.8, 0.1))  # reduced areas and rates (figs. 8 and 9)
_SHOWN_FRACTIONS = (0.0, 0.15, 0.3, 0.5, 1.0)  # of the time of a run, at which it is shown
_TURNING_RATES = (0.02, 0.04, 0.07, 0.1)  # at reduced area 0.7 (fig. 10a)
_AREAS = (0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95)
_RATES = (0.01, 0.02, 0.03, 0.05, 0.07, 0.09, 0.11, 0.13, 0.16)
_TILT = 0.05  # radians, on the grid: with less, a slow pair would seem to be at rest before it turns
_ALLOWED = 3  # percent, between brackets
# Actual reduced areas of the published runs by their nominal ones.
_ACTUAL_AREAS = {0.7: 0.707, 0.8: 0.797, 0.9: 0.9044}


def _trapped(reduced_area: float, rate: float) -> Case:
    return Case.of("doublet-trap", {"vesicles.reduced_area": reduced_area, "flow.rate": rate})


def _generate(quick: bool) -> SectionGenerator:
    areas, rates = ((0.7, 0.8), _RATES[1::3]) if quick else (_AREAS, _RATES)
    shown = {place: _trapped(*place) for place in _SHOWN}
    turning = {rate: _trapped(0.7, rate) for rate in _TURNING_RATES}
    grid = {
        (area, rate): _trapped(area, rate).with_changes({"start.tilt": _TILT})
        for area in areas
        for rate in rates
    }
    side_by_side, separation, actual = _studies(areas, quick)
    results = yield SectionPlan(
        [*shown.values(), *turning.values(), *grid.values()], [side_by_side, separation, actual]
    )
    rows = {
        rf"$\Delta A$ = {area:g}, $\dot\epsilon$ = {rate:g}": results.run(case)
        for (area, rate), case in shown.items()
    }
    outcomes = {place: results.summary(case) for place, case in grid.items()}
    boundaries = [results.points(study) for study in (side_by_side, separation)]
    return SectionContent(
        [
            _TEXT,
            SectionFigure(
                "snapshots", _SNAPSHOTS_CAPTION, filmstrip(rows, fractions=_SHOWN_FRACTIONS, reach=3.3)
            ),
            SectionFigure(
                "angle",
                _ANGLE_CAPTION,
                trapped_figures.angles([results.run(case) for case in turning.values()], outcomes),
            ),
            _ANGLE_TEXT,
            [_angle_comparison(results, rate, case) for rate, case in turning.items()],
            _DIAGRAM_TEXT,
            SectionFigure(
                "phase-diagram",
                _DIAGRAM_CAPTION,
                trapped_figures.phase_diagram(
                    outcomes, _searched(results, [side_by_side, separation]), *boundaries
                ),
                f"{side_by_side.command}; {separation.command}",
            ),
            [
                *_side_by_side_comparisons(results, side_by_side, actual),
                *_separation_comparisons(results, separation),
            ],
        ]
    )


def _studies(areas: Sequence[float], quick: bool) -> tuple[StudyCase, StudyCase, StudyCase]:
    """Return the end of side by side, the end of the pair, and the first for the published vesicles."""
    coarse = {"search.tolerance": 0.03} if quick else {}
    side_by_side, separation = (
        StudyCase.of(name, {"sweep.values": list(areas)} | coarse)
        for name in ("critical-extension-rate", "critical-separation-rate")
    )
    published_vesicles = {
        "sweep.values": [actual for nominal, actual in _ACTUAL_AREAS.items() if nominal in areas],
        "scene.vesicles.length": published()["settings"]["length"],
    }
    actual = StudyCase.of("critical-extension-rate", published_vesicles | coarse)
    return side_by_side, separation, actual


def _searched(results: Results, studies: Sequence[StudyCase]) -> dict[Place, Outcome]:
    """Return the outcomes of all runs of the searches, by reduced area and rate."""
    summaries = (
        results.summary_of(key)
        for study in studies
        for point in results.boundary(study).points
        for key in point.runs
    )
    return {
        (summary.scene.vesicles[0].reduced_area, summary.scene.flow.rate): summary.outcome
        for summary in summaries
        if summary.scene.flow is not None
    }


def _angle_comparison(results: Results, rate: float, case: Case) -> Comparison:
    summary = results.summary(case)
    name = f"final angle θ, ΔA = 0.7, ε̇ = {rate:g}"
    return compare_numbers(
        name, None, summary.inclination_angle, runs_of(case), unit="°", note=str(summary.outcome)
    )


def _side_by_side_comparisons(results: Results, study: StudyCase, actual: StudyCase) -> list[Comparison]:
    """Return where the side-by-side pair is lost, also at the reduced areas and lengths of published runs."""
    known = {area: (low, high) for area, low, high in published()["trap"]["critical_extension_rate"]}
    points, actual_points = results.points(study), results.points(actual)
    brackets, actual_brackets = results.brackets(study), results.brackets(actual)
    comparisons = []
    for area, point in points.items():
        comparisons.append(
            compare_intervals(
                f"rate that ends side by side, ΔA = {area:g}",
                known.get(area),
                brackets.get(area),
                study_runs(study, point.runs),
                allowed=_ALLOWED if area in known else None,
                note=_outcomes(point.outcomes),
            )
        )
        actual_area = _ACTUAL_AREAS.get(area)
        if actual_area is not None and actual_area in actual_points:
            actual_point = actual_points[actual_area]
            comparisons.append(
                compare_intervals(
                    f"the same, ΔA = {actual_area:g}, length 0.99755·2π, as published runs had",
                    known.get(area),
                    actual_brackets.get(actual_area),
                    study_runs(actual, actual_point.runs),
                    allowed=_ALLOWED,
                    note=_outcomes(actual_point.outcomes),
                )
            )
    return comparisons


def _separation_comparisons(results: Results, study: StudyCase) -> list[Comparison]:
    brackets = results.brackets(study)
    return [
        compare_intervals(
            f"rate that separates, ΔA = {area:g}",
            None,
            brackets.get(area),
            study_runs(study, point.runs),
            note=_outcomes(point.outcomes),
        )
        for area, point in results.points(study).items()
    ]


def _outcomes(ends: Sequence[str | None]) -> str:
    return " | ".join(outcome or "?" for outcome in ends)


_TEXT = (
    "A doublet relaxed at rest, H = 0.7, δ = 0.4, is held in a trap with its line of centers along the "
    "diverging axis (θ = 180°), tilted by 0.001 rad.  It turns toward θ = 90°, and at higher rates stops on "
    "the way."
)
_SNAPSHOTS_CAPTION = (
    "Snapshots, centered on the pair, at 0, 15, 30, 50 and 100% of each run; square: the stagnation point; "
    "color: tension."
)
_ANGLE_CAPTION = (
    "Left: inclination angle against time at reduced area 0.7.  Right: final angle of pairs that are held "
    "side by side, against rate."
)
_ANGLE_TEXT = (
    "The paper gives final angles in a figure only.  Deflated pairs turn to 90° at low rates, as published.  "
    "The roundest ones (reduced area 0.9 and more, low rates) return to 180°: their line of centers is the "
    "longest axis of the pair, which the flow aligns with its diverging axis.  At reduced area 0.85 and rate "
    "0.01 the pair turns too slowly to be distinguished from one at rest."
)
_DIAGRAM_TEXT = (
    "The published critical rate is where the side-by-side doublet is lost.  Past the paper: beyond it the "
    "pair is first held tip to tip.  It is separated only beyond a second rate, which hardly depends on the "
    "reduced area, because tips that touch are alike.  At reduced area 0.65 there is no such interval."
)
_DIAGRAM_CAPTION = (
    "Outcomes against reduced area and extension rate; the size of a bound pair's mark grows with its "
    "angle.  Bars: computed brackets of both transitions; open boxes: published brackets."
)


SECTION = Section("trap", "A doublet in a fluid trap", _generate)
