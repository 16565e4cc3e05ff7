"""Power laws and straight lines through computed values, with their uncertainty."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import linregress, t

_CONFIDENCE = 0.95
_FEWEST = 3  # two values lie on a line, and on a power law, whatever the physics


@dataclass(frozen=True)
class PowerLawFit:
    """The power law value = prefactor · x^exponent.

    Attributes
    ----------
    prefactor, exponent : float
        Its constants.
    error : float
        Half the 95% confidence interval of the exponent.
    """

    prefactor: float
    exponent: float
    error: float

    def __str__(self) -> str:
        """Return the exponent with its error."""
        return f"{self.exponent:.3f} ± {self.error:.3f}".replace("-", "−")


@dataclass(frozen=True)
class StraightLineFit:
    """The line value = intercept + slope · x.

    Attributes
    ----------
    intercept, slope : float
        Its constants.
    intercept_error, slope_error : float
        Half their 95% confidence intervals.
    """

    intercept: float
    slope: float
    intercept_error: float
    slope_error: float


def power_law(x: Sequence[float], values: Sequence[float]) -> PowerLawFit:
    """Fit a power law: a straight line through the logarithms, by least squares.

    Parameters
    ----------
    x, values : sequence of float
        Positive, at least three.

    Returns
    -------
    PowerLawFit
        The fit.

    Raises
    ------
    ValueError
        If there are fewer than three values.
    """
    line = straight_line(np.log(x).tolist(), np.log(values).tolist())
    return PowerLawFit(float(np.exp(line.intercept)), line.slope, line.slope_error)


def straight_line(x: Sequence[float], values: Sequence[float]) -> StraightLineFit:
    """Fit a straight line by least squares.

    The confidence intervals are those of Student's t distribution with two degrees of freedom fewer than
    there are values.

    Parameters
    ----------
    x, values : sequence of float
        At least three.

    Returns
    -------
    StraightLineFit
        The fit.

    Raises
    ------
    ValueError
        If there are fewer than three values.
    """
    if len(x) < _FEWEST:
        raise ValueError(f"a fit needs at least {_FEWEST} values, got {len(x)}")
    line = linregress(x, values)
    quantile = t.ppf((1 + _CONFIDENCE) / 2, len(x) - 2)
    return StraightLineFit(
        float(line.intercept),
        float(line.slope),
        float(quantile * line.intercept_stderr),
        float(quantile * line.stderr),
    )
