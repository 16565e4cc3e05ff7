"""How many points each membrane has.

With ``points = "auto"`` a run begins with the fewest points on `LADDER` that resolve its start, and climbs
the ladder when a step ends in a state that they do not resolve.  A state is resolved if its estimated error
in space (`solver.analysis.spatial_error`) is within the tolerance and its membranes are far enough apart for
the sum over adhesion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from solver.analysis.spatial_error import shape_tails, spatial_error
from solver.forces.adhesion import Everywhere
from solver.membrane.geometry import Geometry, Membranes
from solver.membrane.restoring import shape_rates
from solver.membrane.symmetry import independent_vesicles
from solver.motion.equation import accuracy_of
from solver.potentials.neighbors import Neighbors
from solver.potentials.proximity import Closeness, waist_error
from solver.potentials.refinement import MAXIMUM_FACTOR
from solver.simulation.initial_state import placed_state

if TYPE_CHECKING:
    from solver.scene import Scene

Array = NDArray[np.float64]

LADDER = (32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024)


class UnresolvedError(ArithmeticError):
    """No number of points on the ladder resolves a state; the message says why."""


class Resolution(Protocol):
    """Chooses the number of points.

    Attributes
    ----------
    points : int
        On each vesicle at the start.
    """

    points: int

    def finer(self, membranes: Membranes, time: float, state: Array) -> int | None:
        """Return the number of points with which a step is taken again.

        Parameters
        ----------
        membranes : Membranes
        time : float
            At the end of the step.
        state : (state_size,)
            At that time.

        Returns
        -------
        int or None
            None if the present number resolves the state.

        Raises
        ------
        UnresolvedError
            If no number does.
        """


def resolution_of(scene: Scene) -> Resolution:
    """Return the resolution that a scene asks for.

    Parameters
    ----------
    scene : Scene

    Returns
    -------
    Resolution
    """
    points = scene.numerics.points
    return AdaptiveResolution(scene) if points == "auto" else FixedResolution(points)


def with_points(scene: Scene, points: int) -> Scene:
    """Return a scene with another number of points.

    Parameters
    ----------
    scene : Scene
    points : int
        On each vesicle.

    Returns
    -------
    Scene
    """
    return scene.model_copy(update={"numerics": scene.numerics.model_copy(update={"points": points})})


class FixedResolution:
    """The same number of points whatever happens.

    Parameters
    ----------
    points : int
        On each vesicle.
    """

    def __init__(self, points: int) -> None:
        self.points = points

    def finer(self, membranes: Membranes, time: float, state: Array) -> None:
        """Return None, always.

        Parameters
        ----------
        membranes : Membranes
        time : float
        state : (state_size,)
        """


class AdaptiveResolution:
    """As many points as the tolerance needs.

    Parameters
    ----------
    scene : Scene

    Attributes
    ----------
    points : int
        On each vesicle at the start.
    """

    def __init__(self, scene: Scene) -> None:
        numerics = scene.numerics
        self._tolerance = numerics.tolerance
        self._rate = shape_rates(independent_vesicles(scene), scene)
        adhesion = scene.adhesion if len(scene.vesicles) > 1 else None
        self._least_distance = 0.0  # between membranes, over the spacing
        self._closest = np.inf  # distance to which adhesion draws the membranes
        if adhesion:
            everywhere = Everywhere(adhesion.singularity, accuracy_of(numerics))
            self._least_distance = everywhere.reach / MAXIMUM_FACTOR
            self._closest = adhesion.distance
        self.points = self._first(scene)

    def finer(self, membranes: Membranes, time: float, state: Array) -> int | None:
        """Return the next number of points on the ladder if the present one does not resolve a state.

        Parameters
        ----------
        membranes : Membranes
        time : float
        state : (state_size,)

        Returns
        -------
        int or None

        Raises
        ------
        UnresolvedError
            If the membranes are too close for the largest number.
        """
        geometry = Geometry(membranes, state)
        apart = self._apart(geometry)
        if apart and self._smooth(geometry, time, state):
            return None
        higher = next((points for points in LADDER if points > membranes.points), None)
        if higher is None and not apart:
            raise UnresolvedError(
                f"the membranes are closer at time {time:g} than {membranes.points} points on each resolve"
            )
        return higher

    def _first(self, scene: Scene) -> int:
        for points in LADDER:
            placed = with_points(scene, points)
            membranes, state = Membranes.of_scene(placed), placed_state(placed)
            geometry = Geometry(membranes, state)
            resolves_contact = self._closest >= self._least_distance * membranes.spacing.max()
            if resolves_contact and self._apart(geometry) and self._smooth(geometry, 0.0, state):
                return points
        return LADDER[-1]

    def _smooth(self, geometry: Geometry, time: float, state: Array) -> bool:
        error = spatial_error(shape_tails(geometry.membranes, state), self._rate * time)
        error += waist_error(geometry)
        return bool(np.all(error <= self._tolerance))

    def _apart(self, geometry: Geometry) -> bool:
        if self._least_distance == 0:
            return True
        if geometry.membranes.multiplicity > 1:
            return Closeness(geometry).nearest >= self._least_distance
        return Neighbors(geometry, self._least_distance).nearest >= self._least_distance
