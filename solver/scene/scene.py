"""What is simulated: the validated, frozen description that every other part of the project passes on.

The TOML files, the command line's ``--set`` and the service's requests are these same models.  Units:
viscosity 1; a length of 2π and a bending modulus of 1 are the defaults of a vesicle.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Annotated, Self

from pydantic import Field, ValidationInfo, field_validator, model_validator

from solver.dimensions import TIME, UNITS
from solver.flows import Flow, ImposedFlow
from solver.model import Model, Positive
from solver.pair_potentials import Adhesion
from solver.protocols import Constant, FlowProtocol, Piece
from solver.scene.arrangement import Arrangement
from solver.scene.criteria import Criteria
from solver.scene.ellipses import overlapping_pair
from solver.scene.numerics import Numerics
from solver.scene.outlines import deformed_angles, outline, outline_of, overlapping_outlines
from solver.scene.output import Output
from solver.scene.start import RandomWaves, Start
from solver.scene.tangent_angles import crosses_itself
from solver.scene.units import Units
from solver.scene.vesicle import Vesicle

# Vesicles up to which matrices over all points are kept.  Beyond, sums are faster (measured).
LARGEST_DENSE = 6

# Samples, or frames, of a run: each costs an evaluation, which no work limit counts.
MOST_RECORDS = 1_000_000

# Of a protocol in a horizon: shorter ones are lost in the round-off of the time, and no step could end.
MOST_TIME_SCALES = 1_000_000


class Scene(Model):
    """Everything that a run depends on.

    Attributes
    ----------
    units : Units or None
        What the units are: with them numbers may be given, and are shown, with a unit.  No result changes.
    horizon : float
        Time at which a run ends unless its outcome is decided earlier.
    arrangement : Arrangement or None
        Rule that places many vesicles, instead of a list of them.
    vesicles : tuple of Vesicle
        Vesicles with their places, at least one.
    adhesion : Adhesion or None
        Attraction between the membranes of different vesicles.  Without one they do not adhere.
    flow : ImposedFlow or None
        Flow far from the vesicles.  Without one the fluid is at rest.
    protocol : RateProtocol or None
        How the rate of the flow changes with time.  Without one it is constant.
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
    # Left out where there is none, so that keys of scenes are what they were before there were protocols.
    protocol: FlowProtocol | None = Field(None, exclude_if=lambda protocol: protocol is None)
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
        pair = _overlapping_pair(self.vesicles)
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

    @model_validator(mode="after")
    def _deformed_within_reason(self) -> Self:
        deformation = self.start.deformation
        if deformation is None:
            return self
        for index, vesicle in enumerate(self.vesicles):
            if vesicle.is_circle:
                raise ValueError(
                    f"start.deformation: vesicle {index} is a circle (reduced area "
                    f"{vesicle.reduced_area:g}), which has no other shape of its length and area; leave the "
                    "table out"
                )
        # Two waves of the amplitude a take 4/3·a² of the reduced area: at most half of what it lacks to 1.
        roundest = max(vesicle.reduced_area for vesicle in self.vesicles)
        most = math.sqrt(3 / 8 * (1 - roundest))
        if deformation.amplitude > most:
            raise ValueError(
                f"start.deformation.amplitude must be at most {most:.4g} for the reduced area {roundest:g}, "
                f"got {deformation.amplitude:g}"
            )
        problem = _deformed_too_much(self.vesicles, deformation)
        if problem:
            raise ValueError(
                f"start.deformation: {problem}; the amplitude must be below {deformation.amplitude:g}"
            )
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

    @model_validator(mode="after")
    def _of_a_flow(self) -> Self:
        if self.protocol is not None and self.flow is None:
            raise ValueError("protocol: there is no flow whose rate could change")
        if isinstance(self.protocol, Constant):
            object.__setattr__(self, "protocol", None)  # equal scenes are equal
        return self

    @model_validator(mode="after")
    def _rates_that_steps_can_follow(self) -> Self:
        name = self.protocol.time_scale if self.protocol else None
        if name is None:
            return self
        least, given = self.horizon / MOST_TIME_SCALES, getattr(self.protocol, name)
        if given < least:
            raise ValueError(
                f"protocol.{name} must be at least {least:g}, a millionth of the horizon, got {given:g}"
            )
        return self

    @property
    def constant_from(self) -> float:
        """When the rate of the flow is constant up to the horizon: 0 without a protocol, or infinite."""
        last = self._last_piece
        if last is None:
            return 0.0
        return math.inf if last.constant is None else last.start

    @property
    def _last_piece(self) -> Piece | None:
        """What of the protocol the horizon comes in."""
        protocol = self.protocol
        return protocol.course.pieces[protocol.last_piece(self.horizon)] if protocol else None

    @property
    def highest_rate(self) -> float:
        """The largest rate that the flow has up to the horizon, 0 without one."""
        if self.flow is None:
            return 0.0
        return self.flow.rate * self.protocol.largest(self.horizon) if self.protocol else self.flow.rate

    @property
    def shear_rate(self) -> float | None:
        """That of the flow; None for flows that have none, and where the rate changes with time."""
        return self.flow.shear_rate if self.flow and self.protocol is None else None

    @property
    def settled(self) -> Scene:
        """The scene as it is once the rate does not change up to the horizon; otherwise itself."""
        last = self._last_piece
        if self.flow is None or last is None or last.constant is None:
            return self
        flow = self.flow.model_copy(update={"rate": self.flow.rate * last.constant})
        return self.model_copy(update={"flow": flow, "protocol": None})

    @property
    def imposed_flow(self) -> ImposedFlow | None:
        """The flow in the end, None in a quiescent fluid: one without, or with a flow of rate 0."""
        flow = self.settled.flow
        return flow if flow and flow.rate > 0 else None

    @model_validator(mode="after")
    def _options_of_many(self) -> Self:
        if self.many and self.numerics.integrator == "rosenbrock":
            raise ValueError(
                f"numerics.integrator 'rosenbrock' takes at most {LARGEST_DENSE} vesicles, "
                f"got {len(self.vesicles)}: it needs the exact Jacobian"
            )
        return self


@lru_cache(maxsize=4)  # the scenes of a study have the same vesicles, or a few kinds of them
def _overlapping_pair(vesicles: tuple[Vesicle, ...]) -> tuple[int, int] | None:
    """Return the indices of two vesicles that overlap at the start, None if all are apart."""
    ellipses = [index for index, vesicle in enumerate(vesicles) if vesicle.tangent_angle is None]
    among_ellipses = overlapping_pair(tuple(vesicles[index] for index in ellipses))
    if among_ellipses:
        first, second = among_ellipses
        return ellipses[first], ellipses[second]
    if len(ellipses) == len(vesicles):
        return None
    return overlapping_outlines(vesicles, [outline(vesicle) for vesicle in vesicles])


def _deformed_too_much(vesicles: tuple[Vesicle, ...], waves: RandomWaves) -> str | None:
    """Say which vesicles overlap or cross themselves when waves have deformed them, None if none do."""
    shapes = [deformed_angles(vesicle, index, waves) for index, vesicle in enumerate(vesicles)]
    for index, shape in enumerate(shapes):
        if crosses_itself(shape):
            return f"vesicle {index} crosses itself with these waves"
    pair = overlapping_outlines(vesicles, list(map(outline_of, vesicles, shapes)))
    return f"vesicles {pair[0]} and {pair[1]} overlap with these waves" if pair else None
