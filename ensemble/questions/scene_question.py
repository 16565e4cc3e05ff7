"""The question what becomes of a single scene."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ensemble.config.measured import Measured, measured_document, measured_fields
from ensemble.config.run_key import run_key
from ensemble.questions.question import SHORT_KEY, Answer, Question, StoredAnswer, StoredAnswers, where_kept
from ensemble.questions.size_limits import MOST_VESICLES, limit_vesicles
from solver.scene import Scene, Units

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm
    from rich.console import Console
    from rich.table import Table

    from ensemble.config.figure_options import FigureOptions, OnPicture
    from ensemble.display.progress import Display
    from ensemble.store import Store
    from ensemble.store.listing import Listing
    from ensemble.store.run_record import RunSummary

_COLUMNS = {
    "run": "key",
    "outcome": "outcome",
    "configuration": "configuration",
    "flow": "flow.kind",
    "rate": "flow.rate",
    "reduced area": "vesicles.reduced_area",
    "hamaker": "adhesion.hamaker",
    "integrator": "numerics.integrator",
    "points": "work.points",
    "rev": "results_revision",
}
_WORK = ("points", "steps", "rejected_steps", "rhs_evaluations", "wall_seconds")
_RESULTS = (
    "outcome",
    "configuration",
    "failure",
    "undecided",
    "time",
    "perturbations",
    "sensitive",
    "period",
    "settled",
    "effective_aspect_ratio",
    "inclination_angle",
    "gap",
    "viscosity",
    "energy",
    "arrangement",
    "error",
)


class SceneQuestion(Question[Scene]):
    """The question what becomes of a scene, see `Question`.

    Attributes
    ----------
    document : Scene
        What is asked.
    name : str
        The preset that the scene was made from, or ``scene``.
    """

    kind = "scene"
    document_type = Scene
    marker = "horizon"
    command = "run"
    title = "Simulate one scene"
    collection = "runs"
    answer_grows = True
    answer_title = "run"
    has_many_runs = False
    scene_path = ""

    @classmethod
    def check_size(cls, document: Any) -> None:
        """See `Question`.

        Parameters
        ----------
        document : object
            What was sent.
        """
        limit_vesicles(document, MOST_VESICLES)

    @cached_property
    def key(self) -> str:
        """Key of the run."""
        return run_key(self.document)

    def planned_runs(self) -> list[tuple[Scene, int]]:
        """See `Question`."""
        return [(self.document, 1)]

    def answer(
        self,
        communicator: Intracomm | None,
        store: Path | None,
        ranks_per_run: int,
        on_change: Callable[[float, float], None],
    ) -> Answer | None:
        """See `Question`.

        Parameters
        ----------
        communicator : Intracomm or None
            All ranks; None if this process is alone, which needs no MPI library.
        store : Path or None
            Keeps the run; if it has it already, nothing is simulated.
        ranks_per_run : int
            How many ranks compute the run together.
        on_change : callable
            Takes the time that is reached and the latest end.

        Returns
        -------
        Answer or None
            On the first rank; None elsewhere.
        """
        from ensemble.mpi.single_run import single_run
        from ensemble.mpi.store_on_ranks import store_on_ranks

        with nullcontext() if store is None else store_on_ranks(communicator, store) as opened:
            summary = single_run(communicator, self.document, opened, ranks_per_run, on_change)
        # The run may have been made for a scene with other units.
        return None if summary is None else _FinishedRun(summary.in_units(self.document.units), store)

    @classmethod
    def progress(cls, console: Console, for_program: bool) -> Display:
        """See `Question`.

        Parameters
        ----------
        console : Console
            Where it is shown.
        for_program : bool
            Whether it is read by a program.

        Returns
        -------
        context manager
            Gives a function that takes the time that is reached and the latest end.
        """
        from ensemble.display.progress import run_lines, run_progress

        return run_lines(console) if for_program else run_progress(console)

    @classmethod
    def summary(cls, json_document: Mapping[str, Any]) -> str:
        """See `Question`.

        Parameters
        ----------
        json_document : mapping
            As `ensemble run --json` prints it.

        Returns
        -------
        str
            The outcome, or why the run failed.
        """
        return str(json_document["failure"] or json_document["outcome"])

    @classmethod
    def stored(cls, store: Store, name: str) -> StoredAnswer | None:
        """See `Question`.

        Parameters
        ----------
        store : Store
            An open store.
        name : str
            Key of the run, or as much of it as no other key begins with.

        Returns
        -------
        StoredAnswer or None
            The run; as far as it has come, if it is not done.
        """
        from ensemble.errors import NotStored
        from ensemble.questions.unfinished_answer import UnfinishedAnswer
        from ensemble.store.unfinished import unfinished_run

        try:
            return _StoredRun(store.summary(store.full_key(name)), store)
        except NotStored:
            unfinished = unfinished_run(store.path, name)
            return UnfinishedAnswer(unfinished) if unfinished else None

    @classmethod
    def all_stored(cls, store: Store, listing: Listing, columns: Sequence[str]) -> StoredAnswers:
        """See `Question`.

        Parameters
        ----------
        store : Store
            An open store.
        listing : Listing
            Fields are those of the scene and the results, such as ``flow.rate``.
        columns : sequence of str
            Such fields; without any the usual ones, and those by which the listing chooses and sorts.

        Returns
        -------
        StoredAnswers
            The runs.
        """
        from ensemble.store.catalog_tables import RUN_FIELDS
        from ensemble.store.columns import column_of, columns_of
        from ensemble.store.filters import compared_fields

        usual = [
            column_of(path, RUN_FIELDS, heading)._replace(width=SHORT_KEY if path == "key" else None)
            for heading, path in _COLUMNS.items()
        ]
        asked = dict.fromkeys(compared_fields(listing.where), "where")
        if listing.sort is not None:
            asked.setdefault(listing.sort.removeprefix("-"), "sort")
        more = [
            column_of(path, RUN_FIELDS, asked=by)
            for path, by in asked.items()
            if path not in _COLUMNS.values()
        ]
        shown = columns_of(columns, RUN_FIELDS) or (*usual, *more)
        return StoredAnswers((json.loads(record.json) for record in store.run_records(listing)), shown)


def run_document(summary: RunSummary) -> dict[str, Any]:
    """Return the results and the cost of a run as JSON data.

    Parameters
    ----------
    summary : RunSummary
        Of the run.

    Returns
    -------
    dict
        A quantity that the scene does not have is None.  Where the units of the scene are known, the
        results in these are added as ``in_units``.
    """
    return _results_and_cost(summary) | measured_document(measured_results(summary))


def _results_and_cost(summary: RunSummary) -> dict[str, Any]:
    document = summary.document()
    return (
        {name: document[name] for name in _RESULTS}
        | {name: document["work"][name] for name in _WORK}
        | {"run_key": summary.key, "results_revision": summary.results_revision}
    )


def measured_results(summary: RunSummary) -> dict[str, Measured]:
    """Return the results of a run in the units of its scene.

    Parameters
    ----------
    summary : RunSummary

    Returns
    -------
    dict of str to Measured
        By dotted path; empty if the units are not known.
    """
    document = summary.document()
    results = {name: document[name] for name in _RESULTS}
    return measured_fields(summary, results, summary.scene.units)


@dataclass(frozen=True)
class _FinishedRun(Answer):
    """A run that has just been made, or that the store had already."""

    summary: RunSummary
    store: Path | None

    @property
    def complete(self) -> bool:
        from solver.analysis.run import Outcome

        return self.summary.outcome is not Outcome.FAILED

    def json_document(self) -> dict[str, Any]:
        return run_document(self.summary)

    def table(self) -> Table:
        from ensemble.display.result_tables import fields_table

        return fields_table(_results_and_cost(self.summary), measured_results(self.summary))

    @property
    def footer(self) -> str | None:
        return None if self.store is None else where_kept(self.summary.key, "run.png", self.store)


@dataclass(frozen=True)
class _StoredRun(StoredAnswer):
    """A run of a store."""

    summary: RunSummary
    store: Store

    def in_units(self, units: Units) -> StoredAnswer:
        return _StoredRun(self.summary.in_units(units), self.store)

    def json_document(self) -> dict[str, Any]:
        document = self.summary.document()
        return document | measured_document(measured_fields(self.summary, document, self.summary.scene.units))

    def table(self) -> Table:
        """Return the results and the cost of the run, and the scene that it is of."""
        from ensemble.display.result_tables import fields_table

        scene = self.summary.scene
        document = {"scene": scene.model_dump(mode="json", exclude_none=True)}
        measured = measured_results(self.summary) | measured_fields(self.summary, document, scene.units)
        return fields_table(_results_and_cost(self.summary) | document, measured)

    def draw(self, output: Path, options: FigureOptions, on_progress: OnPicture | None = None) -> None:
        """Draw what happened in the run, or its movie."""
        from ensemble.figures import draw_run

        run = replace(self.store.load(self.summary.key), scene=self.summary.scene)
        draw_run(run, output, options, on_progress)
