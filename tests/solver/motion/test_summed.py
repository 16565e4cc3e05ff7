"""Many vesicles, by sums: the same motion as by matrices, whatever is near, and the tools that find it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from solver.forces import coarsened_adhesion
from solver.forces.adhesion import DirectAdhesion
from solver.forces.coarsened_adhesion import CoarsenedAdhesion
from solver.integrators import InitialValueProblem
from solver.integrators.bdf import BackwardDifferentiation
from solver.integrators.sdc import DeferredCorrection
from solver.membrane.geometry import Geometry, Membranes
from solver.motion.dense import DenseEquation
from solver.motion.summed import SummedEquation
from solver.motion.terms import dense_equation, equation_of_motion, summed_equation
from solver.parallel import SERIAL
from solver.potentials.neighbors import Neighbors, gap
from solver.potentials.proximity import Closeness
from solver.potentials.refinement import LARGEST_REFINED
from solver.scene import LARGEST_DENSE, Extension, Numerics, PowerLaw, Scene, Shear, Trap, Vesicle
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate
from tests.solver.steps import all_steps, equal_steps
from tests.solver.suspensions import suspension

Array = NDArray[np.float64]


def close_together(points: int, **fields: Any) -> Scene:
    """Five vesicles, two of them so close that sums over one are refined, two that are closer than that."""
    places = ((0.2, 0.0, 0.3), (1.75, 0.6, 1.2), (3.3, 0.3, 1.9), (0.3, 2.6, 2.8), (3.3, 3.0, 0.9))
    vesicles = tuple(
        Vesicle(reduced_area=0.9, length=4.5 + 0.3 * k, center=(x, y), angle=angle)
        for k, (x, y, angle) in enumerate(places)
    )
    defaults: dict[str, Any] = {
        "horizon": 1.0,
        "vesicles": vesicles,
        "numerics": Numerics(points=points, tolerance=1e-9),
    }
    return Scene(**defaults | fields)


@pytest.mark.parametrize(
    "fields",
    [
        {"flow": Shear(rate=0.8)},
        {"flow": Extension(rate=0.3), "adhesion": PowerLaw(hamaker=1.5, distance=0.3)},
        {"flow": Trap(rate=0.3), "adhesion": PowerLaw(hamaker=1.5, distance=0.3, exponents=(5, 3))},
        {"adhesion": PowerLaw(hamaker=1.5, distance=0.3, cutoff=1.2)},
    ],
    ids=["shear", "extension", "trap", "cutoff"],
)
def test_sums_and_matrices_give_the_same_motion(fields: dict[str, Any]) -> None:
    scene = close_together(64, **fields)
    state = placed_state(scene)
    matrices, sums = dense_equation(scene), summed_equation(scene, SERIAL)
    expected, found = matrices.motion(state), sums.motion(state)
    assert found.closeness
    assert expected.closeness
    factors = found.closeness.refinement(sums.layer.ratio).groups[:, 2]
    assert {2, 4} & set(factors)
    assert factors.max() > LARGEST_REFINED
    for name in ("velocity", "rotation_rate", "tension"):
        there, here = getattr(expected, name), getattr(found, name)
        np.testing.assert_allclose(here, there, rtol=0, atol=1e-9 * np.max(np.abs(there)), err_msg=name)
    if sums.adhesion:
        assert matrices.adhesion
        assert expected.adhesion is not None
        largest = np.max(np.abs(expected.adhesion))
        np.testing.assert_allclose(found.adhesion, expected.adhesion, rtol=0, atol=1e-11 * largest)
        energy = matrices.adhesion.energy(expected.geometry, expected.closeness)
        assert sums.adhesion.energy(found.geometry, found.closeness) == pytest.approx(energy, rel=1e-11)


def test_the_velocity_converges_spectrally_with_the_points() -> None:
    """Of the centers, which every number of points has, against twice the finest."""

    def centers(points: int) -> Array:
        scene = close_together(points, flow=Shear(rate=0.8))
        return summed_equation(scene, SERIAL).rate(placed_state(scene))[-10:]

    exact = centers(256)
    errors = [np.max(np.abs(centers(points) - exact)) for points in (32, 64, 128)]
    assert errors[1] < 0.05 * errors[0]
    assert errors[2] < 0.01 * errors[1]
    assert errors[2] < 1e-7


def test_membranes_do_not_stretch() -> None:
    scene = suspension(8, 64, 1e-6)
    sums = summed_equation(scene, SERIAL)
    motion = sums.motion(placed_state(scene))
    gradient = motion.geometry.arclength_derivative(motion.velocity)
    stretching = np.sum(motion.geometry.tangents * gradient, axis=0)
    assert np.max(np.abs(stretching)) < 100 * sums.inextensibility.tolerance * np.max(np.abs(gradient))


def test_the_last_tension_is_where_the_iteration_begins() -> None:
    scene = suspension(8)
    sums, state = summed_equation(scene, SERIAL), placed_state(scene)
    sums.rate(state)
    first = sums.inextensibility.iterations
    rate = sums.rate(state)
    assert sums.inextensibility.iterations <= first + 1
    fresh = summed_equation(scene, SERIAL).rate(state)
    left_over = 10 * sums.inextensibility.tolerance * np.max(np.abs(fresh))
    np.testing.assert_allclose(rate, fresh, rtol=0, atol=left_over)


def test_blocks_of_the_jacobian_are_those_of_vesicles_far_from_the_others() -> None:
    vesicles = tuple(
        Vesicle(reduced_area=0.8 + 0.05 * k, center=(40.0 * k, 1.0), angle=0.7 * k) for k in range(3)
    )
    scene = Scene(horizon=1.0, vesicles=vesicles, flow=Shear(rate=0.5))
    state = placed_state(scene)
    exact, found = dense_equation(scene).jacobian(state), summed_equation(scene, SERIAL).jacobian(state)
    for members, block in zip(found.members, found.blocks, strict=True):
        expected = exact.matrix[np.ix_(members, members)]
        np.testing.assert_allclose(block, expected, rtol=0, atol=2e-4 * np.max(np.abs(expected)))
    direction = np.random.default_rng(0).standard_normal(state.size)
    solve = found.solver(0.1)
    np.testing.assert_allclose(solve(direction - 0.1 * (found @ direction)), direction, rtol=0, atol=1e-9)


@pytest.mark.parametrize("cutoff", [None, 1.2])
def test_blocks_contain_how_others_draw_a_vesicle(cutoff: float | None) -> None:
    """Against differences of the adhesion force while one vesicle is shifted."""
    scene = suspension(4, 64, 1e-9, adhesion=PowerLaw(hamaker=1.0, distance=0.4, cutoff=cutoff))
    sums, state, step = summed_equation(scene, SERIAL), placed_state(scene), 1e-5
    assert sums.adhesion
    membranes = sums.membranes

    def drawn(shift: float) -> Array:
        moved = state.copy()
        moved[4 * membranes.points + 1] += shift  # the second one's center, x
        geometry = Geometry(membranes, moved)
        return sums.adhesion.density(geometry, Neighbors(geometry, sums.reach))[:, 1]  # type: ignore[union-attr]

    geometry = Geometry(membranes, state)
    stiffness = sums.adhesion.stiffness(geometry, Neighbors(geometry, sums.reach))[:, 1]
    expected = (drawn(step) - drawn(-step)) / (2 * step)
    np.testing.assert_allclose(stiffness[:2], expected, rtol=0, atol=1e-6 * np.max(np.abs(expected)))


def scattered(count: int, points: int) -> Geometry:
    """A suspension, in which most vesicles are far from each other."""
    scene = suspension(count, points)
    return Geometry(Membranes.of_scene(scene), placed_state(scene))


@pytest.mark.parametrize("accuracy", [1e-5, 1e-7, 1e-9])
@pytest.mark.parametrize("exponents", [(4, 2), (5, 3)])
def test_adhesion_between_far_vesicles_needs_few_of_their_points(
    accuracy: float, exponents: tuple[int, int]
) -> None:
    geometry = scattered(16, 64)
    potential = PowerLaw(hamaker=1.0, distance=0.4, exponents=exponents)
    near, everyone = Neighbors(geometry, 8.0), Closeness(geometry)
    sums = CoarsenedAdhesion(potential, accuracy, SERIAL)
    exact = DirectAdhesion(potential, 1e-12, geometry.membranes)
    expected = exact.density(geometry, everyone)
    allowed = 10 * accuracy * np.max(np.abs(expected))
    np.testing.assert_allclose(sums.density(geometry, near), expected, rtol=0, atol=allowed)
    assert sums.energy(geometry, near) == pytest.approx(exact.energy(geometry, everyone), rel=accuracy)
    stiffness = exact.stiffness(geometry, everyone)
    found = sums.stiffness(geometry, near)
    np.testing.assert_allclose(found, stiffness, rtol=0, atol=10 * accuracy * np.max(np.abs(stiffness)))


# --- Neighbors --------------------------------------------------------------------------------------------


def test_neighbors_are_those_found_among_all_pairs() -> None:
    scene = close_together(64)
    geometry = Geometry(dense_equation(scene).membranes, placed_state(scene))
    everyone, near = Closeness(geometry), Neighbors(geometry, 6.0)
    expected = np.where(everyone.distances <= 6.0, everyone.distances, np.inf)
    found = np.full_like(expected, np.inf)
    found[near.pairs[:, 0], near.pairs[:, 1]] = near.distances
    np.testing.assert_array_equal(found, expected)
    assert near.nearest == everyone.nearest


@pytest.mark.parametrize("apart", [1.0, 30.0])
def test_the_gap_is_found_however_far_apart_vesicles_are(apart: float) -> None:
    circles = tuple(
        Vesicle(reduced_area=1.0, length=2 * np.pi, center=(x, y))
        for x, y in ((0.0, 0.0), (2 + apart, 0.0), (0.0, 3 + apart))
    )
    scene = Scene(horizon=1.0, vesicles=circles)
    assert gap(Geometry(dense_equation(scene).membranes, placed_state(scene))) == pytest.approx(
        apart, rel=1e-3
    )


# --- In time ----------------------------------------------------------------------------------------------


def test_steps_with_blocks_converge_to_those_with_the_whole_jacobian() -> None:
    scene = suspension(4, 32, 1e-7)
    state = placed_state(scene)
    whole = dense_equation(scene)
    exact = all_steps(BackwardDifferentiation(InitialValueProblem(whole, state, 0.0, 0.5), 1e-8), 0.5)[
        -1
    ].state
    errors = []
    for tolerance in (1e-3, 1e-5):
        sums = summed_equation(scene, SERIAL)
        problem = InitialValueProblem(sums, state, 0.0, 0.5)
        steps = all_steps(BackwardDifferentiation(problem, tolerance), 0.5)
        errors.append(np.max(np.abs(steps[-1].state - exact)))
    assert errors[0] < 3e-2
    assert errors[1] < 3e-4


def test_deferred_correction_keeps_its_order_with_blocks() -> None:
    scene = suspension(4, 16, 1e-9, adhesion=None)
    sums = summed_equation(scene, SERIAL)
    problem = InitialValueProblem(sums, placed_state(scene), 0.0, 0.5)
    state = all_steps(BackwardDifferentiation(problem, 1e-4), 0.5)[-1].state

    def final(order: int, count: int) -> Array:
        method = DeferredCorrection(order)
        return equal_steps(method, sums, state, 0.25, count)[-1].state

    exact = final(5, 64)
    for order in (2, 3):
        errors = [np.max(np.abs(final(order, count) - exact)) for count in (16, 48)]
        # Less than the order by what the stiff modes take from it with any Jacobian.
        assert np.log(errors[0] / errors[1]) / np.log(3) > order - 0.6


def test_the_same_scene_gives_the_same_run_twice() -> None:
    first, second = (simulate(suspension(LARGEST_DENSE + 1, horizon=0.2)) for _ in range(2))
    assert first.failure is None
    assert first.work.tension_iterations
    np.testing.assert_array_equal(first.frames.center, second.frames.center)
    np.testing.assert_array_equal(first.frames.tangent_angle, second.frames.tangent_angle)


# --- What a scene becomes ---------------------------------------------------------------------------------


def test_few_vesicles_have_matrices_and_many_have_sums() -> None:
    few, many = suspension(LARGEST_DENSE), suspension(LARGEST_DENSE + 1)
    assert isinstance(equation_of_motion(few, SERIAL), DenseEquation)
    assert isinstance(equation_of_motion(many, SERIAL), SummedEquation)
    first = many.vesicles[0].model_copy(update={"viscosity_contrast": 2.0})
    thick = many.model_copy(update={"vesicles": (first, *many.vesicles[1:])})
    assert isinstance(equation_of_motion(thick, SERIAL), DenseEquation)


def test_terms_that_a_scene_lacks_are_never_constructed(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: Any) -> None:
        raise AssertionError("constructed")

    monkeypatch.setattr(coarsened_adhesion, "CoarsenedAdhesion", refuse)
    monkeypatch.setattr(coarsened_adhesion, "DirectAdhesion", refuse)
    scene = suspension(LARGEST_DENSE + 1, adhesion=None, flow=None)
    sums = summed_equation(scene, SERIAL)
    sums.rate(placed_state(scene))
    sums.jacobian(placed_state(scene))


@pytest.mark.parametrize(
    ("cutoff", "needless"), [(None, "DirectAdhesion"), (1.2, "CoarsenedAdhesion")], ids=["without", "with"]
)
def test_the_adhesion_that_a_cutoff_needs_is_the_only_one_constructed(
    cutoff: float | None, needless: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: Any) -> None:
        raise AssertionError("constructed")

    monkeypatch.setattr(coarsened_adhesion, needless, refuse)
    adhesion = PowerLaw(hamaker=1.0, distance=0.4, cutoff=cutoff)
    assert summed_equation(suspension(LARGEST_DENSE + 1, adhesion=adhesion), SERIAL).adhesion


def test_beyond_the_cutoff_many_vesicles_feel_nothing() -> None:
    geometry = scattered(9, 64)
    nearest = gap(geometry)
    potential = PowerLaw(hamaker=1.0, distance=0.1, cutoff=0.9 * nearest)
    adhesion = DirectAdhesion(potential, 1e-7, geometry.membranes)
    near = Neighbors(geometry, adhesion.reach)
    assert adhesion.energy(geometry, near) == 0
    assert not np.any(adhesion.density(geometry, near))
    assert not np.any(adhesion.stiffness(geometry, near))


def test_what_serves_few_vesicles_only_is_refused() -> None:
    integrator = Numerics(integrator="rosenbrock")
    with pytest.raises(ValidationError, match=r"numerics\.integrator"):
        suspension(LARGEST_DENSE + 1, numerics=integrator)
    suspension(LARGEST_DENSE, numerics=integrator)
