"""The question where the boundary between outcomes lies, which is a study."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, Any

from ensemble.config.certifying_scene import can_be_certified, certifying_scene
from ensemble.config.study import Study
from ensemble.questions.cost import run_work
from ensemble.questions.question import Answer, Question, StoredAnswer, StoredAnswers, where_kept
from ensemble.questions.size_limits import (
    MOST_BOUNDARY_POINTS,
    MOST_VESICLES_SWEPT,
    limit_points,
    limit_vesicles,
)
from solver.scene import Scene, Units

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm
    from rich.console import Console
    from rich.table import Table

    from ensemble.config.figure_options import FigureOptions, OnPicture
    from ensemble.display.progress import Display
    from ensemble.mpi.run_study import Snapshot, StudyResult
    from ensemble.search.boundary import Boundary
    from ensemble.store import Store
    from ensemble.store.columns import ListColumn
    from ensemble.store.listing import Listing

_ENDS = 2  # of a bracket, hence limits that are run first, and runs at finer numerics


class StudyQuestion(Question[Study]):
    """The question where a boundary lies, see `Question`.

    Attributes
    ----------
    document : Study
        What is asked.
    name : str
        The name of the study.
    """

    kind = "study"
    document_type = Study
    marker = "search"
    command = "bisect"
    title = "Trace a boundary"
    collection = "boundaries"
    answer_title = "diagram"
    answer_grows = True
    principal_fields = ("sweep.values", "search.limits", "search.tolerance", "search.scan", "search.certify")

    @classmethod
    def check_size(cls, document: Any) -> None:
        """See `Question`.

        Parameters
        ----------
        document : object
            What was sent.
        """
        limit_vesicles(document, MOST_VESICLES_SWEPT, "scene")
        limit_points(document, MOST_BOUNDARY_POINTS, "sweep")

    @cached_property
    def key(self) -> str:
        """Key of the study."""
        return self.document.key

    def planned_runs(self) -> Iterator[tuple[Scene, int]]:
        """See `Question`.

        Counted are the values of the scan all over the limits, those of a bisection, both ends, and these
        again at finer numerics: they certify, or confirm an end that is sensitive, as most are.
        """
        study = self.document
        low, high = study.search.limits
        candidates = math.log(high / low) / math.log1p(study.search.tolerance)
        scanning = math.ceil(study.search.scan * math.log10(high / low))
        searching = scanning + math.ceil(math.log2(max(candidates, 2))) + _ENDS
        for at in study.places:
            scenes = [study.scene_at(at, limit) for limit in study.search.limits]
            costliest = max(scenes, key=run_work)
            yield from ((scene, searching if scene is costliest else 0) for scene in scenes)
            if can_be_certified(costliest):
                yield certifying_scene(costliest), _ENDS

    def answer(
        self,
        communicator: Intracomm | None,
        store: Path | None,
        ranks_per_run: int,
        on_change: Callable[[Snapshot], None],
    ) -> Answer:
        """See `Question`.

        Parameters
        ----------
        communicator : Intracomm
            All ranks.
        store : Path
            Keeps the runs and the boundary.
        ranks_per_run : int
            How many ranks compute a run together.
        on_change : callable
            Takes snapshots of the boundary.

        Returns
        -------
        Answer
            On every rank.
        """
        from ensemble.mpi.run_study import run_study
        from ensemble.mpi.store_on_ranks import store_on_ranks

        assert communicator is not None, "many runs need a communicator"
        assert store is not None, "and a store"
        with store_on_ranks(communicator, store) as opened:
            result = run_study(communicator, self.document, opened, on_change, ranks_per_run)
        return _TracedBoundary(result, store)

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
            Gives a function that takes a `Snapshot`.
        """
        from ensemble.display.progress import study_lines, study_progress

        return study_lines(console) if for_program else study_progress(console)

    @classmethod
    def summary(cls, json_document: Mapping[str, Any]) -> str:
        """See `Question`.

        Parameters
        ----------
        json_document : mapping
            As `ensemble bisect --json` prints it.

        Returns
        -------
        str
            How many points have converged, what became of each of the others, and where it is known that the
            answer is not the only one.
        """
        points = json_document["boundary"]
        from ensemble.display.result_tables import place_text

        remarks = [
            f"{place_text(point['parameters'])}: {remark}" for point in points for remark in _remarks(point)
        ]
        converged = sum(point["status"] == "converged" for point in points)
        return "; ".join((f"{converged} of {len(points)} points converged", *remarks))

    @classmethod
    def stored(cls, store: Store, name: str) -> StoredAnswer | None:
        """See `Question`.

        Parameters
        ----------
        store : Store
            An open store.
        name : str
            The name of the study, with or without its changes, or the beginning of its key.

        Returns
        -------
        StoredAnswer or None
            The boundary.

        Raises
        ------
        ValueError
            If there are several; names their keys.
        """
        named = store.boundaries_named(name)
        if len(named) > 1:
            keys = "; ".join(
                f"{each.study_key} of {each.updated:%Y-%m-%d %H:%M:%S}, {each.name}" for each in named
            )
            raise ValueError(f"{name!r} — {len(named)} boundaries; name one by its key: {keys}")
        return _StoredBoundary(named[0], store) if named else None

    @classmethod
    def all_stored(cls, store: Store, listing: Listing, columns: Sequence[str]) -> StoredAnswers:
        """See `Question`.

        Parameters
        ----------
        store : Store
            An open store.
        listing : Listing
            Fields are those of the boundary, such as ``name``.
        columns : sequence of str
            Such fields.

        Returns
        -------
        StoredAnswers
            The boundaries.
        """
        from ensemble.store.catalog_tables import BOUNDARY_FIELDS
        from ensemble.store.columns import columns_of

        shown = columns_of(columns, BOUNDARY_FIELDS) or _columns()
        return StoredAnswers((json.loads(record.json) for record in store.boundary_records(listing)), shown)


