"""What the sections of the paper report from their runs: every content is made, those on shear in detail."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from scipy.special import gamma

from ensemble.figures import save
from ensemble.report.paper.case import Case, StudyCase
from ensemble.report.paper.comparison import Comparison, Evidence
from ensemble.report.paper.least_squares import straight_line
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import Section, SectionContent, SectionFigure
from ensemble.report.paper.sections import (
    SECTIONS,
    critical_hamaker,
    laboratory,
    potential_exponents,
    sections_named,
    sheared_doublets,
    unequal_vesicles,
)
from ensemble.report.paper.sections.shear_cases import ShearDoublet
from ensemble.report.paper.sections.steady_limits import compare_limit
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.store import Store
from solver.analysis.run import Energy, Outcome, Run, Viscosity
from solver.scene import Scene
from tests.ensemble.made_runs import orbit

PERIOD = 36.5


def made_up(scene: Scene) -> Run:
    """An orbit, or a steady vesicle, as if it were this scene's run; whatever the scene, of one period."""
    run = orbit(len(scene.vesicles), scene.flow.kind if scene.flow else None, scene.adhesion is not None)
    return replace(
        run,
        scene=scene,
        period=PERIOD if len(scene.vesicles) == 2 and scene.flow else None,
        effective_aspect_ratio=2.5,
        inclination_angle=31.0 if len(scene.vesicles) == 1 else 131.0,
        viscosity=Viscosity(1.97, 1.85, 0.12),
        energy=Energy(8.0, -3.0),
    )


def traced(case: StudyCase) -> Boundary:
    """A boundary that the line 0.1 + 0.55·x describes."""
    study = case.study
    points = [
        BoundaryPoint(
            parameters={study.sweep[0].parameter: at},
            bracket=(0.1 + 0.55 * at, 0.11 + 0.55 * at),
            outcomes=("separated", "bound"),
            status="converged",
            certified=False,
            runs=[],
        )
        for at in study.sweep[0].values
    ]
    return Boundary(
        study_key=study.key,
        study=study.model_dump(mode="json"),
        name=study.name,
        points=points,
        updated=datetime(2026, 1, 1, tzinfo=UTC),
    )


def content_of(section: Section, store: Store) -> SectionContent:
    """The quick content of a section, from a store in which everything that it plans is made up."""
    generator = section.generate(True)
    plan = next(generator)
    while True:
        for case in plan.cases:
            if not store.contains(case.key):
                store.save(made_up(case.scene))
        for case in plan.studies:
            store.save_boundary(traced(case))
        try:
            plan = generator.send(Results(store))
        except StopIteration as finished:
            return finished.value


class Contents(dict[str, SectionContent]):
    """Contents of sections by name, each made when it is first asked for."""

    def __init__(self, store: Store) -> None:
        self._store = store

    def __missing__(self, name: str) -> SectionContent:
        (section,) = sections_named([name])
        return self.setdefault(name, content_of(section, self._store))


@pytest.fixture(scope="module")
def contents(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Contents]:
    with Store.open(tmp_path_factory.mktemp("paper") / "store") as store:
        yield Contents(store)


def rows(content: SectionContent) -> dict[str, Comparison]:
    return {
        row.quantity: row
        for part in content.blocks
        if not isinstance(part, str | SectionFigure)
        for row in part
    }


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.name)
def test_every_section_compares_and_draws(section: Section, contents: Contents, tmp_path: Path) -> None:
    figures = [part for part in contents[section.name].blocks if isinstance(part, SectionFigure)]
    assert figures
    assert rows(contents[section.name])
    for figure in figures:
        save(figure.figure, tmp_path / f"{figure.name}.svg")


def test_published_vesicles_are_listed_only_where_the_exact_ones_deviate(
    contents: Contents,
) -> None:
    found = rows(contents["shear"])
    assert found["period, H = 1.5, shear rate 0.5"].deviation == pytest.approx(100 * (PERIOD / 36.34 - 1))
    listed = {name for name in found if name.endswith("published vesicles")}
    deviating = {name for name, row in found.items() if name.startswith("shear rate") and row.agrees is False}
    assert listed
    assert listed == {f"{name}, published vesicles" for name in deviating - listed}


def test_brackets_and_their_line_stand_beside_the_published(contents: Contents) -> None:
    found = rows(contents["critical-hamaker"])
    assert found["H_c at shear rate 0.5"].published == (0.3, 0.4)
    assert found["H_c at shear rate 0.5"].computed == pytest.approx((0.375, 0.385))
    assert found["H_c at shear rate 0.5"].agrees is True
    seen = [row for name, row in found.items() if name.startswith("at T = 100")]
    assert [row.published for row in seen] == ["separated", "bound"] * 3
    assert all(row.computed == "bound" for row in seen)


def test_parts_of_the_viscosity_are_compared(contents: Contents) -> None:
    found = rows(contents["viscosity"])
    assert found["[μ], doublet, bending and tension, reduced area 0.707"].computed == 1.85
    assert found["[μ], doublet, adhesion, published vesicles"].published == 0.36
    assert found["[μ], single vesicle, reduced area 0.9044"].published == 1.811
    assert found["inclination, reduced area 0.9044"].deviation == pytest.approx(31.0 - 31.31)


def test_both_published_kinds_of_vesicles_are_what_they_say() -> None:
    exact, published_run = ShearDoublet(1.5), ShearDoublet(1.5, as_published=True)
    assert {vesicle.reduced_area for vesicle in exact.case.scene.vesicles} == {0.9}
    (vesicle,) = {vesicle.reduced_area for vesicle in published_run.case.scene.vesicles}
    assert vesicle == 0.9044
    assert published_run.case.scene.vesicles[0].length == pytest.approx(0.99755 * 2 * math.pi, rel=1e-6)
    scene = published_run.until_published_horizon.scene
    assert scene.horizon == 100.0
    assert scene.criteria.revolutions > scene.horizon


