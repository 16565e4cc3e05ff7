"""What lies behind a state that hardly changes: a stable steady state, an unstable one, or a slow motion."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.steady_states.newton import NoSteadyStateError, correction
from solver.steady_states.stability import Perturbations
from solver.steady_states.steady_equations import with_all_vesicles

if TYPE_CHECKING:
    from solver.membrane.geometry import Membranes
    from solver.steady_states.steady_equations import SteadyEquations

Array = NDArray[np.float64]

# Radians or lengths: a state whose steady state is farther away is still on its way there.
NEAR = 1e-2

# Largest element, in radians or lengths, of the perturbation with which a state leaves an unstable one: as
# large as the tilt with which pairs start in the trap unless they are told otherwise.
PERTURBATION = 1e-3

_ROUND_OFF = 1e-9  # below it the sign of a perturbation is that of rounding errors


class HiddenInstabilityError(ArithmeticError):
    """A pair that is computed as a vesicle and its image rests in a state that only others leave."""


@dataclass(frozen=True)
class Rest:
    """What is behind a state that hardly changes.

    Attributes
    ----------
    steady : bool
        Whether a steady state is near, stable or not.
    stable : bool
        Whether it is stable, too.
    departure : (n,) or None
        The state with an unstable perturbation of the size `PERTURBATION`; None unless it has a smaller one.
    """

    steady: bool
    stable: bool
    departure: Array | None = None


def rest_near(equations: SteadyEquations, membranes: Membranes, state: Array) -> Rest:
    """Find out what is behind a state that hardly changes.

    Parameters
    ----------
    equations : SteadyEquations
        Of all vesicles.
    membranes : Membranes
        Of those that are computed.
    state : (n,)
        Of those that are computed.

    Returns
    -------
    Rest

    Raises
    ------
    HiddenInstabilityError
        If the steady state is unstable only against perturbations that break the symmetry of the pair.
    """
    complete = with_all_vesicles(membranes, state)
    try:
        distance = correction(equations, complete)
    except NoSteadyStateError:
        return Rest(steady=False, stable=False)
    if np.abs(distance).max() > NEAR:
        return Rest(steady=False, stable=False)
    perturbations = Perturbations.of(equations, complete)
    if perturbations.stable:
        return Rest(steady=True, stable=True)
    for index in range(perturbations.unstable):
        direction = _of_computed(membranes, perturbations.direction(index))
        if np.abs(direction).max() < 0.5:
            continue  # it breaks the symmetry
        present = perturbations.component(-distance, index)
        wanted = PERTURBATION if present > -_ROUND_OFF else -PERTURBATION
        departure = state + (wanted - present) * direction if abs(present) < PERTURBATION else None
        return Rest(steady=True, stable=False, departure=departure)
    raise HiddenInstabilityError(
        "the pair rests in a state that is unstable against perturbations which break its symmetry; "
        "place the vesicles slightly off"
    )


def _of_computed(membranes: Membranes, direction: Array) -> Array:
    """Return the part of a perturbation of all vesicles that keeps the symmetry, for those computed."""
    every = direction[: membranes.curves * membranes.points].reshape(membranes.multiplicity, -1)
    centers = direction[every.size :].reshape(2, membranes.multiplicity, membranes.count)
    sign = np.array([1.0, -1.0])[: membranes.multiplicity]
    mean = np.einsum("m,cmv->cv", sign, centers) / membranes.multiplicity
    return np.concatenate([every.mean(axis=0), mean.ravel()])
