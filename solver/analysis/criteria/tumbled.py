"""A single vesicle has tumbled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.analysis.criteria.criterion import Criterion, History
from solver.analysis.revolutions import may_tumble
from solver.analysis.run import Outcome

if TYPE_CHECKING:
    from solver.scene import Scene


class Tumbled(Criterion):
    """The long axis of a single vesicle has made ``revolutions`` full turns."""

    @classmethod
    def applies_to(cls, scene: Scene) -> bool:
        """Return whether the scene is a single vesicle that may tumble.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        bool
        """
        return may_tumble(scene)

    def decide(self, history: History) -> Outcome | None:
        """Return `Outcome.TUMBLING` once all half turns are made.

        Parameters
        ----------
        history : History

        Returns
        -------
        Outcome or None
        """
        assert history.long_axis
        half_turns = len(history.long_axis.half_turns) - 1
        return Outcome.TUMBLING if half_turns >= 2 * self._scene.criteria.revolutions else None
