"""A run that is not done, as `ensemble show` presents it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from ensemble.questions.question import StoredAnswer

if TYPE_CHECKING:
    from pathlib import Path

    from rich.table import Table

    from ensemble.config.figure_options import FigureOptions, OnPicture
    from ensemble.store.unfinished import UnfinishedRun
    from solver.scene import Units


@dataclass(frozen=True)
class UnfinishedAnswer(StoredAnswer):
    """How far a run has come, and what it has recorded.

    Attributes
    ----------
    unfinished : UnfinishedRun
    """

    unfinished: UnfinishedRun

    def in_units(self, units: Units) -> StoredAnswer:
        """Return the same with other units of the scene; see `StoredAnswer`.

        Parameters
        ----------
        units : Units

        Returns
        -------
        UnfinishedAnswer
        """
        scene = self.unfinished.scene.model_copy(update={"units": units})
        return UnfinishedAnswer(replace(self.unfinished, scene=scene))

    def json_document(self) -> dict[str, Any]:
        """Return how far the run has come, its last diagnostics, and its scene.

        Returns
        -------
        dict
        """
        return self.unfinished.json_document()

    def table(self) -> Table:
        """Return the same as a table.

        Returns
        -------
        Table
        """
        from ensemble.display.result_tables import fields_table

        return fields_table(self.json_document())

    def draw(self, output: Path, options: FigureOptions, on_progress: OnPicture | None = None) -> None:
        """Draw what has happened so far, or its movie; see `StoredAnswer`.

        Parameters
        ----------
        output : Path
        options : FigureOptions
        on_progress : callable, optional

        Raises
        ------
        ValueError
            If the run cannot be drawn in this format, or has not begun.
        """
        from ensemble.figures import draw_run

        run = self.unfinished.run()
        if run is None:
            raise ValueError(f"run {self.unfinished.key}: its start relaxes, and there is nothing to draw")
        draw_run(run, output, options, on_progress)
