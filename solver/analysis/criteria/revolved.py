"""A pair revolves and stays together."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.analysis.criteria.criterion import Criterion, History
from solver.analysis.run import Outcome
from solver.analysis.settling import convergence

if TYPE_CHECKING:
    from solver.scene import Scene


class Revolved(Criterion):
    """The line of centers has made ``revolutions`` full turns, and its motion has settled.

    A pair slides open once in every half turn.  Durations of half turns and largest distances of the centers
    in them must repeat themselves within ``settled_change``, and go on to do so (`has_settled`).  One turn is
    no proof: a motion may approach an unstable one for a while before it leaves it.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self._seen = 0  # half turns that have been looked at

    @classmethod
    def applies_to(cls, scene: Scene) -> bool:
        """Return whether the scene is a pair in a flow that rotates it.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        bool
        """
        flow = scene.imposed_flow
        return len(scene.vesicles) == 2 and flow is not None and flow.rotates

    def decide(self, history: History) -> Outcome | None:
        """Return `Outcome.BOUND` at the first half turn after which the motion has settled.

        Parameters
        ----------
        history : History

        Returns
        -------
        Outcome or None
        """
        line, criteria = history.line_of_centers, self._scene.criteria
        assert line
        if history.time <= self._scene.constant_from or line.half_turns == self._seen:
            return None
        self._seen = line.half_turns
        bound = self._seen >= 2 * criteria.revolutions and line.has_settled(criteria.settled_change)
        return Outcome.BOUND if bound else None

    def lacking(self, history: History) -> str | None:
        """Return how far the pair has turned, or how much its half turns still change.

        Parameters
        ----------
        history : History

        Returns
        -------
        str or None
        """
        line, criteria = history.line_of_centers, self._scene.criteria
        assert line
        found = convergence(line.cycle)
        if line.half_turns < 2 * criteria.revolutions or not found:
            turns = "1 full turn" if line.half_turns == 2 else f"{line.half_turns / 2:g} full turns"
            return f"the pair has made {turns} since it first stood across the flow"
        change = min(each.change for each in found)
        return (
            f"the motion has not settled: after {line.half_turns / 2:g} full turns it still changes by "
            f"{100 * change:.2g} %, and criteria.settled_change is {100 * criteria.settled_change:g} %"
        )
