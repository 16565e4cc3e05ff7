"""What an outcome criterion is given, and what it does."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.memory import Remembering, Saved, plain

if TYPE_CHECKING:
    from solver.analysis.line_of_centers import LineOfCenters
    from solver.analysis.long_axis import LongAxisTracker
    from solver.analysis.run import Outcome
    from solver.membrane.geometry import Membranes
    from solver.scene import Scene
    from solver.steady_states.rest import Rest

Array = NDArray[np.float64]


@dataclass(frozen=True)
class History:
    """The run up to the end of its last step.

    Attributes
    ----------
    time : float
        End of the last step.
    state : (state_size,)
        At that time.
    membranes : Membranes
        Those of the state.
    sample : mapping from name to float
        The diagnostics that were recorded last, ``time`` among them; `solver.analysis.run.Series` names them.
        A criterion that reads them depends on how often a scene is recorded; none of this package does.
    line_of_centers : LineOfCenters or None
        Of two vesicles.
    long_axis : LongAxisTracker or None
        Of a single vesicle that may tumble.
    examine : callable or None
        Finds out what is behind a state that hardly changes; None for many vesicles, for which it would take
        too long.
    """

    time: float
    state: Array
    membranes: Membranes
    sample: Mapping[str, float]
    line_of_centers: LineOfCenters | None
    long_axis: LongAxisTracker | None
    examine: Callable[[], Rest] | None = None


class Criterion(Remembering, ABC):
    """Decides runs of the scenes that it applies to.

    All attributes but the scene are its memory, and plain values (`solver.memory`).

    Parameters
    ----------
    scene : Scene

    Attributes
    ----------
    departure : (n,) or None
        State with which the run goes on, where the criterion has found that it rests only because nothing
        disturbs it.  The time loop takes it once.
    """

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self.departure: Array | None = None

    def saved(self) -> Saved:
        """Return all attributes but the scene; see `Remembering`.

        Returns
        -------
        dict
        """
        return {name: plain(value, name) for name, value in vars(self).items() if name != "_scene"}

    def restore(self, saved: Saved) -> None:
        """Remember what another criterion of the kind did; see `Remembering`.

        Parameters
        ----------
        saved : dict
        """
        for name, value in saved.items():
            setattr(self, name, plain(value, name))

    @classmethod
    @abstractmethod
    def applies_to(cls, scene: Scene) -> bool:
        """Return whether the criterion can decide runs of a scene.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        bool
        """

    def begin(self, history: History) -> None:
        """Take note of a state with which steps begin: the start, or one that was resampled or perturbed.

        Parameters
        ----------
        history : History
            In that state.
        """

    @abstractmethod
    def decide(self, history: History) -> Outcome | None:
        """Return what the run has become, None while that is open.

        It is called after every step.

        Parameters
        ----------
        history : History

        Returns
        -------
        Outcome or None
        """

    def lacking(self, history: History) -> str | None:
        """Return what an undecided run lacks at its end for this criterion to decide it.

        Parameters
        ----------
        history : History

        Returns
        -------
        str or None
            In one line; None if there is nothing to say.
        """
        return None
