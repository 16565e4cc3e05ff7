"""A study: one search for a critical value at every value of a sweep, or combination of several."""

from __future__ import annotations

from functools import cached_property
from itertools import product
from typing import Annotated, Any, Self

from pydantic import AfterValidator, Field, ValidationInfo, field_validator, model_validator

from ensemble.config.certifying_scene import certifying_scene
from ensemble.config.dotted_paths import Location
from ensemble.config.geometric_grid import GeometricGrid
from ensemble.config.overrides import LONGEST_NAME, override
from ensemble.config.parameter_values import OneOrSeveral, ValueOf, number_locations, remember_scene
from ensemble.config.question_key import question_key
from ensemble.config.validation import validated
from solver.analysis.run import Configuration, Outcome
from solver.scene import Model, Positive, Scene

WITHOUT_ANSWER = (Outcome.UNDECIDED, Outcome.FAILED)


def _ascending(ends: tuple[float, float]) -> tuple[float, float]:
    if not ends[0] < ends[1]:
        raise ValueError("the first must be less than the second")
    return ends


_SEARCHED, _SWEPT = ValueOf("searched"), ValueOf("swept")
_Searched = Annotated[Positive, _SEARCHED]
Interval = Annotated[tuple[_Searched, _Searched], AfterValidator(_ascending)]


class Guess(Model):
    """Where the boundary is expected at one place: it saves runs and changes no answer.

    Attributes
    ----------
    at : tuple of float
        Value of each swept parameter; a number if there is one.
    bracket : (float, float)
        Values of the searched parameter between which the boundary is expected.
    """

    at: Annotated[tuple[float, ...], OneOrSeveral(), _SWEPT]
    bracket: Interval


