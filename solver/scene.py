"""What is simulated: the validated, frozen description that every other part of the project passes on.

The TOML files, the command line's ``--set`` and the service's requests are these same models.  Units:
viscosity 1; a length of 2π and a bending modulus of 1 are the defaults of a vesicle.
"""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

Positive = Annotated[float, Field(gt=0)]
NonNegative = Annotated[float, Field(ge=0)]


class Model(BaseModel):
    """Base of all configuration: immutable, refuses unknown keys, NaN and infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Vesicle(Model):
    """An inextensible membrane that starts as an ellipse of exactly this reduced area and length."""

    reduced_area: float = Field(0.9, gt=0, le=1)  # 4π·area/length²
    length: Positive = 2 * math.pi
    bending_modulus: Positive = 1.0
    center: tuple[float, float] = (0.0, 0.0)
    angle: float = math.pi / 2  # of the long axis against x, radians


class Adhesion(Model):
    """Potential H[(δ/r)^m − (m/n)(δ/r)^n] between points of different vesicles (paper, eq. 2)."""

    hamaker: NonNegative
    distance: Positive
    exponents: tuple[int, int] = (4, 2)

    @model_validator(mode="after")
    def _ordered_exponents(self) -> Self:
        m, n = self.exponents
        if not m > n >= 2:
            raise ValueError(f"exponents must be integers m > n >= 2, got [{m}, {n}]")
        return self


class Shear(Model):
    """Velocity rate·(y, 0)."""

    kind: Literal["shear"] = "shear"
    rate: NonNegative


class Extension(Model):
    """Velocity rate·(−x, y): converges along x, diverges along y."""

    kind: Literal["extension"] = "extension"
    rate: NonNegative


class Trap(Model):
    """Extension whose stagnation point follows the mean of the vesicle centers."""

    kind: Literal["trap"] = "trap"
    rate: NonNegative


Flow = Annotated[Shear | Extension | Trap, Field(discriminator="kind")]


class Start(Model):
    """How the run begins: as placed, or relaxed at rest first and then turned.

    ``relaxed`` relaxes the vesicles without flow to equilibrium and turns them so that the line of centers
    lies on the diverging axis (y) plus ``tilt`` radians.
    """

    relaxed: bool = False
    tilt: float = 1e-3


class Numerics(Model):
    """Resolution in space and time."""

    points: int = Field(64, ge=16, le=1024, multiple_of=2)  # on each vesicle
    tolerance: float = Field(1e-4, ge=1e-12, le=0.1)  # local error of tangent angle and center, absolute
    integrator: Literal["bdf"] = "bdf"


class Criteria(Model):
    """When a run is decided.  The criteria are part of the answer and are stored with it."""

    separated_distance: Positive = 12.0  # center distance that counts as separated when passed outward
    revolutions: int = Field(1, ge=1)  # of the line of centers that a bound pair has completed
    gap_growth: NonNegative = 0.01  # relative growth of the gap's maximum that still counts as none
    steady_speed: Positive = 1e-5  # normal speed of every membrane point below which a state is steady
    steady_time: Positive = 5.0  # for at least this long
    extensions: float = Field(4.0, ge=1)  # an undecided run may go on to this multiple of the horizon


class Output(Model):
    """How often diagnostics (``interval``) and states (``frame_interval``) are recorded."""

    interval: Positive = 0.25
    frame_interval: Positive = 1.0


class Scene(Model):
    """Everything a run depends on."""

    horizon: Positive
    vesicles: tuple[Vesicle, ...] = Field(min_length=1)
    adhesion: Adhesion | None = None
    flow: Flow | None = None
    start: Start = Start()
    numerics: Numerics = Numerics()
    criteria: Criteria = Criteria()
    output: Output = Output()
