"""A pair revolves and stays together."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.analysis.criteria.criterion import Criterion, History
from solver.analysis.run import Outcome

if TYPE_CHECKING:
    from solver.scene import Scene


class Revolved(Criterion):
    """The line of centers has made ``revolutions`` full turns, and the gap no longer grows.

    A pair slides open once in every half turn.  The gap's maximum in the last half turn must not exceed that
    in the one before by more than the fraction ``gap_growth``.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self._compared = 0  # half turns after which the gap has been looked at

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
        """Return `Outcome.BOUND` at the first half turn after which the gap has not grown.

        Parameters
        ----------
        history : History

        Returns
        -------
        Outcome or None
        """
        assert history.line_of_centers
        half_turns = history.line_of_centers.half_turns
        completed = len(half_turns) - 1
        if completed < 2 * self._scene.criteria.revolutions or completed == self._compared:
            return None
        self._compared = completed
        earlier, previous, last = half_turns[-3:]
        time, gap = np.array(history.samples["time"]), np.array(history.samples["gap"])
        before = gap[(time >= earlier) & (time <= previous)].max(initial=0.0)
        after = gap[(time >= previous) & (time <= last)].max(initial=0.0)
        return Outcome.BOUND if after <= (1 + self._scene.criteria.gap_growth) * before else None
