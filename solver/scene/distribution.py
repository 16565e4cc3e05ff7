"""How a quantity varies among the vesicles of an arrangement: one for all, or a random one for each."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Discriminator, Tag, model_validator

from solver.model import Model, NonNegative

Array = NDArray[np.float64]

DEVIATIONS = 2.0  # standard deviations, beyond which a normal distribution is cut off


class Uniform(Model):
    """A uniform distribution.

    Attributes
    ----------
    low, high : float
        Smallest and largest value.
    """

    kind: Literal["uniform"] = "uniform"
    low: float
    high: float

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.low <= self.high:
            raise ValueError(f"low must not be more than high, got {self.low} and {self.high}")
        return self

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the largest value that can be drawn."""
        return self.low, self.high

    def draw(self, count: int, random: np.random.Generator) -> Array:
        """Draw independent values.

        Parameters
        ----------
        count : int
        random : Generator

        Returns
        -------
        (count,)
        """
        return random.uniform(self.low, self.high, count)


class Normal(Model):
    """A normal distribution, cut off at `DEVIATIONS` standard deviations from its mean.

    Attributes
    ----------
    mean : float
        Mean, which is also the median.
    deviation : float
        Standard deviation before the tails are cut off.
    """

    kind: Literal["normal"] = "normal"
    mean: float
    deviation: NonNegative

    @property
    def ends(self) -> tuple[float, float]:
        """The least and the largest value that can be drawn."""
        return self.mean - DEVIATIONS * self.deviation, self.mean + DEVIATIONS * self.deviation

    def draw(self, count: int, random: np.random.Generator) -> Array:
        """Draw independent values.

        Parameters
        ----------
        count : int
        random : Generator

        Returns
        -------
        (count,)
        """
        from scipy.stats import truncnorm  # for the reason that `solver.membrane.shapes` gives

        scaled = truncnorm.rvs(-DEVIATIONS, DEVIATIONS, size=count, random_state=random)
        return np.asarray(self.mean + self.deviation * scaled)


def _tag(value: Any) -> str:
    kind = value.get("kind") if isinstance(value, dict) else getattr(value, "kind", None)
    return kind if isinstance(kind, str) else "number"


Distribution = Annotated[
    Annotated[float, Tag("number")] | Annotated[Uniform, Tag("uniform")] | Annotated[Normal, Tag("normal")],
    Discriminator(_tag),
]


def ends(distribution: float | Uniform | Normal) -> tuple[float, float]:
    """Return the least and the largest value that can be drawn.

    Parameters
    ----------
    distribution : float, Uniform or Normal

    Returns
    -------
    low : float
    high : float
    """
    return (distribution, distribution) if isinstance(distribution, int | float) else distribution.ends


def samples(distribution: float | Uniform | Normal, count: int, random: np.random.Generator) -> Array:
    """Draw a value for each vesicle.

    Parameters
    ----------
    distribution : float, Uniform or Normal
    count : int
        Number of vesicles.
    random : Generator

    Returns
    -------
    (count,)
    """
    if isinstance(distribution, int | float):
        return np.full(count, float(distribution))
    return distribution.draw(count, random)
