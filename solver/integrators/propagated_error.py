"""The error that the steps of backward differentiation have left in the state.

A formula of order k leaves the local error C ∇ᵏ⁺¹y in every step.  To first order the error e = y − y_exact
obeys the linearized equation of motion with these as its source.  The same formula solves it, with the same
steps and the matrix in hand.

The Jacobian in hand may be several steps old, and then errors grow or die out at another rate than the
motion's.  So in every third step a difference of two rates shows what it does to the error now, and until
the next one the Jacobian is taken to be wrong in the direction of that error only.

A motion that repeats itself forgets all errors but one: how far it is ahead of the exact motion in time.
This one stays, τ dy/dt, and grows and shrinks with the slope dy/dt by factors of hundreds.  Computed step by
step it would turn a little into other directions each time, and grow there like an instability.  So the lead
τ is a number, and only the rest of the error, d in e = τ dy/dt + d, obeys the linearized equation.  After
every step what d has along the slope goes to the lead.

Local errors of opposite signs may cancel by chance, and then what is wrong with each of them does not.  So
the same is done for a second error, whose sources have random signs: the size that it would usually have.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.integrators.backward_differences import (
    ROWS,
    combined,
    extended,
    interpolant,
)
from solver.integrators.control import root_mean_square

if TYPE_CHECKING:
    from solver.memory import Saved
    from solver.motion.jacobian import Jacobian

Array = NDArray[np.float64]

_PROBED_EVERY = 3  # steps; more often costs more and, measured over eight scenes, gains nothing
# Far beyond every state: an error as large says that nothing is known.  In a motion that never repeats
# itself it would go on to grow until it overflows.
_LOST = 1e9
# Root mean square; differences of rates would be noise if they were smaller, and not linear if larger.
_LEAST_PROBE, _LARGEST_PROBE = 1e-3, 1e-2
# A step that moves the state by less than this multiple of its local error has no slope worth the name.
_MOVES = 10.0


class LinearizedStep(NamedTuple):
    """A step of y − y_predicted + Σₘ wₘ ∇ᵐy = c·f(y), with a linear f.

    Attributes
    ----------
    order : int
        Order k of the formula.
    weights : (k,)
        The weights w.
    duration : float
        The duration c.
    jacobian : Jacobian
        The derivative J of f.
    solve : callable
        From a right-hand side b to the solution x of (I − c·J) x = b.
    """

    order: int
    weights: Array
    duration: float
    jacobian: Jacobian
    solve: Callable[[Array], Array]


class Evaluation(NamedTuple):
    """A rate that is known.

    Attributes
    ----------
    state, rate : (n,)
    """

    state: Array
    rate: Array


@dataclass(frozen=True)
class _Deviation:
    """What a Jacobian leaves out: a rate for one direction, nothing for those orthogonal to it."""

    jacobian: Jacobian
    direction: Array
    rate: Array

    def __matmul__(self, direction: Array) -> Array:
        share = (self.direction @ direction) / (self.direction @ self.direction)
        return np.multiply.outer(self.rate, share)


class PropagatedError:
    """The estimated error of the state, as tables of backward differences beside that of the state.

    Parameters
    ----------
    rate : callable
        From a state (n,) to its rate (n,).
    error : (n, 2)
        Of the state in which the integration begins: the estimate, and the one with random signs.
    slopes : (2, n)
        The slope of the state there, and its first backward difference.
    """

    def __init__(self, rate: Callable[[Array], Array], error: Array, slopes: Array) -> None:
        self._rate = rate
        self._table = np.zeros((ROWS, *error.shape))  # of the errors without the leads
        self._table[0] = error
        self._slopes = np.zeros((ROWS, len(error)))
        self._slopes[: len(slopes)] = slopes
        self._leads = np.zeros(2)
        self._steps = 0
        self._deviation: _Deviation | None = None
        self._random = np.random.default_rng(0)

    def saved(self, jacobian: Jacobian) -> Saved:
        """Return what decides the errors to come.

        Parameters
        ----------
        jacobian : Jacobian
            Of the last step.  What another one leaves out is of no use any more.

        Returns
        -------
        dict
        """
        deviation = self._deviation
        if deviation and deviation.jacobian is not jacobian:
            deviation = None
        return {
            "table": self._table.copy(),
            "slopes": self._slopes.copy(),
            "leads": self._leads.copy(),
            "steps": self._steps,
            "deviation": (deviation.direction.copy(), deviation.rate.copy()) if deviation else None,
            "random": json.dumps(self._random.bit_generator.state),  # it holds integers of 128 bits
        }

    def restore(self, saved: Saved, jacobian: Jacobian) -> None:
        """Go on where another one was.

        Parameters
        ----------
        saved : dict
        jacobian : Jacobian
            The same as that with which it was saved.
        """
        self._table, self._steps = saved["table"].copy(), saved["steps"]
        self._slopes, self._leads = saved["slopes"].copy(), saved["leads"].copy()
        self._deviation = None
        if saved["deviation"]:
            direction, rate = saved["deviation"]
            # A column in memory, as the error is that was probed: its products are then the same to the bit.
            self._deviation = _Deviation(jacobian, np.stack([direction, direction], axis=1)[:, 0], rate)
        self._random.bit_generator.state = json.loads(saved["random"])

    def advance(
        self, step: LinearizedStep, slope: Array, local_error: Array, remainder: Array, near: Evaluation
    ) -> None:
        """Follow one step.

        Parameters
        ----------
        step : LinearizedStep
        slope : (n,)
            Of the state at the end.
        local_error : (n,)
            What the formula leaves out of its right-hand side.
        remainder : (n,)
            How far the accepted state is from the solution of the formula.
        near : Evaluation
            Close to the accepted state.
        """
        table, order = self._table, step.order
        predicted = table[: order + 1].sum(axis=0)
        history = combined(step.weights, table[1 : order + 1])
        signs = self._signs()
        source = local_error[:, None] * signs - history
        change = step.solve(step.duration * (step.jacobian @ predicted) + source)
        error = predicted + change
        self._steps += 1
        if self._steps % _PROBED_EVERY == 0:
            self._deviation = self._probe(step.jacobian, error[:, 0], near)
        if self._deviation and self._deviation.jacobian is step.jacobian:
            change = change + step.solve(step.duration * (self._deviation @ error))
        extended(table, order, change + remainder[:, None] * signs)
        extended(self._slopes, order, slope - self._slopes[: order + 1].sum(axis=0))
        self._separate(step.duration * root_mean_square(slope) > _MOVES * root_mean_square(local_error))
        if self._steps % _PROBED_EVERY == 0:
            largest = np.abs(self._whole(1)).max(axis=(0, 1))
            if largest.max() > _LOST:
                part = np.minimum(1.0, _LOST / largest)
                table *= part
                self._leads *= part

    def _separate(self, moves: bool) -> None:
        """Move what the rest of the errors has along the slope to the leads, or the leads to the rest."""
        slope = self._slopes[0]
        more = (slope @ self._table[0]) / (slope @ slope) if moves else -self._leads
        self._table -= self._slopes[:, :, None] * more
        self._leads += more

    def _whole(self, rows: int) -> Array:
        """Return the first rows of the table of the errors with the leads, (rows, n, 2)."""
        return np.asarray(self._table[:rows] + self._slopes[:rows, :, None] * self._leads)

    def _signs(self) -> Array:
        """Return the signs of a source, (2,)."""
        return np.array([1.0, 2.0 * self._random.integers(2) - 1.0])

    def _probe(self, jacobian: Jacobian, error: Array, near: Evaluation) -> _Deviation | None:
        size = root_mean_square(error)
        if size == 0:
            return None
        scale = min(max(size, _LEAST_PROBE), _LARGEST_PROBE) / size
        try:
            rate = (near.rate - self._rate(near.state - scale * error)) / scale
        except ArithmeticError:
            return None
        return _Deviation(jacobian, error, rate - jacobian @ error)

    def rescale(self, order: int, matrix: Array, left_out: Array) -> None:
        """Change the step size.

        Values between the old ones come from a polynomial, which has an error of its own.

        Parameters
        ----------
        order : int
            Order k of the polynomial.
        matrix : (k + 1, k + 2)
            See `rescaling`.
        left_out : (n,)
            ∇ᵏ⁺¹y of the state, in the old step size.
        """
        self._table[: order + 1] = combined(matrix[:, :-1], self._table[: order + 1])
        self._table[: order + 1] -= matrix[:, -1, None, None] * left_out[:, None] * self._signs()
        self._slopes[: order + 1] = matrix[:, :-1] @ self._slopes[: order + 1]

    def interpolant(self, order: int, time: float, size: float) -> Callable[[float], Array]:
        """Return the error between steps; see `interpolant` of `backward_differences`.

        Parameters
        ----------
        order : int
        time : float
        size : float

        Returns
        -------
        callable
        """
        return interpolant(self._whole(order + 1), order, time, size)
