"""Any number of independent scenes, each to be run once."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from ensemble.config.run_key import run_key
from ensemble.search.task_queue import RunAnswer, Task
from solver.scene import Scene

_AUTOMATIC_POINTS = 64  # what a scene that leaves the number to the solver usually comes to


class Batch:
    """The task queue of a batch: the longest run comes first, so that the last ones end at about one time.

    Parameters
    ----------
    scenes : iterable of Scene
        Equal ones are run once.
    known : callable
        Returns the answer of the run with a key if it has been made before, else None.  A run that has been
        made before is never a task.
    """

    def __init__(self, scenes: Iterable[Scene], known: Callable[[str], RunAnswer | None]) -> None:
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

    def answer(self, task: Task, answer: RunAnswer) -> None:
        """Take note that a run has been made, whatever its outcome is: a numerical failure counts too.

        Parameters
        ----------
        task : Task
            A task that is handed out.
        answer : RunAnswer
            Of its run.
        """
        self._running.remove(task.key)

    def cancelled(self, task: Task) -> None:
        """See `TaskQueue`.

        Parameters
        ----------
        task : Task
            A task that is handed out.
        """
        self._running.remove(task.key)
        self._waiting.append(task)

    def unneeded_tasks(self) -> tuple[Task, ...]:
        """Return nothing: every run of a batch is needed."""
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
    """Return a number that grows with the time that a run is expected to take.

    It is the time up to which the run may go on, times the pairs of points.  When a run will be decided
    cannot be known beforehand, so only comparisons mean anything.

    Parameters
    ----------
    scene : Scene
        That is run.

    Returns
    -------
    float
    """
    points = _AUTOMATIC_POINTS if scene.numerics.points == "auto" else scene.numerics.points
    relaxation = scene.start.horizon if scene.start.relaxed else 0.0
    return (relaxation + scene.horizon) * (len(scene.vesicles) * points) ** 2
