"""The state in which a run begins, as a scene describes it."""

from __future__ import annotations

from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from solver.dimensions import ANGLE, TIME
from solver.model import Model, Positive

Array = NDArray[np.float64]


class RandomWaves(Model):
    """Random long waves on the membranes, which break every symmetry.

    Attributes
    ----------
    amplitude : float
        Root mean square of the change of tangent angles, in radians.
    seed : int
        Number from which the waves are drawn; equal seeds give equal waves.
    waves : int
        Largest number of waves along a membrane.
    """

    amplitude: Annotated[Positive, ANGLE]
    seed: int = Field(0, ge=0, lt=2**63)
    waves: int = Field(8, ge=2, le=16)

    def change(self, index: int, points: int) -> Array:
        """Return the change of the tangent angles of a vesicle, the same whatever the number of points.

        Parameters
        ----------
        index : int
            Of the vesicle.
        points : int

        Returns
        -------
        (points,)
            Radians.
        """
        random = np.random.default_rng((self.seed, index))
        # One wave would open the curve.
        waves = np.arange(2, self.waves + 1)
        cosines, sines = random.standard_normal((2, waves.size))
        alpha = waves[:, None] * (2 * np.pi * np.arange(points) / points)
        change = cosines @ np.cos(alpha) + sines @ np.sin(alpha)
        return np.asarray(self.amplitude * change / np.sqrt((cosines**2 + sines**2).sum() / 2))


class Start(Model):
    """How a run begins: with the vesicles as placed, or with a pair that has relaxed without flow.

    Attributes
    ----------
    relaxed : bool
        Whether a pair first comes to equilibrium without flow and is then turned, its line of centers along
        the axis y, in which the trap pulls.
    horizon : float
        Time by which the pair must have come to equilibrium.
    tilt : float
        Angle, in radians, by which the relaxed pair is turned away from that axis.
    deformation : RandomWaves or None
        Small random deformation of the vesicles as placed.  Without one they keep their shapes.
    """

    relaxed: bool = False
    horizon: Annotated[Positive, TIME] = 1000.0
    tilt: Annotated[float, ANGLE] = 1e-3
    # Left out where there is none, so that keys of scenes are what they were before there were any.
    deformation: RandomWaves | None = Field(None, exclude_if=lambda deformation: deformation is None)

    @model_validator(mode="after")
    def _not_forgotten(self) -> Self:
        if self.relaxed and self.deformation is not None:
            raise ValueError("deformation: a pair that relaxes forgets it; leave one of the two out")
        return self
