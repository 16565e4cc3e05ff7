"""Configurations of a pair that stays together, by what is measured of its motion or of its contact.

In motion a pair *slides* open in every half turn while its vesicles keep their directions, or *tumbles* as
one (Quaife et al. 2019, section V).  Where one turns into the other its period has a peak, the resonance.
What jumps there is how often the long axes of the vesicles turn.  A pair whose vesicles keep their directions
without sliding open *rolls*: round vesicles tread past each other.

At rest the contact is *flat*, or one membrane bulges into the other one, *male-female*, or it is bent like an
S, *sigmoid* (Ziherl & Svetina 2007; Flormann et al. 2017).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from solver.analysis.contacts import CONTACT
from solver.analysis.run import Arrangement, Configuration, Outcome
from solver.membrane import curve
from solver.membrane.spectral import resampled

if TYPE_CHECKING:
    from solver.analysis.line_of_centers import LineOfCenters
    from solver.membrane.geometry import Membranes
    from solver.scene import Scene

Array = NDArray[np.float64]

SLIDES: Final = 1.2  # opening from which a pair whose vesicles keep their directions slides
BENT: Final = 0.01  # bow or twist, over the length of the contact, from which it is not flat

_FINER = 8  # times as many points, of which the nearest ones are sought
_LEAST_POINTS = 8  # of a contact
_HALF = 0.5  # between a vesicle that keeps its direction and one that turns with the pair


def _keeps_directions(pair: Arrangement) -> bool:
    return pair.own_turns is not None and max(pair.own_turns) < _HALF


def _turns_as_one(pair: Arrangement) -> bool:
    return pair.own_turns is not None and min(pair.own_turns) >= _HALF


def _bent(pair: Arrangement) -> tuple[float, float] | None:
    return None if pair.bow is None or pair.twist is None else (abs(pair.bow), abs(pair.twist))


def _slides(pair: Arrangement) -> bool:
    return _keeps_directions(pair) and (pair.opening or 0.0) >= SLIDES


def _rolls(pair: Arrangement) -> bool:
    return _keeps_directions(pair) and (pair.opening or np.inf) < SLIDES


def _is_flat(pair: Arrangement) -> bool:
    bent = _bent(pair)
    return bent is not None and max(bent) < BENT


def _is_bowed(pair: Arrangement) -> bool:
    bent = _bent(pair)
    return bent is not None and max(bent) >= BENT and bent[0] >= bent[1]


def _is_sigmoid(pair: Arrangement) -> bool:
    bent = _bent(pair)
    return bent is not None and max(bent) >= BENT and bent[0] < bent[1]


# A configuration and what must hold for it.  No two hold at once.
CONFIGURATIONS: Final[Mapping[Configuration, Callable[[Arrangement], bool]]] = {
    Configuration.SLIDING: _slides,
    Configuration.ROLLING: _rolls,
    Configuration.TUMBLING: _turns_as_one,
    Configuration.FLAT: _is_flat,
    Configuration.MALE_FEMALE: _is_bowed,
    Configuration.SIGMOID: _is_sigmoid,
}


def configuration_of(arrangement: Arrangement | None) -> Configuration | None:
    """Return the configuration of a pair.

    Parameters
    ----------
    arrangement : Arrangement or None

    Returns
    -------
    Configuration or None
        None if nothing is measured, or no configuration fits: one vesicle turns and the other one does not.
    """
    if arrangement is None:
        return None
    return next((each for each, holds in CONFIGURATIONS.items() if holds(arrangement)), None)


def arrangement_of(
    scene: Scene, outcome: Outcome, line: LineOfCenters | None, membranes: Membranes, state: Array
) -> Arrangement | None:
    """Measure a pair at the end of its run.

    Parameters
    ----------
    scene : Scene
    outcome : Outcome
    line : LineOfCenters or None
        Of two vesicles.
    membranes : Membranes
        Of the vesicles that are computed.
    state : (state_size,)

    Returns
    -------
    Arrangement or None
        None for a pair that has neither settled nor come to rest, or is apart.
    """
    if line is None or scene.adhesion is None:
        return None
    if outcome is Outcome.BOUND and line.has_settled(scene.criteria.settled_change):
        own_turns = line.own_turns
        if own_turns is None or any(vesicle.is_circle for vesicle in scene.vesicles):
            return Arrangement(opening=line.opening)
        return Arrangement(line.opening, tuple(map(float, own_turns * membranes.multiplicity)))
    if outcome not in (Outcome.BOUND, Outcome.EQUILIBRIUM, Outcome.STEADY):
        return None
    lengths = np.tile(membranes.length, membranes.multiplicity)
    points = curve.positions(membranes.curve_tangent_angle(state), membranes.curve_center(state), lengths)
    bent = contact_shape(points, CONTACT * scene.adhesion.distance)
    return None if bent is None else Arrangement(bow=bent[0], twist=bent[1])


def contact_shape(points: Array, distance: float) -> tuple[float, float] | None:
    """Measure how the contact of two membranes is bent.

    The middle line is fitted, across the axis along which it extends, by Legendre polynomials up to degree 3.

    Parameters
    ----------
    points : (2, 2, N)
        Of both membranes, each x and y.
    distance : float
        At most so far is a point of the contact from the other membrane.

    Returns
    -------
    (float, float) or None
        The coefficients of degree 2 (bow) and 3 (twist) over the length of the contact.  None without one.
    """
    first, second = resampled(points, _FINER * points.shape[-1])
    apart = np.hypot(*(first[:, :, None] - second[:, None, :]))
    middle = np.concatenate(
        [_middle(first, second, apart, distance), _middle(second, first, apart.T, distance)], axis=1
    )
    if middle.shape[1] < 2 * _LEAST_POINTS * _FINER:
        return None
    offset = middle - middle.mean(axis=1, keepdims=True)
    across, along = np.linalg.eigh(offset @ offset.T).eigenvectors.T
    place, height = along @ offset, across @ offset
    length = np.ptp(place)
    scaled = 2 * (place - place.min()) / length - 1
    *_, bow, twist = np.polynomial.legendre.legfit(scaled, height / length, 3)
    return float(bow), float(twist)


def _middle(own: Array, others: Array, apart: Array, distance: float) -> Array:
    """Return the points halfway from a membrane to the nearest points of the other one, (2, ·)."""
    nearest = apart.argmin(axis=1)
    touching = apart.min(axis=1) < distance
    return np.asarray(0.5 * (own[:, touching] + others[:, nearest[touching]]))
