"""What breaks the symmetry of a pair: its growth, beside eigenvalues where the pair rests."""

from __future__ import annotations

import numpy as np
import pytest

from solver.motion.terms import accurate_equation
from solver.scene import Numerics, PowerLaw, Scene, Shear, Start, Trap, Vesicle
from solver.simulation.broken_symmetry import symmetry_breaking, symmetry_growth
from solver.simulation.simulate import simulate
from solver.simulation.steady_scenes import find_steady_state
from solver.simulation.vesicle_shapes import Shapes
from solver.steady_states.stability import Perturbations
from solver.steady_states.steady_equations import SteadyEquations


def pair(**fields: object) -> Scene:
    return Scene.model_validate(
        {
            "horizon": 2000.0,
            "vesicles": [Vesicle(reduced_area=0.9, center=(x, 0.0)) for x in (-1.2, 1.2)],
            "adhesion": PowerLaw(hamaker=0.7, distance=0.4),
            "numerics": Numerics(points=48, tolerance=1e-5),
        }
        | fields
    )


def antisymmetric_growth(scene: Scene, shapes: Shapes) -> float:
    """The largest eigenvalue of those whose perturbation turns the two vesicles differently."""
    equations = SteadyEquations(accurate_equation(scene.vesicles, scene), scene)
    membranes = equations.membranes
    state = membranes.pack(shapes.tangent_angle, shapes.center)
    perturbations = Perturbations.of(equations, state)
    for index, eigenvalue in enumerate(perturbations.eigenvalues):
        first, second = membranes.tangent_angle(perturbations.direction(index))
        if np.abs(first + second).max() < 1e-3 * np.abs(first - second).max():
            return float(eigenvalue.real)
    raise AssertionError("all perturbations keep the symmetry")


def test_at_rest_the_growth_is_the_largest_eigenvalue_that_breaks_the_symmetry() -> None:
    scene = pair(flow=Trap(rate=0.05), start=Start(relaxed=True))
    frames = simulate(scene).frames
    shapes = find_steady_state(scene, Shapes(frames.tangent_angle[-1], frames.center[-1])).shapes
    expected = antisymmetric_growth(scene, shapes)
    assert expected < 0
    assert symmetry_growth(scene, shapes, 40.0) == pytest.approx(expected, rel=0.02)


def test_a_doublet_in_shear_returns_to_its_symmetry_whatever_the_numerics() -> None:
    scene = pair(flow=Shear(rate=0.5), adhesion=PowerLaw(hamaker=1.0, distance=0.4))
    run = simulate(scene)
    assert run.settled
    breaking = symmetry_breaking(run)
    assert breaking.stable
    assert breaking.factor == pytest.approx(np.exp(breaking.growth_rate * breaking.period))
    finer = simulate(scene.model_copy(update={"numerics": Numerics(points=64, tolerance=1e-6)}))
    assert symmetry_breaking(finer).growth_rate == pytest.approx(breaking.growth_rate, rel=0.05)


def test_a_pair_without_a_symmetry_or_a_period_is_refused() -> None:
    scene = pair(flow=Shear(rate=0.5), horizon=2.0)
    with pytest.raises(ValueError, match="period"):
        symmetry_breaking(simulate(scene.model_copy(update={"horizon": 0.1})))
    first, second = scene.vesicles
    unequal = scene.model_copy(update={"vesicles": (first, second.model_copy(update={"reduced_area": 0.8}))})
    with pytest.raises(ValueError, match="vesicles"):
        symmetry_growth(unequal, Shapes(np.zeros((2, 48)), np.zeros((2, 2))), 1.0)
