"""Power laws and lines through computed values, with what they leave uncertain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import linregress, t

_CONFIDENCE = 0.95


@dataclass(frozen=True)
class PowerLaw:
    """value = prefactor · x^exponent; `error` is half the 95% confidence interval of the exponent."""

    prefactor: float
    exponent: float
    error: float

    def __str__(self) -> str:
        return f"{self.exponent:.3f} ± {self.error:.3f}".replace("-", "−")


def power_law(x: Sequence[float], values: Sequence[float]) -> PowerLaw:
    """Fit a straight line to the logarithms by least squares.

    Parameters
    ----------
    x, values : sequence of float
        Positive, at least three: two lie on a power law whatever the physics.

    Raises
    ------
    ValueError
        If there are fewer.
    """
    if len(x) < 3:
        raise ValueError(f"a power law needs at least 3 values, got {len(x)}")
    line = linregress(np.log(x), np.log(values))
    quantile = t.ppf((1 + _CONFIDENCE) / 2, len(x) - 2)
    return PowerLaw(float(np.exp(line.intercept)), float(line.slope), float(quantile * line.stderr))


@dataclass(frozen=True)
class Line:
    """value = intercept + slope · x; the errors are half the 95% confidence intervals."""

    intercept: float
    slope: float
    intercept_error: float
    slope_error: float


def straight_line(x: Sequence[float], values: Sequence[float]) -> Line:
    """Fit a straight line by least squares.

    Parameters
    ----------
    x, values : sequence of float
        At least three: two lie on a line whatever the physics.

    Raises
    ------
    ValueError
        If there are fewer.
    """
    if len(x) < 3:
        raise ValueError(f"a line needs at least 3 values, got {len(x)}")
    line = linregress(x, values)
    quantile = t.ppf((1 + _CONFIDENCE) / 2, len(x) - 2)
    return Line(
        float(line.intercept),
        float(line.slope),
        float(quantile * line.intercept_stderr),
        float(quantile * line.stderr),
    )
