"""What there is to run, and which run is made next.  Pure: no MPI, no files, no clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, TypeVar

from solver.analysis.run import Configuration, Outcome
from solver.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Task:
    """A run to make.

    Attributes
    ----------
    scene : Scene
    key : str
        Of the run.
    """

    scene: Scene
    key: str


SomeTask = TypeVar("SomeTask", bound=Task)


class RunAnswer(NamedTuple):
    """What a run has come to.

    Attributes
    ----------
    outcome : Outcome or Configuration
        The latter in a study that asks for it (`ensemble.search.study_search.counted`).
    sensitive : bool
        Whether the error of the run could have made it another one.
    configuration : Configuration or None
        Of a pair that has stayed together.
    """

    outcome: Outcome | Configuration
    sensitive: bool = False
    configuration: Configuration | None = None


class TaskQueue(Protocol[SomeTask]):
    """Hands out tasks to idle workers and takes the answers of their runs, in any order."""

    def next_task(self) -> SomeTask | None:
        """Return the most useful task for an idle worker; None if every useful one is handed out already."""

    def answer(self, task: SomeTask, answer: RunAnswer) -> None:
        """Take the answer of a task's run.

        Parameters
        ----------
        task : Task
            A task that is handed out.
        answer : RunAnswer
            Of its run.
        """

    def cancelled(self, task: SomeTask) -> None:
        """Take back a task whose run was cancelled.

        Parameters
        ----------
        task : Task
            A task that is handed out.
        """

    def unneeded_tasks(self) -> Sequence[SomeTask]:
        """Return the tasks that are handed out and whose outcome is no longer needed."""

    @property
    def done(self) -> bool:
        """Whether no further outcome is needed."""

    @property
    def known_answers(self) -> int:
        """How many outcomes come from runs made before."""

    @property
    def runs_left(self) -> float:
        """How many more runs are expected."""
