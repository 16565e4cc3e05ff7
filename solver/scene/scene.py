"""What is simulated: the validated, frozen description that every other part of the project passes on.

The TOML files, the command line's ``--set`` and the service's requests are these same models.  Units:
viscosity 1; a length of 2π and a bending modulus of 1 are the defaults of a vesicle.
"""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from solver.scene.arrangement import Arrangement
from solver.scene.ellipses import overlapping_pair
from solver.scene.model import Model, NonNegative, Positive
from solver.scene.vesicle import Vesicle

# Vesicles up to which matrices over all points are kept; measured: beyond, sums are faster (`suspension`).
LARGEST_DENSE = 6

__all__ = [
    "Adhesion",
    "Arrangement",
    "Criteria",
    "Extension",
    "Flow",
    "Model",
    "NonNegative",
    "Numerics",
    "Output",
    "Positive",
    "Scene",
    "Shear",
    "Start",
    "Trap",
    "Vesicle",
]


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
    # Instead of the vesicles, into which it is turned here: a scene that has been checked has none.
    arrangement: Arrangement | None = Field(None, exclude=True)
    vesicles: tuple[Vesicle, ...] = Field((), validate_default=True)
    adhesion: Adhesion | None = None
    flow: Flow | None = None
    start: Start = Start()
    numerics: Numerics = Numerics()
    criteria: Criteria = Criteria()
    output: Output = Output()

    @field_validator("vesicles")
    @classmethod
    def _listed_or_arranged(cls, vesicles: tuple[Vesicle, ...], info: ValidationInfo) -> tuple[Vesicle, ...]:
        arrangement = info.data.get("arrangement")
        if arrangement is None:
            if not vesicles and "arrangement" in info.data:  # absent if it was refused itself
                raise ValueError("a scene needs at least one vesicle, or an arrangement")
            return vesicles
        if vesicles:
            raise ValueError("a scene has either vesicles or an arrangement, not both")
        return tuple(arrangement.vesicles())

    @model_validator(mode="after")
    def _arranged(self) -> Self:
        self.__dict__["arrangement"] = None  # scenes of equal vesicles are equal
        return self

    @model_validator(mode="after")
    def _apart(self) -> Self:
        pair = overlapping_pair(self.vesicles)
        if pair:
            i, j = pair
            raise ValueError(
                f"vesicles {i} and {j} overlap: centers {list(self.vesicles[i].center)} and "
                f"{list(self.vesicles[j].center)} must lie farther apart"
            )
        return self

    @model_validator(mode="after")
    def _relaxed_pair(self) -> Self:
        if self.start.relaxed and len(self.vesicles) != 2:
            raise ValueError(f"start.relaxed needs exactly 2 vesicles, got {len(self.vesicles)}")
        return self

    @property
    def many(self) -> bool:
        """Whether sums serve the scene better than matrices over all points.

        They know no viscosity contrast.
        """
        return len(self.vesicles) > LARGEST_DENSE and all(v.viscosity_contrast == 1 for v in self.vesicles)

    @model_validator(mode="after")
    def _options_of_many(self) -> Self:
        if self.many and self.numerics.integrator == "rosenbrock":
            raise ValueError(
                f"numerics.integrator 'rosenbrock' takes at most {LARGEST_DENSE} vesicles, "
                f"got {len(self.vesicles)}: it needs the exact Jacobian"
            )
        return self
