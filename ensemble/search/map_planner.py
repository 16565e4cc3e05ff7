"""Decides which cell of a map is run next.  Pure: no MPI, no files, no clock."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ensemble.config.outcome_map import OutcomeMap
from ensemble.config.run_key import run_key
from ensemble.search.map_record import NO_SCENE, MapRecord, MapRunRecord
from ensemble.search.map_refinement import Cell, MapRefinement
from ensemble.search.task_queue import RunAnswer, Task
from ensemble.timestamp import now
from solver.analysis.run_labels import label_of


@dataclass(frozen=True, kw_only=True)
class MapRun(Task):
    """A run to make for a map.

    Attributes
    ----------
    cell : (int, int)
        Its numbers along the axes, from 0.
    """

    cell: Cell


class MapPlanner:
    """The task queue of a map.

    Parameters
    ----------
    outcome_map : OutcomeMap
        What is asked.
    known : callable
        Returns the answer of the run with a key if it has been made before, else None.  A run that has been
        made before is never a task.
    """

    def __init__(self, outcome_map: OutcomeMap, known: Callable[[str], RunAnswer | None]) -> None:
        self._map = outcome_map
        self._known = known
        self._refinement = MapRefinement(outcome_map.shape, outcome_map.scan)
        self._numbers: dict[str, int] = {}  # of the labels
        self._keys: dict[Cell, str] = {}
        self._waiting: list[MapRun] = []
        self._running: set[Cell] = set()
        self.known_answers = 0
        self._take_known()

    def next_task(self) -> MapRun | None:
        """See `TaskQueue`."""
        while self._waiting:
            task = self._waiting.pop()
            # Another command on the same store may have made this run in the meantime.
            answer = self._known(task.key)
            if answer is None:
                self._running.add(task.cell)
                return task
            self.known_answers += 1
            self._tell(task, answer)
            self._take_known()
        return None

    def answer(self, task: MapRun, answer: RunAnswer) -> None:
        """See `TaskQueue`.

        Parameters
        ----------
        task : MapRun
            A task that is handed out.
        answer : RunAnswer
            Of its run.
        """
        self._running.remove(task.cell)
        self._tell(task, answer)
        self._take_known()

    def cancelled(self, task: MapRun) -> None:
        """See `TaskQueue`.

        Parameters
        ----------
        task : MapRun
            A task that is handed out.
        """
        self._running.remove(task.cell)
        self._waiting.append(task)

    def unneeded_tasks(self) -> tuple[MapRun, ...]:
        """Return nothing: every run is needed."""
        return ()

    @property
    def done(self) -> bool:
        """See `TaskQueue`."""
        return self._refinement.done

    @property
    def runs_left(self) -> int:
        """See `TaskQueue`."""
        return len(self._refinement.wave) + self._refinement.cells_to_come

    def record(self) -> MapRecord:
        """Return the map, which is done."""
        words = sorted(self._numbers)
        order = [words.index(word) for word in self._numbers]
        return MapRecord(
            key=self._map.key,
            name=self._map.name,
            map=self._map.model_dump(mode="json"),
            labels=words,
            cells=[[order[number] for number in column] for column in self._refinement.labels.tolist()],
            runs=[MapRunRecord(cell=cell, run=key) for cell, key in sorted(self._keys.items())],
            updated=now(),
        )

    def _take_known(self) -> None:
        """Begin every wave that is new, as long as the runs of a whole one have been made before."""
        while not (self._waiting or self._running or self._refinement.done):
            for cell in sorted(self._refinement.wave, reverse=True):
                task = self._task(cell)
                if task is None:
                    self._label(cell, NO_SCENE)
                    continue
                answer = self._known(task.key)
                if answer is None:
                    self._waiting.append(task)
                else:
                    self.known_answers += 1
                    self._tell(task, answer)

    def _task(self, cell: Cell) -> MapRun | None:
        """Return the run of a cell; None if there is no such scene, which only looking at it can tell."""
        try:
            scene = self._map.scene_at(cell)
        except ValueError:
            return None
        return MapRun(scene=scene, key=run_key(scene), cell=cell)

    def _tell(self, task: MapRun, answer: RunAnswer) -> None:
        self._keys[task.cell] = task.key
        self._label(task.cell, label_of(self._map.label, answer))

    def _label(self, cell: Cell, label: str) -> None:
        self._refinement.tell(cell, self._numbers.setdefault(label, len(self._numbers)))
