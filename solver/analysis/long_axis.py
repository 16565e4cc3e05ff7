"""The long axis of a single vesicle, which may tumble."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.revolutions import RevolutionTracker
from solver.membrane.inclination import inclination_by_angle

if TYPE_CHECKING:
    from solver.scene import Scene

Array = NDArray[np.float64]


class LongAxisTracker(RevolutionTracker):
    """Follows the long principal axis of a single vesicle, a line without a direction."""

    direction_period = np.pi

    def _direction(self, state: Array) -> float:
        return float(inclination_by_angle(self.membranes.tangent_angle(state))[0])


def may_tumble(scene: Scene) -> bool:
    """Return whether a scene is a single vesicle with a long axis, in a flow that rotates it.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    bool
    """
    flow = scene.imposed_flow
    rotates = flow is not None and flow.rotates
    return len(scene.vesicles) == 1 and rotates and scene.vesicles[0].reduced_area < 1
