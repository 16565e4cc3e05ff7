"""Following steady states as a parameter changes, through folds (Keller 1977).

The state and the parameter together are the unknowns.  From a point on the branch a step leads along its
tangent; Newton's method then returns to the branch in the plane across.  At a fold the parameter turns back,
and nothing special happens to these unknowns.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from solver.forces.tension import TensionNotFoundError
from solver.roots import root
from solver.steady_states.branch import Branch, BranchPoint
from solver.steady_states.newton import NoSteadyStateError, least_squares, steady_state
from solver.steady_states.stability import Perturbations
from solver.steady_states.steady_equations import with_all_vesicles

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.steady_states.steady_equations import SteadyEquations

Array = NDArray[np.float64]

_KEPT_EIGENVALUES = 6
_CONVERGED = 1e-9
_ITERATIONS = 24  # where branches meet convergence is linear: the Jacobian leaves refined quadratures out
# Where branches meet, the equations hardly determine one direction, and round-off there is magnified.
_RANK = 1e-10
_ROUND_OFF = 1e-4
_FIRST_STEP, _SMALLEST_STEP, _LARGEST_STEP = 0.02, 1e-7, 0.1
_SMALL_CHANGE = 1e-4  # of a parameter, over its scale, in differences
_STRAIGHT, _LEAST_STRAIGHT = 0.99, 0.95  # cosines of the angle between neighboring tangents
_ROOT = 1e-9  # accuracy of folds and crossings, as a distance along the branch
_SAME = 1e-4  # distance along the branch below which a crossing is the fold's own


class OutsideParameterError(ValueError):
    """The scene allows no such value of the parameter."""


class Limits(NamedTuple):
    """How far a branch is followed.

    Attributes
    ----------
    to : float
        The value of the parameter at which it ends; it also ends when it returns past its start.
    most_points : int
    while_stable : bool
        Whether it ends where the first perturbation begins to grow.
    """

    to: float
    most_points: int = 200
    while_stable: bool = False


class Family(Protocol):
    """The scenes that differ by the value of a parameter, as equations for their steady states."""

    def computed(self, value: float) -> SteadyEquations:
        """Return the equations of the vesicles that are computed along the branch.

        Parameters
        ----------
        value : float
            Of the parameter.

        Returns
        -------
        SteadyEquations

        Raises
        ------
        OutsideParameterError
            If the scene allows no such value.
        """

    def complete(self, value: float) -> SteadyEquations:
        """Return the equations of all vesicles.

        Parameters
        ----------
        value : float
            Of the parameter.

        Returns
        -------
        SteadyEquations

        Raises
        ------
        OutsideParameterError
            If the scene allows no such value.
        """


class Continuation:
    """Follows the branch of steady states of a family of scenes.

    Parameters
    ----------
    family : Family
    scale : float
        A change of the parameter that counts as much as one of a radian or a length.
    """

    def __init__(self, family: Family, scale: float) -> None:
        self._family = family
        self._scale = scale

    def start(self, value: float, state: Array, upward: bool) -> BranchPoint:
        """Return the first point of the branch.

        Parameters
        ----------
        value : float
            Of the parameter.
        state : (n,)
            Near a steady state.
        upward : bool
            Whether the parameter rises from there.

        Returns
        -------
        BranchPoint

        Raises
        ------
        NoSteadyStateError
            If Newton's method does not converge.
        """
        state = steady_state(self._equations(value), state)
        ahead = np.zeros(state.size + 1)
        ahead[-1] = 1.0 if upward else -1.0
        return self._point(np.append(state, value / self._scale), ahead)

    def follow(self, first: BranchPoint, limits: Limits) -> Branch:
        """Follow the branch.

        Parameters
        ----------
        first : BranchPoint
        limits : Limits

        Returns
        -------
        Branch
        """
        points, folds, crossings = [first], list[BranchPoint](), list[BranchPoint]()
        low, high = sorted((first.parameter, limits.to))
        size, ended = _FIRST_STEP, f"it has {limits.most_points} points"
        while len(points) < limits.most_points:
            try:
                reached, size = self._step(points[-1], size)
                if not low < reached.parameter < high:
                    edge = low if reached.parameter <= low else high
                    reached, ended = self._at(points[-1], reached, edge), f"the parameter is {edge:g}"
                turned = self._folds(points[-1], reached)
                crossings += self._crossings(points[-1], reached, turned)
            except NoSteadyStateError as error:
                ended = str(error)
                break
            folds += turned
            points.append(reached)
            if not low < reached.parameter < high:
                break
            if limits.while_stable and not reached.stable:
                ended = "the state has become unstable"
                break
        return Branch(tuple(points), tuple(folds), tuple(crossings), ended)

    def _equations(self, value: float) -> SteadyEquations:
        try:
            return self._family.computed(value)
        except OutsideParameterError as error:
            raise NoSteadyStateError(str(error)) from error

    def _perturbations(self, point: BranchPoint | Array) -> Perturbations:
        """Linearize the motion of all vesicles about a point, or about a state with a parameter."""
        unknowns = self._unknowns(point) if isinstance(point, BranchPoint) else point
        value = float(unknowns[-1] * self._scale)
        state = with_all_vesicles(self._equations(value).membranes, unknowns[:-1])
        return Perturbations.of(self._family.complete(value), state)

    def _unknowns(self, point: BranchPoint) -> Array:
        return np.append(point.state, point.parameter / self._scale)

    def _linearization(self, unknowns: Array) -> tuple[Array, Array]:
        """Return the residual in a state with a parameter, and its derivatives by both."""
        state, value = unknowns[:-1], float(unknowns[-1] * self._scale)
        equations = self._equations(value)
        try:
            residual = equations.residual(state)
            by_state = np.concatenate(equations.linearization(state))
            by_parameter = self._by_parameter(value, state)
        except TensionNotFoundError as error:
            raise NoSteadyStateError(str(error)) from error
        return residual, np.concatenate([by_state, by_parameter[:, None]], axis=1)

    def _by_parameter(self, value: float, state: Array) -> Array:
        """Return the derivative of the residual by the parameter over its scale, by differences."""
        residuals = dict[int, Array]()
        for side in (-1, 1):
            with suppress(NoSteadyStateError):
                beyond = self._equations(value + side * _SMALL_CHANGE * self._scale)
                residuals[side] = beyond.residual(state)
        if len(residuals) < 2:
            residuals[0] = self._equations(value).residual(state)
        first, last = min(residuals), max(residuals)
        return (residuals[last] - residuals[first]) / ((last - first) * _SMALL_CHANGE)

    def _step(self, point: BranchPoint, size: float) -> tuple[BranchPoint, float]:
        """Return the next point, and the size of the step after it."""
        while True:
            try:
                reached = self._ahead(point, size)
                straight = self._product(point.tangent, reached.tangent)
                if straight > _LEAST_STRAIGHT:
                    return reached, min(_LARGEST_STEP, size * (1.5 if straight > _STRAIGHT else 1.0))
                reason = "the branch bends sharply"
            except NoSteadyStateError as error:
                reason = str(error)
            size /= 2
            if size < _SMALLEST_STEP:
                raise NoSteadyStateError(reason)

    def _ahead(self, point: BranchPoint, distance: float) -> BranchPoint:
        """Return the point of the branch at a distance along the tangent of another one."""
        origin = self._unknowns(point)
        unknowns = origin + distance * point.tangent
        across = self._weights(point.state.size) * point.tangent
        before = np.inf
        for _ in range(_ITERATIONS):
            residual, rows = self._linearization(unknowns)
            error = np.append(residual, across @ (unknowns - origin) - distance)
            step = least_squares(np.vstack([rows, across]), -error, _RANK)
            unknowns = unknowns + step
            longest = float(np.abs(step).max())
            if longest < _CONVERGED or before / 2 < longest < _ROUND_OFF:
                return self._point(unknowns, point.tangent)
            before = longest
        raise NoSteadyStateError("Newton's method does not return to the branch")

    def _at(self, point: BranchPoint, beyond: BranchPoint, value: float) -> BranchPoint:
        """Return the point with a value of the parameter that lies between two points."""
        part = (value - point.parameter) / (beyond.parameter - point.parameter)
        between = point.state + part * (beyond.state - point.state)
        state = steady_state(self._equations(value), between)
        reached = self._point(np.append(state, value / self._scale), point.tangent)
        return replace(reached, parameter=value)  # the scale costs its last digit

    def _point(self, unknowns: Array, ahead: Array) -> BranchPoint:
        """Return a point with its tangent and stability; the tangent points ahead."""
        _, rows = self._linearization(unknowns)
        weights = self._weights(unknowns.size - 1)
        right = np.zeros(len(rows) + 1)
        right[-1] = 1.0
        tangent = least_squares(np.vstack([rows, weights * ahead]), right, _RANK)
        tangent /= np.sqrt(self._product(tangent, tangent))
        perturbations = self._perturbations(unknowns)
        return BranchPoint(
            parameter=float(unknowns[-1] * self._scale),
            state=unknowns[:-1],
            tangent=tangent,
            eigenvalues=perturbations.eigenvalues[:_KEPT_EIGENVALUES],
            unstable=perturbations.unstable,
        )

    def _folds(self, first: BranchPoint, last: BranchPoint) -> list[BranchPoint]:
        """Return where the parameter turns back between two points."""
        if first.tangent[-1] * last.tangent[-1] >= 0:
            return []
        return [self._root(first, last, lambda point: float(point.tangent[-1]))]

    def _crossings(
        self, first: BranchPoint, last: BranchPoint, folds: list[BranchPoint]
    ) -> list[BranchPoint]:
        """Return where the number of growing perturbations changes between two points, but for folds."""
        found = list[BranchPoint]()
        for index in range(*sorted((first.unstable, last.unstable))):

            def growth(point: BranchPoint, index: int = index) -> float:
                return self._perturbations(point).refined(index).real

            if growth(first) * growth(last) >= 0:
                continue
            crossing = self._root(first, last, growth)
            others = [*folds, *found]  # a complex pair crosses once
            if all(self._distance(crossing, other) > _SAME for other in others):
                found.append(crossing)
        return found

    def _root(
        self, first: BranchPoint, last: BranchPoint, function: Callable[[BranchPoint], float]
    ) -> BranchPoint:
        """Return the point between two others at which a function changes its sign."""
        change = self._unknowns(last) - self._unknowns(first)
        distance = self._product(first.tangent, change)
        ends = {0.0: first, distance: last}

        def at(part: float) -> float:
            return function(ends[part] if part in ends else self._ahead(first, part))

        return self._ahead(first, root(at, 0.0, distance, _ROOT))

    def _distance(self, first: BranchPoint, last: BranchPoint) -> float:
        difference = self._unknowns(last) - self._unknowns(first)
        return float(np.sqrt(self._product(difference, difference)))

    def _product(self, first: Array, second: Array) -> float:
        return float(first @ (self._weights(first.size - 1) * second))

    def _weights(self, size: int) -> Array:
        """Return what each unknown counts in a product: means over angles and centers, and the parameter."""
        weights = np.full(size + 1, 1 / size)
        weights[-1] = 1.0
        return weights
