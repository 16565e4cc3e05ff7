"""Past the paper: where steady states end, computed directly and beside bisection and what is published."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Final

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ensemble.config.overrides import override
from ensemble.config.validation import validated
from ensemble.figures.bifurcation import bifurcation_diagram
from ensemble.figures.style import BLACK, GRAY, STYLE, VERMILLION, WIDTH
from ensemble.figures.symbols import quantity
from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.paper.comparison import Comparison, Interval, Value, published
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import (
    Section,
    SectionContent,
    SectionFigure,
    SectionGenerator,
    SectionPlan,
)
from ensemble.report.paper.sections.boundary_figures import draw_brackets
from ensemble.report.paper.sections.viscosity_contrasts import keller_skalak
from ensemble.store.branch_record import summary_of
from solver.scene import Scene, Trap
from solver.simulation.resolution import with_points
from solver.simulation.steady_scenes import SteadyBranch, follow_steady_states
from solver.simulation.vesicle_shapes import Shapes
from solver.steady_states.continuation import Limits, OutsideParameterError
from solver.steady_states.newton import NoSteadyStateError

if TYPE_CHECKING:
    from ensemble.search.branch_summary import BranchSummary

_RATE, _AREA, _CONTRAST = "flow.rate", "vesicles.reduced_area", "vesicles.viscosity_contrast"
_TRAP_AREAS = (0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95)
_SHEAR_AREAS = (0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95)
_SHOWN: Final = 0.8  # reduced area of the diagram
_SLOW, _TIP_TO_TIP, _TREADING = 0.05, 0.1, 2.0  # rates and contrast at which branches start
_LEAST_RATE = 0.01


def _side_by_side(area: float) -> Case:
    return Case.of("doublet-trap", {_AREA: area, _RATE: _SLOW})


def _tip_to_tip() -> Case:
    # With 64 points the crossing is not found at reduced areas up to 0.7.
    return Case.of("doublet-trap", {_AREA: _SHOWN, _RATE: _TIP_TO_TIP, "numerics.points": 96})


def _treading(area: float) -> Case:
    return Case.of("vesicle-shear", {_AREA: area, _RATE: 1.0, _CONTRAST: _TREADING})


def _generate(quick: bool) -> SectionGenerator:
    trap_areas, shear_areas = ((_SHOWN,), (0.75,)) if quick else (_TRAP_AREAS, _SHEAR_AREAS)
    loss = StudyCase.of(
        "critical-extension-rate",
        {"sweep.values": list(trap_areas)} | ({"search.tolerance": 0.03} if quick else {}),
    )
    tumbling = StudyCase.of(
        "critical-viscosity-contrast",
        {"sweep.values": list(shear_areas)} | ({"search.tolerance": 0.1} if quick else {}),
    )
    starts = [*map(_side_by_side, {*trap_areas, _SHOWN}), _tip_to_tip(), *map(_treading, shear_areas)]
    results = yield SectionPlan(starts, [loss, tumbling])
    side = list(_trap_comparisons(results, loss, trap_areas))
    tips = list(_tip_to_tip_comparisons(results, trap_areas))
    treading = list(_treading_comparisons(results, tumbling, shear_areas))
    figures = [SectionFigure("limits", _LIMITS_CAPTION, _limits(results, loss, tumbling, side, treading))]
    branches = _shown_branches(results)
    if branches:
        figures.append(SectionFigure("branches", _CAPTION, bifurcation_diagram(branches)))
    return SectionContent([_TEXT, *figures, _HYSTERESIS, side, tips, _TREADING_TEXT, treading])


def _shown_branches(results: Results) -> list[BranchSummary]:
    """Return the branches in the trap at the reduced area of the diagram."""
    tip = _tip_to_tip()
    wanted = [(_side_by_side(_SHOWN), np.inf), (tip, _LEAST_RATE), (tip, np.inf)]
    found = [(case, _branch(results, case, _RATE, Limits(to))) for case, to in wanted]
    return [summary_of(case.scene, _RATE, None, branch) for case, branch in found if branch is not None]


@matplotlib.rc_context(STYLE)
def _limits(
    results: Results,
    loss: StudyCase,
    tumbling: StudyCase,
    side: Sequence[Comparison],
    treading: Sequence[Comparison],
) -> Figure:
    """Draw folds beside the brackets of bisection and what is published, against reduced area."""
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    trap, shear = figure.subplots(1, 2)
    for area, low, high in published()["trap"]["critical_extension_rate"]:
        trap.plot([area, area], [low, high], color=GRAY, linewidth=6, alpha=0.4, label="published")
    areas = np.linspace(0.58, 0.97, 80)
    shear.plot(areas, [keller_skalak(area) for area in areas], color=GRAY, label="Keller and Skalak")
    for axes, study, rows in ((trap, loss, side), (shear, tumbling, treading)):
        draw_brackets(axes, results.brackets(study), BLACK, "bisection")
        folds = [
            (area, row.computed)
            for area, row in zip(sorted(study.study.sweep[0].values), rows, strict=True)
            if row.computed is not None
        ]
        axes.plot(*np.reshape(folds, (-1, 2)).T, "D", color=VERMILLION, markersize=4, label="fold")
        handles, labels = axes.get_legend_handles_labels()
        axes.legend(dict(zip(labels, handles, strict=True)).values(), dict.fromkeys(labels))
        axes.set_xlabel(quantity(_AREA).label)
    trap.set_ylabel(quantity(_RATE, Trap).label)
    shear.set_ylabel(quantity(_CONTRAST).label)
    return figure


def _branch(
    results: Results, case: Case, parameter: str, limits: Limits, near: Shapes | None = None
) -> SteadyBranch | None:
    """Return the branch from a case's steady state, or from one nearby; None if there is none."""
    if near is None:
        frames = results.run(case).frames
        near = Shapes(frames.tangent_angle[-1], frames.center[-1])
    document, points = case.scene.model_dump(), near.tangent_angle.shape[1]
    start = {_RATE: case.scene.flow.rate if case.scene.flow else 0.0} | {
        _AREA: case.scene.vesicles[0].reduced_area,
        _CONTRAST: case.scene.vesicles[0].viscosity_contrast,
    }

    def scene_at(value: float) -> Scene:
        try:
            return with_points(validated(Scene, override(document, {parameter: value})), points)
        except ValueError as error:
            raise OutsideParameterError(str(error)) from error

    try:
        return follow_steady_states(
            scene_at, start[parameter], near, limits, upward=limits.to > start[parameter]
        )
    except NoSteadyStateError:
        return None


