"""Whether a pair that is computed as a vesicle and its image would stay one.

The symmetric motion cannot show what breaks its symmetry.  So both vesicles are computed, each on its own,
from a state in which the second one differs a little from the image of the first one, and the difference is
followed.  It is so small that it changes linearly.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.integrators import InitialValueProblem, integrator_for
from solver.integrators.control import root_mean_square
from solver.membrane.geometry import Geometry
from solver.membrane.spectral import highest_modes
from solver.membrane.symmetry import has_images
from solver.motion.terms import accurate_equation
from solver.simulation.blas_threads import one_blas_thread
from solver.simulation.resolution import with_points
from solver.simulation.vesicle_shapes import Shapes

if TYPE_CHECKING:
    from solver.analysis.run import Run
    from solver.motion.dense import DenseEquation
    from solver.scene import Numerics, Scene

Array = NDArray[np.float64]

# Radians, root mean square.  A difference that leaves these bounds is scaled: a larger one does not change
# linearly, and a smaller one would be no concern of the step control, whatever became of it.
_SIZE, _SMALLEST, _LARGEST = 1e-4, 1e-5, 1e-3
_TOLERANCE = 1e-7  # of the steps
_WAVES = 4  # of the first difference, besides a turn


@dataclass(frozen=True)
class SymmetryBreaking:
    """What becomes of a small difference between a vesicle and the image of the other one.

    Attributes
    ----------
    growth_rate : float
        Of the difference that decays most slowly or grows fastest, mean over a period, 1/time.
    period : float
        Of the motion.
    """

    growth_rate: float
    period: float

    @property
    def factor(self) -> float:
        """By how much the difference grows in a period."""
        return float(np.exp(self.growth_rate * self.period))

    @property
    def stable(self) -> bool:
        """Whether it decays."""
        return self.growth_rate < 0

    def record(self) -> dict[str, bool | float]:
        """Return what is told of it, by name: in the answer of a command and in a report."""
        return {"stable": self.stable, "growth_rate": self.growth_rate, "growth_factor": self.factor}


def symmetry_breaking(run: Run) -> SymmetryBreaking:
    """Follow a difference that breaks the symmetry of the motion to which a pair has settled.

    Parameters
    ----------
    run : Run
        Of a vesicle and its image, with a period.  Its last state is the first one.

    Returns
    -------
    SymmetryBreaking

    Raises
    ------
    ValueError
        If the second vesicle is not the image of the first one, or if there is no period.
    ArithmeticError
        If no step is possible.
    """
    if run.period is None:
        raise ValueError(f"the run has no period: it is {run.outcome} at time {run.time:g}")
    frames = run.frames
    scene = with_points(run.scene, frames.tangent_angle.shape[-1])
    rate = symmetry_growth(scene, Shapes(frames.tangent_angle[-1], frames.center[-1]), run.period)
    return SymmetryBreaking(rate, float(run.period))


def symmetry_growth(scene: Scene, shapes: Shapes, period: float) -> float:
    """Return how fast a difference between two vesicles grows that breaks their symmetry.

    It is followed for two periods, and the growth is that in the second one, when only what grows fastest or
    decays most slowly is left.

    Parameters
    ----------
    scene : Scene
        Of a vesicle and its image, with the number of points of the shapes.
    shapes : Shapes
        On the motion in question.
    period : float
        Of the motion; any duration where the pair is at rest.

    Returns
    -------
    float
        Mean over a period, 1/time.

    Raises
    ------
    ValueError
        If the second vesicle is not the image of the first one.
    ArithmeticError
        If no step is possible.
    """
    require_image(scene)
    with one_blas_thread():
        difference = _Difference(accurate_equation(scene.vesicles, scene), scene.numerics)
        membranes = difference.equation.membranes
        state = membranes.pack(shapes.tangent_angle, shapes.center)
        perturbed = difference.with_shape(state, _turn_and_waves(membranes.points))
        later, _ = difference.follow(perturbed, period)
        _, growth = difference.follow(later, period)
    return float(growth / period)


def require_image(scene: Scene) -> None:
    """Refuse a scene of which no symmetry can be broken.

    Parameters
    ----------
    scene : Scene

    Raises
    ------
    ValueError
        If it is not of a vesicle and its image.
    """
    if not has_images(scene):
        raise ValueError(
            "vesicles: not two equal ones opposite to each other, so both are computed and `settled` of the "
            "run says whether perturbations have died out"
        )


def _turn_and_waves(points: int) -> Array:
    """Return a turn and long waves together, (points,)."""
    angle = 2 * np.pi * np.arange(points) / points
    phases = np.random.default_rng(0).uniform(0, 2 * np.pi, _WAVES)
    waves = np.arange(1, _WAVES + 1)[:, None] * angle + phases[:, None]
    return np.asarray(1 + np.cos(waves).sum(axis=0))


class _Difference:
    """Follows the difference between the second vesicle and the image of the first one.

    Parameters
    ----------
    equation : DenseEquation
        Of both vesicles.
    numerics : Numerics
        Of their scene.
    """

    def __init__(self, equation: DenseEquation, numerics: Numerics) -> None:
        self.equation = equation
        self._numerics = numerics.model_copy(update={"tolerance": min(_TOLERANCE, numerics.tolerance)})

    def follow(self, state: Array, duration: float) -> tuple[Array, float]:
        """Return the state after some time, and by how much the logarithm of the difference has grown."""
        time, growth = 0.0, 0.0
        while time < duration:
            problem = InitialValueProblem(self.equation, state, time, duration)
            integrator = integrator_for(problem, self._numerics, 2)
            first = size = root_mean_square(self._shape(state))
            while time < duration and _SMALLEST < size < _LARGEST:
                step = integrator.step()
                time, state = step.end, step.state
                size = root_mean_square(self._shape(state))
            growth += float(np.log(size / first))
            state = self.with_shape(state, self._shape(state))
        return state, growth

    def with_shape(self, state: Array, shape: Array) -> Array:
        """Return the symmetric state nearby, with a difference of this shape and of the usual size."""
        membranes = self.equation.membranes
        first, second = membranes.tangent_angle(state)
        turn = self._turn(state)
        mean, half = (first + second - turn) / 2, _SIZE * shape / root_mean_square(shape) / 2
        center = membranes.center(state)
        offset = (center[0] - center[1]) / 2
        return membranes.pack(np.stack([mean - half, mean + half + turn]), np.stack([offset, -offset]))

    def _shape(self, state: Array) -> Array:
        """Return the difference of the tangent angles that can change, (points,).

        A shift of points stays as it is, and so do the modes that the discretization holds.
        """
        membranes = self.equation.membranes
        first, second = membranes.tangent_angle(state)
        curvature = Geometry(membranes, state).curvature.mean(axis=0)
        constant = np.column_stack([curvature, highest_modes(membranes.points)])
        orthonormal, _ = np.linalg.qr(constant)
        difference = second - first - self._turn(state)
        return np.asarray(difference - orthonormal @ (orthonormal.T @ difference))

    def _turn(self, state: Array) -> float:
        """Return the odd multiple of π by which the tangents of an image are turned."""
        first, second = self.equation.membranes.tangent_angle(state)
        turns = np.round((second - first).mean() / np.pi)
        return float(np.pi * turns)
