"""The sections of the paper's report: what they ask for, and what they read off runs."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ensemble.report.paper.case import Case
from ensemble.report.paper.sections import SECTIONS
from ensemble.report.paper.sections.contact_region import contact_region
from ensemble.report.paper.sections.draining import draining_time
from ensemble.report.paper.sections.equilibrium_energies import DoubletEnergy, least_energy_parameter
from solver.analysis.run import Outcome
from solver.simulation.simulate import simulate


@pytest.mark.parametrize("section", SECTIONS, ids=lambda section: section.name)
def test_a_section_asks_for_scenes_and_studies_that_are_valid(section) -> None:
    quick, full = (next(section.generate(quick)) for quick in (True, False))
    for plan in (quick, full):
        assert all(case.scene.horizon > 0 for case in plan.cases)
        assert all(case.study.sweep[0].values for case in plan.studies)
    values = [sum(len(case.study.sweep[0].values) for case in plan.studies) for plan in (quick, full)]
    assert len({case.key for case in quick.cases}) <= len({case.key for case in full.cases})
    assert values[0] <= values[1]


def test_draining_ends_when_the_energy_stays_within_a_percent() -> None:
    time = np.linspace(0, 20, 2001)
    run = SimpleNamespace(series={"time": time, "adhesion_energy": -3 * (1 - np.exp(-time))})
    assert draining_time(run) == pytest.approx(np.log(100), abs=0.011)
    run.series["adhesion_energy"][900] = -2.9  # it leaves once more, at t = 9
    assert draining_time(run) == pytest.approx(9.01)


def test_the_least_energy_is_found_between_the_values() -> None:
    def energies(minimum: float) -> list[DoubletEnergy]:
        return [
            DoubletEnergy(area, 10 - area, area - 20 + 7 * (area - minimum) ** 2)
            for area in (0.6, 0.7, 0.8, 0.9, 0.98)
        ]

    assert least_energy_parameter(energies(0.843)) == pytest.approx(0.843, abs=1e-5)
    assert least_energy_parameter(energies(0.5)) is None


@pytest.fixture(scope="module")
def doublet():
    run = simulate(
        Case.of("doublet-equilibrium", {"vesicles.reduced_area": 0.95, "numerics.points": 64}).scene
    )
    assert run.outcome is Outcome.EQUILIBRIUM
    return run


def test_the_contact_region_is_measured_where_it_is(doublet) -> None:
    contact = contact_region(doublet)
    # Seen at the points alone; a run measures its gap between them, too.
    assert doublet.gap <= contact.gap.min() < 1.005 * doublet.gap
    assert contact.middle_gap > contact.gap.min()
    assert 0 < contact.dip < 0.2
    # It lies symmetrically about the line of centers, and its ends are far apart.
    np.testing.assert_allclose(contact.along, -contact.along[::-1], atol=1e-3)
    assert contact.gap[0] > 5 * contact.gap.min()


def test_the_adhesive_force_repels_inside_the_contact_region_and_attracts_around_it(doublet) -> None:
    contact = contact_region(doublet)
    assert contact.pull_in_middle < 0
    assert contact.pull_at_edge < contact.pull_in_middle
    assert contact.pull[0] > 0
    # A vesicle at rest feels no net force; what is left is the far side, which attracts weakly.
    arclength = np.append(0, np.cumsum(np.hypot(np.diff(contact.along), np.diff(contact.gap / 2))))
    net = np.trapezoid(contact.pull, arclength)
    assert abs(net) < 0.1 * np.trapezoid(np.abs(contact.pull), arclength)


def test_a_pair_meets_in_an_extensional_flow_as_in_a_trap() -> None:
    changes = {"vesicles.1.center": [2.5, 0.1], "horizon": 10.0, "numerics.points": 32}
    flow, trap = (
        simulate(Case.of("pair-extension", changes | {"flow.kind": kind}).scene)
        for kind in ("extension", "trap")
    )
    assert flow.outcome is trap.outcome is Outcome.UNDECIDED
    np.testing.assert_allclose(flow.series["center_distance"], trap.series["center_distance"], rtol=2e-4)
    np.testing.assert_allclose(flow.series["center_angle"], trap.series["center_angle"], atol=2e-4)
    drift = flow.frames.center[-1].mean(axis=0) - trap.frames.center[-1].mean(axis=0)
    assert np.abs(drift).max() > 0.05, "the flow that is not moved carries the pair away"
