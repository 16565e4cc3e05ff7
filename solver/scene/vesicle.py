"""One vesicle as a scene describes it."""

from __future__ import annotations

import math

from pydantic import Field

from solver.model import Model, Positive


class Vesicle(Model):
    """An inextensible membrane that starts as an ellipse of exactly this reduced area and length."""

    reduced_area: float = Field(0.9, gt=0, le=1)  # 4π·area/length²
    length: Positive = 2 * math.pi
    bending_modulus: Positive = 1.0
    viscosity_contrast: Positive = 1.0  # of the fluid inside to that outside
    center: tuple[float, float] = (0.0, 0.0)
    angle: float = math.pi / 2  # of the long axis against x, radians
