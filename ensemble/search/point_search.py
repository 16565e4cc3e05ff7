"""What is asked at one value of a sweep: a search or a certification, with its answers and its tasks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

from ensemble.config.run_key import run_key
from ensemble.search.critical_value import Side
from ensemble.search.task_queue import Task
from solver.analysis.run import Outcome
from solver.scene import Scene


@dataclass(frozen=True, kw_only=True)
class SearchRun(Task):
    """A run to make, and the place in the study whose question it answers."""

    sweep_value: float
    value: float


@dataclass(frozen=True)
class _Answer:
    outcome: Outcome
    key: str


class ValueSearch(Protocol):
    """Hands out values to try and takes the sides on which they lie, in any order."""

    def ask(self) -> float | None:
        """Return a value to try and mark it as pending; None if there is none."""

    def tell(self, value: float, side: Side) -> None:
        """Take the answer for a value."""

    def withdraw(self, value: float) -> None:
        """Give back a pending value."""

    def pointless(self) -> frozenset[float]:
        """Return the pending values whose answers no longer matter."""

    @property
    def done(self) -> bool:
        """Whether no further answer is needed."""


SomeValueSearch = TypeVar("SomeValueSearch", bound=ValueSearch)


class PointSearch(Generic[SomeValueSearch]):
    """Turns the values that are asked into tasks, and outcomes of runs into answers.

    Parameters
    ----------
    asking : Asking
    sweep_value : float
    scene_at : callable
        Scene of a value.
    side : callable
        Side of an outcome.
    known : callable
        Outcome of the run with this key if it has been made before, else None.  Such a run is never a task.
    """

    def __init__(
        self,
        search: SomeValueSearch,
        sweep_value: float,
        scene_at: Callable[[float], Scene],
        side: Callable[[Outcome], Side],
        known: Callable[[str], Outcome | None],
    ) -> None:
        self.search = search
        self.sweep_value = sweep_value
        self._scene_at = scene_at
        self._side = side
        self._known = known
        self._answers: dict[float, _Answer] = {}
        self._pending: dict[float, SearchRun] = {}
        self.known_answers = 0

    @property
    def pending(self) -> Mapping[float, SearchRun]:
        """Trials that are out, by value."""
        return self._pending

    @property
    def untouched(self) -> bool:
        """Whether nothing is known and nothing is out."""
        return not self._answers and not self._pending

    @property
    def runs(self) -> list[str]:
        """Keys of the runs that gave the answers, in the order of their values."""
        return [self._answers[value].key for value in sorted(self._answers)]

    def outcomes(self, bracket: tuple[float | None, float | None]) -> tuple[str | None, str | None]:
        """Outcomes at the ends of a bracket; None where an end is unknown."""
        low, high = (None if end is None else self._answers[end].outcome for end in bracket)
        return low, high

    def pointless_tasks(self) -> tuple[SearchRun, ...]:
        """Return the tasks that are out and whose outcome no longer matters."""
        return tuple(self._pending[value] for value in sorted(self.search.pointless()))

    def next_task(self) -> SearchRun | None:
        """Return the task of the most useful value to try; None if there is none."""
        while (value := self.search.ask()) is not None:
            # Another study on the same store may have made this run in the meantime.
            if not self.take_known(value):
                self._pending[value] = self._task(value)
                return self._pending[value]
        return None

    def take_known(self, value: float) -> bool:
        """Take the answer for a value if its run has been made before, and say whether it was."""
        task = self._task(value)
        outcome = self._known(task.key)
        if outcome is None:
            return False
        self._take(task, outcome)
        self.known_answers += 1
        return True

    def take_all_known(self) -> None:
        """Take the answers for all values that would be asked, as far as their runs have been made before."""
        while self.next_task() is not None:
            pass
        for task in tuple(self._pending.values()):
            self.cancelled(task)

    def answer(self, task: SearchRun, outcome: Outcome) -> None:
        """Take the outcome of a task's run."""
        del self._pending[task.value]
        self._take(task, outcome)

    def cancelled(self, task: SearchRun) -> None:
        """Take back a task whose run was given up."""
        del self._pending[task.value]
        self.search.withdraw(task.value)

    def _task(self, value: float) -> SearchRun:
        scene = self._scene_at(value)
        return SearchRun(sweep_value=self.sweep_value, value=value, scene=scene, key=run_key(scene))

    def _take(self, task: SearchRun, outcome: Outcome) -> None:
        self.search.tell(task.value, self._side(outcome))
        self._answers[task.value] = _Answer(outcome, task.key)
