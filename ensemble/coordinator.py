"""Decides which run of a study is the most useful one to make next.  Pure: no MPI, no files, no clock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from ensemble.boundary import Boundary, BoundaryPoint
from ensemble.grid import GeometricGrid
from ensemble.keys import run_key
from ensemble.parameters import parameter_value
from ensemble.search import Status
from ensemble.study import Study
from ensemble.timestamp import now
from solver.run import Outcome
from solver.scene import Scene


@dataclass(frozen=True)
class Task:
    """A run to make: the scene, its key, and the place in the study whose question it answers."""

    sweep_value: float
    value: float
    scene: Scene
    key: str


@dataclass(frozen=True)
class _Answer:
    outcome: Outcome
    key: str


class Coordinator:
    """All searches of a study and the tasks that are out.

    Searches are worked on in the order of the sweep, one task each before any gets a second one: two workers
    get further on two searches than on one, and finished searches tell the later ones where to begin.
    When there are more workers than searches left, the searches are cut into more than two parts at once.

    Parameters
    ----------
    study : Study
    known : callable
        Outcome of the run with this key if it has been made before, else None.  Such a run is never a task.
    made : iterable of Scene
        Scenes of runs made before.  Those of this study that are known are answers from the start.
    """

    def __init__(
        self, study: Study, known: Callable[[str], Outcome | None], made: Iterable[Scene] = ()
    ) -> None:
        self._study = study
        self._known = known
        grid = GeometricGrid(study.search.tolerance)
        self._values = {grid.value(index) for index in grid.within(*study.search.limits)}
        self._searches = {at: study.critical_value() for at in study.sweep.values}
        self._answers: dict[float, dict[float, _Answer]] = {at: {} for at in study.sweep.values}
        self._pending: dict[float, dict[float, Task]] = {at: {} for at in study.sweep.values}
        for at, value in filter(None, map(self._place, made)):
            self._take_known(self._task(at, value))
        self.known_answers = sum(map(len, self._answers.values()))

    def next_task(self) -> Task | None:
        """Return the most useful task for an idle worker; None if every useful run is out already."""
        # Sorting is stable: among equally busy searches the order of the sweep holds.
        for at in sorted(self._searches, key=lambda at: len(self._pending[at])):
            task = self._next_of(at)
            if task is not None:
                self._pending[at][task.value] = task
                return task
        return None

    def answer(self, task: Task, outcome: Outcome) -> None:
        """Take the outcome of a task's run."""
        del self._pending[task.sweep_value][task.value]
        self._take(task, outcome)

    def cancelled(self, task: Task) -> None:
        """Take back a task whose run was given up."""
        del self._pending[task.sweep_value][task.value]
        self._searches[task.sweep_value].withdraw(task.value)

    def pointless_tasks(self) -> tuple[Task, ...]:
        """Return the tasks that are out and whose outcome no longer matters."""
        return tuple(
            tasks[value]
            for at, tasks in self._pending.items()
            for value in sorted(self._searches[at].pointless())
        )

    @property
    def done(self) -> bool:
        """Whether no search needs any further answer."""
        return all(search.done for search in self._searches.values())

    @property
    def runs_left(self) -> float:
        """How many more answers the searches need, if each halves its bracket."""
        return sum(self._halvings(at) for at, search in self._searches.items() if not search.done)

    def boundary(self) -> Boundary:
        """Return the boundary as far as it is known."""
        return Boundary(
            study_key=self._study.key,
            study=self._study.model_dump(mode="json"),
            name=self._study.name,
            points=[self._point(at) for at in self._study.sweep.values],
            updated=now(),
        )

    def _place(self, scene: Scene) -> tuple[float, float] | None:
        """Where in the study a run of this scene would be, if everything else in it is the study's."""
        try:
            at = parameter_value(scene, self._study.sweep.parameter)
            value = parameter_value(scene, self._study.search.parameter)
        except ValueError:  # a scene of another kind
            return None
        return (at, value) if at in self._searches and value in self._values else None

    def _task(self, at: float, value: float) -> Task:
        scene = self._study.scene_at(at, value)
        return Task(at, value, scene, run_key(scene))

    def _next_of(self, at: float) -> Task | None:
        search = self._searches[at]
        if not self._answers[at] and not self._pending[at]:
            guess = self._study.guess_at(at, self._converged())
            if guess is not None:
                search.reseed(guess)
        while (value := search.ask()) is not None:
            task = self._task(at, value)
            # Another study on the same store may have made this run in the meantime.
            if not self._take_known(task):
                return task
        return None

    def _converged(self) -> dict[float, tuple[float, float]]:
        return {
            at: (low, high)
            for at, search in self._searches.items()
            if search.status is Status.CONVERGED
            for low, high in [search.bracket]
            if low is not None and high is not None
        }

    def _take_known(self, task: Task) -> bool:
        outcome = self._known(task.key)
        if outcome is not None:
            self._take(task, outcome)
        return outcome is not None

    def _take(self, task: Task, outcome: Outcome) -> None:
        self._searches[task.sweep_value].tell(task.value, self._study.side(outcome))
        self._answers[task.sweep_value][task.value] = _Answer(outcome, task.key)

    def _halvings(self, at: float) -> float:
        limits = self._study.search.limits
        low, high = (end or limit for end, limit in zip(self._searches[at].bracket, limits, strict=True))
        return max(1.0, math.log2(math.log(high / low) / math.log1p(self._study.search.tolerance)))

    def _point(self, at: float) -> BoundaryPoint:
        search, answers = self._searches[at], self._answers[at]
        low, high = search.bracket
        return BoundaryPoint(
            parameters={self._study.sweep.parameter: at},
            bracket=(low, high),
            outcomes=(
                None if low is None else answers[low].outcome,
                None if high is None else answers[high].outcome,
            ),
            status=search.status,
            certified=False,
            runs=[answers[value].key for value in sorted(answers)],
        )
