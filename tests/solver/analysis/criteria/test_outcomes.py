"""How runs end: each outcome reached by a real run, as soon as it is decided."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from solver.analysis.run import Outcome, Run
from solver.scene import Criteria, Extension, PowerLaw, Scene, Shear, Start, Trap, Vesicle
from solver.simulation.simulate import simulate
from tests.solver.scenes import shear_pair

Array = NDArray[np.float64]


def followed(scene: Scene) -> tuple[Run, float]:
    """A run, and when its last step began."""
    ends = [0.0]
    run = simulate(scene, after_step=lambda simulation: ends.append(simulation.time))
    return run, ends[-2]


def test_weak_adhesion_separates() -> None:
    run, last_step = followed(shear_pair(0.1))
    assert run.outcome is Outcome.SEPARATED
    distance = run.series["center_distance"]
    assert distance[-1] == pytest.approx(12.0, abs=1e-9)
    assert np.all(distance[run.series["time"] <= last_step] < 12.0)
    assert run.period is None
    assert run.viscosity is None


def rotation(run: Run) -> Array:
    """By how much the line of centers has turned."""
    angle = run.series["center_angle"]
    return np.abs(angle - angle[0])


# The line of centers begins along the flow.  Three half turns after it first stood across it, which is the
# least that tells, the motion of a strongly bound pair has settled.
SETTLED = 0.5 * np.pi + 3 * np.pi


def test_strong_adhesion_binds_as_soon_as_the_motion_has_settled() -> None:
    run, last_step = followed(shear_pair(3.5))
    assert run.outcome is Outcome.BOUND
    assert run.settled
    assert run.undecided is None
    assert rotation(run)[-1] >= SETTLED
    assert np.all(rotation(run)[run.series["time"] <= last_step] < SETTLED)


@pytest.fixture(scope="module")
def bound() -> Run:
    return simulate(shear_pair(3.5))


def test_a_bound_pair_has_a_period_and_a_viscosity(bound: Run) -> None:
    assert 1.75 * bound.period == pytest.approx(bound.time, rel=0.1)
    assert bound.viscosity
    assert bound.viscosity.total == pytest.approx(bound.viscosity.bending_tension + bound.viscosity.adhesion)
    assert bound.effective_aspect_ratio
    aspect = bound.effective_aspect_ratio
    assert 2 * np.pi / 0.5 * (aspect + 1 / aspect) == pytest.approx(bound.period, rel=1e-12)


def test_the_viscosity_is_the_average_over_the_last_turn(bound: Run) -> None:
    assert bound.viscosity
    assert bound.period
    time = bound.series["time"]
    end = CubicSpline(rotation(bound), time)(SETTLED)
    fine = np.linspace(end - bound.period, end, 4001)
    for name, value in (
        ("viscosity_bending_tension", bound.viscosity.bending_tension),
        ("viscosity_adhesion", bound.viscosity.adhesion),
    ):
        assert np.mean(np.interp(fine, time, bound.series[name])) == pytest.approx(value, rel=2e-3)


def test_more_revolutions_take_longer(bound: Run) -> None:
    run = simulate(shear_pair(3.5, criteria=Criteria(revolutions=3)))
    assert run.outcome is Outcome.BOUND
    assert bound.period is not None
    assert run.time - bound.time == pytest.approx(1.5 * bound.period, rel=0.03)


def test_the_horizon_leaves_a_run_undecided() -> None:
    run = simulate(shear_pair(3.5, horizon=5.0))
    assert run.outcome is Outcome.UNDECIDED
    assert run.time == 5.0
    assert run.undecided == "the pair has made 0 full turns since it first stood across the flow"
    assert (run.period, run.settled) == (None, None)


def test_a_scene_of_three_vesicles_is_completed_at_its_horizon() -> None:
    vesicles = tuple(Vesicle(center=(3.0 * i, 0.0)) for i in range(3))
    run = simulate(Scene(horizon=0.5, vesicles=vesicles, flow=Shear(rate=0.5)))
    assert run.outcome is Outcome.COMPLETED
    assert run.time == 0.5
    assert run.undecided is None


def far_apart(direction: float, flow: Extension | Shear) -> Scene:
    center = (6.5 * np.cos(direction), 6.5 * np.sin(direction))
    vesicles = (Vesicle(center=(-center[0], -center[1])), Vesicle(center=center))
    return Scene(horizon=0.5, vesicles=vesicles, flow=flow)


def test_a_pair_that_comes_closer_is_not_separated_however_far_apart() -> None:
    assert simulate(far_apart(0.0, Extension(rate=0.1))).outcome is Outcome.UNDECIDED


def test_a_pair_that_starts_beyond_the_distance_is_separated_half_as_far_again() -> None:
    """Straight out the distance grows nearly as exp(rate·time)."""
    scene = far_apart(np.pi / 2, Extension(rate=0.1)).model_copy(update={"horizon": 10.0})
    run = simulate(scene)
    assert run.outcome is Outcome.SEPARATED
    assert run.series["center_distance"][-1] == pytest.approx(1.5 * 13.0, abs=1e-6)
    assert run.time == pytest.approx(np.log(1.5) / 0.1, rel=0.03)


def test_a_pair_at_rest_beyond_the_distance_is_not_separated() -> None:
    scene = far_apart(0.0, Extension(rate=0.0)).model_copy(update={"flow": None, "horizon": 30.0})
    assert simulate(scene).outcome is Outcome.EQUILIBRIUM


def test_the_separated_distance_is_the_scene_s() -> None:
    near, far = (simulate(shear_pair(0.1, criteria=Criteria(separated_distance=d))) for d in (5.0, 8.0))
    assert near.outcome is far.outcome is Outcome.SEPARATED
    assert near.series["center_distance"][-1] == pytest.approx(5.0, abs=1e-6)
    assert far.series["center_distance"][-1] == pytest.approx(8.0, abs=1e-6)
    assert near.time < far.time


def test_a_tank_treading_vesicle_is_steady() -> None:
    run = simulate(Scene(horizon=100.0, vesicles=(Vesicle(),), flow=Shear(rate=0.5)))
    assert run.outcome is Outcome.STEADY
    assert run.time < 50
    assert run.viscosity
    assert run.inclination_angle
    assert 0 < run.inclination_angle < 45


def test_a_pair_at_rest_reaches_equilibrium() -> None:
    vesicles = (Vesicle(center=(-1.3, 0.0)), Vesicle(center=(1.3, 0.0)))
    scene = Scene(horizon=200.0, vesicles=vesicles, adhesion=PowerLaw(hamaker=1.0, distance=0.4))
    run = simulate(scene)
    assert run.outcome is Outcome.EQUILIBRIUM
    quiet = run.series["time"] > run.time - scene.criteria.steady_time
    assert np.max(run.series["state_rate"][quiet]) < scene.criteria.steady_rate
    assert run.period is None
    assert run.viscosity is None


def trapped(rate: float, tilt: float = 1e-2) -> Scene:
    """The published trap: reduced area 0.8, H = 0.7, started from the doublet at rest."""
    return Scene(
        horizon=1000.0,
        vesicles=(
            Vesicle(reduced_area=0.8, center=(-1.2, 0.0)),
            Vesicle(reduced_area=0.8, center=(1.2, 0.0)),
        ),
        adhesion=PowerLaw(hamaker=0.7, distance=0.4),
        flow=Trap(rate=rate),
        start=Start(relaxed=True, tilt=tilt),
    )


@pytest.mark.parametrize(
    ("rate", "outcome"), [(0.08, Outcome.BOUND), (0.098, Outcome.END_TO_END), (0.3, Outcome.SEPARATED)]
)
def test_the_three_outcomes_in_a_trap(rate: float, outcome: Outcome) -> None:
    """The published critical rate is between 0.09 and 0.10, where side by side becomes tip to tip."""
    run = simulate(trapped(rate))
    assert run.outcome is outcome
    assert run.inclination_angle is not None
    if outcome is Outcome.BOUND:
        assert 90 < run.inclination_angle < 180
    else:
        assert run.inclination_angle == pytest.approx(180, abs=1)


@pytest.mark.parametrize(("rate", "tilt", "outcome"), [(0.14, 0.0, "separated"), (0.1, 1e-8, "end-to-end")])
def test_a_pair_does_not_stay_in_an_unstable_state(rate: float, tilt: float, outcome: str) -> None:
    """On the diverging axis the pair rests, and any perturbation tears it away."""
    run = simulate(trapped(rate, tilt))
    assert run.outcome == outcome
    assert len(run.perturbations) == 1


def test_a_perturbation_that_is_there_grows_by_itself() -> None:
    run = simulate(trapped(0.09, tilt=1e-2))
    assert run.outcome is Outcome.BOUND
    assert run.perturbations == ()


def test_a_slow_motion_is_no_rest() -> None:
    scene = Scene(
        horizon=100.0,
        vesicles=(Vesicle(center=(-1.5, 0.0)), Vesicle(center=(1.5, 0.0))),
        adhesion=PowerLaw(hamaker=1e-4, distance=0.4),
    )
    run = simulate(scene)
    assert run.series["state_rate"][-1] < scene.criteria.steady_rate
    assert run.outcome is Outcome.UNDECIDED
