"""Free vesicles at rest against the Euler–Lagrange equation, solved here by shooting.

A shape of least ½∫κ² ds at fixed length and area satisfies κ'' + κ³/2 − σκ = p, with constants σ and p
(tension and pressure).  It shares nothing with the solver.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import root

from solver.analysis.run import Outcome
from solver.integrators import InitialValueProblem, integrator_for
from solver.membrane.shapes import ellipse_tangent_angle, of_reduced_area
from solver.motion.terms import dense_equation
from solver.scene import Criteria, Numerics, Scene, Vesicle
from solver.simulation.simulate import simulate

Array = NDArray[np.float64]

REDUCED_AREAS = (0.98, 0.93, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55, 0.5, 0.45, 0.4, 0.35, 0.3)


def quarter(unknowns: Array) -> Array:
    """What a quarter of the curve, from tip to flank, misses, its reduced area and four times its ∫κ² ds.

    unknowns : κ at the tip, σ and p; the curve has the length 2π
    """
    tip, sigma, pressure = unknowns

    def change(_: float, state: Array) -> list[float]:
        theta, kappa, slope, x, *_ = state
        return [
            kappa,
            slope,
            sigma * kappa - kappa**3 / 2 + pressure,
            np.cos(theta),
            np.sin(theta),
            kappa**2,
            x * np.sin(theta),
        ]

    start = [np.pi / 2, tip, 0.0, 0.0, 0.0, 0.0, 0.0]
    theta, _, slope, x, y, square, moment = solve_ivp(
        change, (0, np.pi / 2), start, method="DOP853", rtol=1e-13, atol=1e-13
    ).y[:, -1]
    return np.array([slope, theta - np.pi, 4 * (moment - x * y) / np.pi, 4 * square])


@cache
def curvature_energies() -> dict[float, float]:
    """∫κ² ds by reduced area, each shape computed from the one before."""
    energies = {}
    unknowns = np.array([1.4, -2.5, 3.0])  # a circle, slightly bent
    for reduced_area in REDUCED_AREAS:
        misses = lambda u, wanted=reduced_area: quarter(u)[:3] - [0, 0, wanted]  # noqa: E731
        solution = root(misses, unknowns, tol=1e-13)
        unknowns = solution.x
        assert np.max(np.abs(misses(unknowns))) < 1e-12
        energies[reduced_area] = float(quarter(unknowns)[3])
    return energies


def test_the_shooting_reproduces_published_values() -> None:
    """Of a code that has nothing to do with this one either, to six digits."""
    for reduced_area, expected in {0.85: 9.237801, 0.75: 11.365472, 0.65: 13.641882}.items():
        assert curvature_energies()[reduced_area] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize(
    ("reduced_area", "points"), [(0.98, 64), (0.9, 64), (0.75, 128), (0.6, 128), (0.45, 128)]
)
def test_an_ellipse_relaxes_to_the_euler_lagrange_shape(reduced_area: float, points: int) -> None:
    scene = Scene(
        horizon=200.0,
        vesicles=(Vesicle(reduced_area=reduced_area),),
        numerics=Numerics(points=points, tolerance=1e-9),
        criteria=Criteria(steady_rate=1e-7),
    )
    run = simulate(scene)
    assert run.outcome is Outcome.EQUILIBRIUM
    assert 2 * run.energy.bending == pytest.approx(curvature_energies()[reduced_area], rel=1e-8)


@pytest.mark.parametrize(
    ("reduced_area", "points"), [(0.35, 192), pytest.param(0.3, 384, marks=pytest.mark.long)]
)
def test_a_slender_vesicle_relaxes_to_the_euler_lagrange_shape(reduced_area: float, points: int) -> None:
    """From a blunt shape: of an ellipse as slender as this the points would not resolve the tips.

    At 0.3 the waist is 0.055 wide, three spacings of 384 points.
    """
    scene = Scene(
        horizon=100.0,
        vesicles=(Vesicle(reduced_area=reduced_area),),
        numerics=Numerics(points=points, tolerance=1e-8),
    )
    equation = dense_equation(scene)
    blunt = of_reduced_area(ellipse_tangent_angle(0.55, 2 * np.pi, 0.0, points), reduced_area)
    state = equation.membranes.pack(blunt[None], np.zeros((1, 2)))
    problem = InitialValueProblem(equation, state, 0.0, scene.horizon)
    integrator = integrator_for(problem, scene.numerics, 1)
    step = integrator.step()
    while step.end < scene.horizon:
        step = integrator.step()
    energy = equation.bending.energy(equation.motion(step.state).geometry)
    assert 2 * energy == pytest.approx(curvature_energies()[reduced_area], rel=1e-8)
