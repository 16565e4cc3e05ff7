"""One vesicle as a scene describes it."""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from solver.dimensions import ANGLE, BENDING_MODULUS, LENGTH
from solver.model import Model, Positive
from solver.scene.tangent_angles import crosses_itself, reduced_area_of

# A vesicle whose reduced area is less than this below 1 is circular: its curvature varies by 3e-5 at most.
_ROUNDNESS = 1e-9
# By so much the reduced area of a given shape may be another one, and its ends may lie apart over its length.
_MISMATCH = 0.01
# Farther from the origin the places of a vesicle's points lose the digits that make its shape.
_FARTHEST = 1e9

Coordinate = Annotated[float, Field(ge=-_FARTHEST, le=_FARTHEST), LENGTH]


class Vesicle(Model):
    """An inextensible membrane of exactly this reduced area and length that starts as an ellipse or as given.

    Attributes
    ----------
    reduced_area : float
        Area over that of a circle of the same perimeter, 4π·area/length²; 1 is a circle.
    length : float
        Perimeter of the membrane.
    bending_modulus : float
        Stiffness of the membrane against bending.
    viscosity_contrast : float
        Viscosity of the fluid inside over that outside.
    center : (2,)
        Where the vesicle starts, x and y.
    angle : float
        Angle of the long axis against x, in radians, at the start.  A shape of its own is turned by it.
    tangent_angle : tuple of float or None
        The shape in which it starts instead of an ellipse: tangent angles at points equispaced in arclength,
        counterclockwise, in radians, continued beyond ±π instead of jumping.  `ensemble start-from` writes
        them.  Their reduced area may differ by 0.01 from the one stated, which counts.
    """

    reduced_area: float = Field(0.9, gt=0, le=1)
    length: Annotated[Positive, LENGTH] = 2 * math.pi
    bending_modulus: Annotated[Positive, BENDING_MODULUS] = 1.0
    viscosity_contrast: Positive = 1.0
    center: tuple[Coordinate, Coordinate] = (0.0, 0.0)
    angle: Annotated[float, ANGLE] = math.pi / 2
    # Left out where there is none, so that keys of scenes are what they were before there were any.
    tangent_angle: tuple[Annotated[float, ANGLE], ...] | None = Field(
        None, min_length=16, max_length=4096, exclude_if=lambda shape: shape is None
    )

    @field_validator("tangent_angle")
    @classmethod
    def _encloses_the_area(
        cls, shape: tuple[float, ...] | None, info: ValidationInfo
    ) -> tuple[float, ...] | None:
        if shape is None:
            return None
        if len(shape) % 2:
            raise ValueError(f"must have an even number of angles, got {len(shape)}")
        angles = np.array(shape)
        enclosed, gap = reduced_area_of(angles)
        if not gap < _MISMATCH or not 0 < enclosed < 1 + _MISMATCH:
            raise ValueError("must be those of a closed curve that is run through counterclockwise")
        steps = np.abs(np.diff(angles, append=angles[0] + 2 * math.pi))
        if steps.max() >= math.pi:
            raise ValueError(
                "must change by less than π from each angle to the next, and from the last to the first "
                f"plus 2π, got {steps.max():.4g} after angle {steps.argmax()}: continue them beyond ±π, as "
                "numpy.unwrap does"
            )
        wanted = info.data.get("reduced_area")
        if wanted is not None and not abs(enclosed - wanted) < _MISMATCH:
            raise ValueError(f"have the reduced area {enclosed:.6g}, and reduced_area is {wanted:g}")
        if crosses_itself(angles):
            raise ValueError("must be those of a curve that does not cross itself")
        return shape

    @property
    def is_circle(self) -> bool:
        """Whether it is a circle up to round-off, which has the largest area for its length."""
        return self.reduced_area > 1 - _ROUNDNESS
