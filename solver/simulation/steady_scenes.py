"""Steady states of scenes: from a state nearby to what a steady state is like, and along branches."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis import averages
from solver.analysis.criteria.steady import outcome_at_rest
from solver.analysis.diagnostics import measures
from solver.analysis.free_energy import energy_of
from solver.analysis.spatial_error import shape_tails, spatial_error
from solver.membrane.symmetry import has_images, independent_vesicles
from solver.motion.terms import accurate_equation
from solver.simulation.vesicle_shapes import Shapes
from solver.steady_states.continuation import Continuation, Limits
from solver.steady_states.newton import steady_state
from solver.steady_states.stability import Perturbations
from solver.steady_states.steady_equations import SteadyEquations, with_all_vesicles

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.analysis.run import Energy, Outcome, Viscosity
    from solver.scene import Scene
    from solver.steady_states.branch import BranchPoint

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_KEPT_EIGENVALUES = 6
_NEARBY = 1e-3  # relative change of a parameter that shows whether it changes both vesicles of a pair alike


@dataclass(frozen=True)
class SteadyState:
    """A steady state of a scene.  Quantities that the scene does not have are None.

    Attributes
    ----------
    scene : Scene
        Its number of points is that of the state.
    outcome : Outcome
        Of a run that came to rest there.
    stable : bool
        Whether no small perturbation grows.
    eigenvalues : complex (k,)
        Rates of growth of the perturbations that grow fastest, the fastest first, 1/time.
    inclination_angle, gap : float or None
        As of a `Run`.
    viscosity : Viscosity or None
    energy : Energy
    spatial_error : float
        Of positions, see `solver.analysis.spatial_error`.
    shapes : Shapes
    """

    scene: Scene
    outcome: Outcome
    stable: bool
    eigenvalues: ComplexArray
    inclination_angle: float | None
    gap: float | None
    viscosity: Viscosity | None
    energy: Energy
    spatial_error: float
    shapes: Shapes


@dataclass(frozen=True)
class SteadyPoint:
    """A steady state on a branch, with its value of the parameter."""

    parameter: float
    state: SteadyState


@dataclass(frozen=True)
class SteadyBranch:
    """A branch of steady states; see `solver.steady_states.branch.Branch`.

    Attributes
    ----------
    points, folds, crossings : tuple of SteadyPoint
    ended : str
    """

    points: tuple[SteadyPoint, ...]
    folds: tuple[SteadyPoint, ...]
    crossings: tuple[SteadyPoint, ...]
    ended: str


def find_steady_state(scene: Scene, near: Shapes) -> SteadyState:
    """Find the steady state of a scene near a state.

    Parameters
    ----------
    scene : Scene
        With the number of points of the state.
    near : Shapes
        Such as those at the end of a run.

    Returns
    -------
    SteadyState

    Raises
    ------
    NoSteadyStateError
        If Newton's method does not converge.
    """
    equations = SteadyEquations(accurate_equation(scene.vesicles, scene), scene)
    state = equations.membranes.pack(near.tangent_angle, near.center)
    return _described(scene, equations, steady_state(equations, state))


def follow_steady_states(
    scene_at: Callable[[float], Scene], start: float, near: Shapes, limits: Limits, upward: bool
) -> SteadyBranch:
    """Follow a branch of steady states in a parameter, through folds.

    Parameters
    ----------
    scene_at : callable
        From a value of the parameter to the scene with the number of points of the state.  Raises
        `OutsideParameterError`.
    start : float
        First value.
    near : Shapes
        Near a steady state there.
    limits : Limits
    upward : bool
        Whether the parameter rises first.

    Returns
    -------
    SteadyBranch

    Raises
    ------
    NoSteadyStateError
        If there is no steady state to start from.
    """
    family = _SceneFamily(scene_at, start, upward)
    continuation = Continuation(family, scale=abs(start) or 1.0)
    membranes = family.computed(start).membranes
    computed = slice(membranes.count)  # the others are images
    first = continuation.start(
        start, membranes.pack(near.tangent_angle[computed], near.center[computed]), upward
    )
    branch = continuation.follow(first, limits)
    points, folds, crossings = (
        tuple(family.described(point) for point in part)
        for part in (branch.points, branch.folds, branch.crossings)
    )
    return SteadyBranch(points, folds, crossings, branch.ended)


class _SceneFamily:
    """The scenes along a branch; see `solver.steady_states.continuation.Family`."""

    def __init__(self, scene_at: Callable[[float], Scene], start: float, upward: bool) -> None:
        self._scene_at = scene_at
        beyond = start + (_NEARBY if upward else -_NEARBY) * (abs(start) or 1.0)
        self._symmetric = has_images(scene_at(start)) and has_images(scene_at(beyond))

    def computed(self, value: float) -> SteadyEquations:
        scene = self._scene_at(value)
        vesicles = independent_vesicles(scene) if self._symmetric else scene.vesicles
        return SteadyEquations(accurate_equation(vesicles, scene), scene)

    def complete(self, value: float) -> SteadyEquations:
        scene = self._scene_at(value)
        return SteadyEquations(accurate_equation(scene.vesicles, scene), scene)

    def described(self, point: BranchPoint) -> SteadyPoint:
        complete = self.complete(point.parameter)
        state = with_all_vesicles(self.computed(point.parameter).membranes, point.state)
        return SteadyPoint(point.parameter, _described(self._scene_at(point.parameter), complete, state))


def _described(scene: Scene, equations: SteadyEquations, state: Array) -> SteadyState:
    """Measure a steady state of all vesicles."""
    equation, membranes = equations.equation, equations.membranes
    perturbations = Perturbations.of(equations, state)
    motion = equation.motion(state)
    sample = {name: float(measure(motion)) for name, measure in measures(scene, equation).items()}
    tails = shape_tails(membranes, state)
    shapes = Shapes(membranes.tangent_angle(state), membranes.center(state))
    if len(scene.vesicles) == 2:
        offset = shapes.center[1] - shapes.center[0]
        sample["center_angle"] = float(np.arctan2(offset[1], offset[0]))
    outcome = outcome_at_rest(scene, membranes, state)
    return SteadyState(
        scene=scene,
        outcome=outcome,
        stable=perturbations.stable,
        eigenvalues=perturbations.eigenvalues[:_KEPT_EIGENVALUES],
        inclination_angle=averages.inclination(scene, sample),
        gap=sample.get("gap"),
        viscosity=averages.steady_viscosity(sample),
        energy=energy_of(scene, outcome, sample),
        spatial_error=float(spatial_error(tails, age=np.full_like(tails, np.inf)).max()),
        shapes=shapes,
    )
