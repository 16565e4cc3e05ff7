"""The report's sections on shear: what they read off runs, and that they say it."""

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
from ensemble.report.paper import critical_hamaker, exponents, shear, unequal, viscosity
from ensemble.report.paper.case import StudyCase
from ensemble.report.paper.comparison import Row
from ensemble.report.paper.power_laws import straight_line
from ensemble.report.paper.results import Results
from ensemble.report.paper.section import Chapter, Drawing, Section
from ensemble.report.paper.shear_doublet import Doublet
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.store import Store
from solver.analysis.run import Energy, Outcome, Run, Viscosity
from solver.scene import Scene
from tests.ensemble.made_runs import orbit

SECTIONS = (shear.SECTION, critical_hamaker.SECTION, viscosity.SECTION, exponents.SECTION, unequal.SECTION)
PERIOD = 36.5


def made_up(scene: Scene) -> Run:
    """An orbit, or a steady vesicle, as if it were this scene's run; whatever the scene, of one period."""
    run = orbit(len(scene.vesicles), scene.flow.kind if scene.flow else None, scene.adhesion is not None)
    return replace(
        run,
        scene=scene,
        period=PERIOD if len(scene.vesicles) == 2 and scene.flow else None,
        effective_aspect_ratio=2.5,
        inclination_angle=31.0,
        viscosity=Viscosity(1.97, 1.85, 0.12),
        energy=Energy(8.0, -3.0),
    )


def traced(case: StudyCase) -> Boundary:
    """A boundary that the line 0.1 + 0.55·x describes."""
    study = case.study
    points = [
        BoundaryPoint(
            parameters={study.sweep.parameter: at},
            bracket=(0.1 + 0.55 * at, 0.11 + 0.55 * at),
            outcomes=("separated", "bound"),
            status="converged",
            certified=False,
            runs=[],
        )
        for at in study.sweep.values
    ]
    return Boundary(
        study_key=study.key,
        study=study.model_dump(mode="json"),
        name=study.name,
        points=points,
        updated=datetime(2026, 1, 1, tzinfo=UTC),
    )


def chapter(section: Section, store: Store) -> Chapter:
    """The quick chapter, whatever it plans being in the store as made up."""
    course = section.course(True)
    plan = next(course)
    while True:
        for case in plan.cases:
            if not store.contains(case.key):
                store.save(made_up(case.scene))
        for case in plan.studies:
            store.save_boundary(traced(case))
        try:
            plan = course.send(Results(store))
        except StopIteration as finished:
            return finished.value


@pytest.fixture(scope="module")
def chapters(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Chapter]]:
    with Store.open(tmp_path_factory.mktemp("paper") / "store") as store:
        yield {section.name: chapter(section, store) for section in SECTIONS}


def rows(chapter: Chapter) -> dict[str, Row]:
    return {
        row.quantity: row for part in chapter.content if not isinstance(part, str | Drawing) for row in part
    }


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.name)
def test_every_section_compares_and_draws(
    section: Section, chapters: dict[str, Chapter], tmp_path: Path
) -> None:
    drawings = [part for part in chapters[section.name].content if isinstance(part, Drawing)]
    assert drawings
    assert rows(chapters[section.name])
    for drawing in drawings:
        save(drawing.figure, tmp_path / f"{drawing.name}.svg")


def test_published_vesicles_are_listed_only_where_the_exact_ones_deviate(
    chapters: dict[str, Chapter],
) -> None:
    found = rows(chapters["shear"])
    assert found["period, H = 1.5, shear rate 0.5"].deviation == pytest.approx(100 * (PERIOD / 36.34 - 1))
    listed = {name for name in found if name.endswith("published vesicles")}
    deviating = {name for name, row in found.items() if name.startswith("shear rate") and row.agrees is False}
    assert listed
    assert listed == {f"{name}, published vesicles" for name in deviating - listed}


def test_brackets_and_their_line_stand_beside_the_published(chapters: dict[str, Chapter]) -> None:
    found = rows(chapters["critical-hamaker"])
    assert found["H_c at shear rate 0.5"].published == (0.3, 0.4)
    assert found["H_c at shear rate 0.5"].computed == pytest.approx((0.375, 0.385))
    assert found["H_c at shear rate 0.5"].agrees is True
    seen = [row for name, row in found.items() if name.startswith("at T = 100")]
    assert [row.published for row in seen] == ["separated", "bound"] * 3
    assert all(row.computed == "bound" for row in seen)


def test_parts_of_the_viscosity_are_compared(chapters: dict[str, Chapter]) -> None:
    found = rows(chapters["viscosity"])
    assert found["[μ], doublet, bending and tension, reduced area 0.707"].computed == 1.85
    assert found["[μ], doublet, adhesion, published vesicles"].published == 0.36
    assert found["[μ], single vesicle, reduced area 0.9044"].published == 1.811
    assert found["inclination, reduced area 0.9044"].deviation == pytest.approx(31.0 - 31.31)


