"""Studies whose runs are made up, made by workers in any order."""

from __future__ import annotations

from collections.abc import Callable

from ensemble.search.point_search import SearchRun
from ensemble.search.study_planner import StudyPlanner
from ensemble.search.task_queue import RunAnswer


def trace(
    planner: StudyPlanner,
    physics: Callable[[SearchRun], RunAnswer],
    workers: int = 1,
    choose: Callable[[int], int] = lambda out: 0,
) -> list[SearchRun]:
    """Make all runs of a study, of the tasks that are out the one that `choose` picks."""
    out: list[SearchRun] = []
    made: list[SearchRun] = []
    while not planner.done:
        while len(out) < workers and (task := planner.next_task()) is not None:
            out.append(task)
        if not out:
            assert planner.done, "known answers were all that it needed"
            break
        made.append(out.pop(choose(len(out))))
        planner.answer(made[-1], physics(made[-1]))
        for unneeded in planner.unneeded_tasks():
            out.remove(unneeded)
            planner.cancelled(unneeded)
    assert not out
    assert planner.next_task() is None
    assert planner.runs_left == 0
    return made
