"""A study: one search for a critical value at every value of a sweep."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any, Self

from pydantic import (
    AfterValidator,
    Field,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema, core_schema

from ensemble.config.certifying_scene import certifying_scene
from ensemble.config.dotted_paths import locations, value_at
from ensemble.config.geometric_grid import GeometricGrid
from ensemble.config.measured import dimension_at
from ensemble.config.overrides import LONGEST_NAME, override
from ensemble.config.validation import validated
from solver.analysis.run import Outcome
from solver.dimensions import Dimension, or_quantity
from solver.scene import Model, Positive, Scene

WITHOUT_ANSWER = (Outcome.UNDECIDED, Outcome.FAILED)


def _ascending(ends: tuple[float, float]) -> tuple[float, float]:
    if not ends[0] < ends[1]:
        raise ValueError("the first must be less than the second")
    return ends


_SCENE = "scene"  # key of the validated scene in the context of a validation


@dataclass(frozen=True)
class _ValueOf:
    """Metadata of a value of a parameter, which has that one's dimension.

    Attributes
    ----------
    role : str
        Key of the dimension in the context of a validation.
    """

    role: str

    def remember(self, path: str, info: ValidationInfo) -> str:
        """Keep the dimension of a parameter for the values that are validated after it."""
        if info.context is not None and _SCENE in info.context:
            info.context[self.role] = dimension_at(info.context[_SCENE], path)
        return path

    def _validate(self, value: Any, handler: Callable[[Any], Any], info: ValidationInfo) -> Any:
        dimension: Dimension | None = (info.context or {}).get(self.role)
        return handler(value) if dimension is None else dimension.validate(value, handler, info)

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        return core_schema.with_info_wrap_validator_function(self._validate, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return or_quantity(handler(schema), handler.mode)


_SEARCHED, _SWEPT = _ValueOf("searched"), _ValueOf("swept")
_Searched = Annotated[Positive, _SEARCHED]
Interval = Annotated[tuple[_Searched, _Searched], AfterValidator(_ascending)]


class Guess(Model):
    """Where the boundary is expected at one value of the sweep: it saves runs and changes no answer.

    Attributes
    ----------
    at : float
        Value of the swept parameter.
    bracket : (float, float)
        Values of the searched parameter between which the boundary is expected.
    """

    at: Annotated[float, _SWEPT]
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
    low : tuple of Outcome
        Outcomes below the critical value.
    high : tuple of Outcome
        Outcomes above the critical value.
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
    low: tuple[Outcome, ...] = Field(min_length=1)
    high: tuple[Outcome, ...] = Field(min_length=1)
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
    def _answers(cls, outcomes: tuple[Outcome, ...]) -> tuple[Outcome, ...]:
        if set(WITHOUT_ANSWER) & set(outcomes):
            raise ValueError(f"{' and '.join(WITHOUT_ANSWER)} are no answers and belong to neither side")
        return outcomes

    @field_validator("high")
    @classmethod
    def _opposite(cls, high: tuple[Outcome, ...], info: ValidationInfo) -> tuple[Outcome, ...]:
        if set(high) & set(info.data.get("low", ())):
            raise ValueError("must share no outcome with low")
        return high

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
    """A boundary between outcomes, traced from a base scene in two of its parameters.

    Attributes
    ----------
    name : str
        What the study and its boundary are called; at most 100 characters.
    scene : Scene
        The scene in which both parameters are varied.
    sweep : Sweep
        The values at which a critical value is searched for.
    search : Search
        That critical value.
    """

    # Without control characters: it is shown on terminals and in pages.
    name: Annotated[str, Field(min_length=1, max_length=LONGEST_NAME, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")]
    scene: Scene
    sweep: Sweep
    search: Search

    @field_validator("scene")
    @classmethod
    def _whose_parameters_have_dimensions(cls, scene: Scene, info: ValidationInfo) -> Scene:
        if info.context is not None:
            info.context[_SCENE] = scene
        return scene

    @model_validator(mode="after")
    def _parameters_fit_the_scene(self) -> Self:
        searched = self._number_locations("search.parameter", self.search.parameter)
        swept = self._number_locations("sweep.parameter", self.sweep.parameter)
        if searched & swept:
            raise ValueError(
                f"sweep.parameter: {self.sweep.parameter!r} — must differ from search.parameter "
                f"{self.search.parameter!r}"
            )
        for sweep_value in self.sweep.values:
            for limit in self.search.limits:
                scene = self.scene_at(sweep_value, limit)
                if self.search.certify:
                    certifying_scene(scene)
        return self

    def _number_locations(self, field: str, path: str) -> set[tuple[str | int, ...]]:
        document = self._scene_document
        try:
            places = set(locations(document, path))
        except ValueError as error:
            raise ValueError(f"{field}: {error}") from None
        numbers = [value_at(document, location) for location in places]
        if not numbers or not all(type(number) in (int, float) for number in numbers):
            raise ValueError(f"{field}: {path!r} — must be the dotted path of a number in the scene")
        return places

    @cached_property
    def _scene_document(self) -> dict[str, Any]:
        return self.scene.model_dump()

    @cached_property
    def key(self) -> str:
        """Key of the study: 16 hexadecimal digits of the SHA-256 of its canonical JSON, without units."""
        document = self.model_dump(mode="json", exclude={"scene": {"units"}})
        canonical = json.dumps(document, sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()[:16]

    def scene_at(self, sweep_value: float, value: float) -> Scene:
        """Return the scene at one value of each of the two parameters.

        Parameters
        ----------
        sweep_value : float
            Of the swept parameter.
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
        changes = {self.sweep.parameter: sweep_value, self.search.parameter: value}
        return validated(Scene, override(self._scene_document, changes))
