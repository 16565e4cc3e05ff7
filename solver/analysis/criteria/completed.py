"""A scene of many vesicles has been followed to its horizon."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.analysis.criteria.criterion import Criterion, History
from solver.analysis.run import Outcome

if TYPE_CHECKING:
    from solver.scene import Scene


class Completed(Criterion):
    """The horizon has come: of three vesicles or more nobody asks whether they stay together."""

    @classmethod
    def applies_to(cls, scene: Scene) -> bool:
        """Return whether the scene has three vesicles or more.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        bool
        """
        return len(scene.vesicles) > 2

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
