"""An outcome criterion that is added from outside decides runs."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from solver.analysis.criteria import CRITERIA, Criterion, History
from solver.analysis.run import Outcome
from solver.scene import Scene, Vesicle
from solver.simulation.simulate import simulate
from tests.solver.scenes import uneven_pair

CLOSE = 0.4


class Close(Criterion):
    """A pair has come close."""

    @classmethod
    def applies_to(cls, scene: Scene) -> bool:
        return len(scene.vesicles) == 2

    def decide(self, history: History) -> Outcome | None:
        return Outcome.BOUND if history.sample["gap"] < CLOSE else None


@pytest.fixture
def close() -> Iterator[None]:
    CRITERIA.append(Close)
    yield
    CRITERIA.remove(Close)


PAIR = uneven_pair(horizon=6.0)


@pytest.mark.usefixtures("close")
def test_it_ends_a_run_at_once() -> None:
    run = simulate(PAIR)
    assert run.outcome is Outcome.BOUND
    gap, time = run.series["gap"], run.series["time"]
    decided = time[gap < CLOSE]
    assert run.time < 6.0
    # It sees what has been recorded by the end of a step, and the end itself is recorded last.
    assert decided[0] <= run.time < decided[0] + 1.0


@pytest.mark.usefixtures("close")
def test_it_leaves_other_scenes_alone() -> None:
    run = simulate(Scene(vesicles=(Vesicle(),), horizon=1.0))
    assert run.outcome is Outcome.UNDECIDED


def test_without_it_the_run_goes_on() -> None:
    run = simulate(PAIR)
    assert run.outcome is Outcome.UNDECIDED
    assert run.series["gap"][-1] < CLOSE
