"""Refining a vesicle's points for the targets that are close to it.

The trapezoid rule over one membrane is accurate at a target that is a few spacings away
(`solver.potentials.quadrature`).  For nearer ones the membrane is interpolated to a power of two times as
many points, decided target by target.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

MAXIMUM_FACTOR = 32  # beyond it the adhesion of a close target is not resolved
LARGEST_REFINED = 4  # factor up to which the single layer is refined; measured: from 8 on that is slower


class Refinement(NamedTuple):
    """By which factor each curve is refined for which targets.

    Attributes
    ----------
    groups : (k, 3)
        Target vesicle, source curve and factor of each group of targets; a target is in at most one group of
        every other curve.
    rows : (·,)
        ``rows[starts[g]:starts[g + 1]]`` are the points of group g within their vesicle.
    starts : (k + 1,)
    interpolations : (·, n)
        `spectral.interpolations` up to the largest factor.
    """

    groups: Indices
    rows: Indices
    starts: Indices
    interpolations: Array

    @property
    def largest_factor(self) -> int:
        """The largest factor that the matrices allow; no group has a larger one."""
        rows, points = self.interpolations.shape
        return rows // points // 2 + 1


@compiled
def refinement_factors(distance_per_spacing: Array, ratio: float) -> Indices:
    """Return the least powers of two by which points have to be refined, at most `MAXIMUM_FACTOR`.

    Parameters
    ----------
    distance_per_spacing : (n,)
        Of each target.
    ratio : float
        Distance over refined spacing to reach.

    Returns
    -------
    (n,)
    """
    factors = np.empty(distance_per_spacing.size, dtype=np.int64)
    for i in range(factors.size):
        factors[i] = 1
        while factors[i] < MAXIMUM_FACTOR and factors[i] * distance_per_spacing[i] < ratio:
            factors[i] *= 2
    return factors


@compiled
def _group_targets(
    pairs: Indices,
    distances: Array,
    ratio: float,
    limits: Array,
    groups: Indices,
    rows: Indices,
    starts: Indices,
) -> int:
    """Write the arrays of `group_targets`, and return the number of groups."""
    found = used = 0
    starts[0] = 0
    for pair in range(pairs.shape[0]):
        source = pairs[pair, 1]
        factors = refinement_factors(distances[pair], ratio)
        factor = 1
        while factor <= MAXIMUM_FACTOR:
            for i in range(factors.size):
                if factors[i] == factor and distances[pair, i] < limits[source]:
                    rows[used] = i
                    used += 1
            if used > starts[found]:
                groups[found, 0], groups[found, 1], groups[found, 2] = pairs[pair, 0], source, factor
                found += 1
                starts[found] = used
            factor *= 2
    return found


def group_targets(
    pairs: Indices, distances: Array, ratio: float, limits: Array
) -> tuple[Indices, Indices, Indices]:
    """Make the groups, rows and starts of a `Refinement`.

    Parameters
    ----------
    pairs : (k, 2)
        Target vesicle and source curve.
    distances : (k, n)
        Distance over spacing, by pair and point of the target.
    ratio : float
        Distance over refined spacing to reach.
    limits : (C,)
        Points at this distance from a source curve, or beyond, are left out.

    Returns
    -------
    groups : (·, 3)
    rows : (·,)
    starts : (·,)
    """
    most = len(pairs) * MAXIMUM_FACTOR.bit_length()
    groups, starts = np.empty((most, 3), dtype=np.int64), np.empty(most + 1, dtype=np.int64)
    rows = np.empty(distances.size, dtype=np.int64)
    found = _group_targets(pairs, distances, ratio, limits, groups, rows, starts)
    return groups[:found], rows[: starts[found]], starts[: found + 1]


def within(refinement: Refinement, own: slice, size: int) -> Refinement:
    """Return the part of a refinement that concerns some of the points.

    Parameters
    ----------
    refinement : Refinement
    own : slice
        Of these points, counted through all vesicles.
    size : int
        Number of all points.

    Returns
    -------
    Refinement
    """
    if own == slice(0, size):
        return refinement
    sizes = np.diff(refinement.starts)
    group = np.repeat(np.arange(sizes.size), sizes)
    rows = refinement.rows[: group.size]
    point = refinement.groups[group, 0] * refinement.interpolations.shape[1] + rows
    inside = (own.start <= point) & (point < own.stop)
    sizes = np.bincount(group[inside], minlength=sizes.size)
    starts = np.concatenate([[0], np.cumsum(sizes[sizes > 0])])
    return Refinement(refinement.groups[sizes > 0], rows[inside], starts, refinement.interpolations)


def sum_costs(refinement: Refinement, costs: Array, size: int) -> Array:
    """Add up, for each point, the costs of the groups that it is in.

    Parameters
    ----------
    refinement : Refinement
        With k groups.
    costs : (k,)
        Of being in each group.
    size : int
        Number of points.

    Returns
    -------
    (size,)
    """
    sizes = np.diff(refinement.starts)
    group = np.repeat(np.arange(sizes.size), sizes)
    point = refinement.groups[group, 0] * refinement.interpolations.shape[1] + refinement.rows[: group.size]
    return np.bincount(point, weights=costs[group], minlength=size).astype(np.float64)


@compiled
def interpolation_to(refinement: Refinement, factor: int) -> Array:
    """Return the interpolation matrix for a factor.

    Parameters
    ----------
    refinement : Refinement
    factor : int
        At least 2.

    Returns
    -------
    (factor·n, n)
    """
    n = refinement.interpolations.shape[1]
    return refinement.interpolations[(factor - 2) * n : (2 * factor - 2) * n]


@compiled
def refined_points(points: Array, source: int, factor: int, refinement: Refinement) -> Array:
    """Return the points of one curve, refined.

    Parameters
    ----------
    points : (2, C, n)
        Of all curves.
    source : int
        Number of the curve.
    factor : int
    refinement : Refinement

    Returns
    -------
    (2, factor·n)
    """
    x, y = points[0, source], points[1, source]
    refined = np.empty((2, factor * x.size))
    if factor == 1:
        for j in range(x.size):
            refined[0, j], refined[1, j] = x[j], y[j]
    else:
        matrix = interpolation_to(refinement, factor)
        for i in range(refined.shape[1]):
            row, fine_x, fine_y = matrix[i], 0.0, 0.0
            for j in range(x.size):
                fine_x += row[j] * x[j]
                fine_y += row[j] * y[j]
            refined[0, i], refined[1, i] = fine_x, fine_y
    return refined


@compiled
def selected_points(points: Array, curve: int, rows: Indices) -> Array:
    """Return some of the points of one curve.

    Parameters
    ----------
    points : (2, C, n)
        Of all curves.
    curve : int
        Number of the curve.
    rows : (k,)
        Which of its points.

    Returns
    -------
    (2, k)
    """
    selected = np.empty((2, rows.size))
    for k in range(rows.size):
        selected[0, k], selected[1, k] = points[0, curve, rows[k]], points[1, curve, rows[k]]
    return selected
