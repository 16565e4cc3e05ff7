"""The question what becomes of a scene all over two of its parameters, which is a map."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ensemble.config.measured import measured_document
from ensemble.config.outcome_map import OutcomeMap
from ensemble.questions.cost import run_work
from ensemble.questions.question import Answer, Question, StoredAnswer, StoredAnswers, where_kept
from ensemble.questions.size_limits import MOST_VESICLES_SWEPT, limit_vesicles
from solver.analysis.run import Outcome
from solver.scene import Scene, Units

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm
    from rich.table import Table

    from ensemble.config.figure_options import FigureOptions, OnPicture
    from ensemble.mpi.usage import RunUsage
    from ensemble.search.map_record import MapRecord
    from ensemble.store import Store
    from ensemble.store.listing import Listing

# A boundary from one side of a map to the other has at most as many cells, on both its sides, as there are
# columns and rows, and takes 2 to 2.5 runs a cell.
_RUNS_FOR_A_LINE = 2.5


class MapQuestion(Question[OutcomeMap]):
    """The question what becomes of a scene all over two of its parameters, see `Question`.

    Attributes
    ----------
    document : OutcomeMap
        What is asked.
    name : str
        The name of the map.
    """

    kind = "map"
    document_type = OutcomeMap
    marker = "axes"
    command = "map"
    title = "Draw a map"
    collection = "maps"
    answer_title = "map"
    principal_fields = ("axes.limits", "axes.resolution", "label", "scan")

    @classmethod
    def check_size(cls, document: Any) -> None:
        """See `Question`.

        Parameters
        ----------
        document : object
            What was sent.
        """
        limit_vesicles(document, MOST_VESICLES_SWEPT, "scene")

    @cached_property
    def key(self) -> str:
        """Key of the map."""
        return self.document.key

    def planned_runs(self) -> list[tuple[Scene, int]]:
        """See `Question`.

        Counted are the cells of the first lattice, and those along a boundary from one side to the other.

        Returns
        -------
        list of (Scene, int)
        """
        columns, rows = self.document.shape
        corners = [self.document.scene_at((i, j)) for i in (0, columns - 1) for j in (0, rows - 1)]
        costliest = max(corners, key=run_work)
        return [(costliest, (self.document.scan + 1) ** 2 + round(_RUNS_FOR_A_LINE * (columns + rows)))]

    def answer(
        self,
        communicator: Intracomm | None,
        store: Path | None,
        ranks_per_run: int,
        on_change: Callable[..., None],
    ) -> Answer:
        """See `Question`.

        Parameters
        ----------
        communicator : Intracomm
            All ranks.
        store : Path
            Keeps the runs and the map.
        ranks_per_run : int
            How many ranks compute a run together.
        on_change : callable
            Takes the progress of the runs.

        Returns
        -------
        Answer
            On every rank.
        """
        from ensemble.mpi.run_study import run_queue
        from ensemble.mpi.store_on_ranks import store_on_ranks, whole_store
        from ensemble.search.map_planner import MapPlanner

        assert communicator is not None, "many runs need a communicator"
        assert store is not None, "and a store"
        with store_on_ranks(communicator, store) as opened:

            def conclude(planner: MapPlanner) -> MapRecord:
                record = planner.record()
                whole_store(opened).save_map(record)
                return record

            record, usage = run_queue(
                communicator,
                ranks_per_run,
                opened,
                begin=lambda: MapPlanner(self.document, whole_store(opened).answer),
                publish=lambda planner, progress: on_change(progress),
                conclude=conclude,
            )
        return _DrawnMap(record, usage, store)

    @classmethod
    def summary(cls, json_document: Mapping[str, Any]) -> str:
        """See `Question`.

        Parameters
        ----------
        json_document : mapping
            As `ensemble map --json` prints it.

        Returns
        -------
        str
            Which share of the cells has which label.
        """
        shares = json_document["shares"].items()
        return ", ".join(f"{word} {share:.1%}" for word, share in shares)

    @classmethod
    def stored(cls, store: Store, name: str) -> StoredAnswer | None:
        """See `Question`.

        Parameters
        ----------
        store : Store
            An open store.
        name : str
            The name of the map, or the beginning of its key.

        Returns
        -------
        StoredAnswer or None

        Raises
        ------
        ValueError
            If there are several; names their keys.
        StoreError
            If the map of this key is damaged.
        """
        if store.map_grids.contains(name):
            return _StoredMap(store.map(name))
        maps = store.maps()
        found = [each for each in maps if each.name == name] or [
            each for each in maps if name and (each.key.startswith(name) or each.name.startswith(f"{name}, "))
        ]
        if len(found) > 1:
            keys = "; ".join(f"{each.key}, {each.name}" for each in found)
            raise ValueError(f"{name!r} — {len(found)} maps; name one by its key: {keys}")
        return _StoredMap(found[0]) if found else None

    @classmethod
    def all_stored(cls, store: Store, listing: Listing, columns: Sequence[str]) -> StoredAnswers:
        """See `Question`.

        Parameters
        ----------
        store : Store
            An open store.
        listing : Listing
            Only its limit; maps are few, and are not filtered.
        columns : sequence of str
            None, or the error names the command for one map.

        Returns
        -------
        StoredAnswers
            The newest first.

        Raises
        ------
        ValueError
            If the listing has filters, an order or columns.
        """
        from ensemble.store.columns import ListColumn

        if listing.where or listing.sort or columns:
            raise ValueError("maps: they are listed whole, the newest first; ensemble show prints one")
        shown = (
            ListColumn("map", itemgetter("key")),
            ListColumn("name", itemgetter("map")),
            ListColumn("cells", itemgetter("cells")),
            ListColumn("runs", itemgetter("runs")),
            ListColumn("labels", lambda document: list(document["shares"])),
        )
        return StoredAnswers((each.summary() for each in store.maps()[: listing.limit]), shown)


def _table(record: MapRecord) -> Table:
    from ensemble.display.result_tables import fields_table

    return fields_table(record.summary())


@dataclass(frozen=True)
class _DrawnMap(Answer):
    """A map and what it took to draw it."""

    record: MapRecord
    usage: RunUsage
    store: Path

    @property
    def complete(self) -> bool:
        return Outcome.FAILED not in self.record.labels

    def json_document(self) -> dict[str, Any]:
        return self.record.summary() | {
            "made": self.usage.runs,
            "wall_seconds": self.usage.wall_seconds,
            "store": str(self.store),
        }

    def table(self) -> Table:
        return _table(self.record)

    @property
    def footer(self) -> str:
        work = f"{self.usage.runs} runs in {self.usage.wall_seconds:.1f} s"
        return f"{work}; {where_kept(self.record.key, 'map.png', self.store)}"


@dataclass(frozen=True)
class _StoredMap(StoredAnswer):
    """A map of a store."""

    record: MapRecord

    def in_units(self, units: Units) -> StoredAnswer:
        return _StoredMap(self.record.in_units(units))

    def json_document(self) -> dict[str, Any]:
        """Return what the map has come to, the question, the values along both axes and all cells.

        The values are also in the units of the scene, if it has any.
        """
        first, second = self.record.question.axes
        return (
            self.record.summary()
            | {
                "question": self.record.map,
                "values": {first.parameter: first.values, second.parameter: second.values},
                "labels": self.record.labels,
                "label_numbers": self.record.cells,
                "made": self.record.run_documents(),
            }
            | measured_document(self.record.measured())
        )

    def table(self) -> Table:
        return _table(self.record)

    def draw(self, output: Path, options: FigureOptions, on_progress: OnPicture | None = None) -> None:
        """Draw the phase diagram."""
        from ensemble.figures import map_diagram, refuse_movie, save, width_of

        refuse_movie(output, f"{self.record.name} is a map")
        save(map_diagram(self.record, width_of(options)), output, options)
