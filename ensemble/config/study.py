"""A study: one search for a critical value at every value of a sweep, described by a TOML document.

Presets of studies and scenes ship with the package and are used by name.
"""

from __future__ import annotations

import copy
import hashlib
import json
import math
import tomllib
from collections.abc import Iterable, Mapping
from functools import cache, cached_property
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Self, TypeVar

from pydantic import AfterValidator, Field, ValidationError, ValidationInfo, field_validator, model_validator

from ensemble.config.overrides import explain, locations, override, parse_override, value_at
from ensemble.search.certification import Certification, finer
from ensemble.search.critical_value import CriticalValueSearch, Side
from ensemble.search.grid import GeometricGrid
from solver.analysis.run import Outcome
from solver.scene import Model, Positive, Scene

# A guess reaches beyond the point on the line through known neighbors by this share of the line's change
# from the nearest of them, for the boundary's curvature, and by this many tolerances for their brackets.
CURVATURE_MARGIN = 0.1
BRACKET_MARGIN = 2.0

NO_ANSWER = {Outcome.UNDECIDED: Side.UNDECIDED, Outcome.FAILED: Side.FAILED}


def _ascending(ends: tuple[float, float]) -> tuple[float, float]:
    if not ends[0] < ends[1]:
        raise ValueError("the first must be less than the second")
    return ends


Bracket = Annotated[tuple[Positive, Positive], AfterValidator(_ascending)]


class Guess(Model):
    """Where the boundary is expected at one value of the sweep: it saves runs and changes no answer."""

    at: float
    bracket: Bracket


class Search(Model):
    """Which critical value is looked for: of what, within which limits, between which outcomes."""

    parameter: str  # dotted path in the scene
    tolerance: float = Field(0.01, ge=1e-9, le=0.5)  # relative width that the bracket stays below
    limits: Bracket
    guesses: tuple[Guess, ...] = ()  # to begin with, until two points of the boundary are known
    low: tuple[Outcome, ...] = Field(min_length=1)  # outcomes below the critical value
    high: tuple[Outcome, ...] = Field(min_length=1)  # outcomes above it
    certify: bool = False  # run the ends of the bracket again at finer numerics

    @field_validator("limits")
    @classmethod
    def _wide_enough(cls, limits: tuple[float, float], info: ValidationInfo) -> tuple[float, float]:
        tolerance = info.data.get("tolerance")  # absent if it was refused itself
        if tolerance is not None and len(GeometricGrid(tolerance).within(*limits)) < 2:
            raise ValueError(f"must be further apart than the tolerance {tolerance}")
        return limits

    @field_validator("low", "high")
    @classmethod
    def _answers(cls, outcomes: tuple[Outcome, ...]) -> tuple[Outcome, ...]:
        if NO_ANSWER.keys() & set(outcomes):
            raise ValueError(f"{' and '.join(NO_ANSWER)} are no answers and belong to neither side")
        return outcomes

    @field_validator("high")
    @classmethod
    def _opposite(cls, high: tuple[Outcome, ...], info: ValidationInfo) -> tuple[Outcome, ...]:
        if set(high) & set(info.data.get("low", ())):
            raise ValueError("must share no outcome with low")
        return high


class Sweep(Model):
    """Along what, and at which values, the boundary is traced."""

    parameter: str  # dotted path in the scene
    values: tuple[float, ...] = Field(min_length=1)

    @field_validator("values")
    @classmethod
    def _distinct(cls, values: tuple[float, ...]) -> tuple[float, ...]:
        if len(set(values)) < len(values):
            raise ValueError("values must be distinct")
        return values


