"""A map: what becomes of a scene all over two of its parameters."""

from __future__ import annotations

import math
from functools import cached_property
from itertools import product
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator

from ensemble.config.overrides import LONGEST_NAME, override
from ensemble.config.parameter_values import ValueOf, number_locations, remember_scene
from ensemble.config.question_key import question_key
from ensemble.config.validation import validated
from solver.analysis.run_labels import LABELS
from solver.scene import Model, Scene

_ALONG = ValueOf("along")
_DIGITS = 10  # of a value: so that it is the same on all processors


class Axis(Model):
    """A parameter of a map, and which of its values are looked at.

    Attributes
    ----------
    parameter : str
        Dotted path of a number in the scene.
    limits : (float, float)
        Where the map begins and ends.
    resolution : float
        Width of a cell as a share of the whole axis, from 0.005 to 0.5.
    spacing : str
        Whether cells have the same width (``linear``) or the same ratio of their ends (``geometric``).
    """

    parameter: str
    limits: tuple[Annotated[float, _ALONG], Annotated[float, _ALONG]]
    resolution: float = Field(0.02, ge=0.005, le=0.5)
    spacing: Literal["linear", "geometric"] = "linear"

    @field_validator("parameter")
    @classmethod
    def _of_values_below(cls, parameter: str, info: ValidationInfo) -> str:
        return _ALONG.remember(parameter, info)

    @model_validator(mode="after")
    def _ascends(self) -> Self:
        first, last = self.limits
        if not first < last:
            raise ValueError("limits: the first must be less than the second")
        if self.spacing == "geometric" and first <= 0:
            raise ValueError("limits: must be above 0 with the spacing geometric")
        ends_and_middles = (*self.edges, *self.values)
        if len(set(ends_and_middles)) < len(ends_and_middles):
            raise ValueError(
                f"limits: must be farther apart than {first!r} and {last!r}: the values of {self.cells} "
                f"cells have {_DIGITS} digits, and some would be equal"
            )
        return self

    @property
    def cells(self) -> int:
        """How many cells there are along the axis."""
        return math.ceil(1 / self.resolution - 1e-9)

    @cached_property
    def edges(self) -> tuple[float, ...]:
        """The ends of the cells, ascending: one more than there are cells."""
        return self._at(range(self.cells + 1), 0.0)

    @cached_property
    def values(self) -> tuple[float, ...]:
        """The values at which cells are run: their middles."""
        return self._at(range(self.cells), 0.5)

    def _at(self, cells: range, shift: float) -> tuple[float, ...]:
        share = (np.array(cells) + shift) / self.cells
        first, last = self.limits
        is_linear = self.spacing == "linear"
        values = first + (last - first) * share if is_linear else first * (last / first) ** share
        return tuple(float(f"{value:.{_DIGITS}g}") for value in values)


class OutcomeMap(Model):
    """What becomes of a scene all over two of its parameters.

    Attributes
    ----------
    name : str
        What the map is called; at most 100 characters.
    scene : Scene
        The scene in which both parameters are varied.
    axes : (Axis, Axis)
        The two parameters.
    label : str
        By which word of a run cells are told apart: ``outcome``, or ``configuration``, which is that of a
        pair that stays together and else the outcome.
    scan : int
        Into how many parts each axis is divided at first, from 1 to 100: regions that are narrower may go
        unseen.
    """

    # Without control characters: it is shown on terminals and in pages.
    name: Annotated[str, Field(min_length=1, max_length=LONGEST_NAME, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")]
    scene: Scene
    axes: tuple[Axis, Axis]
    label: Annotated[str, LABELS] = "outcome"
    scan: int = Field(6, ge=1, le=100)

    _whose_parameters_have_dimensions = field_validator("scene")(remember_scene)

    @model_validator(mode="after")
    def _parameters_fit_the_scene(self) -> Self:
        document = self._scene_document
        first, second = (
            number_locations(document, f"axes.{index}.parameter", axis.parameter)
            for index, axis in enumerate(self.axes)
        )
        if first & second:
            raise ValueError("axes.1.parameter: must differ from axes.0.parameter")
        columns, rows = self.shape
        for cell in product((0, columns - 1), (0, rows - 1)):
            try:
                self.scene_at(cell)
            except ValueError as error:
                at = zip(self.axes, cell, strict=True)
                values = ", ".join(f"{axis.parameter}={axis.values[index]!r}" for axis, index in at)
                raise ValueError(f"axes: {values} — {error}") from None
        return self

    @cached_property
    def _scene_document(self) -> dict[str, Any]:
        return self.scene.model_dump()

    @cached_property
    def key(self) -> str:
        """Key of the map: 16 hexadecimal digits, whatever the units of its scene."""
        return question_key(self)

    @property
    def shape(self) -> tuple[int, int]:
        """How many cells there are along each axis."""
        first, second = self.axes
        return first.cells, second.cells

    def scene_at(self, cell: tuple[int, int]) -> Scene:
        """Return the scene in the middle of a cell.

        Parameters
        ----------
        cell : (int, int)
            Its numbers along the axes, from 0.

        Returns
        -------
        Scene

        Raises
        ------
        ValueError
            If the scene does not allow the values there.
        """
        changes = {axis.parameter: axis.values[index] for axis, index in zip(self.axes, cell, strict=True)}
        return validated(Scene, override(self._scene_document, changes))
