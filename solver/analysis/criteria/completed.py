"""A scene has been followed to its horizon, and that was all."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.analysis.criteria.criterion import Criterion, History
from solver.analysis.run import Outcome

if TYPE_CHECKING:
    from solver.scene import Scene


class Completed(Criterion):
    """The horizon has come, and no motion can settle before.

    Of three vesicles or more nobody asks whether they stay together.  In a flow whose rate changes up to the
    horizon nothing comes to rest or repeats itself.
    """

    @classmethod
    def applies_to(cls, scene: Scene) -> bool:
        """Return whether the scene has three vesicles or more, or a rate that changes up to the horizon.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        bool
        """
        return len(scene.vesicles) > 2 or scene.constant_from >= scene.horizon

    def decide(self, history: History) -> Outcome | None:
        """Return `Outcome.COMPLETED` at the horizon.

        Parameters
        ----------
        history : History

        Returns
        -------
        Outcome or None
        """
        return Outcome.COMPLETED if history.time >= self._scene.horizon else None
