"""Adhesion whose attraction ends at a cutoff.

Between points at the distance r the potential φ of `adhesion` is multiplied by a switch,

    ψ(r) = χ(s) φ(r),   s = (c² − r²)/(c² − δ²),   χ(s) = s⁵ (126 − 420 s + 540 s² − 315 s³ + 70 s⁴),

which is 1 up to the distance δ, where attraction begins, and 0 from the cutoff c on.  So repulsion and the
depth of the potential's minimum stay as they are.  χ has four continuous derivatives, for the sake of the
trapezoid rule; χ' = 630 s⁴ (1 − s)⁴.  The force is −∇ψ = −2 ψ_q (x − y) with q = r².
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver import scene
from solver.adhesion import Adhesion
from solver.compilation import compiled
from solver.geometry import Geometry, Membranes
from solver.proximity import Proximity
from solver.refinement import MAXIMUM_FACTOR
from solver.spectral import interpolation

Array = NDArray[np.float64]

_JUMP = 126.0 * 120.0  # of the switch's fifth derivative at either end


@compiled
def truncated_potential(
    square: float, distance: float, cutoff: float, m: int, n: int
) -> tuple[float, float, float]:
    """ψ/H at r² = ``square``, and its first and second derivative by r²."""
    if square >= cutoff * cutoff:
        return 0.0, 0.0, 0.0
    ratio = distance / np.sqrt(square)
    low = ratio**n
    high = low * ratio ** (m - n)
    value = high - m / n * low
    slope = -0.5 * m * (high - low) / square
    bend = 0.5 * m * ((0.5 * m + 1.0) * high - (0.5 * n + 1.0) * low) / (square * square)
    width = cutoff * cutoff - distance * distance
    s = (cutoff * cutoff - square) / width
    if s >= 1.0:
        return value, slope, bend
    rest = s * (1.0 - s)
    switch = s**5 * (126.0 - s * (420.0 - s * (540.0 - s * (315.0 - 70.0 * s))))
    first = -630.0 * rest**4 / width
    second = 2520.0 * rest**3 * (1.0 - 2.0 * s) / (width * width)
    return (
        switch * value,
        switch * slope + first * value,
        switch * bend + 2.0 * first * slope + second * value,
    )


@compiled
def truncated_energy(targets: Array, sources: Array, distance: float, cutoff: float, m: int, n: int) -> float:
    """Σ Σ ψ/H over ``targets`` (2, t) and ``sources`` (2, s)."""
    total = 0.0
    for i in range(targets.shape[1]):
        for j in range(sources.shape[1]):
            dx, dy = targets[0, i] - sources[0, j], targets[1, i] - sources[1, j]
            total += truncated_potential(dx * dx + dy * dy, distance, cutoff, m, n)[0]
    return total


@compiled
def truncated_force(targets: Array, sources: Array, distance: float, cutoff: float, m: int, n: int) -> Array:
    """−∇ Σ ψ/H over ``sources`` (2, s) at each of ``targets`` (2, t), (2, t)."""
    force = np.zeros(targets.shape)
    for i in range(targets.shape[1]):
        for j in range(sources.shape[1]):
            dx, dy = targets[0, i] - sources[0, j], targets[1, i] - sources[1, j]
            slope = truncated_potential(dx * dx + dy * dy, distance, cutoff, m, n)[1]
            force[0, i] -= 2.0 * slope * dx
            force[1, i] -= 2.0 * slope * dy
    return force


@compiled
def truncated_hessian(
    targets: Array, sources: Array, distance: float, cutoff: float, m: int, n: int
) -> Array:
    """Derivatives xx, xy, yy (3, t, s) of each pair's force by the target's position."""
    hessian = np.empty((3, targets.shape[1], sources.shape[1]))
    for i in range(targets.shape[1]):
        for j in range(sources.shape[1]):
            dx, dy = targets[0, i] - sources[0, j], targets[1, i] - sources[1, j]
            _, slope, bend = truncated_potential(dx * dx + dy * dy, distance, cutoff, m, n)
            hessian[0, i, j] = -2.0 * slope - 4.0 * bend * dx * dx
            hessian[1, i, j] = -4.0 * bend * dx * dy
            hessian[2, i, j] = -2.0 * slope - 4.0 * bend * dy * dy
    return hessian


class _Group(NamedTuple):
    """Targets, and a curve refined for them."""

    target: int
    source: int
    rows: NDArray[np.int64]
    factor: int
    points: Array  # (2, factor·N)
    weight: float  # of one of them


class TruncatedAdhesion(Adhesion):
    """`Adhesion` with a cutoff.  Every rank computes all of it.

    Parameters
    ----------
    parameters : scene.Adhesion
        With a cutoff.
    accuracy : float
        As for `Adhesion`; sources are also refined for the switch, whose fifth derivative jumps.
    membranes : Membranes
    """

    def __init__(self, parameters: scene.Adhesion, accuracy: float, membranes: Membranes) -> None:
        super().__init__(parameters, accuracy)
        if parameters.cutoff is None:
            raise ValueError(
                "adhesion.cutoff: None — attraction that ends has a distance beyond which it does"
            )
        cutoff = parameters.cutoff
        distance, m, n = self._potential
        self._truncated = distance, cutoff, m, n
        # Where the switch is steepest in r, at the cutoff.
        width = (cutoff**2 - distance**2) / (2 * cutoff)
        spacing = float(membranes.spacing.max())
        self._least_factor = 1
        while self._least_factor < MAXIMUM_FACTOR and _switch_error(spacing, width) > accuracy:
            self._least_factor *= 2
            spacing /= 2
        self._switch_error = _switch_error(spacing, width)

    def density(self, geometry: Geometry, closeness: Proximity) -> Array:
        """See `Adhesion`."""
        density = np.zeros_like(geometry.points)
        for group in self._groups(geometry, closeness):
            force = truncated_force(
                geometry.points[:, group.target, group.rows], group.points, *self._truncated
            )
            density[:, group.target, group.rows] += self._hamaker * group.weight * force
        return density

    def jacobian(self, geometry: Geometry, closeness: Proximity) -> Array:
        """See `Adhesion`."""
        membranes = geometry.membranes
        points, size = membranes.points, membranes.count * membranes.points
        by_points = np.zeros((2, size, 2, membranes.copies * size))
        for group in self._groups(geometry, closeness):
            pair = truncated_hessian(
                geometry.points[:, group.target, group.rows], group.points, *self._truncated
            )
            pair *= self._hamaker * group.weight
            folded = pair if group.factor == 1 else pair @ interpolation(points, group.factor)
            rows = group.target * points + group.rows
            columns = slice(group.source * points, (group.source + 1) * points)
            for component, (a, b) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
                each = (0, 1, 1, 2)[component]
                by_points[a, rows, b, columns] -= folded[each]
                by_points[a, rows, b, rows] += pair[each].sum(axis=1)
        return geometry.by_state(membranes.fold(by_points))

    def sum_error(self, closeness: Proximity) -> float:
        """See `Adhesion`."""
        return max(super().sum_error(closeness), self._switch_error)

    def energy(self, geometry: Geometry, closeness: Proximity) -> float:
        """See `Adhesion`."""
        total = 0.0
        for group in self._groups(geometry, closeness):
            targets = geometry.points[:, group.target, group.rows]
            pair = truncated_energy(targets, group.points, *self._truncated)
            total += 0.5 * geometry.membranes.spacing[group.target] * group.weight * pair
        return float(geometry.membranes.copies * self._hamaker * total)

    def _groups(self, geometry: Geometry, closeness: Proximity) -> Iterator[_Group]:
        spacing, points = geometry.membranes.curve_spacing, geometry.membranes.points
        refinement = closeness.refinement(self.ratio)
        for index, (target, source, factor) in enumerate(refinement.groups.tolist()):
            rows = refinement.rows[refinement.starts[index] : refinement.starts[index + 1]]
            factor = max(factor, self._least_factor)
            curve = np.ascontiguousarray(geometry.curve_points[:, source])
            fine = curve if factor == 1 else curve @ interpolation(points, factor).T
            yield _Group(target, source, rows, factor, fine, spacing[source] / factor)


def _switch_error(spacing: float, width: float) -> float:
    """Error of the trapezoid rule across the ends of the switch, relative to the force.

    A jump J of the fifth derivative by x/width leaves 2 J (spacing/(2π width))⁶ at most, after Euler and
    Maclaurin; all ends and higher derivatives, measured on ellipses, leave up to 10 times as much.
    """
    return float(20 * _JUMP * (spacing / (2 * np.pi * width)) ** 6)
