"""Steady states: Newton's method, their eigenvalues, and branches of them."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.membrane.geometry import Geometry
from solver.membrane.resampling import resampled_angle
from solver.motion.equation import conserved_quantities
from solver.motion.terms import accurate_equation
from solver.scene import Numerics, PowerLaw, Scene, Shear, Start, Trap, Vesicle
from solver.simulation.initial_state import placed_state
from solver.simulation.resolution import with_points
from solver.simulation.simulate import simulate
from solver.simulation.steady_scenes import SteadyBranch, find_steady_state, follow_steady_states
from solver.simulation.vesicle_shapes import Shapes
from solver.steady_states.continuation import Limits, OutsideParameterError
from solver.steady_states.newton import NoSteadyStateError, correction, steady_state
from solver.steady_states.stability import Perturbations
from solver.steady_states.steady_equations import SteadyEquations, with_all_vesicles
from tests.solver.scenes import uneven_pair

Array = NDArray[np.float64]


def equations_of(scene: Scene) -> SteadyEquations:
    return SteadyEquations(accurate_equation(scene.vesicles, scene), scene)


def trapped(rate: float, reduced_area: float = 0.8, points: int = 64) -> Scene:
    """The published trap: H = 0.7, δ = 0.4, started from the doublet at rest."""
    return Scene(
        horizon=2000.0,
        vesicles=tuple(Vesicle(reduced_area=reduced_area, center=(x, 0.0)) for x in (-1.1, 1.1)),
        adhesion=PowerLaw(hamaker=0.7, distance=0.4),
        flow=Trap(rate=rate),
        start=Start(relaxed=True),
        numerics=Numerics(points=points),
    )


def treading(contrast: float, points: int = 64) -> Scene:
    return Scene(
        horizon=4000.0,
        vesicles=(Vesicle(reduced_area=0.8, viscosity_contrast=contrast),),
        flow=Shear(rate=1.0),
        numerics=Numerics(points=points),
    )


@cache
def rest_of(scene: Scene) -> Shapes:
    """Where a run of the scene comes to rest."""
    frames = simulate(scene).frames
    return Shapes(frames.tangent_angle[-1], frames.center[-1])


def finer(shapes: Shapes, points: int) -> Shapes:
    angles = np.array([resampled_angle(angle[None], points)[0] for angle in shapes.tangent_angle])
    return Shapes(angles, shapes.center)


def test_determining_rows_are_the_derivatives_of_what_is_kept() -> None:
    scene = uneven_pair(numerics=Numerics(points=48))
    equations, state = equations_of(scene), placed_state(scene)
    rows = equations.determining_rows(state)[: 3 * 2]
    change = np.random.default_rng(1).standard_normal(state.size)

    def kept(size: float) -> Array:
        return conserved_quantities(Geometry(equations.membranes, state + size * change))

    differences = (8 * (kept(1e-3) - kept(-1e-3)) - kept(2e-3) + kept(-2e-3)) / 12e-3
    np.testing.assert_allclose(rows @ change, differences, rtol=0, atol=1e-9)


def test_newton_converges_quadratically_to_rest_with_the_area_asked_for() -> None:
    scene = trapped(0.08)
    equations = equations_of(scene)
    near = rest_of(scene)
    state = equations.membranes.pack(near.tangent_angle, near.center)
    lengths = []
    for _ in range(3):
        step = correction(equations, state)
        lengths.append(np.abs(step).max())
        state = state + step
    assert lengths[1] < 10 * lengths[0] ** 2 + 1e-8
    assert lengths[2] < 1e-9
    geometry = Geometry(equations.membranes, state)
    # The rate leads areas back as fast as the error in space changes them: 3e-12 at 64 points.
    np.testing.assert_allclose(conserved_quantities(geometry)[:2], 0.8, rtol=0, atol=1e-11)
    assert np.abs(equations.residual(state)).max() < 1e-8


def test_a_steady_state_is_where_a_run_comes_to_rest() -> None:
    scene = treading(3.0)
    run = simulate(scene)
    found = find_steady_state(scene, rest_of(scene))
    assert found.outcome is run.outcome
    assert found.stable
    assert found.inclination_angle == pytest.approx(run.inclination_angle, abs=1e-3)
    assert found.viscosity
    assert run.viscosity
    assert found.viscosity.total == pytest.approx(run.viscosity.total, abs=1e-4)


def test_what_is_far_from_any_steady_state_is_refused() -> None:
    scene = trapped(0.3)
    with pytest.raises(NoSteadyStateError):
        find_steady_state(scene, rest_of(trapped(0.08)))


def test_at_rest_perturbations_decay_without_oscillations() -> None:
    """Without a flow the motion descends the energy: a gradient flow has real eigenvalues."""
    scene = trapped(0.08).model_copy(update={"flow": None, "start": Start()})
    found = find_steady_state(scene, rest_of(scene))
    assert found.stable
    assert np.all(found.eigenvalues.imag == 0)
    assert np.all(found.eigenvalues.real < 0)


def test_the_eigenvalue_of_a_treading_vesicle_is_the_rate_at_which_a_run_returns() -> None:
    scene = treading(3.0)
    equations = equations_of(scene)
    near = rest_of(scene)
    state = steady_state(equations, equations.membranes.pack(near.tangent_angle, near.center))
    perturbations = Perturbations.of(equations, state)
    # Long before the end the run is on the slowest way back.
    run = simulate(scene.model_copy(update={"numerics": Numerics(points=64, tolerance=1e-8)}))
    time, angle = run.series["time"], run.series["inclination_angle"]
    late = (time > 25) & (time < 35)
    distance = np.abs(angle[late] - np.radians(find_steady_state(scene, near).inclination_angle or 0))
    decay = np.polyfit(time[late], np.log(distance), 1)[0]
    assert perturbations.fastest_growth == pytest.approx(decay, rel=0.02)


def test_a_pair_has_the_eigenvalues_of_a_vesicle_with_its_image_and_more() -> None:
    scene = trapped(0.08)
    near = rest_of(scene)
    half = SteadyEquations(accurate_equation(scene.vesicles[:1], scene), scene)
    state = half.membranes.pack(near.tangent_angle[:1], near.center[:1])
    state = steady_state(half, state)
    symmetric = Perturbations.of(half, state).eigenvalues[:4]
    every = Perturbations.of(equations_of(scene), with_all_vesicles(half.membranes, state)).eigenvalues[:12]
    for value in symmetric:
        assert np.abs(every - value).min() < 1e-4 * abs(value)
    assert np.abs(every[:, None] - symmetric).min(axis=1).max() > 0.01  # others break the symmetry


def rate_branch(points: int) -> SteadyBranch:
    near = finer(rest_of(trapped(0.093)), points)

    def scene_at(rate: float) -> Scene:
        return trapped(rate, points=points)

    return follow_steady_states(scene_at, 0.0935, near, Limits(np.inf), upward=True)


def test_side_by_side_ends_at_a_fold_whatever_the_number_of_points() -> None:
    branch, finer_branch = rate_branch(64), rate_branch(96)
    (fold,), (finer_fold,) = branch.folds, finer_branch.folds
    assert not branch.crossings
    assert fold.parameter == pytest.approx(finer_fold.parameter, abs=1e-9)
    # A perturbation begins to grow where the branch turns, and the branch returns to its first rate.
    assert abs(fold.state.eigenvalues[0]) < 1e-4
    stable = [point.state.stable for point in branch.points]
    assert stable == sorted(stable, reverse=True)
    assert branch.points[-1].parameter == branch.points[0].parameter
    assert max(point.parameter for point in branch.points) <= fold.parameter


def test_runs_agree_with_the_fold() -> None:
    """Just below the fold a run that starts on the branch stays, just above it leaves."""
    (fold,) = rate_branch(64).folds
    equations = equations_of(trapped(fold.parameter - 1e-4))
    shapes = fold.state.shapes
    state = equations.membranes.pack(shapes.tangent_angle, shapes.center)
    assert np.abs(correction(equations, state)).max() < 0.2
    with pytest.raises(NoSteadyStateError):
        steady_state(equations_of(trapped(fold.parameter + 1e-4)), state)


def test_tip_to_tip_begins_at_a_crossing() -> None:
    scene = trapped(0.06)
    near = rest_of(trapped(0.1))
    branch = follow_steady_states(lambda rate: trapped(rate), 0.1, near, Limits(0.03), upward=False)
    (crossing,) = branch.crossings
    assert not branch.folds
    assert scene.flow
    assert [point.state.stable for point in branch.points] == [
        point.parameter > crossing.parameter for point in branch.points
    ]
    assert crossing.state.outcome == "end-to-end"
    assert abs(crossing.state.eigenvalues[0]) < 1e-5


def test_treading_ends_at_a_fold() -> None:
    branch = follow_steady_states(treading, 4.1, rest_of(treading(4.1)), Limits(np.inf), upward=True)
    (fold,) = branch.folds
    assert 4.1 < fold.parameter < 4.3
    assert simulate(treading(fold.parameter * 1.02)).outcome == "tumbling"
    assert simulate(treading(fold.parameter * 0.98)).outcome == "steady"


def test_a_branch_ends_where_the_scene_allows_no_more() -> None:
    def scene_at(reduced_area: float) -> Scene:
        if reduced_area > 0.803:
            raise OutsideParameterError("reduced_area: at most 0.803")
        return trapped(0.08, reduced_area)

    branch = follow_steady_states(scene_at, 0.8, rest_of(trapped(0.08)), Limits(1.0), upward=True)
    assert "0.803" in branch.ended
    assert branch.points[-1].parameter == pytest.approx(0.803, abs=1e-4)


def test_a_branch_ends_exactly_at_the_value_asked_for() -> None:
    near = rest_of(trapped(0.05))
    branch = follow_steady_states(lambda area: trapped(0.05, area), 0.8, near, Limits(0.85), upward=True)
    assert branch.points[-1].parameter == 0.85  # which is not 0.85 / 0.8 · 0.8


def test_a_branch_with_both_vesicles_changed_apart_loses_its_symmetry() -> None:
    def scene_at(reduced_area: float) -> Scene:
        scene = trapped(0.05)
        first = scene.vesicles[0].model_copy(update={"reduced_area": reduced_area})
        return scene.model_copy(update={"vesicles": (first, scene.vesicles[1])})

    branch = follow_steady_states(scene_at, 0.8, rest_of(trapped(0.05)), Limits(0.81), upward=True)
    assert branch.points[-1].parameter == 0.81
    shapes = branch.points[-1].state.shapes
    scene = with_points(scene_at(0.81), 64)
    areas = Geometry(
        equations_of(scene).membranes, equations_of(scene).membranes.pack(shapes.tangent_angle, shapes.center)
    ).areas
    np.testing.assert_allclose(areas / np.pi, [0.81, 0.8], rtol=0, atol=1e-11)
