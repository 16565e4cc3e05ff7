"""Shapes and arrangement have come to rest."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.criteria.criterion import Criterion, History
from solver.analysis.criteria.revolved import Revolved
from solver.analysis.run import Outcome
from solver.analysis.settling import state_rate
from solver.membrane import curve

if TYPE_CHECKING:
    from solver.membrane.geometry import Membranes
    from solver.scene import Scene

Array = NDArray[np.float64]

_COMPARED = 0.1  # States are compared that lie this part of the steady time apart, or one step.
_LATER = 1.2  # a slow motion is examined again when this multiple of the time has passed


class Steady(Criterion):
    """Shapes and arrangement have come to rest in a stable steady state.

    They have not changed faster than ``steady_rate`` for ``steady_time``.  What lies behind such a state is
    then examined once.  If it is a steady state that is unstable, the run goes on, with a perturbation where
    the state has a smaller one; if it is a slow motion, the run goes on too.

    The outcome is `EQUILIBRIUM` in a fluid at rest.  In a flow that strains, two vesicles are `BOUND` side by
    side, or `END_TO_END`.  Anything else is `STEADY`.

    Parameters
    ----------
    scene : Scene
    """

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene)
        self._leaves = False  # an unstable state, and has not moved yet
        self._again = 0.0  # when a slow motion is examined again
        self._earlier: tuple[float, Array]  # with which a state is compared
        self._moved: float  # when it last moved

    @classmethod
    def applies_to(cls, scene: Scene) -> bool:
        """Return whether the scene may come to rest: all but a pair that the flow always turns.

        Parameters
        ----------
        scene : Scene

        Returns
        -------
        bool
        """
        flow = scene.imposed_flow
        return (flow is not None and flow.strains) or not Revolved.applies_to(scene)

    def begin(self, history: History) -> None:
        """Compare what follows with this state, which may have been resampled or perturbed.

        Parameters
        ----------
        history : History
        """
        self._earlier, self._moved = (history.time, history.state), history.time

    def decide(self, history: History) -> Outcome | None:
        """Return the outcome once all is at rest.

        Parameters
        ----------
        history : History

        Returns
        -------
        Outcome or None
        """
        if history.time <= self._scene.constant_from:
            return None
        if not self._at_rest(history):
            self._leaves = False
            return None
        if self._leaves or history.time < self._again:
            return None
        if history.examine is not None:
            rest = history.examine()
            if not rest.steady:
                self._again = _LATER * history.time
                return None
            if not rest.stable:
                self._leaves = True
                self.departure = rest.departure
                return None
        return outcome_at_rest(self._scene, history.membranes, history.state)

    def _at_rest(self, history: History) -> bool:
        criteria, time, state = self._scene.criteria, history.time, history.state
        earlier, before = self._earlier
        duration = time - earlier
        # Over a short step the noise of the integrator would pass for motion.
        if duration >= _COMPARED * criteria.steady_time:
            if state_rate(history.membranes, state - before, duration) > criteria.steady_rate:
                self._moved = time
            self._earlier = time, state
        return time - self._moved >= criteria.steady_time


def outcome_at_rest(scene: Scene, membranes: Membranes, state: Array) -> Outcome:
    """Return the outcome of a run that has come to rest.

    Parameters
    ----------
    scene : Scene
    membranes : Membranes
        Of the vesicles that are computed.
    state : (n,)

    Returns
    -------
    Outcome
    """
    flow = scene.imposed_flow
    if flow is None:
        return Outcome.EQUILIBRIUM
    if not flow.strains or len(scene.vesicles) != 2:
        return Outcome.STEADY
    first, second = membranes.curve_center(state)
    line = np.arctan2(*(second - first)[::-1])
    points = curve.positions(membranes.tangent_angle(state), membranes.center(state), membranes.length)
    along = np.abs(np.cos(curve.inclination(points) - line)).mean()
    return Outcome.END_TO_END if along > np.cos(np.pi / 4) else Outcome.BOUND
