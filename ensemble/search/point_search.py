"""The search, or the certification, at one place of a boundary, with its answers and its tasks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar

from ensemble.config.run_key import run_key
from ensemble.search.critical_value import Side
from ensemble.search.task_queue import RunAnswer, Task
from solver.analysis.run import Configuration, Outcome
from solver.scene import Scene


@dataclass(frozen=True, kw_only=True)
class SearchRun(Task):
    """A run to make for a search, and its place in the study.

    Attributes
    ----------
    at : tuple of float
        Value of each swept parameter.
    value : float
        Of the searched parameter.
    """

    at: tuple[float, ...]
    value: float


@dataclass(frozen=True)
class _KnownRun:
    answer: RunAnswer
    key: str


class ValueSearch(Protocol):
    """Asks for values to try and takes the sides on which they lie, in any order."""

    def ask(self) -> float | None:
        """Return a value to try and mark it as pending; None if there is none."""

    def tell(self, value: float, side: Side) -> None:
        """Take the answer for a value.

        Parameters
        ----------
        value : float
            That was tried.
        side : Side
            On which it lies.
        """

    def withdraw(self, value: float) -> None:
        """Give back a pending value.

        Parameters
        ----------
        value : float
            A pending one.
        """

    def unneeded(self) -> frozenset[float]:
        """Return the pending values whose answers are no longer needed."""

    @property
    def done(self) -> bool:
        """Whether no further answer is needed."""


SomeValueSearch = TypeVar("SomeValueSearch", bound=ValueSearch)


class PointSearch(Generic[SomeValueSearch]):
    """Turns the values that a search asks for into tasks, and outcomes of runs into answers.

    Parameters
    ----------
    search : ValueSearch
        What asks for values.
    at : tuple of float
        Where it searches: the value of each swept parameter.
    scene_at : callable
        Returns the scene of a value.
    side : callable
        Returns the side of an outcome.
    known : callable
        Returns the answer of the run with a key if it has been made before, else None.  A run that has been
        made before is never a task.
    """

    def __init__(
        self,
        search: SomeValueSearch,
        at: tuple[float, ...],
        scene_at: Callable[[float], Scene],
        side: Callable[[Outcome | Configuration], Side],
        known: Callable[[str], RunAnswer | None],
    ) -> None:
        self.search = search
        self.at = at
        self._scene_at = scene_at
        self._side = side
        self._known = known
        self._answers: dict[float, _KnownRun] = {}
        self._pending: dict[float, SearchRun] = {}
        self.known_answers = 0

    @property
    def pending(self) -> Mapping[float, SearchRun]:
        """The tasks that are handed out, by value."""
        return self._pending

    @property
    def runs(self) -> list[str]:
        """The keys of the runs that gave the answers, in the order of their values."""
        return [self._answers[value].key for value in sorted(self._answers)]

    def outcomes(self, bracket: tuple[float | None, float | None]) -> tuple[str | None, str | None]:
        """Return the outcomes at the ends of a bracket.

        Parameters
        ----------
        bracket : (float or None, float or None)
            Two values whose answers are known; None for an end that is unknown.

        Returns
        -------
        (str or None, str or None)
            None for an end that is unknown.
        """
        low, high = (None if end is None else self.answer_at(end).outcome for end in bracket)
        return low, high

    def answer_at(self, value: float) -> RunAnswer:
        """Return the answer of the run at a value.

        Parameters
        ----------
        value : float
            Whose answer is known.

        Returns
        -------
        RunAnswer
        """
        return self._answers[value].answer

    def adopt(self, other: PointSearch[Any]) -> None:
        """Take the answers that another search has got from runs at the same numerics.

        Parameters
        ----------
        other : PointSearch
        """
        for value, run in other._answers.items():
            self._take(self._task(value), run.answer)

    def unneeded_tasks(self) -> tuple[SearchRun, ...]:
        """Return the tasks that are handed out and whose outcome is no longer needed."""
        return tuple(self._pending[value] for value in sorted(self.search.unneeded()))

    def next_task(self) -> SearchRun | None:
        """Return the task of the most useful value to try; None if there is none."""
        while (value := self.search.ask()) is not None:
            # Another study on the same store may have made this run in the meantime.
            task = self._task(value)
            if not self._take_known(task):
                self._pending[value] = task
                return task
        return None

    def take_known(self, value: float) -> bool:
        """Take the answer for a value if its run has been made before.

        Parameters
        ----------
        value : float
            That the search may try.

        Returns
        -------
        bool
            Whether it has been made before.
        """
        return self._take_known(self._task(value))

    def take_all_known(self) -> None:
        """Take the answers for all values that the search asks for, as far as their runs exist already."""
        while self.next_task() is not None:
            pass
        for task in tuple(self._pending.values()):
            self.cancelled(task)

    def answer(self, task: SearchRun, answer: RunAnswer) -> None:
        """Take the answer of a task's run.

        Parameters
        ----------
        task : SearchRun
            A task that is handed out.
        answer : RunAnswer
            Of its run.
        """
        del self._pending[task.value]
        self._take(task, answer)

    def cancelled(self, task: SearchRun) -> None:
        """Take back a task whose run was cancelled.

        Parameters
        ----------
        task : SearchRun
            A task that is handed out.
        """
        del self._pending[task.value]
        self.search.withdraw(task.value)

    def _task(self, value: float) -> SearchRun:
        scene = self._scene_at(value)
        return SearchRun(at=self.at, value=value, scene=scene, key=run_key(scene))

    def _take_known(self, task: SearchRun) -> bool:
        answer = self._known(task.key)
        if answer is None:
            return False
        self._take(task, answer)
        self.known_answers += 1
        return True

    def _take(self, task: SearchRun, answer: RunAnswer) -> None:
        self.search.tell(task.value, self._side(answer.outcome))
        self._answers[task.value] = _KnownRun(answer, task.key)
