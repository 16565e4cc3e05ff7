"""What is simulated: the validated, frozen description that every other part of the project passes on.

The TOML files, the command line's ``--set`` and the service's requests are these same models.  Units:
viscosity 1; a length of 2π and a bending modulus of 1 are the defaults of a vesicle.
"""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from solver.dimensions import TIME, UNITS
from solver.flows import Flow, ImposedFlow
from solver.model import Model, Positive
from solver.pair_potentials import Adhesion
from solver.scene.arrangement import Arrangement
from solver.scene.criteria import Criteria
from solver.scene.ellipses import overlapping_pair
from solver.scene.numerics import Numerics
from solver.scene.output import Output
from solver.scene.start import Start
from solver.scene.units import Units
from solver.scene.vesicle import Vesicle

# Vesicles up to which matrices over all points are kept.  Beyond, sums are faster (measured).
LARGEST_DENSE = 6

# Samples, or frames, of a run: each costs an evaluation, which no work limit counts.
MOST_RECORDS = 1_000_000


class Scene(Model):
    """Everything that a run depends on.

    Attributes
    ----------
    units : Units or None
        What the units are, for numbers that are given or shown with a unit.  No result depends on them.
    horizon : float
        Time at which a run ends that is not decided before.  A run that is decided ends at once.
    arrangement : Arrangement or None
        May be given instead of the vesicles.  Validation turns it into these; in a validated scene it is
        None.
    vesicles : tuple of Vesicle
        At least one.
    adhesion : Adhesion or None
        None if nothing adheres.
    flow : ImposedFlow or None
        None if the fluid is quiescent.
    start : Start
        How a run begins.
    numerics : Numerics
        Resolution in space and time.
    criteria : Criteria
        When a run is decided.
    output : Output
        How often a run is recorded.
    """

    units: Units | None = None
    horizon: Annotated[Positive, TIME]
    arrangement: Arrangement | None = Field(None, exclude=True)
    vesicles: tuple[Vesicle, ...] = Field((), validate_default=True)
    adhesion: Adhesion | None = None
    flow: Flow | None = None
    start: Start = Start()
    numerics: Numerics = Numerics()
    criteria: Criteria = Criteria()
    output: Output = Output()

    @field_validator("units")
    @classmethod
    def _of_all_fields_below(cls, units: Units | None, info: ValidationInfo) -> Units | None:
        if info.context is not None:
            info.context[UNITS] = units
        return units

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
    def _drop_arrangement(self) -> Self:
        # Scenes of equal vesicles are equal, however these were arranged.  As in `__post_init__` of a frozen
        # dataclass: a validator before the fields would see parsed JSON, which is not strict about types.
        object.__setattr__(self, "arrangement", None)
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
        """Whether sums are used instead of matrices over all points; they support no viscosity contrast."""
        return len(self.vesicles) > LARGEST_DENSE and all(v.viscosity_contrast == 1 for v in self.vesicles)

    @model_validator(mode="after")
    def _records_that_can_be_held(self) -> Self:
        for name, interval in self.output:
            if self.horizon > MOST_RECORDS * interval:
                raise ValueError(
                    f"output.{name} must be at least {self.horizon / MOST_RECORDS:g}, a millionth of the "
                    f"horizon, got {interval:g}"
                )
        return self

    @property
    def imposed_flow(self) -> ImposedFlow | None:
        """The flow, None in a quiescent fluid: one without, or with a flow of rate 0."""
        return self.flow if self.flow and self.flow.rate > 0 else None

    @model_validator(mode="after")
    def _options_of_many(self) -> Self:
        if self.many and self.numerics.integrator == "rosenbrock":
            raise ValueError(
                f"numerics.integrator 'rosenbrock' takes at most {LARGEST_DENSE} vesicles, "
                f"got {len(self.vesicles)}: it needs the exact Jacobian"
            )
        return self
