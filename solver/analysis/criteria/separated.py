"""A pair has come apart."""

from __future__ import annotations

from typing import TYPE_CHECKING

from solver.analysis.criteria.criterion import Criterion, History
from solver.analysis.run import Outcome

if TYPE_CHECKING:
    from solver.scene import Scene


class Separated(Criterion):
    """The centers of a pair have passed ``separated_distance``, moving apart."""

    @classmethod
    def applies_to(cls, scene: Scene) -> bool:
        """Return whether the scene is a pair.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        bool
        """
        return len(scene.vesicles) == 2

    def decide(self, history: History) -> Outcome | None:
        """Return `Outcome.SEPARATED` once the line of centers has passed the distance.

        Parameters
        ----------
        history : History

        Returns
        -------
        Outcome or None
        """
        assert history.line_of_centers
        return Outcome.SEPARATED if history.line_of_centers.separated else None
