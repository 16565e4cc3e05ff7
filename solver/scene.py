"""What is simulated: the validated, frozen description that every other part of the project passes on.

The TOML files, the command line's ``--set`` and the service's requests are these same models.  Units:
viscosity 1; a length of 2π and a bending modulus of 1 are the defaults of a vesicle.
"""

from __future__ import annotations

import math
from itertools import combinations
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from solver.shapes import semi_axes

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
    viscosity_contrast: Positive = 1.0  # of the fluid inside to that outside
    center: tuple[float, float] = (0.0, 0.0)
    angle: float = math.pi / 2  # of the long axis against x, radians


def ellipses_overlap(first: Vesicle, second: Vesicle, samples: int = 720) -> bool:
    """Whether the starting ellipses of two vesicles touch or overlap, seen at ``samples`` points of each."""
    return _reaches_into(first, second, samples) or _reaches_into(second, first, samples)


def _reaches_into(first: Vesicle, second: Vesicle, samples: int) -> bool:
    """Whether a boundary point of ``first`` lies in ``second``."""
    alpha = np.linspace(0, 2 * np.pi, samples, endpoint=False)
    major, minor = semi_axes(first.reduced_area, first.length)
    axis = np.exp(1j * first.angle)
    boundary = complex(*first.center) + axis * (major * np.cos(alpha) + 1j * minor * np.sin(alpha))
    major, minor = semi_axes(second.reduced_area, second.length)
    inside = (boundary - complex(*second.center)) * np.exp(-1j * second.angle)
    return bool(np.any((inside.real / major) ** 2 + (inside.imag / minor) ** 2 <= 1))


class Adhesion(Model):
    """Potential H[(δ/r)^m − (m/n)(δ/r)^n] between points of different vesicles (paper, eq. 2)."""

    hamaker: NonNegative
    distance: Positive
    exponents: tuple[int, int] = (4, 2)
    cutoff: Positive | None = None  # distance beyond which points do not attract; None: they always do

    @model_validator(mode="after")
    def _ordered_exponents(self) -> Self:
        m, n = self.exponents
        if not m > n >= 2:
            raise ValueError(f"exponents must be integers m > n >= 2, got [{m}, {n}]")
        return self

    @model_validator(mode="after")
    def _cutoff_beyond_the_repulsion(self) -> Self:
        if self.cutoff is not None and self.cutoff <= self.distance:
            raise ValueError(f"cutoff must be more than the distance {self.distance}, got {self.cutoff}")
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
    horizon: Positive = 1000.0  # by which the relaxation must have come to rest
    tilt: float = 1e-3


class Numerics(Model):
    """Resolution in space and time."""

    # On each vesicle; "auto": as many as the tolerance needs, and more when a run comes to need them.
    points: Annotated[int, Field(ge=16, le=1024, multiple_of=2)] | Literal["auto"] = 64
    tolerance: float = Field(1e-4, ge=1e-12, le=0.1)  # local error of tangent angle and center, absolute
    integrator: Literal["auto", "bdf", "rosenbrock", "sdc", "imex-euler"] = "auto"
    order: int | None = Field(None, ge=2, le=8)  # of "sdc"; None: its usual one
    # By the estimated error of each step, or as the paper: by the drift of areas and lengths over the run.
    step_control: Literal["embedded", "area-length"] = "embedded"
    work_limit: int = Field(1_000_000, ge=1)  # evaluations after which a run is given up

    @model_validator(mode="after")
    def _options_of_the_integrator(self) -> Self:
        if self.order is not None and self.integrator != "sdc":
            raise ValueError(
                f"order can be chosen for integrator 'sdc' only, got {self.order} with {self.integrator!r}"
            )
        if self.step_control == "area-length" and self.integrator not in ("sdc", "imex-euler"):
            raise ValueError(
                f"step_control 'area-length' needs integrator 'sdc' or 'imex-euler', got {self.integrator!r}"
            )
        return self


class Criteria(Model):
    """When a run is decided.  The criteria are part of the answer and are stored with it."""

    # Center distance that counts as separated when passed outward; 1.5 times the first one if that is more.
    separated_distance: Positive = 12.0
    # Of the line of centers that a bound pair has completed, or of its long axis that a tumbling vesicle has.
    revolutions: int = Field(1, ge=1)
    gap_growth: NonNegative = 0.01  # relative growth of the gap's maximum that still counts as none
    steady_rate: Positive = 1e-5  # change of every tangent angle and center below which a state is steady
    steady_time: Positive = 5.0  # for at least this long
    extensions: float = Field(4.0, ge=1)  # an undecided run may go on to this multiple of the horizon


class Output(Model):
    """How often diagnostics (``interval``) and states (``frame_interval``) are recorded."""

    interval: Positive = 0.5
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

    @model_validator(mode="after")
    def _apart(self) -> Self:
        for (i, first), (j, second) in combinations(enumerate(self.vesicles), 2):
            if ellipses_overlap(first, second):
                raise ValueError(
                    f"vesicles {i} and {j} overlap: centers {list(first.center)} and {list(second.center)} "
                    "must lie farther apart"
                )
        return self

    @model_validator(mode="after")
    def _relaxed_pair(self) -> Self:
        if self.start.relaxed and len(self.vesicles) != 2:
            raise ValueError(f"start.relaxed needs exactly 2 vesicles, got {len(self.vesicles)}")
        return self
