"""The equations whose root is a steady state.

At a steady state tangent angles and centers rest.  That alone does not determine it: the motion keeps the
area and the closure of each curve and the two highest modes of its tangent angles, the points may be shifted
along the membranes, and where the flow is the same everywhere the vesicles may be moved or turned together.
So equations for what is kept are added, and each free motion is fixed.  There are more equations than
unknowns, but they do not contradict each other.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.membrane.geometry import Geometry
from solver.membrane.spectral import highest_modes
from solver.motion.equation import conserved_quantities

if TYPE_CHECKING:
    from solver.flows import ImposedFlow
    from solver.membrane.geometry import Membranes
    from solver.motion.dense import DenseEquation
    from solver.scene import Scene

Array = NDArray[np.float64]


class SteadyEquations:
    """Rest, and what determines one state at rest among those that differ by what is kept or free.

    Parameters
    ----------
    equation : DenseEquation
        Of all vesicles of the scene, or of those of which the others are images.
    scene : Scene

    Attributes
    ----------
    equation : DenseEquation
    """

    def __init__(self, equation: DenseEquation, scene: Scene) -> None:
        self.equation = equation
        computed = scene.vesicles[: self.membranes.count]  # the others are images
        self._reduced_areas = np.array([vesicle.reduced_area for vesicle in computed])
        self._translations = _free_translations(scene.flow, self.membranes)
        self._may_turn = scene.flow is None or scene.flow.rate == 0

    @property
    def membranes(self) -> Membranes:
        """What stays the same, of the vesicles that are computed."""
        return self.equation.membranes

    def residual(self, state: Array) -> Array:
        """Return by how much a state fails to satisfy the equations.

        Parameters
        ----------
        state : (n,)

        Returns
        -------
        (n + k,)
            Its rate of change without common translations, then what is kept; zeros for what is fixed.
        """
        kept = conserved_quantities(Geometry(self.membranes, state))
        kept[: self.membranes.count] -= self._reduced_areas
        fixed = len(self.determining_rows(state)) - len(kept)
        return np.concatenate([self._relative(self.equation.rate(state)), kept, np.zeros(fixed)])

    def linearization(self, state: Array) -> tuple[Array, Array]:
        """Return the derivatives of `residual` by the state, in two parts.

        Parameters
        ----------
        state : (n,)

        Returns
        -------
        motion : (n, n)
            Of the rate of change.
        determining : (k, n)
            See `determining_rows`.
        """
        motion = self._relative(self.equation.jacobian(state).matrix)
        return motion, self.determining_rows(state)

    def determining_rows(self, state: Array) -> Array:
        """Return the derivatives of what is kept, and the directions that are fixed.

        Parameters
        ----------
        state : (n,)

        Returns
        -------
        (k, n)
            Rows: reduced areas and mean tangents of the vesicles; highest modes; shifts of points;
            translations and the rotation of all vesicles, where these are free.
        """
        geometry = Geometry(self.membranes, state)
        return np.concatenate([_kept(geometry), _fixed(geometry), self._rigid(geometry)])

    def _relative(self, rates: Array) -> Array:
        """Take off, in a rate or in its derivatives (n, ...), the free motions of all centers together."""
        relative = rates.copy()
        for centers in self._center_slices():
            relative[centers] -= relative[centers].mean(axis=0)
        return relative

    def _center_slices(self) -> list[slice]:
        """Return where a state has the coordinates of the centers along each free translation."""
        count, points = self.membranes.count, self.membranes.points
        first = [count * points + axis * count for axis in self._translations]
        return [slice(start, start + count) for start in first]

    def _rigid(self, geometry: Geometry) -> Array:
        """Return the free motions of all vesicles together, (0 to 3, n)."""
        membranes = geometry.membranes
        rows = []
        for centers in self._center_slices():
            rows.append(np.zeros(membranes.state_size))
            rows[-1][centers] = 1 / membranes.count
        if self._may_turn:
            x, y = geometry.centers - geometry.curve_centers.mean(axis=1)[:, None]
            turned = membranes.pack(np.ones_like(geometry.tangent_angle), np.stack([-y, x], axis=1))
            rows.append(turned / membranes.points)
        return np.array(rows).reshape(-1, membranes.state_size)


def _free_translations(flow: ImposedFlow | None, membranes: Membranes) -> list[int]:
    """Return the axes along which all vesicles may be moved together, for the flow's gradient is the same."""
    if membranes.multiplicity > 1:
        return []  # a pair of images has its mean at the origin
    if flow is None:
        return [0, 1]
    somewhere = np.random.default_rng(0).uniform(-3, 3, (2, 16))
    gradient = flow.velocity_gradient(somewhere)
    moved = [flow.velocity_gradient(somewhere + step[:, None]) for step in np.eye(2)]
    return [axis for axis in range(2) if np.array_equal(gradient, moved[axis])]


def _kept(geometry: Geometry) -> Array:
    """Return the derivatives of `conserved_quantities` by the state, (3·M, n)."""
    membranes = geometry.membranes
    count, points = membranes.count, membranes.points
    rows = np.zeros((3, count, membranes.state_size))
    offsets = geometry.points - geometry.centers[:, :, None]
    by_area = 4 * np.pi / membranes.length**2 * membranes.spacing
    for vesicle in range(count):
        angles = slice(vesicle * points, (vesicle + 1) * points)
        tangents = geometry.tangents[:, vesicle]
        rows[0, vesicle, angles] = by_area[vesicle] * np.sum(tangents * offsets[:, vesicle], axis=0)
        rows[1, vesicle, angles] = -tangents[1] / points
        rows[2, vesicle, angles] = tangents[0] / points
    return rows.reshape(3 * count, -1)


def _fixed(geometry: Geometry) -> Array:
    """Return what is fixed of each vesicle: its highest modes and the shift of its points, (4·M, n)."""
    membranes = geometry.membranes
    count, points = membranes.count, membranes.points
    rows = np.zeros((4, count, membranes.state_size))
    for vesicle in range(count):
        angles = slice(vesicle * points, (vesicle + 1) * points)
        rows[:3, vesicle, angles] = highest_modes(points).T
        rows[3, vesicle, angles] = geometry.curvature[vesicle] / points
    return rows.reshape(4 * count, -1)


def with_all_vesicles(membranes: Membranes, state: Array) -> Array:
    """Return the state of all vesicles from that of those which are not images.

    Parameters
    ----------
    membranes : Membranes
        Of the vesicles that are not images.
    state : (n,)

    Returns
    -------
    (multiplicity·n,)
    """
    every = replace(
        membranes,
        length=np.tile(membranes.length, membranes.multiplicity),
        bending_modulus=np.tile(membranes.bending_modulus, membranes.multiplicity),
        circular=np.tile(membranes.circular, membranes.multiplicity),
        multiplicity=1,
    )
    return every.pack(membranes.curve_tangent_angle(state), membranes.curve_center(state))
