"""Steps of integrators, on equations that several tests share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from solver.integrators import InitialValueProblem, Integrator, Step
from solver.integrators.bdf import BackwardDifferentiation
from solver.integrators.control import Attempt, StepDecision, root_mean_square
from solver.integrators.integrator import DifferentialEquation
from solver.integrators.one_step import OneStepIntegrator, OneStepMethod
from solver.motion.dense import DenseEquation
from solver.motion.jacobian import DenseJacobian
from solver.motion.terms import dense_equation
from solver.scene import Numerics
from solver.simulation.initial_state import placed_state
from tests.solver.scenes import shear_pair

Array = NDArray[np.float64]
Function = Callable[[Array], Array]


@dataclass(frozen=True)
class FunctionEquation:
    """A differential equation given by functions; ``matrix`` returns the Jacobian as a matrix."""

    rate: Function
    matrix: Function
    conserved: Function = lambda state: state[:1]

    def jacobian(self, state: Array) -> DenseJacobian:
        return DenseJacobian(self.matrix(state))

    def symmetries(self, state: Array) -> Array:
        return np.empty((0, state.size))


class EqualSteps:
    """The control that gives all steps the same size; a step that fails is not tried again."""

    def __init__(self, size: float) -> None:
        self._size = size

    def first_size(self, acceleration: Array) -> float:
        return self._size

    def judge(self, attempt: Attempt) -> StepDecision:
        return StepDecision(self._size)

    def reject(self, size: float, reason: str) -> StepDecision:
        return StepDecision(0.0, reason)


def all_steps(integrator: Integrator, end: float) -> list[Step]:
    steps = [integrator.step()]
    while steps[-1].end < end:
        steps.append(integrator.step())
    return steps


def state_at(steps: list[Step], time: float) -> Array:
    return next(step.interpolate(time) for step in steps if time <= step.end)


def equal_steps(
    method: OneStepMethod, equation: DifferentialEquation, state: Array, end: float, count: int
) -> list[Step]:
    problem = InitialValueProblem(equation, state, 0.0, end)
    steps = all_steps(OneStepIntegrator(method, EqualSteps(end / count), problem), end)
    assert len(steps) == count
    return steps


def oscillator(y: Array) -> Array:
    """Van der Pol's equation."""
    return np.array([y[1], (1 - y[0] ** 2) * y[1] - y[0]])


def oscillator_jacobian(y: Array) -> Array:
    return np.array([[0.0, 1.0], [-2 * y[0] * y[1] - 1, 1 - y[0] ** 2]])


OSCILLATOR_EQUATION = FunctionEquation(oscillator, oscillator_jacobian)
OSCILLATOR_START, TIMES = np.array([2.0, 0.0]), np.linspace(0.0, 2.0, 201)
OSCILLATOR = solve_ivp(
    lambda _, y: oscillator(y),
    (0, 2),
    OSCILLATOR_START,
    method="DOP853",
    t_eval=TIMES,
    rtol=1e-13,
    atol=1e-14,
).y.T


def oscillator_errors(
    method: OneStepMethod, count: int, jacobian: Function = oscillator_jacobian
) -> tuple[float, float]:
    """Error at the end, and the largest at any time, after steps of equal size."""
    steps = equal_steps(method, FunctionEquation(oscillator, jacobian), OSCILLATOR_START, 2.0, count)
    errors = [
        np.abs(state_at(steps, time) - exact).max() for time, exact in zip(TIMES, OSCILLATOR, strict=True)
    ]
    return float(np.abs(steps[-1].state - OSCILLATOR[-1]).max()), float(max(errors))


@cache
def sheared_pair(begin: float) -> tuple[DenseEquation, Array, float]:
    """Adhering vesicles that have been in shear for some time, and the rate of their fastest mode."""
    scene = shear_pair(1.5, numerics=Numerics(points=32, tolerance=1e-9))
    dynamics = dense_equation(scene)
    problem = InitialValueProblem(dynamics, placed_state(scene), 0.0, begin)
    state = all_steps(BackwardDifferentiation(problem, 1e-8), begin)[-1].state
    return dynamics, state, float(-np.linalg.eigvals(dynamics.jacobian(state).matrix).real.min())


def pair_errors(
    begin: float,
    duration: float,
    counts: tuple[int, ...],
    methods: Sequence[OneStepMethod],
    finest: OneStepMethod,
) -> Array:
    """Errors (methods, counts) of the sheared pair's state after steps of equal size."""
    dynamics, state, _ = sheared_pair(begin)

    def final(method: OneStepMethod, count: int) -> Array:
        return equal_steps(method, dynamics, state, duration, count)[-1].state

    reference = final(finest, 2 * max(counts))
    return np.array(
        [[root_mean_square(final(method, count) - reference) for count in counts] for method in methods]
    )


def amplification(method: OneStepMethod, decay: float) -> float:
    """Of one unit step for y' = −decay·y."""
    matrix = np.array([[-decay]])
    equation = FunctionEquation(lambda y: matrix @ y, lambda _: matrix)
    (step,) = equal_steps(method, equation, np.ones(1), 1.0, 1)
    return abs(float(step.state[0]))


def stiff_errors(method: OneStepMethod) -> Array:
    """Prothero & Robinson's: y' = −10⁶ (y − cos t) − sin t, with the time as the first component.

    Errors at 50 times in steps of 1/16.
    """

    def rate(y: Array) -> Array:
        return np.array([1.0, -1e6 * (y[1] - np.cos(y[0])) - np.sin(y[0])])

    def jacobian(y: Array) -> Array:
        return np.array([[0.0, 0.0], [-1e6 * np.sin(y[0]) - np.cos(y[0]), -1e6]])

    steps = equal_steps(method, FunctionEquation(rate, jacobian), np.array([0.0, 1.0]), 2.0, 32)
    return np.array([abs(state_at(steps, time)[1] - np.cos(time)) for time in np.linspace(0.01, 2.0, 50)])
