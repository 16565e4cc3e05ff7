"""Intrinsic viscosity of vesicles and doublets in shear, against reduced area (paper, section V)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ensemble.figures.style import BLACK, BLUE, GREEN, STYLE, VERMILLION, WIDTH
from ensemble.report.paper.case import Case
from ensemble.report.paper.comparison import Row, number
from ensemble.report.paper.published import published
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import Chapter, Course, Drawing, Section, SectionPlan
from ensemble.report.paper.shear_doublet import published_vesicles

_HAMAKER, _STRONG = 0.7, 2.1
_ALLOWED, _ALLOWED_INDEPENDENT = 2.0, 0.3  # percent
_ALLOWED_INCLINATION = 0.3  # degrees
# Parts of a doublet's viscosity by their table in the published values, and their fields.
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


def _course(quick: bool) -> Course:
    areas = [area for area, _ in published()["viscosity"]["single"]]
    areas = areas[2::2] if quick else areas
    independent = published()["independent"]["single_vesicle"]
    singles = {area: _single(area) for area in [*areas, *(area for area, _, _ in independent)]}
    doublets = {area: _doublet(area) for area in areas}
    strong = {
        "0.9": _doublet(0.9, _STRONG),
        "published vesicles": _doublet(0.9, _STRONG).but(published_vesicles()),
    }
    results = yield SectionPlan([*singles.values(), *doublets.values(), *strong.values()])
    rows = [
        _row(results, f"single vesicle, reduced area {area:g}", value, singles[area], "total")
        for area, value in published()["viscosity"]["single"]
        if area in areas
    ]
    for table, part in _PARTS.items():
        for area, value in published()["viscosity"][table]:
            if area in areas:
                name = f"{_NAMES[part]}, reduced area {area:g}"
                rows.append(_row(results, name, value, doublets[area], part))
    return Chapter(
        [
            f"Shear rate 0.5, H = {_HAMAKER:g}, δ = 0.4.  Doublets: averages over their last turn.",
            _drawing(results, singles, doublets),
            rows,
            f"The strong doublet, H = {_STRONG:g}: adhesion contributes more, bending and tension less.",
            [
                _row(results, f"{_NAMES[part]}, {kind}", value, case, part)
                for kind, case in strong.items()
                for part, value in zip(_PARTS.values(), published()["viscosity"]["strong"], strict=True)
            ],
            "A single vesicle against another boundary-integral code, with 3 to 4 digits.",
            [row for value in independent for row in _independent_rows(results, *value)],
        ]
    )


def _part(results: Results, case: Case, part: str) -> float | None:
    viscosity = results.summary(case).viscosity
    return None if viscosity is None else getattr(viscosity, part)


def _row(results: Results, name: str, value: float, case: Case, part: str) -> Row:
    computed, total = _part(results, case, part), _part(results, case, "total")
    note = ""
    if part == "adhesion" and computed is not None and total is not None:  # a small part, read off a figure
        note = f"differs by {computed - value:+.3f}, {100 * (computed - value) / total:+.1f} % of the total"
    return number(f"[μ], {name}", value, computed, [case], allowed=_ALLOWED, note=note)


def _independent_rows(results: Results, area: float, viscosity: float, inclination: float) -> list[Row]:
    case = _single(area)
    return [
        number(
            f"[μ], single vesicle, reduced area {area:g}",
            viscosity,
            _part(results, case, "total"),
            [case],
            allowed=_ALLOWED_INDEPENDENT,
        ),
        number(
            f"inclination, reduced area {area:g}",
            inclination,
            results.summary(case).inclination_angle,
            [case],
            allowed=_ALLOWED_INCLINATION,
            unit="°",
        ),
    ]


@matplotlib.rc_context(STYLE)
def _drawing(results: Results, singles: Mapping[float, Case], doublets: Mapping[float, Case]) -> Drawing:
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    single = {area: _part(results, case, "total") for area, case in singles.items()}
    parts = {
        part: {area: _part(results, case, part) for area, case in doublets.items()}
        for part in _PARTS.values()
    }
    tables = published()["viscosity"]
    for axes, drawn in (
        (left, [(single, "single", "one vesicle", BLUE), (parts["total"], "doublet", "doublet", VERMILLION)]),
        (
            right,
            [
                (single, "single", "one vesicle", BLUE),
                (parts["bending_tension"], "doublet_bending_tension", "doublet, bending + tension", BLACK),
                (parts["adhesion"], "doublet_adhesion", "doublet, adhesion", GREEN),
            ],
        ),
    ):
        for values, table, label, color in drawn:
            axes.plot(*_columns(values), "-", color=color, label=label)
            axes.plot(*np.array(tables[table]).T, "D", color=color, markerfacecolor="white", markersize=4)
        axes.set(xlabel=r"reduced area $\Delta A$", ylabel=r"intrinsic viscosity $[\mu]$")
    left.plot(*np.array(tables["ghigliotti"]).T, "k+", label="Ghigliotti et al. (2010)")
    left.legend()
    right.legend()
    return Drawing(
        "viscosity", "Intrinsic viscosity against reduced area; diamonds: published, lines: computed.", figure
    )


def _columns(values: Mapping[float, float | None]) -> np.ndarray:
    known: Sequence[tuple[float, float]] = sorted(
        (at, value) for at, value in values.items() if value is not None
    )
    return np.array(known).reshape(-1, 2).T


SECTION = Section("viscosity", "Viscosity of a dilute suspension", _course)
