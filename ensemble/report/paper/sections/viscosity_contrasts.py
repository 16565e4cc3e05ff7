"""Past the paper: vesicles whose fluid is more viscous than that around them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ensemble.figures.style import BLACK, GRAY, STYLE, WIDTH
from ensemble.figures.symbols import quantity
from ensemble.report.paper.case import StudyCase
from ensemble.report.paper.comparison import (
    Comparison,
    Interval,
    compare_intervals,
    compare_numbers,
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
from solver.scene.ellipses import semi_axes

_CONTRAST: Final = quantity("vesicles.viscosity_contrast")
_AREA: Final = quantity("vesicles.reduced_area")
_HAMAKER: Final = quantity("adhesion.hamaker")
_QUICK_TREADING: Final[dict[str, Any]] = {"sweep.values": [0.75, 0.9], "search.tolerance": 0.1}
_QUICK_ADHESION: Final[dict[str, Any]] = {"sweep.values": [1.0, 4.0], "search.tolerance": 0.1}


def keller_skalak(reduced_area: float) -> float:
    """Return the viscosity contrast beyond which an ellipse in shear tumbles.

    This is the theory of Keller & Skalak (1982) in two dimensions.  The inclination φ of an ellipse with
    semi-axes a and b obeys φ' = rate·(−½ + ½ f₀ [f₁ + 1/(f₁ (1 + f₂ (λ − 1)))] cos 2φ) with
    f₀ = 2ab/(a² + b²), f₁ = ½(a/b − b/a), f₂ = (a² + b²)/(a + b)² and the viscosity contrast λ.  It has a
    steady solution as long as the factor of cos 2φ is at least ½.

    Parameters
    ----------
    reduced_area : float
        Reduced area of the ellipse.

    Returns
    -------
    float
        The critical λ.
    """
    a, b = semi_axes(reduced_area, 2 * math.pi)
    f0, f1, f2 = 2 * a * b / (a**2 + b**2), (a / b - b / a) / 2, (a**2 + b**2) / (a + b) ** 2
    return float(1 + (1 / (f1 * (1 / f0 - f1)) - 1) / f2)


def _generate(quick: bool) -> SectionGenerator:
    treading = StudyCase.of("critical-viscosity-contrast", _QUICK_TREADING if quick else {})
    adhesion = StudyCase.of("critical-hamaker-contrast", _QUICK_ADHESION if quick else {})
    results = yield SectionPlan([], [treading, adhesion])
    return SectionContent(
        [
            _TEXT,
            SectionFigure(
                "contrast",
                _CAPTION,
                _figure(results.brackets(treading), results.brackets(adhesion)),
                f"{treading.command}; {adhesion.command}",
            ),
            _treading_comparisons(results, treading),
            _adhesion_comparisons(results, adhesion),
        ]
    )


_TEXT = (
    "If the fluid inside is viscous enough compared with the one outside, a single vesicle no longer treads "
    "around a steady shape but tumbles.  The theory of Keller and Skalak, here in two dimensions, assumes an "
    "ellipse with a linear velocity on it.  A shape that bending and flow determine, with a velocity that "
    "stretches the membrane nowhere, treads up to somewhat larger contrasts.  A doublet of more viscous "
    "vesicles needs a little less adhesion, up to a contrast of 4; at 8 a pair may come round many times "
    "before it separates, so that one turn proves nothing."
)
_CAPTION = (
    "Left: contrast beyond which a vesicle tumbles, shear rate 1; gray: Keller and Skalak's theory.  Right: "
    "critical Hamaker constant against contrast, shear rate 0.5, δ = 0.4."
)


def _treading_comparisons(results: Results, study: StudyCase) -> list[Comparison]:
    brackets = results.brackets(study)
    return [
        compare_numbers(
            f"critical contrast, reduced area {area:g} (published: Keller and Skalak)",
            keller_skalak(area),
            math.sqrt(math.prod(brackets[area])) if area in brackets else None,
            study_runs(study, point.runs),
            note=point.status,
        )
        for area, point in sorted(results.points(study).items())
    ]


def _adhesion_comparisons(results: Results, study: StudyCase) -> list[Comparison]:
    brackets = results.brackets(study)
    return [
        compare_intervals(
            f"H_c, contrast {contrast:g}",
            None,
            brackets.get(contrast),
            study_runs(study, point.runs),
            note=point.status,
        )
        for contrast, point in sorted(results.points(study).items())
    ]


@matplotlib.rc_context(STYLE)
def _figure(treading: Mapping[float, Interval], adhesion: Mapping[float, Interval]) -> Figure:
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    areas = np.linspace(0.55, 0.97, 100)
    left.plot(areas, [keller_skalak(area) for area in areas], color=GRAY, label="Keller and Skalak")
    left.set(xlabel=_AREA.label, ylabel=_CONTRAST.label, ylim=(1, None))
    left.text(0.62, 5.5, "tumbling")
    left.text(0.75, 1.8, "tank-treading")
    draw_brackets(left, treading, BLACK, "bracket")
    left.legend(loc="upper left")
    draw_brackets(right, adhesion, BLACK, "bracket")
    right.set(xlabel=_CONTRAST.label, ylabel=_HAMAKER.label, xscale="log")
    right.set_xticks(list(adhesion), [f"{contrast:g}" for contrast in adhesion], minor=False)
    right.minorticks_off()
    return figure


SECTION = Section("contrast", "Past the paper: viscosity contrast", _generate)