def _fold(branch: SteadyBranch | None) -> float | None:
    return branch.folds[0].parameter if branch is not None and branch.folds else None


def compare_limit(
    quantity: str, known: Value, value: float | None, case: Case, bracket: Interval | None = None
) -> Comparison:
    """Set a limit beside what is published and the bracket of bisection.

    Parameters
    ----------
    quantity : str
        What is compared.
    known : float, (float, float), str or None
        What is published.
    value : float or None
        The limit; None if the branch has none.
    case : Case
        The run from whose end the branch starts.
    bracket : (float, float) or None
        Of bisection.

    Returns
    -------
    Comparison
        Its note has nine digits of the limit, and says whether it lies inside the bracket, or why not.
    """
    notes = [] if value is None else [f"computed {value:.9g}"]
    if bracket is not None:
        notes.append(f"bisection {bracket[0]:.5g} to {bracket[1]:.5g}{_place(value, bracket)}")
    return Comparison(
        quantity=quantity,
        published=known,
        computed=value,
        note="; ".join(notes),
        runs=[case.key],
        command=case.command,
    )


def _place(limit: float | None, bracket: Interval) -> str:
    """Return where a limit lies beside a bracket, and why if it is not inside."""
    low, high = bracket
    if limit is None:
        return ""
    if low <= limit <= high:
        return ", the limit inside"
    if limit > high:
        return (
            f", the limit {limit / high - 1:.2%} above: a stable state is there, but the start of bisection "
            "misses it"
        )
    return (
        f", the limit {1 - limit / low:.2%} below: this state is gone there, and bisection finds another one"
    )


