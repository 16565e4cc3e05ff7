"""The adhesion strength that holds a doublet together in shear, against the shear rate (paper, section V)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final, NamedTuple

import numpy as np
from scipy.optimize import linprog

from ensemble.config.dotted_paths import parameter_value
from ensemble.report.paper import boundary_figures
from ensemble.report.paper.boundary_figures import Diagram
from ensemble.report.paper.case import StudyCase
from ensemble.report.paper.comparison import Bracket, Row, bracket, number, words
from ensemble.report.paper.power_laws import Line, straight_line
from ensemble.report.paper.published import published
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import Chapter, Course, Drawing, Section, SectionPlan
from ensemble.report.paper.shear_doublet import Doublet
from solver.analysis.run import Outcome, Run
from solver.scene import Scene

_PRESETS: Final = {0.4: "critical-hamaker", 0.1: "critical-hamaker-short-range"}  # by separation distance
_QUICK_RATES = (0.5, 1.0)
_QUICK_TOLERANCE = 0.05
_ALLOWED = 3.0  # percent, of published brackets
_COME_ROUND = 1.5 * math.pi  # of the line of centers


class _Published(NamedTuple):
    """A published phase diagram: brackets (low, high) by shear rate, and its line."""

    distance: float
    brackets: dict[float, tuple[float, float]]
    intercept: float
    slope: float

    def ends(self) -> list[tuple[Doublet, str]]:
        """Doublets of the published vesicles at either end of the brackets, and what became of them."""
        return [
            (Doublet(hamaker, rate, self.distance, as_published=True), fate)
            for rate, ends in self.brackets.items()
            for hamaker, fate in zip(ends, _FATES, strict=True)
        ]


_FATES = ("separated", "bound")


def _published() -> list[_Published]:
    return [
        _Published(
            table["distance"], {rate: (low, high) for rate, low, high in table["brackets"]}, *table["fit"]
        )
        for table in published()["shear"]["critical_hamaker"]
    ]


def _study(distance: float, quick: bool) -> StudyCase:
    changes = {"sweep.values": list(_QUICK_RATES), "search.tolerance": _QUICK_TOLERANCE} if quick else {}
    return StudyCase.of(_PRESETS[distance], changes)


def seen_at_the_end(run: Run) -> str:
    """What a run's end looks like: separated if the pair moves apart and has not come round yet."""
    distance, angle = run.series["center_distance"], run.series["center_angle"]
    leaving = distance[-1] > distance[-2] and abs(angle[-1] - angle[0]) < _COME_ROUND
    return _FATES[0] if run.outcome is Outcome.SEPARATED or leaving else _FATES[1]


def _course(quick: bool) -> Course:
    tables = [table for table in _published() if not quick or table.distance in tuple(_PRESETS)[:1]]
    studies = {table.distance: _study(table.distance, quick) for table in tables}
    seen = [end for table in tables for end in table.ends()]
    results = yield SectionPlan(
        [doublet.until_published_horizon for doublet, _ in seen], list(studies.values())
    )
    content: list[str | list[Row] | Drawing] = [_INTRODUCTION]
    diagrams = [_diagram(results, table, studies[table.distance]) for table in tables]
    content.append(
        Drawing(
            "diagram",
            "Critical Hamaker constant against shear rate.  Marks: runs of the search; black: its brackets "
            "and their line; gray: the published brackets and line.",
            boundary_figures.diagrams(diagrams),
            "; ".join(study.command for study in studies.values()),
        )
    )
    for table, diagram in zip(tables, diagrams, strict=True):
        content += [
            f"### δ = {table.distance:g}",
            [
                *_bracket_rows(results, table, studies[table.distance]),
                *_line_rows(table, diagram.line, studies[table.distance]),
            ],
            _seen_rows(results, table.ends()),
        ]
    return Chapter(content)


_INTRODUCTION = (
    "The published brackets are where the runs stood at T = 100, with vesicles of reduced area 0.9044.  A "
    "doublet near the boundary opens and closes slowly and may come round once and separate later, most of "
    "all at small δ, so a boundary decided by events (here) lies above one that is read at T = 100.  Below "
    "each comparison the ends of the published brackets are run at the published settings and read at "
    "T = 100 (separated: moving apart and not come round yet); these must agree."
)


def _diagram(results: Results, table: _Published, study: StudyCase) -> Diagram:
    brackets = results.brackets(study)
    centers = [math.sqrt(low * high) for low, high in brackets.values()]
    runs = [results.summary_of(key) for point in results.points(study).values() for key in point.runs]
    return Diagram(
        distance=table.distance,
        runs=[(*_place(run.scene), run.outcome) for run in runs],
        brackets=brackets,
        line=straight_line(list(brackets), centers) if len(centers) > 2 else None,
        published_brackets=table.brackets,
        published_line=(table.intercept, table.slope),
    )


def _place(scene: Scene) -> tuple[float, float]:
    return parameter_value(scene, "flow.rate"), parameter_value(scene, "adhesion.hamaker")


def _bracket_rows(results: Results, table: _Published, study: StudyCase) -> list[Row]:
    brackets = results.brackets(study)
    return [
        bracket(
            f"H_c at shear rate {rate:g}",
            table.brackets.get(rate),
            brackets.get(rate),
            study,
            allowed=_ALLOWED if rate in table.brackets else None,
            runs=point.runs,
            note=point.status,
        )
        for rate, point in sorted(results.points(study).items())
    ]


def _line_rows(table: _Published, line: Line | None, study: StudyCase) -> list[Row]:
    if line is None:
        return []
    intercepts, slopes = lines_through(table.brackets)
    return [
        number(
            f"{name} of the line H_c(rate)",
            known,
            value,
            study,
            unit="",
            note=f"± {error:.2g}; lines through all published brackets have {low:.2f} to {high:.2f}",
        )
        for name, known, value, error, (low, high) in (
            ("slope", table.slope, line.slope, line.slope_error, slopes),
            ("intercept", table.intercept, line.intercept, line.intercept_error, intercepts),
        )
    ]


def lines_through(brackets: Mapping[float, Bracket]) -> tuple[Bracket, Bracket]:
    """Least and greatest intercept, then slope, of the straight lines that pass all brackets."""
    ends = np.array(list(brackets.values()))
    line = np.stack([np.ones(len(ends)), list(brackets)], axis=1)
    limits = {"A_ub": np.concatenate([line, -line]), "b_ub": np.concatenate([ends[:, 1], -ends[:, 0]])}

    def least(direction: tuple[float, float]) -> float:
        return float(linprog(direction, **limits, bounds=(None, None)).fun)

    return (least((1, 0)), -least((-1, 0))), (least((0, 1)), -least((0, -1)))


def _seen_rows(results: Results, ends: Iterable[tuple[Doublet, str]]) -> list[Row]:
    rows = []
    for doublet, fate in ends:
        run = results.run(doublet.until_published_horizon)
        distance = run.series["center_distance"]
        rows.append(
            words(
                f"at T = 100, published vesicles, shear rate {doublet.rate:g}, H = {doublet.hamaker:g}",
                fate,
                seen_at_the_end(run),
                [doublet.until_published_horizon],
                note=f"centers {distance[-1]:.1f} apart, {distance.max():.1f} at most",
            )
        )
    return rows


SECTION = Section("critical-hamaker", "When a doublet in shear stays together", _course)
