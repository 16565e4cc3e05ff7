"""A parabolic profile without walls."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal

import numpy as np
from pydantic import Field

from solver.dimensions import LENGTH
from solver.flows.imposed_flow import Array, ImposedFlow, Symbol


class Poiseuille(ImposedFlow):
    """Velocity rate·(w/2)(1 − y²/w², 0) with the half-width w.

    It is the profile of a plane channel without the walls (Kaoui, Biros & Misbah 2009).  A vesicle feels
    the curvature rate/w of the profile alone; the half-width adds a common velocity.

    Attributes
    ----------
    rate : float
        Shear rate at the distance of the half-width from the center line y = 0.
    half_width : float
        Distance from the center line at which the fluid is at rest.
    """

    kind: Literal["poiseuille"] = "poiseuille"
    # Far beyond, the curvature of the profile or the velocity of the fluid has no digits left.
    half_width: Annotated[float, Field(ge=1e-6, le=1e6), LENGTH] = 1.0

    title: ClassVar[str] = "Poiseuille flow"
    symbols: ClassVar[Mapping[str, Symbol]] = {
        "rate": Symbol("shear rate at the half-width", r"\dot{\gamma}_w", "γ̇w"),
        "half_width": Symbol("half-width", "w", "w"),
    }

    def velocity(self, points: Array, centers: Array) -> Array:
        """Return the velocity at points.

        Parameters
        ----------
        points : (2, ...)
        centers : (2, C)
            Of all vesicles; the flow does not follow them.

        Returns
        -------
        (2, ...)
        """
        width = self.half_width
        along = 0.5 * self.rate * width * (1 - (points[1] / width) ** 2)
        return np.stack([along, np.zeros_like(along)])

    def velocity_gradient(self, points: Array) -> Array:
        """Return the velocity gradient at points.

        Parameters
        ----------
        points : (2, ...)

        Returns
        -------
        (2, 2, ...)
        """
        gradient = np.zeros((2, *points.shape))
        gradient[0, 1] = -self.rate * points[1] / self.half_width
        return gradient