def test_what_is_seen_at_the_end_is_how_far_apart_a_pair_is_and_whither_it_goes() -> None:
    run = replace(orbit(), outcome=Outcome.UNDECIDED)  # its line of centers turns by 8 radians
    half_turn = np.linspace(0, -np.pi, 41)
    growing = np.linspace(3.0, 10.0, 41)
    leaving = replace(run, series=dict(run.series) | {"center_distance": growing, "center_angle": half_turn})
    sliding = replace(run, series=dict(run.series) | {"center_distance": growing})
    turned_back = np.append(growing[1:], 9.9)
    returning = replace(leaving, series=dict(leaving.series) | {"center_distance": turned_back})
    assert critical_hamaker.fate_at_end(run) == "bound"
    assert critical_hamaker.fate_at_end(sliding) == "bound"
    assert critical_hamaker.fate_at_end(leaving) == "separated"
    assert critical_hamaker.fate_at_end(returning) == "bound"
    assert critical_hamaker.fate_at_end(replace(run, outcome=Outcome.SEPARATED)) == "separated"


def test_the_ratio_of_a_published_period_is_that_of_the_published_table(
    contents: Contents,
) -> None:
    ratio = rows(contents["shear"])["λ_eff, H = 1.5, shear rate 0.5"]
    assert ratio.published == 2.49
    assert ratio.note == "eq. 7 gives 2.49 for the published period"


def test_the_area_of_a_period_lies_between_its_neighbors() -> None:
    known = [(0.9, 37.0), (0.91, 39.0), (0.92, 36.0)]
    assert sheared_doublets.area_of_period(known, 38.0) == pytest.approx(0.905)
    assert sheared_doublets.area_of_period(known, 36.5) == pytest.approx(0.91 + 0.01 * 2.5 / 3)
    assert sheared_doublets.area_of_period(known, 41.0) is None


def test_the_share_of_a_membrane_that_touches_another() -> None:
    run = orbit()
    assert unequal_vesicles.contact_fractions(run) == pytest.approx(
        unequal_vesicles.contact_fractions(run)[::-1], abs=0.02
    )
    center = run.frames.center.copy()
    center[-1, 1] += 50.0
    assert unequal_vesicles.contact_fractions(replace(run, frames=replace(run.frames, center=center))) == (
        0.0,
        0.0,
    )


def test_a_straight_line_is_found_with_its_uncertainty() -> None:
    line = straight_line([0.25, 0.5, 1.0], [0.24, 0.38, 0.67])
    assert line.slope == pytest.approx(0.5743, abs=1e-3)
    assert line.slope_error > 0
    with pytest.raises(ValueError, match="at least 3"):
        straight_line([0, 1], [0, 1])


@pytest.mark.parametrize("exponents_of", list(potential_exponents.BINDING_ENERGY))
def test_binding_energies_are_those_of_parallel_lines(exponents_of: tuple[int, int]) -> None:
    m, n = exponents_of

    def energy(separation: np.ndarray) -> np.ndarray:
        """∫ of the potential along a line at this separation, over H·δ (∫ r^−k dx by the beta function)."""
        attraction, repulsion = (
            math.sqrt(math.pi) * gamma((k - 1) / 2) / gamma(k / 2) * separation ** (1 - k) for k in (n, m)
        )
        return repulsion - m / n * attraction

    assert -energy(np.linspace(0.8, 1.0, 20001)).min() == pytest.approx(
        potential_exponents.BINDING_ENERGY[exponents_of], rel=1e-4
    )


def test_lines_through_brackets_are_bounded_by_their_corners() -> None:
    intercepts, slopes = critical_hamaker.lines_through({0.5: (1.0, 2.0), 1.0: (3.0, 3.5), 1.5: (4.0, 6.0)})
    assert slopes == pytest.approx((2.0, 5.0))  # (0.5, 2) to (1, 3); (0.5, 1) to (1, 3.5)
    assert intercepts == pytest.approx((-1.5, 1.0))


@pytest.mark.parametrize(
    ("limit", "place"),
    [(0.0928, "inside"), (0.0940, "0.75 % above"), (0.0920, "0.43 % below"), (None, "0.0924 to 0.0933")],
)
def test_a_limit_is_inside_the_bracket_of_bisection_or_it_is_said_why_not(
    limit: float | None, place: str
) -> None:
    row = compare_limit("rate", (0.09, 0.1), limit, Case.of("doublet-trap", {}), (0.0924, 0.0933))
    assert place.replace(" %", "%") in row.note
    assert row.computed == limit
    assert ("computed 0.0" in row.note) is (limit is not None)


def test_the_closing_estimate_is_converted_as_by_hand() -> None:
    """With R³ = 0.1·κ/(μ·rate) and W = κ/R² in units of which the estimate's are powers of ten."""
    estimate = laboratory.ClosingEstimate(
        rate=0.1, adhesion_energy=1e-6, bending_modulus=1e-18, viscosity=1e-3
    )
    found = laboratory.compare_estimate(estimate, (0.1, 0.1), 4.0, Evidence())
    values = [row.computed for row in found]
    assert values[0] == pytest.approx((10.0, 10.0), rel=1e-12)
    assert values[1:] == pytest.approx(
        [0.04, 4.0, 2.0, 0.1 * 1e-18 / (1e-3 * 8e-18), 250.0, 1.5625e-14], rel=1e-12
    )
