"""Any number of independent scenes, each to be run once."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ensemble.config.run_key import run_key
from ensemble.search.task_queue import Task
from solver.analysis.outcome import latest_time
from solver.analysis.run import Outcome
from solver.scene import Scene

_AUTOMATIC_POINTS = 64  # that a scene usually comes to which leaves the number to the solver


class Batch:
    """The task queue of a batch: the longest run first, so that none is left alone at the end.

    Parameters
    ----------
    scenes : iterable of Scene
        Equal ones are run once.
    known : callable
        Outcome of the run with this key if it has been made before, else None.  Such a run is never a task.
    """

    def __init__(self, scenes: Iterable[Scene], known: Callable[[str], Outcome | None]) -> None:
        tasks = {key: Task(scene=scene, key=key) for scene in scenes for key in [run_key(scene)]}
        self._waiting = sorted(
            (task for task in tasks.values() if known(task.key) is None),
            key=lambda task: expected_work(task.scene),
        )
        self._running: set[str] = set()
        self.known_answers = len(tasks) - len(self._waiting)

    def next_task(self) -> Task | None:
        """See `TaskQueue`."""
        if not self._waiting:
            return None
        task = self._waiting.pop()
        self._running.add(task.key)
        return task

    def answer(self, task: Task, outcome: Outcome) -> None:
        """See `TaskQueue`.  Whatever the outcome is, a numerical failure too, the run has been made."""
        self._running.remove(task.key)

    def cancelled(self, task: Task) -> None:
        """See `TaskQueue`."""
        self._running.remove(task.key)
        self._waiting.append(task)

    def pointless_tasks(self) -> tuple[Task, ...]:
        """See `TaskQueue`.  Every run of a batch is wanted."""
        return ()

    @property
    def done(self) -> bool:
        """See `TaskQueue`."""
        return not self._waiting and not self._running

    @property
    def runs_left(self) -> int:
        """See `TaskQueue`."""
        return len(self._waiting) + len(self._running)


def expected_work(scene: Scene) -> float:
    """A number that grows with the time that a run will take; only comparisons mean anything.

    The time up to which it may go on, times the pairs of points.  Nothing says beforehand when a run will
    be decided.
    """
    points = _AUTOMATIC_POINTS if scene.numerics.points == "auto" else scene.numerics.points
    before = scene.start.horizon if scene.start.relaxed else 0.0
    return (before + latest_time(scene)) * (len(scene.vesicles) * points) ** 2
