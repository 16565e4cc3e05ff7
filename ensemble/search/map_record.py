"""A map as it is kept: the label of every cell, and the runs behind it."""

from __future__ import annotations

from collections import Counter
from typing import Any, Final, Self

import numpy as np
from pydantic import BaseModel, ConfigDict

from ensemble.config.measured import Measured, dimension_at, document_in_units, measured_values
from ensemble.config.outcome_map import OutcomeMap
from ensemble.search.map_refinement import Labels, beside_changes
from ensemble.timestamp import Timestamp
from solver.scene import Scene, Units

# Label of cells where the scene does not allow the values, such as where vesicles would overlap.
NO_SCENE: Final = "no-scene"


class MapRunRecord(BaseModel):
    """A cell that was run.

    Attributes
    ----------
    cell : (int, int)
        Its numbers along the axes, from 0.
    run : str
        Key of its run.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    cell: tuple[int, int]
    run: str


class MapRecord(BaseModel):
    """A whole map.

    Attributes
    ----------
    key : str
        Of the map.
    name : str
        Of the map.
    map : dict
        The question in full.
    labels : list of str
        The labels that cells have; ``no-scene`` where the scene does not allow the values.
    cells : list of list of int
        For each value along the first axis, and each along the second one, the number of the cell's label.
    runs : list of MapRunRecord
        The cells that were run; of the others, those with a scene have the label of the cells around them.
    updated : datetime
        When it was done.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    key: str
    name: str
    map: dict[str, Any]
    labels: list[str]
    cells: list[list[int]]
    runs: list[MapRunRecord]
    updated: Timestamp

    @property
    def question(self) -> OutcomeMap:
        """The map that was asked for."""
        return OutcomeMap.model_validate(self.map)

    @property
    def scene(self) -> Scene:
        """The scene in which both parameters are varied."""
        return Scene.model_validate(self.map["scene"])

    @property
    def numbers(self) -> Labels:
        """The numbers of the labels, (columns, rows)."""
        return np.array(self.cells, dtype=np.int64)

    @property
    def boundary_cells(self) -> int:
        """How many cells have a neighbor with another label."""
        return int(beside_changes(self.numbers).sum())

    def in_units(self, units: Units | None) -> Self:
        """Return the map as if its scene had other units, or none.

        Parameters
        ----------
        units : Units or None

        Returns
        -------
        MapRecord
        """
        return self.model_copy(update={"map": document_in_units(self.map, units)})

    def measured(self) -> dict[str, Measured]:
        """Return the values along the axes in the units of the scene.

        Returns
        -------
        dict of str to Measured
            By parameter; without what has no unit.
        """
        scene = self.scene
        values = {
            axis.parameter: (axis.values, dimension_at(scene, axis.parameter)) for axis in self.question.axes
        }
        return measured_values(values, scene.units)

    def summary(self) -> dict[str, Any]:
        """Return what the map has come to, as JSON data."""
        counts = Counter(self.numbers.ravel().tolist())
        cells = sum(counts.values())
        return {
            "map": self.name,
            "key": self.key,
            "label": self.map["label"],
            "cells": cells,
            "shares": {word: counts[number] / cells for number, word in enumerate(self.labels)},
            "boundary_cells": self.boundary_cells,
            "runs": len(self.runs),
        }

    def run_documents(self) -> list[dict[str, Any]]:
        """Return the cells that were run as JSON data: both parameters, the label and the key of the run."""
        first, second = self.question.axes
        return [
            {
                "parameters": {
                    first.parameter: first.values[made.cell[0]],
                    second.parameter: second.values[made.cell[1]],
                },
                "label": self.labels[self.cells[made.cell[0]][made.cell[1]]],
                "run": made.run,
            }
            for made in self.runs
        ]
