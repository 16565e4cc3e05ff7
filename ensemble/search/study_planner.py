"""Decides which run of a study is the most useful one to make next.  Pure: no MPI, no files, no clock.

Between two reports only the point that they are about is looked at, so that the time for a report grows with
the logarithm of the number of points.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from heapq import heappop, heappush

from ensemble.config.study import Study
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.search.known_brackets import KnownBrackets, expected_bracket
from ensemble.search.point_search import SearchRun
from ensemble.search.study_point import StudyPoint
from ensemble.search.task_queue import RunAnswer
from ensemble.timestamp import now

Place = tuple[float, ...]  # the value of each swept parameter


class StudyPlanner:
    """The task queue of a study: all of its searches, confirmations and certifications.

    Points are worked on in the order of the sweep, one task each before any gets a second one: two workers
    get further on two searches than on one, and finished searches show the later ones where to begin.  When
    there are more workers than runs that are needed in any case, those are made that one outcome of a pending
    run would make needed.

    Parameters
    ----------
    study : Study
        What is to be traced.
    known : callable
        Returns the answer of the run with a key if it has been made before, else None.  A run that has been
        made before is never a task.
    made : iterable of (tuple of float, float)
        Values of the swept parameters and of the searched one at which runs have been made before.
        Those runs that belong to this study are answers from the start.
    """

    def __init__(
        self,
        study: Study,
        known: Callable[[str], RunAnswer | None],
        made: Iterable[tuple[Place, float]] = (),
    ) -> None:
        self._study = study
        self._grid = study.search.grid
        self._indices = self._grid.within(*study.search.limits)
        self._points = {at: StudyPoint(study, at, known) for at in study.places}
        for at, value in {place for place in made if self._is_tried(*place)}:
            self._points[at].take_known(value)
        self._order = {at: order for order, at in enumerate(self._points)}
        # Entries of the queue whose number is no longer that of their point are out of date.
        self._queue: list[tuple[tuple[bool, bool, int], int, int, Place]] = []
        self._entries = dict.fromkeys(self._points, 0)
        self._open: set[Place] = set()
        self._unneeded: dict[Place, tuple[SearchRun, ...]] = {}
        self._documents: dict[Place, BoundaryPoint] = {}
        self._brackets = KnownBrackets()
        for at in self._points:
            self._look_at(at)

    def next_task(self) -> SearchRun | None:
        """See `TaskQueue`."""
        while self._queue:
            _, _, entry, at = heappop(self._queue)
            if entry != self._entries[at]:
                continue
            point = self._points[at]
            if guess := expected_bracket(self._study, at, self._brackets.near(at)):
                point.replace_guess(guess)
            task = point.next_task()
            # A point without a task has none until it gets another answer.
            self._look_at(at, again=task is not None)
            if task is not None:
                return task
        return None

    def answer(self, task: SearchRun, answer: RunAnswer) -> None:
        """See `TaskQueue`.

        Parameters
        ----------
        task : SearchRun
            A task that is handed out.
        answer : RunAnswer
            Of its run.
        """
        self._points[task.at].answer(task, answer)
        self._look_at(task.at)

    def cancelled(self, task: SearchRun) -> None:
        """See `TaskQueue`.

        Parameters
        ----------
        task : SearchRun
            A task that is handed out.
        """
        self._points[task.at].cancelled(task)
        self._look_at(task.at)

    def unneeded_tasks(self) -> tuple[SearchRun, ...]:
        """See `TaskQueue`."""
        return tuple(task for tasks in self._unneeded.values() for task in tasks)

    @property
    def done(self) -> bool:
        """Whether no point needs a further answer."""
        return not self._open

    @property
    def known_answers(self) -> int:
        """See `TaskQueue`."""
        return sum(point.known_answers for point in self._points.values())

    @property
    def runs_left(self) -> float:
        """How many more answers are expected to be needed."""
        return sum(self._points[at].runs_left for at in self._open)

    def boundary(self) -> Boundary:
        """Return the boundary as far as it is known."""
        for at in self._points.keys() - self._documents.keys():
            self._documents[at] = self._points[at].boundary_point()
        return Boundary(
            study_key=self._study.key,
            study=self._study.model_dump(mode="json"),
            name=self._study.name,
            points=[self._documents[at] for at in self._points],
            updated=now(),
        )

    def _is_tried(self, at: Place, value: float) -> bool:
        try:
            return at in self._points and self._grid.index(value) in self._indices
        except ValueError:  # not on the grid
            return False

    def _look_at(self, at: Place, again: bool = True) -> None:
        """Take note of what has become of a point, and enter it in the queue again."""
        point = self._points[at]
        self._documents.pop(at, None)
        (self._open.discard if point.done else self._open.add)(at)
        if unneeded := point.unneeded_tasks():
            self._unneeded[at] = unneeded
        else:
            self._unneeded.pop(at, None)
        self._brackets.note(at, point.searched_bracket)
        self._entries[at] += 1
        if again and at in self._open:
            heappush(self._queue, (point.urgency, self._order[at], self._entries[at], at))
