"""The equation of motion of a scene whose rate of flow changes with time.

The time is the last element of the state, its clock, and changes at the rate 1.  So the equation is again one
of the form dy/dt = f(y): all integrators, their orders and their errors stay as they are, and what is
measured in a state is measured at its time.  This is the one place where a rate becomes one of a moment.

The rate of change is an affine function of the factor of the flow, because flow, tension and the tangential
velocity of the points are linear.  So its derivative by time is the factor's slope times a difference.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.flows import ImposedFlow
    from solver.forces.bending import Bending
    from solver.membrane.geometry import Membranes
    from solver.memory import Saved
    from solver.motion.dense import DenseEquation
    from solver.motion.equation import AdhesionEnergy, Motion
    from solver.motion.jacobian import Jacobian
    from solver.motion.summed import SummedEquation
    from solver.potentials.viscosity_contrast import ViscosityContrast
    from solver.protocols import Piece, RateProtocol

Array = NDArray[np.float64]


def with_clock(state: Array, time: float) -> Array:
    """Return a state with its time.

    Parameters
    ----------
    state : (state_size,)
    time : float

    Returns
    -------
    (state_size + 1,)
    """
    return np.append(state, time)


@dataclass(frozen=True)
class ClockedJacobian:
    """The Jacobian of a rate of change that depends on the clock.

    Attributes
    ----------
    at_rest : Jacobian
        By the state, at the same time.
    by_time : (n - 1,)
        Derivative by time, in the same state.
    """

    at_rest: Jacobian
    by_time: Array

    @property
    def exact(self) -> bool:
        """That of the Jacobian by the state."""
        return self.at_rest.exact

    def __matmul__(self, direction: Array) -> Array:
        """Return J times a direction; see `Jacobian`.

        Parameters
        ----------
        direction : (n,) or (n, k)

        Returns
        -------
        (n,) or (n, k)
        """
        moved = self.at_rest @ direction[:-1] + np.multiply.outer(self.by_time, direction[-1])
        return np.concatenate([moved, np.zeros_like(direction[-1:])])

    def saved(self) -> Saved:
        """Return both parts; see `Jacobian`.

        Returns
        -------
        dict
        """
        return {"at_rest": self.at_rest.saved(), "by_time": self.by_time}

    def solver(self, duration: float) -> Callable[[Array], Array]:
        """Factorize I − duration·J; see `Jacobian`.

        Parameters
        ----------
        duration : float
            Part of a time step.

        Returns
        -------
        callable
        """
        solve = self.at_rest.solver(duration)

        def solved(right: Array) -> Array:
            # The last row of the system says that the clock is given.
            known = duration * np.multiply.outer(self.by_time, right[-1])
            return np.concatenate([solve(right[:-1] + known), right[-1:]])

        return solved


class TimedEquation:
    """The equation of motion from a time on, up to the next break of the protocol.

    Its states have a clock; see `EquationOfMotion`.

    Parameters
    ----------
    equation : DenseEquation or SummedEquation
        In the flow at its full rate.
    flow : ImposedFlow
    protocol : RateProtocol
    time : float
        When the steps begin.
    """

    def __init__(
        self, equation: DenseEquation | SummedEquation, flow: ImposedFlow, protocol: RateProtocol, time: float
    ) -> None:
        self._equation = equation
        self._flow = flow
        self._protocol = protocol
        self._last = protocol.piece_at(time)

    @property
    def evaluations(self) -> int:
        """See `EquationOfMotion`."""
        return self._equation.evaluations

    @property
    def recordings(self) -> int:
        """See `EquationOfMotion`."""
        return self._equation.recordings

    @property
    def membranes(self) -> Membranes:
        """See `EquationOfMotion`."""
        return self._equation.membranes

    @property
    def bending(self) -> Bending:
        """See `EquationOfMotion`."""
        return self._equation.bending

    @property
    def adhesion(self) -> AdhesionEnergy | None:
        """See `EquationOfMotion`."""
        return self._equation.adhesion

    @property
    def contrast(self) -> ViscosityContrast | None:
        """See `EquationOfMotion`."""
        return self._equation.contrast

    @property
    def tension_iterations(self) -> int:
        """See `EquationOfMotion`."""
        return self._equation.tension_iterations

    def motion(self, state: Array) -> Motion:
        """Compute velocity, tension and forces at the time of a state; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size + 1,)

        Returns
        -------
        Motion
        """
        return self._at(state[-1]).motion(state[:-1])

    def rate(self, state: Array) -> Array:
        """Compute d(state)/dt for a step; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size + 1,)

        Returns
        -------
        (state_size + 1,)
        """
        return np.append(self._at(state[-1]).rate(state[:-1]), 1.0)

    def jacobian(self, state: Array) -> ClockedJacobian:
        """Compute the derivative of `rate` by the state, for a step; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size + 1,)

        Returns
        -------
        ClockedJacobian
        """
        time, placed = state[-1], state[:-1]
        jacobian = self._at(time).jacobian(placed)
        piece = self._piece_at(time)
        by_time = np.zeros_like(placed)
        if slope := piece.slope(time):
            here = self._equation.rate(placed)
            by_time = slope * (self._with(piece.factor(time) + 1).rate(placed) - here)
        return ClockedJacobian(jacobian, by_time)

    def restored_jacobian(self, saved: Saved) -> ClockedJacobian:
        """Return a Jacobian that `jacobian` once returned; see `EquationOfMotion`.

        Parameters
        ----------
        saved : dict

        Returns
        -------
        ClockedJacobian
        """
        return ClockedJacobian(self._equation.restored_jacobian(saved["at_rest"]), saved["by_time"])

    def saved(self) -> Saved:
        """Return what was kept for the next evaluations; see `EquationOfMotion`.

        Returns
        -------
        dict
        """
        return self._equation.saved()

    def restore(self, saved: Saved) -> None:
        """Go on where another equation was; see `EquationOfMotion`.

        Parameters
        ----------
        saved : dict
        """
        self._equation.restore(saved)

    def symmetries(self, state: Array) -> Array:
        """Return directions in which every motion may be moved; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size + 1,)

        Returns
        -------
        (M, state_size + 1)
        """
        return np.pad(self._equation.symmetries(state[:-1]), ((0, 0), (0, 1)))

    def conserved(self, state: Array) -> Array:
        """Return quantities of order 1 that the exact motion keeps; see `EquationOfMotion`.

        Parameters
        ----------
        state : (state_size + 1,)

        Returns
        -------
        (3·M,)
        """
        return self._equation.conserved(state[:-1])

    def _piece_at(self, time: float) -> Piece:
        """Return the piece in which a time is; where the last one ends it still is in it."""
        return self._protocol.course.pieces[min(self._protocol.piece_at(time), self._last)]

    def _at(self, time: float) -> DenseEquation | SummedEquation:
        """Return the equation with the flow of a time."""
        return self._with(self._piece_at(time).factor(time))

    def _with(self, factor: float) -> DenseEquation | SummedEquation:
        rate = factor * self._flow.rate
        if self._equation.flow is None or self._equation.flow.rate != rate:
            self._equation.flow = self._flow.model_copy(update={"rate": rate})
        return self._equation