def _columns() -> tuple[ListColumn, ...]:
    from ensemble.store.columns import ListColumn

    def converged(boundary: Mapping[str, Any]) -> int:
        return sum(point["status"] == "converged" for point in boundary["points"])

    def certified(boundary: Mapping[str, Any]) -> int:
        return sum(point["certified"] for point in boundary["points"])

    return (
        ListColumn("boundary", itemgetter("study_key")),
        ListColumn("name", itemgetter("name")),
        ListColumn("points", lambda boundary: len(boundary["points"])),
        ListColumn("converged", converged),
        ListColumn("certified", certified),
        ListColumn("updated", lambda boundary: boundary["updated"][:19].replace("T", " ")),
    )


_ADVICE = {
    "undecided": " (runs reach their end without an outcome: a larger scene.horizon may help)",
    "unbracketed": " (no change of the outcome within search.limits)",
    "failed": " (ensemble query runs --where outcome=failed --columns key,failure says why)",
}


def _remarks(point: Mapping[str, Any]) -> Iterator[str]:
    """Yield what a reader must know of a point of a boundary, besides its bracket."""
    if point["status"] != "converged":
        yield point["status"] + _ADVICE.get(point["status"], "")
    if point["incidental_changes"]:
        yield "other runs show further changes of the outcome"


@dataclass(frozen=True)
class _TracedBoundary(Answer):
    """A boundary and what it took to trace it."""

    result: StudyResult
    store: Path

    @property
    def complete(self) -> bool:
        from ensemble.search.critical_value import SearchStatus

        return all(point.status == SearchStatus.CONVERGED for point in self.result.boundary.points)

    def json_document(self) -> dict[str, Any]:
        """Return the boundary and its cost; `busy_fraction` is None if nothing had to be run."""
        boundary, usage = self.result.boundary, self.result.usage
        return {
            "study": boundary.name,
            "boundary": boundary.point_documents(),
            "criteria": boundary.study["scene"]["criteria"],
            "wall_seconds": usage.wall_seconds,
            "busy_fraction": fmean(usage.busy_fractions) if usage.busy_fractions else None,
            "store": str(self.store),
        }

    def table(self) -> Table:
        from ensemble.display.result_tables import boundary_table

        return boundary_table(self.result.boundary)

    @property
    def footer(self) -> str:
        usage = self.result.usage
        work = f"{usage.runs} runs in {usage.wall_seconds:.1f} s"
        if usage.busy_fractions:
            mean, least = fmean(usage.busy_fractions), min(usage.busy_fractions)
            work += f"; ranks busy {mean:.1%} of the time on average, {least:.1%} at least"
        found = StudyQuestion.summary(self.json_document())
        return f"{work}\n{found}; {where_kept(self.result.boundary.study_key, 'boundary.png', self.store)}"


@dataclass(frozen=True)
class _StoredBoundary(StoredAnswer):
    """A boundary of a store, as far as it is known."""

    boundary: Boundary
    store: Store

    def in_units(self, units: Units) -> StoredAnswer:
        return _StoredBoundary(self.boundary.in_units(units), self.store)

    def json_document(self) -> dict[str, Any]:
        return self.boundary.model_dump(mode="json") | {"points": self.boundary.point_documents()}

    def table(self) -> Table:
        from ensemble.display.result_tables import boundary_table

        return boundary_table(self.boundary)

    def draw(self, output: Path, options: FigureOptions, on_progress: OnPicture | None = None) -> None:
        """Draw the phase diagram, with every run that is behind the boundary, or the surface."""
        from ensemble.figures import phase_diagram, refuse_movie, save, surface_diagram, width_of

        refuse_movie(output, f"{self.boundary.name} is a boundary")
        if len(self.boundary.swept) > 1:
            figure = surface_diagram(self.boundary, width_of(options))
        else:
            figure = phase_diagram(self.boundary, self._runs(), width_of(options))
        save(figure, output, options)

    def _runs(self) -> list[tuple[float, float, str]]:
        """Return the swept value, the searched value and what counts of every run behind the boundary."""
        from ensemble.config.dotted_paths import parameter_value
        from ensemble.search.study_search import counted
        from ensemble.search.task_queue import RunAnswer

        search = self.boundary.study["search"]
        sides = (*search["low"], *search["high"])
        runs: list[tuple[float, float, str]] = []
        for point in self.boundary.points:
            (at,) = self.boundary.place(point)
            for key in point.runs:
                summary = self.store.summary(key)
                value = parameter_value(summary.scene, self.boundary.searched)
                answer = RunAnswer(summary.outcome, configuration=summary.configuration)
                runs.append((at, value, counted(answer, sides).outcome))
        return runs
