"""An adhesion potential that ends at a cutoff, and its sums between points, compiled.

Between points at the distance r the potential φ of `adhesion` is multiplied by a switch,

    ψ(r) = χ(s) φ(r),   s = (c² − r²)/(c² − δ²),   χ(s) = s⁵ (126 − 420 s + 540 s² − 315 s³ + 70 s⁴),

which is 1 up to the distance δ, where attraction begins, and 0 from the cutoff c on.  So repulsion and the
depth of the potential's minimum stay as they are.  χ has four continuous derivatives, for the sake of the
trapezoid rule; χ' = 630 s⁴ (1 − s)⁴.  The force is −∇ψ = −2 ψ_q (x − y) with q = r².
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled

Array = NDArray[np.float64]

_JUMP = 126.0 * 120.0  # of the switch's fifth derivative at either end


class TruncatedPotential(NamedTuple):
    """ψ/H, with δ = ``distance`` and c = ``cutoff``."""

    distance: float
    m: int
    n: int
    cutoff: float


@compiled
def truncated_potential(square: float, potential: TruncatedPotential) -> tuple[float, float, float]:
    """ψ/H at r² = ``square``, and its first and second derivative by r²."""
    distance, m, n, cutoff = potential
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
def truncated_force(
    targets: Array, sources: Array, potential: TruncatedPotential, scale: float, out: Array
) -> None:
    """Write −scale·∇ Σ ψ/H over ``sources`` (2, s) to out (2, t) for each target."""
    for i in range(targets.shape[1]):
        fx = 0.0
        fy = 0.0
        for j in range(sources.shape[1]):
            dx, dy = targets[0, i] - sources[0, j], targets[1, i] - sources[1, j]
            slope = truncated_potential(dx * dx + dy * dy, potential)[1]
            fx -= 2.0 * slope * dx
            fy -= 2.0 * slope * dy
        out[0, i] = scale * fx
        out[1, i] = scale * fy


@compiled
def truncated_energy(targets: Array, sources: Array, potential: TruncatedPotential) -> float:
    """Σ Σ ψ/H over ``targets`` (2, t) and ``sources`` (2, s)."""
    total = 0.0
    for i in range(targets.shape[1]):
        for j in range(sources.shape[1]):
            dx, dy = targets[0, i] - sources[0, j], targets[1, i] - sources[1, j]
            total += truncated_potential(dx * dx + dy * dy, potential)[0]
    return total


@compiled
def truncated_hessian(
    targets: Array,
    sources: Array,
    potential: TruncatedPotential,
    scale: float,
    xx: Array,
    xy: Array,
    yy: Array,
) -> None:
    """Fill the components (t, s) of the derivative of each pair's force by the target's position."""
    for i in range(targets.shape[1]):
        for j in range(sources.shape[1]):
            dx, dy = targets[0, i] - sources[0, j], targets[1, i] - sources[1, j]
            _, slope, bend = truncated_potential(dx * dx + dy * dy, potential)
            xx[i, j] = scale * (-2.0 * slope - 4.0 * bend * dx * dx)
            xy[i, j] = scale * (-4.0 * bend * dx * dy)
            yy[i, j] = scale * (-2.0 * slope - 4.0 * bend * dy * dy)


def switch_error(potential: TruncatedPotential, spacing: float) -> float:
    """Error of the trapezoid rule across the ends of the switch, relative to the force.

    A jump J of the fifth derivative by x/width leaves 2 J (spacing/(2π width))⁶ at most, after Euler and
    Maclaurin; all ends and higher derivatives, measured on ellipses, leave up to 10 times as much.
    """
    # Where the switch is steepest in r, at the cutoff.
    width = (potential.cutoff**2 - potential.distance**2) / (2 * potential.cutoff)
    return float(20 * _JUMP * (spacing / (2 * np.pi * width)) ** 6)
