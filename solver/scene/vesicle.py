"""One vesicle as a scene describes it."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from solver.dimensions import ANGLE, BENDING_MODULUS, LENGTH
from solver.model import Model, Positive

# A vesicle whose reduced area is less than this below 1 is circular: its curvature varies by 3e-5 at most.
_ROUNDNESS = 1e-9


class Vesicle(Model):
    """An inextensible membrane that starts as an ellipse of exactly this reduced area and length.

    Attributes
    ----------
    reduced_area : float
        4π·area/length².
    length : float
        Perimeter of the membrane.
    bending_modulus : float
        Stiffness of the membrane against bending.
    viscosity_contrast : float
        Viscosity of the fluid inside over that outside.
    center : (2,)
        Position, x and y.
    angle : float
        Of the long axis against x, radians.
    """

    reduced_area: float = Field(0.9, gt=0, le=1)
    length: Annotated[Positive, LENGTH] = 2 * math.pi
    bending_modulus: Annotated[Positive, BENDING_MODULUS] = 1.0
    viscosity_contrast: Positive = 1.0
    center: tuple[Annotated[float, LENGTH], Annotated[float, LENGTH]] = (0.0, 0.0)
    angle: Annotated[float, ANGLE] = math.pi / 2

    @property
    def is_circle(self) -> bool:
        """Whether it is a circle up to round-off, which has the largest area for its length."""
        return self.reduced_area > 1 - _ROUNDNESS
