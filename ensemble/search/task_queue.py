"""What there is to run, and which run is made next.  Pure: no MPI, no files, no clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeVar

from solver.analysis.run import Outcome
from solver.scene import Scene


@dataclass(frozen=True, kw_only=True)
class Task:
    """A run to make: the scene and its key."""

    scene: Scene
    key: str


SomeTask = TypeVar("SomeTask", bound=Task)


class TaskQueue(Protocol[SomeTask]):
    """Hands out tasks to idle workers and takes the outcomes of their runs, in any order."""

    def next_task(self) -> SomeTask | None:
        """Return the most useful task for an idle worker; None if every useful run is out already."""

    def answer(self, task: SomeTask, outcome: Outcome) -> None:
        """Take the outcome of a task's run."""

    def cancelled(self, task: SomeTask) -> None:
        """Take back a task whose run was given up."""

    def pointless_tasks(self) -> Sequence[SomeTask]:
        """Return the tasks that are out and whose outcome no longer matters."""

    @property
    def done(self) -> bool:
        """Whether no further outcome is needed."""

    @property
    def known_answers(self) -> int:
        """How many outcomes are from runs made before."""

    @property
    def runs_left(self) -> float:
        """How many more runs are expected."""
