"""The end of attraction at a cutoff: a smooth switch by which any pair potential is multiplied.

Between points at the distance r the potential φ becomes

    ψ(r) = χ(s) φ(r),   s = (c² − r²)/(c² − δ²),   χ(s) = s⁵ (126 − 420 s + 540 s² − 315 s³ + 70 s⁴),

with χ = 1 up to the distance δ, where attraction begins, and χ = 0 from the cutoff c on.  So repulsion and
the depth of the potential's minimum stay as they are.  χ is the polynomial of least degree with four
continuous derivatives at both ends, for the sake of the trapezoid rule; χ' = 630 s⁴ (1 − s)⁴.
"""

from __future__ import annotations

import math

_JUMP = 126.0 * 120.0  # of the switch's fifth derivative at either end


def truncate(
    square: float, distance: float, cutoff: float, value: float, first: float, second: float
) -> tuple[float, float, float]:
    """Compute ψ/H and its derivatives by q = r² from those of φ/H.

    Parameters
    ----------
    square : float
        q, length².
    distance, cutoff : float
        δ and c.
    value, first, second : float
        φ/H and its first and second derivative by q.

    Returns
    -------
    tuple of three floats
        ψ/H and its first and second derivative by q.
    """
    width = cutoff * cutoff - distance * distance
    s = (cutoff * cutoff - square) / width
    s = s if s > 0.0 else 0.0
    s = s if s < 1.0 else 1.0
    product = s * (1.0 - s)
    cube = product * product * product
    switch = s * s * s * s * s * (126.0 - s * (420.0 - s * (540.0 - s * (315.0 - 70.0 * s))))
    switch_first = -630.0 * cube * product / width
    switch_second = 2520.0 * cube * (1.0 - 2.0 * s) / (width * width)
    return (
        switch * value,
        switch * first + switch_first * value,
        switch * second + 2.0 * switch_first * first + switch_second * value,
    )


def switch_error(distance: float, cutoff: float, spacing: float) -> float:
    """Estimate the error of the trapezoid rule across the ends of the switch, relative to the force.

    A jump J of the fifth derivative by x/width leaves 2 J (spacing/(2π width))⁶ at most, by the formula of
    Euler and Maclaurin.  All ends and higher derivatives, measured on ellipses, leave up to 10 times as much.

    Parameters
    ----------
    distance, cutoff : float
        δ and c.
    spacing : float
        Of the sources.

    Returns
    -------
    float
    """
    # Where the switch is steepest in r, at the cutoff.
    width = (cutoff**2 - distance**2) / (2 * cutoff)
    return 20 * _JUMP * (spacing / (2 * math.pi * width)) ** 6
