"""Random places for ellipses in a square, no two of them nearer than a given distance.

Where there is room, each ellipse is put at random places until one is free, the large ones first (random
sequential adsorption; Widom 1966).  This reaches only densities far below that of dense packings.  Where it
fails, all ellipses start aligned on a lattice that fills the square, and random moves, refused where two
would come too near, make them forget the lattice (Metropolis et al. 1953, for hard particles).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from solver.scene.ellipses import Ellipses, clearances

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

_TRIES = 1000  # of places for one ellipse
_SWEEPS = 20  # moves of every ellipse, from the lattice


def placed_at_random(
    axes: Array, side: float, distance: float, angle: float | None, random: np.random.Generator
) -> tuple[ComplexArray, Array]:
    """Place ellipses in the square |x|, |y| ≤ ``side``/2.

    Parameters
    ----------
    axes : (M, 2)
        Semi-axes, the longer one first.
    side : float
    distance : float
        Least distance of any two.
    angle : float or None
        Of all long axes against x, radians; None for random ones.
    random : Generator

    Returns
    -------
    centers : complex (M,)
    angles : (M,)

    Raises
    ------
    ValueError
        If there is no room for all.
    """
    ellipses = _one_by_one(axes, side, distance, angle, random)
    if ellipses is None:
        ellipses = _from_a_lattice(axes, side, distance, angle, random)
    return ellipses.center, np.angle(ellipses.axis)


def _one_by_one(
    axes: Array, side: float, distance: float, angle: float | None, random: np.random.Generator
) -> Ellipses | None:
    count = len(axes)
    placed = Ellipses(
        np.full(count, np.nan + 0j), np.ones(count, complex), axes[:, 0].copy(), axes[:, 1].copy()
    )
    order = np.argsort(-axes[:, 0], kind="stable")
    for rank, index in enumerate(order):
        before = placed[order[:rank]]
        for _ in range(_TRIES):
            chosen = random.uniform(0, np.pi) if angle is None else angle
            placed.axis[index] = np.exp(1j * chosen)
            room = side / 2 - _extent(placed[[index]])
            if room.min() < 0:
                continue
            placed.center[index] = complex(*(room * random.uniform(-1, 1, 2)))
            if _is_free(placed[[index]], before, distance):
                break
        else:
            return None
    return placed


def _from_a_lattice(
    axes: Array, side: float, distance: float, angle: float | None, random: np.random.Generator
) -> Ellipses:
    count, major, minor = len(axes), axes[:, 0].copy(), axes[:, 1].copy()
    axis = np.full(count, np.exp(1j * (0.0 if angle is None else angle)))
    center, apart = _widest_lattice(count, side, _all_as_the_largest(axis, axes))
    if apart < distance:
        raise ValueError(
            f"area_fraction is too high: no room was found for {count} vesicles at a distance of "
            f"{distance:g} from each other in a square of side {side:.4g}"
        )
    ellipses = Ellipses(random.permutation(center), axis, major, minor)
    others = ~np.eye(count, dtype=bool)
    reach = max(apart, 0.1 * float(minor.min()))
    for _ in range(_SWEEPS):
        for index in range(count):
            here = ellipses[[index]]
            turn = 0.0 if angle is not None else random.normal(0, reach / major[index])
            step = reach * complex(*random.normal(0, 1, 2))
            moved = Ellipses(here.center + step, here.axis * np.exp(1j * turn), here.major, here.minor)
            room = side / 2 - _extent(moved)
            inside = abs(moved.center[0].real) <= room[0] and abs(moved.center[0].imag) <= room[1]
            if inside and _is_free(moved, ellipses[others[index]], distance):
                ellipses.center[index], ellipses.axis[index] = moved.center[0], moved.axis[0]
    return ellipses


def _all_as_the_largest(axis: ComplexArray, axes: Array) -> Ellipses:
    """Return ellipses on the origin, each as large as the largest in both axes."""
    major, minor = (np.full(len(axes), largest) for largest in axes.max(axis=0))
    return Ellipses(np.zeros(len(axes), complex), axis, major, minor)


def _widest_lattice(count: int, side: float, ellipses: Ellipses) -> tuple[ComplexArray, float]:
    """Return centers (count,) in staggered rows that fill the square, and the gap between equal ellipses."""
    width, height = side - 2 * _extent(ellipses[:1])
    best, widest = np.zeros(count, complex), -math.inf
    if min(width, height) < 0:
        return best, widest
    for columns in range(1, count + 1):
        rows = math.ceil(count / columns)
        across = width / (columns - 0.5 if rows > 1 else max(columns - 1, 1))
        up = height / max(rows - 1, 1)
        row, column = np.divmod(np.arange(count), columns)
        center = (column + 0.5 * (row % 2)) * across - width / 2 + 1j * (row * up - height / 2)
        offsets = (
            center[np.clip([1, columns - 1, columns, columns + 1, 2 * columns], None, count - 1)] - center[0]
        )
        offsets = offsets[offsets != 0]
        offsets = np.concatenate([offsets, offsets.conj()])
        placed = ellipses[np.zeros(len(offsets), dtype=int)]
        shifted = Ellipses(offsets, placed.axis, placed.major, placed.minor)
        apart = float(clearances(placed, shifted).min(initial=math.inf))
        if apart > widest:
            best, widest = center, apart
    return best, widest


def _extent(ellipse: Ellipses) -> Array:
    """Return how far a single ellipse reaches from its center along x and y, (2,)."""
    return ellipse.support(np.array([[1.0, 1.0j]]))[0]


def _is_free(ellipse: Ellipses, others: Ellipses, distance: float) -> bool:
    """Whether a single ellipse keeps the distance from all others."""
    # Up to thousands this one pass costs less than a look-up in a tree would.
    apart = np.abs(others.center - ellipse.center) - distance
    if np.any(apart < others.minor + ellipse.minor):
        return False
    near = apart < others.major + ellipse.major
    if not near.any():
        return True
    neighbors = others[near]
    repeated = ellipse[np.zeros(len(neighbors.center), dtype=int)]
    return bool(clearances(repeated, neighbors).min() >= distance)
