"""How many points a membrane needs, and how a state is carried to more of them.

With ``points = "auto"`` a run begins with the fewest points on `LADDER` that resolve its start, and climbs
the ladder when a state comes out that they do not resolve.  A state is resolved if its estimated error in
space (`spatial_error`) is within the tolerance and its membranes are far enough apart for adhesion's sum.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from solver.forces.adhesion import Adhesion
from solver.membrane.geometry import Geometry, Membranes
from solver.membrane.spectral import resampled, tail
from solver.membrane.symmetry import independent_vesicles
from solver.motion.equation import accuracy_of
from solver.potentials.neighbors import Neighbors
from solver.potentials.proximity import Closeness, waist_error
from solver.potentials.refinement import MAXIMUM_FACTOR
from solver.scene import Scene
from solver.simulation.initial_state import initial_ellipses

Array = NDArray[np.float64]

LADDER = (32, 48, 64, 96, 128, 192, 256, 384, 512, 768, 1024)

# Of `spatial_error`, measured: position errors of runs converged in time, against the tails of their spectra,
# lie at or below 250·tail³ where the start's tail is the largest and below 60·tail^1.5 where one persists.
_STARTING, _PERSISTING = 300.0, 100.0


class UnresolvedError(ArithmeticError):
    """No number of points on the ladder resolves a state; the message says why."""


class Resolution(Protocol):
    """Chooses the number of points."""

    points: int  # to begin with

    def finer(self, membranes: Membranes, time: float, state: Array) -> int | None:
        """The number of points to compute a state anew with; None if these do.

        Raises
        ------
        UnresolvedError
            If none does.
        """


def resolution_of(scene: Scene) -> Resolution:
    """The resolution that a scene asks for."""
    points = scene.numerics.points
    return AdaptiveResolution(scene) if points == "auto" else FixedResolution(points)


def with_points(scene: Scene, points: int) -> Scene:
    """The scene with this number of points."""
    return scene.model_copy(update={"numerics": scene.numerics.model_copy(update={"points": points})})


class FixedResolution:
    """The same number of points whatever happens."""

    def __init__(self, points: int) -> None:
        self.points = points

    def finer(self, membranes: Membranes, time: float, state: Array) -> None:
        """See `Resolution`."""


class AdaptiveResolution:
    """As many points as the tolerance needs."""

    def __init__(self, scene: Scene) -> None:
        numerics = scene.numerics
        self._tolerance = numerics.tolerance
        self._rate = _rates(scene)
        adhesion = scene.adhesion if len(scene.vesicles) > 1 else None
        self._least_distance = 0.0  # between membranes, over the spacing
        self._closest = np.inf  # where adhesion draws the membranes to
        if adhesion:
            self._least_distance = Adhesion(adhesion, accuracy_of(numerics)).ratio / MAXIMUM_FACTOR
            self._closest = adhesion.distance
        self.points = self._first(scene)

    def finer(self, membranes: Membranes, time: float, state: Array) -> int | None:
        """See `Resolution`."""
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
            membranes, state = Membranes.of_scene(placed), initial_ellipses(placed)
            geometry = Geometry(membranes, state)
            drawn_together = self._closest >= self._least_distance * membranes.spacing.max()
            if drawn_together and self._apart(geometry) and self._smooth(geometry, 0.0, state):
                return points
        return LADDER[-1]

    def _smooth(self, geometry: Geometry, time: float, state: Array) -> bool:
        error = spatial_error(shape_tails(geometry.membranes, state), self._rate * time)
        error += waist_error(geometry)
        return bool(np.all(error <= self._tolerance))

    def _apart(self, geometry: Geometry) -> bool:
        if self._least_distance == 0:
            return True
        if geometry.membranes.copies > 1:
            return Closeness(geometry).nearest >= self._least_distance
        return Neighbors(geometry, self._least_distance).nearest >= self._least_distance


def _rates(scene: Scene) -> Array:
    """How fast bending, adhesion and flow change the shapes of the vesicles that are computed, (M,)."""
    bending = np.array([v.bending_modulus * (2 * np.pi / v.length) ** 3 for v in independent_vesicles(scene)])
    adhesion = scene.adhesion.hamaker if scene.adhesion else 0.0
    flow = scene.flow.rate if scene.flow else 0.0
    return bending + adhesion + flow


def shape_tails(membranes: Membranes, state: Array) -> Array:
    """The `spectral.tail` of each vesicle's tangent angle, (M,)."""
    turned = 2 * np.pi * np.arange(membranes.points) / membranes.points
    return tail(membranes.tangent_angle(state) - turned)


def spatial_error(tails: Array, age: Array) -> Array:
    """Estimate the errors of positions that tails (M,) of spectra stand for.

    Bending smooths the tips of a slender ellipse within a moment, so that the error they leave is little more
    than that of their sampling.  A tail that forces renew does harm for as long as they act.

    Parameters
    ----------
    tails : (M,)
    age : (M,)
        Time since the start, in units of that in which forces change the shapes.
    """
    return np.asarray(_STARTING * tails**3 + _PERSISTING * tails**1.5 * np.minimum(age, 1.0))


def resampled_angle(tangent_angle: Array, points: int) -> Array:
    """Tangent angles (..., N) at ``points`` ≥ N points, (..., points): the same curves."""
    given = tangent_angle.shape[-1]
    if points == given:
        return tangent_angle
    coarse, fine = (2 * np.pi * np.arange(n) / n for n in (given, points))
    return resampled(tangent_angle - coarse, points) + fine


def carried(membranes: Membranes, state: Array, finer: Membranes) -> Array:
    """A state of membranes as a state of the same ones with more points."""
    angle = resampled_angle(membranes.tangent_angle(state), finer.points)
    return finer.pack(angle, membranes.center(state))