def _trap_comparisons(results: Results, study: StudyCase, areas: tuple[float, ...]) -> Iterator[Comparison]:
    known = {area: (low, high) for area, low, high in published()["trap"]["critical_extension_rate"]}
    for area in areas:
        case = _side_by_side(area)
        fold = _fold(_branch(results, case, _RATE, Limits(np.inf)))
        name = f"rate at which side by side ends (fold), ΔA = {area:g}"
        yield compare_limit(name, known.get(area), fold, case, results.brackets(study).get(area))


def _tip_to_tip_comparisons(results: Results, areas: tuple[float, ...]) -> Iterator[Comparison]:
    """Yield where tip to tip begins and ends; the state at other reduced areas is followed from `_SHOWN`."""
    for area in areas:
        case, near = _tip_to_tip(), None
        if area != _SHOWN:
            there = _branch(results, case, _AREA, Limits(area))
            if there is None or there.points[-1].parameter != area:
                continue
            near = there.points[-1].state.shapes
            case = case.with_changes({_AREA: area})
        lower = _branch(results, case, _RATE, Limits(_LEAST_RATE), near)
        upper = _branch(results, case, _RATE, Limits(np.inf), near)
        crossing = max((point.parameter for point in lower.crossings), default=None) if lower else None
        yield compare_limit(
            f"rate at which tip to tip begins (crossing), ΔA = {area:g}", None, crossing, case
        )
        yield compare_limit(f"rate at which tip to tip ends (fold), ΔA = {area:g}", None, _fold(upper), case)


def _treading_comparisons(
    results: Results, study: StudyCase, areas: tuple[float, ...]
) -> Iterator[Comparison]:
    for area in areas:
        case = _treading(area)
        fold = _fold(_branch(results, case, _CONTRAST, Limits(np.inf)))
        name = f"contrast at which treading ends (fold), ΔA = {area:g} (published: Keller and Skalak)"
        yield compare_limit(name, keller_skalak(area), fold, case, results.brackets(study).get(area))


_TEXT = (
    "A steady state and the values of a parameter at which it ends can be computed without time: by Newton's "
    "method, continuation and the eigenvalues of all perturbations, those that break the symmetry of a pair "
    "included.  At a fold a stable and an unstable state meet, and beyond it there is neither.  At a "
    "crossing a state becomes unstable but remains."
)
_LIMITS_CAPTION = (
    "Left: rate at which side by side ends in the trap.  Right: contrast at which a vesicle in shear ceases "
    "to tread.  Bars: brackets of bisection.  Diamonds: folds."
)
_CAPTION = (
    "Steady states in the trap at reduced area 0.8: above, their inclination; below, the fastest growth of a "
    "perturbation.  Solid: stable.  Dashed: unstable."
)
_HYSTERESIS = (
    "Bisection and the fold answer different questions.  Bisection tells at which rate a pair that starts as "
    "the paper's does, upright on the diverging axis, is no longer side by side in the end.  The fold tells "
    "up to which rate a pair that is side by side stays so while the rate rises slowly.  Near the fold the "
    "paper's start misses the state, so bisection lies below it or at it.  Tip to tip is stable from its "
    "crossing to its fold, and where both are stable the pair remembers how it was brought there: an "
    "experiment that raises the rate and lowers it again finds two different critical rates."
)
_TREADING_TEXT = (
    "One vesicle in shear, shear rate 1: treading ends at a fold too.  A vesicle treads below it and tumbles "
    "beyond it, so here bisection and the fold answer the same question."
)


SECTION = Section("steady-limits", "Past the paper: where steady states end", _generate)
