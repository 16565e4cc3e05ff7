"""What an integrator is given, what it does, and how it is registered.

`solver/README.md` says how to add one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from solver.memory import Saved
    from solver.motion.jacobian import Jacobian
    from solver.scene import Numerics

Array = NDArray[np.float64]


class StepFailedError(ArithmeticError):
    """No further step is possible; the message says why."""


class DifferentialEquation(Protocol):
    """An equation dy/dt = f(y) for a state y of n numbers.

    What it raises where f does not exist is an `ArithmeticError`.
    """

    def rate(self, state: Array) -> Array:
        """Compute f.

        Parameters
        ----------
        state : (n,)

        Returns
        -------
        (n,)
        """

    def jacobian(self, state: Array) -> Jacobian:
        """Compute the derivative of f by the state.

        Parameters
        ----------
        state : (n,)

        Returns
        -------
        Jacobian
        """

    def restored_jacobian(self, saved: Saved) -> Jacobian:
        """Return a Jacobian that `jacobian` once returned.

        Parameters
        ----------
        saved : dict
            As `Jacobian.saved` returned it.

        Returns
        -------
        Jacobian
        """

    def symmetries(self, state: Array) -> Array:
        """Return directions in which every solution may be moved, always by the same amount, and stays one.

        Parameters
        ----------
        state : (n,)

        Returns
        -------
        (m, n)
        """

    def conserved(self, state: Array) -> Array:
        """Return quantities of order 1 that the exact solution keeps, for the step control by them.

        Parameters
        ----------
        state : (n,)

        Returns
        -------
        (k,)
        """


@dataclass(frozen=True)
class InitialValueProblem:
    """What an integrator solves.

    Attributes
    ----------
    equation : DifferentialEquation
    state : (n,)
        Where the first step begins.
    start : float
        When the first step begins.
    end : float
        When the last step ends.
    error : (n, 2) or None
        Estimated error of the state, and the size that it would usually have (`Step`); None for an exact one.
    """

    equation: DifferentialEquation
    state: Array
    start: float
    end: float
    error: Array | None = None


@dataclass(frozen=True)
class Step:
    """One accepted step.

    Attributes
    ----------
    start, end : float
    state : (n,)
        At the end.
    interpolate : callable
        From a time in [start, end] to the state there, to the method's order.
    local_error : float
        Root mean square of the estimated error that the step added to the state.
    shortened : bool
        Whether a first attempt with a larger step was rejected.
    evaluated : (n,) or None
        A state within the step's error of that at the end, in which the rate has just been computed.  None if
        there is none.
    error : callable or None
        From a time in [start, end] to an array (n, 2).  Its first column is the estimated error of the state
        there: what all steps so far have left in it.  The second one is the same with random signs of the
        local errors, which do not cancel.  None if the integrator does not propagate errors.
    """

    start: float
    end: float
    state: Array
    interpolate: Callable[[float], Array]
    local_error: float
    shortened: bool
    evaluated: Array | None = None
    error: Callable[[float], Array] | None = None

    def until(self, time: float) -> Self:
        """Return the part of the step up to a time in it.

        Parameters
        ----------
        time : float

        Returns
        -------
        Step
        """
        return replace(self, end=time, state=self.interpolate(time), evaluated=None)


class Integrator(Protocol):
    """Advances a state in time, one accepted step after the other."""

    @property
    def jacobian_evaluations(self) -> int:
        """Number of Jacobians computed."""

    @property
    def factorizations(self) -> int:
        """Number of matrices factorized."""

    def step(self) -> Step:
        """Take one step.

        Returns
        -------
        Step

        Raises
        ------
        StepFailedError
            If no step of representable size satisfies the tolerance.
        """

    def saved(self) -> Saved:
        """Return what decides the steps to come; `solver.memory.Remembering` has it from a list of names.

        Returns
        -------
        dict
        """

    def restore(self, saved: Saved) -> None:
        """Go on where another integrator of the same problem was.

        Parameters
        ----------
        saved : dict
        """


class IntegratorFactory(Protocol):
    """Makes the integrators of one name."""

    def __call__(self, problem: InitialValueProblem, numerics: Numerics) -> Integrator:
        """Make the integrator that a scene asks for.

        Parameters
        ----------
        problem : InitialValueProblem
        numerics : Numerics
            Of the scene.

        Returns
        -------
        Integrator
        """


_factories: dict[str, IntegratorFactory] = {}

# By name; see `register`.
FACTORIES: Mapping[str, IntegratorFactory] = MappingProxyType(_factories)


def register(name: str) -> Callable[[IntegratorFactory], IntegratorFactory]:
    """Register the decorated function as the one that makes the integrators of this name.

    Parameters
    ----------
    name : str
        As in ``numerics.integrator`` of a scene.

    Returns
    -------
    callable
        The decorator.

    Raises
    ------
    ValueError
        If the name is registered already.
    """

    def registered(factory: IntegratorFactory) -> IntegratorFactory:
        if name in _factories:
            raise ValueError(f"an integrator {name!r} is registered already")
        _factories[name] = factory
        return factory

    return registered


def unregister(name: str) -> None:
    """Undo `register`.

    Parameters
    ----------
    name : str
        A registered name.
    """
    del _factories[name]