class Study(Model):
    """A boundary between outcomes, traced from a base scene in two of its parameters."""

    name: Annotated[str, Field(min_length=1)]
    scene: Scene
    search: Search
    sweep: Sweep

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
                    finer(scene)
        return self

    def _number_locations(self, field: str, path: str) -> set[tuple[str | int, ...]]:
        document = self._scene_document
        try:
            found = set(locations(document, path))
        except ValueError as error:
            raise ValueError(f"{field}: {error}") from None
        numbers = [value_at(document, location) for location in found]
        if not numbers or not all(type(number) in (int, float) for number in numbers):
            raise ValueError(f"{field}: {path!r} — must be the dotted path of a number in the scene")
        return found

    @cached_property
    def _scene_document(self) -> dict[str, Any]:
        return self.scene.model_dump()

    @cached_property
    def key(self) -> str:
        """Key of the study: 16 hexadecimal digits of the SHA-256 of its canonical JSON."""
        canonical = json.dumps(self.model_dump(mode="json"), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(canonical.encode()).hexdigest()[:16]

    def scene_at(self, sweep_value: float, value: float) -> Scene:
        """Return the scene with the swept and the searched parameter at these values.

        Raises
        ------
        ValueError
            If the scene does not allow one of them.
        """
        changes = {self.sweep.parameter: sweep_value, self.search.parameter: value}
        return validated(Scene, override(self._scene_document, changes))

    def side(self, outcome: Outcome) -> Side:
        """Return the side of the critical value on which an outcome lies.

        An outcome that the study does not name is no answer to its question, hence undecided.
        """
        if outcome in self.search.low:
            return Side.LOW
        if outcome in self.search.high:
            return Side.HIGH
        return NO_ANSWER.get(outcome, Side.UNDECIDED)

    def critical_value(self, guess: tuple[float, float] | None = None) -> CriticalValueSearch:
        """Return a new search for one point of the boundary."""
        return CriticalValueSearch(GeometricGrid(self.search.tolerance), self.search.limits, guess)

    def certification(self, bracket: tuple[float, float]) -> Certification:
        """Return a new certification of the bracket at which one of the searches has converged."""
        return Certification(GeometricGrid(self.search.tolerance), self.search.limits, bracket)

    def guess_at(
        self, sweep_value: float, known: Mapping[float, tuple[float, float]]
    ) -> tuple[float, float] | None:
        """Say where the critical value is expected from the points of the boundary that are known.

        On the line through two known neighbors, on either side where possible, and a little around it.
        A single one is followed as far as the boundary may rise or fall in proportion to the sweep.

        Parameters
        ----------
        sweep_value : float
        known : mapping from sweep value to bracket
            Converged points.

        Returns
        -------
        (low, high) or None
            Within the limits.  While fewer than two points are known, the study's own guesses stand in for
            them; None without those.
        """
        if len(known) < 2:
            known = {guess.at: guess.bracket for guess in self.search.guesses} | dict(known)
        if not known or sweep_value in known:
            return known.get(sweep_value)
        centers = {at: math.sqrt(low * high) for at, (low, high) in known.items()}
        nearest, *others = sorted(centers, key=lambda at: abs(at - sweep_value))
        if not others:
            ratio = sweep_value / nearest if nearest else 0.0
            spread = max(ratio, 1 / ratio) if ratio > 0 else 2.0  # no proportion across zero
            return self._within_limits(centers[nearest] / spread, centers[nearest] * spread)
        beyond = (at for at in others if (at - sweep_value) * (nearest - sweep_value) < 0)
        other = next(beyond, others[0])
        slope = (centers[other] - centers[nearest]) / (other - nearest)
        change = slope * (sweep_value - nearest)
        center = self._within_limits(centers[nearest] + change, math.inf)[0]
        low, high = known[nearest]
        width = max(BRACKET_MARGIN * self.search.tolerance, (high - low) / (high + low))
        margin = width * center + CURVATURE_MARGIN * abs(change)
        return self._within_limits(center - margin, center + margin)

    def _within_limits(self, low: float, high: float) -> tuple[float, float]:
        first, last = self.search.limits
        return min(max(low, first), last), min(max(high, first), last)


def preset_names() -> tuple[str, ...]:
    """Return the names of the studies and scenes that ship with the package, sorted."""
    return tuple(sorted(_presets()))


def load_study(
    name_or_path: str | Path,
    overrides: Iterable[str] = (),
    tolerance: float | None = None,
    certify: bool = False,
) -> Study:
    """Read a study from a preset or a TOML file.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a preset, else a file.
    overrides : iterable of str
        ``path=value`` with paths from the top of the document, such as ``scene.numerics.points=128``.
    tolerance : float, optional
        Replaces the relative tolerance of the search.
    certify : bool
        Have the brackets certified, also if the document does not ask for it.

    Raises
    ------
    ValueError
        If there is no such preset or file, or it is not a valid study; names the field.
    """
    changes = dict(parse_override(text) for text in overrides)
    if tolerance is not None:
        changes["search.tolerance"] = tolerance
    if certify:
        changes["search.certify"] = True
    return _load(Study, name_or_path, changes)


def load_scene(name_or_path: str | Path, overrides: Iterable[str] = ()) -> Scene:
    """Read a scene from a preset or a TOML file.

    Parameters
    ----------
    name_or_path : str or Path
        Name of a preset, else a file.
    overrides : iterable of str
        ``path=value``, such as ``flow.rate=0.5``.

    Raises
    ------
    ValueError
        If there is no such preset or file, or it is not a valid scene; names the field.
    """
    return _load(Scene, name_or_path, dict(parse_override(text) for text in overrides))


Document = TypeVar("Document", bound=Model)


def preset_document(name: str) -> dict[str, Any]:
    """Return the document of a preset as it is in its file.

    Raises
    ------
    ValueError
        If there is no such preset.
    """
    if name not in preset_names():
        raise ValueError(f"{name!r} is not a preset; presets: {', '.join(preset_names())}")
    return copy.deepcopy(_presets()[name])


@cache
def _presets() -> dict[str, dict[str, Any]]:
    # They do not change, and the service is asked for them hundreds of times a second.
    found = (preset for preset in (files("ensemble") / "presets").iterdir() if preset.name.endswith(".toml"))
    return {Path(preset.name).stem: tomllib.loads(preset.read_text(encoding="utf-8")) for preset in found}


def _load(model: type[Document], name_or_path: str | Path, changes: Mapping[str, Any]) -> Document:
    document = _read(name_or_path)
    try:
        return validated(model, override(document, changes))
    except ValueError as error:
        raise ValueError(f"{name_or_path}: {error}") from error


def _read(name_or_path: str | Path) -> dict[str, Any]:
    if str(name_or_path) in preset_names():
        return preset_document(str(name_or_path))
    if Path(name_or_path).is_file():
        return _toml(Path(name_or_path))
    raise ValueError(
        f"{str(name_or_path)!r} is neither a file nor a preset; presets: {', '.join(preset_names())}"
    )


def _toml(path: Path) -> dict[str, Any]:
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def validated(model: type[Document], document: Mapping[str, Any]) -> Document:
    """Return the study or scene that a document describes.

    Raises
    ------
    ValueError
        If it describes none; names the fields.
    """
    try:
        return model.model_validate(document)
    except ValidationError as error:
        raise ValueError(explain(error, document)) from error
