"""The adhesion strength that holds a doublet together in shear (Quaife et al. 2019, sec. V, fig. 14)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import linprog

from ensemble.config.dotted_paths import parameter_value
from ensemble.report.paper.case import StudyCase
from ensemble.report.paper.comparison import (
    Comparison,
    Interval,
    compare_intervals,
    compare_numbers,
    compare_words,
    published,
    runs_of,
    study_runs,
)
from ensemble.report.paper.least_squares import StraightLineFit, straight_line
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import (
    Section,
    SectionContent,
    SectionFigure,
    SectionGenerator,
    SectionPlan,
)
from ensemble.report.paper.sections.boundary_figures import BoundaryDiagram, boundary_diagrams
from ensemble.report.paper.sections.shear_cases import ShearDoublet
from solver.analysis.run import Outcome, Run
from solver.scene import Scene

_PRESETS: Final = {0.4: "critical-hamaker", 0.1: "critical-hamaker-short-range"}  # by adhesion distance
_QUICK_RATES = (0.5, 1.0)
_QUICK_TOLERANCE = 0.05
_ALLOWED = 3.0  # percent, of published brackets
_COME_ROUND = 1.5 * math.pi  # angle by which the line of centers has turned when a pair has come round
_SEPARATED, _BOUND = "separated", "bound"


class _PublishedDiagram(NamedTuple):
    """A published phase diagram: brackets by shear rate, and a line through them."""

    distance: float
    brackets: dict[float, Interval]
    intercept: float
    slope: float

    def bracket_ends(self) -> list[tuple[ShearDoublet, str]]:
        """Return published doublets at both ends of all brackets, and what becomes of them."""
        return [
            (ShearDoublet(hamaker, rate, self.distance, as_published=True), fate)
            for rate, ends in self.brackets.items()
            for hamaker, fate in zip(ends, (_SEPARATED, _BOUND), strict=True)
        ]


def _published_diagrams() -> list[_PublishedDiagram]:
    return [
        _PublishedDiagram(
            table["distance"], {rate: (low, high) for rate, low, high in table["brackets"]}, *table["fit"]
        )
        for table in published()["shear"]["critical_hamaker"]
    ]


def _study(distance: float, quick: bool) -> StudyCase:
    changes = {"sweep.values": list(_QUICK_RATES), "search.tolerance": _QUICK_TOLERANCE} if quick else {}
    return StudyCase.of(_PRESETS[distance], changes)


def fate_at_end(run: Run) -> str:
    """Return whether the last state of a run looks separated or bound.

    This is how the paper reads its runs, which all end at t = 100.

    Parameters
    ----------
    run : Run

    Returns
    -------
    str
        ``"separated"`` if the pair moves apart and has not come round yet, else ``"bound"``.
    """
    distance, angle = run.series["center_distance"], run.series["center_angle"]
    leaving = distance[-1] > distance[-2] and abs(angle[-1] - angle[0]) < _COME_ROUND
    return _SEPARATED if run.outcome is Outcome.SEPARATED or leaving else _BOUND


def _generate(quick: bool) -> SectionGenerator:
    tables = [table for table in _published_diagrams() if not quick or table.distance == 0.4]
    studies = {table.distance: _study(table.distance, quick) for table in tables}
    published_ends = [end for table in tables for end in table.bracket_ends()]
    results = yield SectionPlan(
        [doublet.until_published_horizon for doublet, _ in published_ends], list(studies.values())
    )
    diagrams = [_diagram(results, table, studies[table.distance]) for table in tables]
    blocks: list[str | list[Comparison] | SectionFigure] = [
        _INTRODUCTION,
        SectionFigure(
            "diagram",
            _DIAGRAM_CAPTION,
            boundary_diagrams(diagrams),
            "; ".join(study.command for study in studies.values()),
        ),
    ]
    for table, diagram in zip(tables, diagrams, strict=True):
        study = studies[table.distance]
        blocks += [
            f"### δ = {table.distance:g}",
            [
                *_bracket_comparisons(results, table, study),
                *_line_comparisons(table, diagram.line, study),
            ],
            _end_state_comparisons(results, table.bracket_ends()),
        ]
    return SectionContent(blocks)


_INTRODUCTION = (
    "The published brackets are read off the state of the runs at T = 100, with vesicles of reduced area "
    "0.9044.  A doublet near the boundary opens and closes slowly and may come round once and separate "
    "later, most of all at small δ, so a boundary decided by events (here) lies above one that is read at T "
    "= 100.  Below each comparison the ends of the published brackets are run at the published settings and "
    "read at T = 100 (separated: moving apart and not come round yet); these must agree."
)
_DIAGRAM_CAPTION = (
    "Critical Hamaker constant against shear rate.  Marks: runs of the search; black: its brackets and their "
    "line; gray: the published brackets and line."
)


def _diagram(results: Results, table: _PublishedDiagram, study: StudyCase) -> BoundaryDiagram:
    brackets = results.brackets(study)
    centers = [math.sqrt(low * high) for low, high in brackets.values()]
    runs = [results.summary_of(key) for point in results.points(study).values() for key in point.runs]
    return BoundaryDiagram(
        distance=table.distance,
        runs=[(*_rate_and_hamaker(run.scene), run.outcome) for run in runs],
        brackets=brackets,
        line=straight_line(list(brackets), centers) if len(centers) > 2 else None,
        published_brackets=table.brackets,
        published_line=(table.intercept, table.slope),
    )


def _rate_and_hamaker(scene: Scene) -> tuple[float, float]:
    return parameter_value(scene, "flow.rate"), parameter_value(scene, "adhesion.hamaker")


def _bracket_comparisons(results: Results, table: _PublishedDiagram, study: StudyCase) -> list[Comparison]:
    brackets = results.brackets(study)
    return [
        compare_intervals(
            f"H_c at shear rate {rate:g}",
            table.brackets.get(rate),
            brackets.get(rate),
            study_runs(study, point.runs),
            allowed=_ALLOWED if rate in table.brackets else None,
            note=point.status,
        )
        for rate, point in sorted(results.points(study).items())
    ]


def _line_comparisons(
    table: _PublishedDiagram, line: StraightLineFit | None, study: StudyCase
) -> list[Comparison]:
    if line is None:
        return []
    intercepts, slopes = lines_through(table.brackets)
    return [
        compare_numbers(
            f"{name} of the line H_c(rate)",
            known,
            value,
            study_runs(study),
            unit="",
            note=f"± {error:.2g}; lines through all published brackets have {low:.2f} to {high:.2f}",
        )
        for name, known, value, error, (low, high) in (
            ("slope", table.slope, line.slope, line.slope_error, slopes),
            ("intercept", table.intercept, line.intercept, line.intercept_error, intercepts),
        )
    ]


def lines_through(brackets: Mapping[float, Interval]) -> tuple[Interval, Interval]:
    """Return the limits of the straight lines that pass through all brackets, by linear programming.

    Parameters
    ----------
    brackets : mapping of float to (float, float)
        Brackets by their abscissa.

    Returns
    -------
    intercepts : (float, float)
        Least and greatest intercept.
    slopes : (float, float)
        Least and greatest slope.
    """
    ends = np.array(list(brackets.values()))
    line = np.stack([np.ones(len(ends)), list(brackets)], axis=1)
    limits = {"A_ub": np.concatenate([line, -line]), "b_ub": np.concatenate([ends[:, 1], -ends[:, 0]])}

    def least(direction: tuple[float, float]) -> float:
        return float(linprog(direction, **limits, bounds=(None, None)).fun)

    return (least((1, 0)), -least((-1, 0))), (least((0, 1)), -least((0, -1)))


def _end_state_comparisons(results: Results, ends: Iterable[tuple[ShearDoublet, str]]) -> list[Comparison]:
    comparisons = []
    for doublet, fate in ends:
        case = doublet.until_published_horizon
        run = results.run(case)
        distance = run.series["center_distance"]
        comparisons.append(
            compare_words(
                f"at T = 100, published vesicles, shear rate {doublet.rate:g}, H = {doublet.hamaker:g}",
                fate,
                fate_at_end(run),
                runs_of(case),
                note=f"centers {distance[-1]:.1f} apart, {distance.max():.1f} at most",
            )
        )
    return comparisons


SECTION = Section("critical-hamaker", "When a doublet in shear stays together", _generate)