def test_both_published_kinds_of_vesicles_are_what_they_say() -> None:
    exact, published_run = Doublet(1.5), Doublet(1.5, as_published=True)
    assert {vesicle.reduced_area for vesicle in exact.case.scene.vesicles} == {0.9}
    (vesicle,) = {vesicle.reduced_area for vesicle in published_run.case.scene.vesicles}
    assert vesicle == 0.9044
    assert published_run.case.scene.vesicles[0].length == pytest.approx(0.99755 * 2 * math.pi, rel=1e-6)
    scene = published_run.until_published_horizon.scene
    assert (scene.horizon, scene.criteria.extensions) == (100.0, 1.0)
    assert scene.criteria.revolutions > scene.horizon


def test_what_is_seen_at_the_end_is_how_far_apart_a_pair_is_and_whither_it_goes() -> None:
    run = replace(orbit(), outcome=Outcome.UNDECIDED)  # its line of centers turns by 8 radians
    half_turn = np.linspace(0, -np.pi, 41)
    growing = np.linspace(3.0, 10.0, 41)
    leaving = replace(run, series=dict(run.series) | {"center_distance": growing, "center_angle": half_turn})
    sliding = replace(run, series=dict(run.series) | {"center_distance": growing})
    turned_back = np.append(growing[1:], 9.9)
    returning = replace(leaving, series=dict(leaving.series) | {"center_distance": turned_back})
    assert critical_hamaker.seen_at_the_end(run) == "bound"
    assert critical_hamaker.seen_at_the_end(sliding) == "bound"
    assert critical_hamaker.seen_at_the_end(leaving) == "separated"
    assert critical_hamaker.seen_at_the_end(returning) == "bound"
    assert critical_hamaker.seen_at_the_end(replace(run, outcome=Outcome.SEPARATED)) == "separated"


def test_a_doublet_slides_by_its_last_turn_alone() -> None:
    run = replace(orbit(), period=20.0)
    distance = np.where(run.series["time"] < 20, 6.0, 2.6)
    distance[-5] = 3.9
    assert shear.opening(
        replace(run, series=dict(run.series) | {"center_distance": distance})
    ) == pytest.approx(1.5)


def test_the_jeffery_period_of_the_ratio_is_the_period() -> None:
    ratio = shear.jeffery_ratio(36.34, 0.5)
    assert 2 * math.pi / 0.5 * (ratio + 1 / ratio) == pytest.approx(36.34)
    assert ratio == pytest.approx(2.49, abs=0.005)  # the paper's table


def test_the_area_of_a_period_lies_between_its_neighbors() -> None:
    known = [(0.9, 37.0), (0.91, 39.0), (0.92, 36.0)]
    assert shear.area_of_period(known, 38.0) == pytest.approx(0.905)
    assert shear.area_of_period(known, 36.5) == pytest.approx(0.91 + 0.01 * 2.5 / 3)
    assert shear.area_of_period(known, 41.0) is None


def test_the_share_of_a_membrane_that_touches_another() -> None:
    run = orbit()
    assert unequal.contact_share(run) == pytest.approx(unequal.contact_share(run)[::-1], abs=0.02)
    center = run.frames.center.copy()
    center[-1, 1] += 50.0
    assert unequal.contact_share(replace(run, frames=replace(run.frames, center=center))) == (0.0, 0.0)


def test_a_straight_line_is_found_with_its_uncertainty() -> None:
    line = straight_line([0.25, 0.5, 1.0], [0.24, 0.38, 0.67])
    assert line.slope == pytest.approx(0.5743, abs=1e-3)
    assert line.slope_error > 0
    with pytest.raises(ValueError, match="at least 3"):
        straight_line([0, 1], [0, 1])


@pytest.mark.parametrize("exponents_of", list(exponents._BINDING))
def test_binding_energies_are_those_of_parallel_lines(exponents_of: tuple[int, int]) -> None:
    m, n = exponents_of

    def energy(separation: np.ndarray) -> np.ndarray:
        """∫ of the potential along a line at this separation, over H·δ (∫ r^−k dx by the beta function)."""
        attraction, repulsion = (
            math.sqrt(math.pi) * gamma((k - 1) / 2) / gamma(k / 2) * separation ** (1 - k) for k in (n, m)
        )
        return repulsion - m / n * attraction

    assert -energy(np.linspace(0.8, 1.0, 20001)).min() == pytest.approx(
        exponents._BINDING[exponents_of], rel=1e-4
    )


def test_lines_through_brackets_are_bounded_by_their_corners() -> None:
    intercepts, slopes = critical_hamaker.lines_through({0.5: (1.0, 2.0), 1.0: (3.0, 3.5), 1.5: (4.0, 6.0)})
    assert slopes == pytest.approx((2.0, 5.0))  # (0.5, 2) to (1, 3); (0.5, 1) to (1, 3.5)
    assert intercepts == pytest.approx((-1.5, 1.0))