class Search(Model):
    """Which critical value is searched for: of what, within which limits, between which outcomes.

    Attributes
    ----------
    parameter : str
        Dotted path, in the scene, of the number whose critical value is searched for.
    tolerance : float
        Relative width that the bracket stays below, from 1e-9 to 0.5.
    limits : (float, float)
        Least and greatest value that may be tried, above 0.
    guesses : tuple of Guess
        Where the boundary is expected, until two of its points are known.
    low : tuple of Outcome or Configuration
        Outcomes below the critical value, or configurations, which then count instead of their outcome.
    high : tuple of Outcome or Configuration
        Those above the critical value.
    scan : int
        How many values in a decade are looked at all over the limits, from 0 to 100, so that other changes
        of the outcome are seen.  With 0 a search ends with the first change that it finds.
    certify : bool
        Whether both ends of every bracket are run again at finer numerics.
    """

    parameter: str
    tolerance: float = Field(0.01, ge=1e-9, le=0.5)
    limits: Interval
    guesses: tuple[Guess, ...] = ()
    low: tuple[Outcome | Configuration, ...] = Field(min_length=1)
    high: tuple[Outcome | Configuration, ...] = Field(min_length=1)
    scan: int = Field(2, ge=0, le=100)
    certify: bool = False

    @field_validator("parameter")
    @classmethod
    def _of_values_below(cls, parameter: str, info: ValidationInfo) -> str:
        return _SEARCHED.remember(parameter, info)

    @field_validator("limits")
    @classmethod
    def _wide_enough(cls, limits: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
        tolerance = info.data.get("tolerance")  # absent if it was refused itself
        if tolerance is not None and len(GeometricGrid(tolerance).within(*limits)) < 2:
            raise ValueError(f"must be further apart than the tolerance {tolerance}")
        return limits

    @field_validator("certify")
    @classmethod
    def _includes_a_scan(cls, certify: bool, info: ValidationInfo) -> bool:
        if certify and info.data.get("scan") == 0:
            raise ValueError("needs search.scan of at least 1: what nobody has looked for is not certified")
        return certify

    @field_validator("low", "high")
    @classmethod
    def _answers(cls, outcomes: tuple[Outcome | Configuration, ...]) -> tuple[Outcome | Configuration, ...]:
        if set(WITHOUT_ANSWER) & set(outcomes):
            raise ValueError(f"{' and '.join(WITHOUT_ANSWER)} are no answers and belong to neither side")
        return outcomes

    @field_validator("high")
    @classmethod
    def _opposite(
        cls, high: tuple[Outcome | Configuration, ...], info: ValidationInfo
    ) -> tuple[Outcome | Configuration, ...]:
        if set(high) & set(info.data.get("low", ())):
            raise ValueError("must share no outcome with low")
        return high

    @property
    def sides(self) -> tuple[Outcome | Configuration, ...]:
        """The outcomes and configurations on both sides."""
        return (*self.low, *self.high)

    @property
    def grid(self) -> GeometricGrid:
        """The values that the search may try."""
        return GeometricGrid(self.tolerance)


class Sweep(Model):
    """Along which parameter, and at which of its values, the boundary is traced.

    Attributes
    ----------
    parameter : str
        Dotted path, in the scene, of the number that is swept.
    values : tuple of float
        Values of this number; at each of them one point of the boundary is searched for.
    """

    parameter: str
    values: tuple[Annotated[float, _SWEPT], ...] = Field(min_length=1)

    @field_validator("parameter")
    @classmethod
    def _of_values_below(cls, parameter: str, info: ValidationInfo) -> str:
        return _SWEPT.remember(parameter, info)

    @field_validator("values")
    @classmethod
    def _distinct(cls, values: tuple[float, ...]) -> tuple[float, ...]:
        if len(set(values)) < len(values):
            raise ValueError("values must be distinct")
        return values


class Study(Model):
    """A boundary between outcomes, traced from a base scene: a critical value against other parameters.

    Attributes
    ----------
    name : str
        Name of the study and of its boundary; at most 100 characters.
    scene : Scene
        The scene in which the parameters are varied.
    sweep : tuple of Sweep
        A critical value is searched for at every combination of their values; a table if there is one.
    search : Search
        Which critical value is searched for, and how.
    """

    # Without control characters: it is shown on terminals and in pages.
    name: Annotated[str, Field(min_length=1, max_length=LONGEST_NAME, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")]
    scene: Scene
    sweep: Annotated[tuple[Sweep, ...], Field(min_length=1), OneOrSeveral()]
    search: Search

    _whose_parameters_have_dimensions = field_validator("scene")(remember_scene)

    @model_validator(mode="after")
    def _parameters_fit_the_scene(self) -> Self:
        taken: dict[str, set[Location]] = {}
        fields = {"search.parameter": self.search.parameter} | self._sweep_fields
        for field, path in fields.items():
            places = number_locations(self._scene_document, field, path)
            for other, others in taken.items():
                if places & others:
                    raise ValueError(f"{field}: {path!r} — must differ from {other} {fields[other]!r}")
            taken[field] = places
        for guess in self.search.guesses:
            if len(guess.at) != len(self.sweep):
                raise ValueError(
                    f"search.guesses: at {', '.join(f'{at:g}' for at in guess.at)} — "
                    f"must have a value for each of the {len(self.sweep)} swept parameters"
                )
        for at in self.places:
            for limit in self.search.limits:
                scene = self.scene_at(at, limit)
                if self.search.certify:
                    certifying_scene(scene)
        return self

    @property
    def _sweep_fields(self) -> dict[str, str]:
        """The swept parameters by the fields that name them."""
        (first, *others) = self.sweep
        if not others:
            return {"sweep.parameter": first.parameter}
        return {f"sweep.{index}.parameter": sweep.parameter for index, sweep in enumerate(self.sweep)}

    @cached_property
    def places(self) -> tuple[tuple[float, ...], ...]:
        """Every combination of the swept values, that of the first parameter changing fastest."""
        last_first = product(*(sweep.values for sweep in reversed(self.sweep)))
        return tuple(place[::-1] for place in last_first)

    @property
    def swept(self) -> tuple[str, ...]:
        """Dotted paths of the swept parameters."""
        return tuple(sweep.parameter for sweep in self.sweep)

    @cached_property
    def _scene_document(self) -> dict[str, Any]:
        return self.scene.model_dump()

    @cached_property
    def key(self) -> str:
        """Key of the study: 16 hexadecimal digits, whatever the units of its scene."""
        return question_key(self)

    def scene_at(self, at: tuple[float, ...], value: float) -> Scene:
        """Return the scene with some values of the parameters.

        Parameters
        ----------
        at : tuple of float
            Of each swept parameter.
        value : float
            Of the searched parameter.

        Returns
        -------
        Scene

        Raises
        ------
        ValueError
            If the scene does not allow one of them.
        """
        changes = dict(zip(self.swept, at, strict=True)) | {self.search.parameter: value}
        return validated(Scene, override(self._scene_document, changes))
