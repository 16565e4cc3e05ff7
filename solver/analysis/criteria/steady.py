"""Shapes and arrangement have come to rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from solver.analysis.criteria.criterion import Criterion, History
from solver.analysis.criteria.revolved import Revolved
from solver.analysis.run import Outcome
from solver.membrane import curve

if TYPE_CHECKING:
    from solver.scene import Scene


class Steady(Criterion):
    """Shapes and arrangement have not changed faster than ``steady_rate`` for ``steady_time``.

    The outcome is `EQUILIBRIUM` in a fluid at rest.  In a flow that strains, two vesicles are `BOUND` side by
    side, or `END_TO_END`.  Anything else is `STEADY`.
    """

    @classmethod
    def applies_to(cls, scene: Scene) -> bool:
        """Return whether the scene may come to rest: all but a pair that revolves.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        bool
        """
        return not Revolved.applies_to(scene)

    def decide(self, history: History) -> Outcome | None:
        """Return the outcome once all is at rest.

        Parameters
        ----------
        history : History

        Returns
        -------
        Outcome or None
        """
        if not self._at_rest(history):
            return None
        flow = self._scene.flow
        if flow is None:
            return Outcome.EQUILIBRIUM
        return _arrangement(history) if flow.strains and history.line_of_centers else Outcome.STEADY

    def _at_rest(self, history: History) -> bool:
        criteria = self._scene.criteria
        time, rate = history.samples["time"], history.samples["state_rate"]
        since = time[-1] - criteria.steady_time
        if time[0] > since:
            return False
        for instant, value in zip(reversed(time), reversed(rate), strict=True):
            if value > criteria.steady_rate:
                return False
            if instant <= since:
                break
        return True


def _arrangement(history: History) -> Outcome:
    """Return how a pair lies: side by side, or end to end with long axes along the line of centers."""
    membranes = history.membranes
    assert history.line_of_centers
    points = curve.positions(
        membranes.tangent_angle(history.state), membranes.center(history.state), membranes.length
    )
    along = np.abs(np.cos(curve.inclination(points) - history.line_of_centers.angle)).mean()
    return Outcome.END_TO_END if along > np.cos(np.pi / 4) else Outcome.BOUND
