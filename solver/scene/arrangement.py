"""Many vesicles in a few lines: what a scene may have instead of its list of vesicles.

Validation turns it into that list, so no other module sees an arrangement.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, field_validator, model_validator

from solver.dimensions import ANGLE, BENDING_MODULUS, LENGTH
from solver.model import Model, Positive
from solver.scene.distribution import Distribution, Normal, Uniform, ends, samples
from solver.scene.ellipses import semi_axes
from solver.scene.placement import placed_at_random
from solver.scene.vesicle import Vesicle

MOST_VESICLES = 4096


class Lattice(Model):
    """Equal vesicles in columns and rows about the origin, at equal distances and angles.

    Attributes
    ----------
    columns, rows : int
        Number of vesicles along x and along y.
    spacing : (2,)
        Distance of neighboring centers along x and y.
    staggered : bool
        Whether every second row is shifted by half a spacing.
    vesicle : Vesicle
        Vesicle that is repeated; its center is the middle of the lattice.
    """

    kind: Literal["lattice"] = "lattice"
    columns: int = Field(ge=1, le=MOST_VESICLES)
    rows: int = Field(ge=1, le=MOST_VESICLES)
    spacing: tuple[Annotated[Positive, LENGTH], Annotated[Positive, LENGTH]]
    staggered: bool = False
    vesicle: Vesicle = Vesicle()

    @model_validator(mode="after")
    def _not_too_many(self) -> Self:
        if self.count > MOST_VESICLES:
            raise ValueError(f"columns times rows must be at most {MOST_VESICLES}, got {self.count}")
        return self

    @property
    def count(self) -> int:
        """Number of vesicles."""
        return self.columns * self.rows

    def vesicles(self) -> tuple[Vesicle, ...]:
        """Return the vesicles, row by row from below."""
        across, up = self.spacing
        placed = []
        for row in range(self.rows):
            shift = 0.25 * across * (-1 if row % 2 else 1) if self.staggered else 0.0
            for column in range(self.columns):
                x = (column - (self.columns - 1) / 2) * across + shift
                y = (row - (self.rows - 1) / 2) * up
                center = (self.vesicle.center[0] + x, self.vesicle.center[1] + y)
                placed.append(self.vesicle.model_copy(update={"center": center}))
        return tuple(placed)


class Random(Model):
    """Vesicles at random places in a square about the origin, none nearer to another than stated.

    Equal arrangements, seed included, give equal vesicles.

    Attributes
    ----------
    count : int
        Number of vesicles.
    area_fraction : float
        Area of all vesicles over that of the square in which they are placed.
    seed : int
        Number from which places and random values are drawn; equal seeds give equal vesicles.
    minimum_distance : float
        Smallest distance between two vesicles at the start.
    reduced_area, length : float, Uniform or Normal
        That of the vesicles: one value for all, or how the values are distributed.
    angle : float or None
        Angle of all long axes against x, in radians.  Without one each vesicle gets a random angle.
    bending_modulus, viscosity_contrast : float
        That of all vesicles.
    """

    kind: Literal["random"] = "random"
    count: int = Field(ge=1, le=MOST_VESICLES)
    area_fraction: float = Field(gt=0, lt=1)
    seed: int = Field(0, ge=0)
    minimum_distance: Annotated[Positive, LENGTH] = 0.2
    reduced_area: Distribution = 0.9
    length: Annotated[Distribution, LENGTH] = 2 * math.pi
    angle: Annotated[float, ANGLE] | None = None
    bending_modulus: Annotated[Positive, BENDING_MODULUS] = 1.0
    viscosity_contrast: Positive = 1.0

    @field_validator("reduced_area")
    @classmethod
    def _possible_reduced_areas(cls, reduced_area: float | Uniform | Normal) -> float | Uniform | Normal:
        low, high = ends(reduced_area)
        if not 0 < low <= high <= 1:
            raise ValueError(
                f"reduced areas must lie above 0 and be at most 1, these are {low:g} to {high:g}"
            )
        return reduced_area

    @field_validator("length")
    @classmethod
    def _positive_lengths(cls, length: float | Uniform | Normal) -> float | Uniform | Normal:
        if not ends(length)[0] > 0:
            raise ValueError(f"lengths must be positive, the least of these is {ends(length)[0]:g}")
        return length

    @model_validator(mode="after")
    def _room_for_all(self) -> Self:
        self.vesicles()
        return self

    def vesicles(self) -> tuple[Vesicle, ...]:
        """Return the vesicles, in no particular order of place or size."""
        return _randomly_placed(self)


@lru_cache(maxsize=32)  # a scene is validated more than once
def _randomly_placed(arrangement: Random) -> tuple[Vesicle, ...]:
    count, random = arrangement.count, np.random.default_rng(arrangement.seed)
    reduced_area = samples(arrangement.reduced_area, count, random)
    length = samples(arrangement.length, count, random)
    axes = np.array([semi_axes(*shape) for shape in zip(reduced_area, length, strict=True)])
    area = float(np.sum(reduced_area * length**2) / (4 * np.pi))
    side = math.sqrt(area / arrangement.area_fraction)
    center, angle = placed_at_random(axes, side, arrangement.minimum_distance, arrangement.angle, random)
    return tuple(
        Vesicle(
            reduced_area=float(reduced_area[index]),
            length=float(length[index]),
            bending_modulus=arrangement.bending_modulus,
            viscosity_contrast=arrangement.viscosity_contrast,
            center=(float(center[index].real), float(center[index].imag)),
            angle=float(angle[index]),
        )
        for index in range(count)
    )


Arrangement = Annotated[Lattice | Random, Field(discriminator="kind")]
