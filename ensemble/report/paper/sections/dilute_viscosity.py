"""Intrinsic viscosity of vesicles and doublets in shear (Quaife et al. 2019, sec. V, fig. 15)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ensemble.figures.style import BLACK, BLUE, GREEN, STYLE, VERMILLION, WIDTH
from ensemble.report.paper.case import Case
from ensemble.report.paper.comparison import Comparison, compare_numbers, published, runs_of
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import (
    Section,
    SectionContent,
    SectionFigure,
    SectionGenerator,
    SectionPlan,
)
from ensemble.report.paper.sections.shear_cases import published_vesicles
from solver.analysis.run import Array

_HAMAKER, _STRONG = 0.7, 2.1
_ALLOWED, _ALLOWED_INDEPENDENT = 2.0, 0.3  # percent
_ALLOWED_INCLINATION = 0.3  # degrees
# Parts of the viscosity of a doublet: tables of published values, and fields of
# `solver.analysis.run.Viscosity`.
_PARTS: Final = {
    "doublet": "total",
    "doublet_bending_tension": "bending_tension",
    "doublet_adhesion": "adhesion",
}
_NAMES: Final = {
    "total": "doublet",
    "bending_tension": "doublet, bending and tension",
    "adhesion": "doublet, adhesion",
}


def _single(reduced_area: float) -> Case:
    return Case.of("vesicle-shear", {"vesicles.reduced_area": reduced_area, "numerics.points": 128})


def _doublet(reduced_area: float, hamaker: float = _HAMAKER) -> Case:
    return Case.of(
        "doublet-shear",
        {"adhesion.hamaker": hamaker, "vesicles.reduced_area": reduced_area, "numerics.points": "auto"},
    )


def _generate(quick: bool) -> SectionGenerator:
    areas = [area for area, _ in published()["viscosity"]["single"]]
    areas = areas[2::2] if quick else areas
    independent = published()["independent"]["single_vesicle"]
    singles = {area: _single(area) for area in [*areas, *(area for area, _, _ in independent)]}
    doublets = {area: _doublet(area) for area in areas}
    strong = {
        "0.9": _doublet(0.9, _STRONG),
        "published vesicles": _doublet(0.9, _STRONG).with_changes(published_vesicles()),
    }
    results = yield SectionPlan([*singles.values(), *doublets.values(), *strong.values()])
    comparisons = [
        _comparison(results, f"single vesicle, reduced area {area:g}", value, singles[area], "total")
        for area, value in published()["viscosity"]["single"]
        if area in areas
    ]
    for table, part in _PARTS.items():
        comparisons += [
            _comparison(results, f"{_NAMES[part]}, reduced area {area:g}", value, doublets[area], part)
            for area, value in published()["viscosity"][table]
            if area in areas
        ]
    return SectionContent(
        [
            f"Shear rate 0.5, H = {_HAMAKER:g}, δ = 0.4.  Doublets: averages over their last revolution.",
            _figure(results, singles, doublets),
            comparisons,
            f"The strong doublet, H = {_STRONG:g}: adhesion contributes more, bending and tension less.",
            [
                _comparison(results, f"{_NAMES[part]}, {kind}", value, case, part)
                for kind, case in strong.items()
                for part, value in zip(_PARTS.values(), published()["viscosity"]["strong"], strict=True)
            ],
            "A single vesicle compared with another boundary-integral code, with 3 to 4 digits.",
            [comparison for value in independent for comparison in _independent_comparisons(results, *value)],
        ]
    )


def _viscosity(results: Results, case: Case, part: str) -> float | None:
    viscosity = results.summary(case).viscosity
    return None if viscosity is None else getattr(viscosity, part)


def _comparison(results: Results, name: str, value: float, case: Case, part: str) -> Comparison:
    computed, total = _viscosity(results, case, part), _viscosity(results, case, "total")
    note = ""
    if part == "adhesion" and computed is not None and total is not None:  # a small part, read off a figure
        note = f"differs by {computed - value:+.3f}, {100 * (computed - value) / total:+.1f} % of the total"
    return compare_numbers(f"[μ], {name}", value, computed, runs_of(case), allowed=_ALLOWED, note=note)


def _independent_comparisons(
    results: Results, area: float, viscosity: float, inclination: float
) -> list[Comparison]:
    case = _single(area)
    return [
        compare_numbers(
            f"[μ], single vesicle, reduced area {area:g}",
            viscosity,
            _viscosity(results, case, "total"),
            runs_of(case),
            allowed=_ALLOWED_INDEPENDENT,
        ),
        compare_numbers(
            f"inclination, reduced area {area:g}",
            inclination,
            results.summary(case).inclination_angle,
            runs_of(case),
            allowed=_ALLOWED_INCLINATION,
            unit="°",
        ),
    ]


@matplotlib.rc_context(STYLE)
def _figure(results: Results, singles: Mapping[float, Case], doublets: Mapping[float, Case]) -> SectionFigure:
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    single = {area: _viscosity(results, case, "total") for area, case in singles.items()}
    parts = {
        part: {area: _viscosity(results, case, part) for area, case in doublets.items()}
        for part in _PARTS.values()
    }
    tables = published()["viscosity"]
    one_vesicle = (single, "single", "one vesicle", BLUE)
    curves = {
        left: [one_vesicle, (parts["total"], "doublet", "doublet", VERMILLION)],
        right: [
            one_vesicle,
            (parts["bending_tension"], "doublet_bending_tension", "doublet, bending + tension", BLACK),
            (parts["adhesion"], "doublet_adhesion", "doublet, adhesion", GREEN),
        ],
    }
    for axes, curves_of_panel in curves.items():
        for values, table, label, color in curves_of_panel:
            axes.plot(*_columns(values), "-", color=color, label=label)
            axes.plot(*np.array(tables[table]).T, "D", color=color, markerfacecolor="white", markersize=4)
        axes.set(xlabel=r"reduced area $\Delta A$", ylabel=r"intrinsic viscosity $[\mu]$")
    left.plot(*np.array(tables["ghigliotti"]).T, "k+", label="Ghigliotti et al. (2010)")
    left.legend()
    right.legend()
    return SectionFigure(
        "viscosity", "Intrinsic viscosity against reduced area; diamonds: published, lines: computed.", figure
    )


def _columns(values: Mapping[float, float | None]) -> Array:
    known: Sequence[tuple[float, float]] = sorted(
        (area, value) for area, value in values.items() if value is not None
    )
    return np.array(known).reshape(-1, 2).T


SECTION = Section("viscosity", "Viscosity of a dilute suspension", _generate)
