"""A single vesicle has tumbled."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.analysis.criteria.criterion import Criterion, History
from solver.analysis.long_axis import may_tumble
from solver.analysis.run import Outcome

if TYPE_CHECKING:
    from solver.scene import Scene


class Tumbled(Criterion):
    """The long axis of a single vesicle has made ``revolutions`` full turns.

    The run goes on until the durations of half turns repeat themselves within ``settled_change``, or to the
    horizon.
    """

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
        axis, criteria = history.long_axis, self._scene.criteria
        assert axis
        if history.time <= self._scene.constant_from or axis.half_turns < 2 * criteria.revolutions:
            return None
        last = history.time >= self._scene.horizon
        return Outcome.TUMBLING if last or axis.has_settled(criteria.settled_change) else None
