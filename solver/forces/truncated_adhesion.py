"""Adhesion whose attraction ends at a cutoff; see `truncated_potential`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from solver import scene
from solver.forces.adhesion import Adhesion, gathered
from solver.forces.adhesion_sums import add_stiffness
from solver.forces.truncated_power_law import TruncatedPotential, switch_error
from solver.membrane.geometry import Geometry, Membranes
from solver.membrane.spectral import interpolations
from solver.parallel import SERIAL, Parallel
from solver.potentials.proximity import Proximity
from solver.potentials.refinement import MAXIMUM_FACTOR, Refinement

Array = NDArray[np.float64]


class TruncatedAdhesion(Adhesion):
    """`Adhesion` with a cutoff, of a few vesicles or of many: only points within it are summed.

    Parameters
    ----------
    parameters : scene.Adhesion
        With a cutoff.
    accuracy : float
        As for `Adhesion`; sources are also refined for the switch, whose fifth derivative jumps.
    membranes : Membranes
    parallel : Parallel

    Attributes
    ----------
    reach : float
        Distance over spacing within which points are felt.
    """

    def __init__(
        self,
        parameters: scene.Adhesion,
        accuracy: float,
        membranes: Membranes,
        parallel: Parallel = SERIAL,
    ) -> None:
        super().__init__(parameters, accuracy, parallel)
        if parameters.cutoff is None:
            raise ValueError(
                "adhesion.cutoff: None — attraction that ends has a distance beyond which it does"
            )
        potential = TruncatedPotential(parameters.distance, *parameters.exponents, parameters.cutoff)
        self._potential = potential
        self._strength = self._hamaker
        spacing = float(membranes.spacing.max())
        self._least_factor = 1
        while self._least_factor < MAXIMUM_FACTOR and switch_error(potential, spacing) > accuracy:
            self._least_factor *= 2
            spacing /= 2
        self._switch_error = switch_error(potential, spacing)
        # Targets see a curve at most half a spacing nearer than it is said to be.
        self._limits = parameters.cutoff / membranes.curve_spacing + 0.5
        self.reach = max(self.ratio, float(self._limits.max()))

    def stiffness(self, geometry: Geometry, closeness: Proximity) -> Array:
        """Derivative of the density at each point by that point, (3, M, N): xx, xy and yy."""
        shares, sums = self._sums(geometry, closeness)
        stiffness = np.zeros((3, *geometry.points.shape[1:]))
        add_stiffness(*sums, self._strength, stiffness)
        return gathered(shares, stiffness)

    def sum_error(self, closeness: Proximity) -> float:
        """See `Adhesion`."""
        return max(super().sum_error(closeness), self._switch_error)

    def _refinement(self, closeness: Proximity) -> Refinement:
        found = closeness.refinement(self.ratio, self._limits)
        groups = found.groups.copy()
        groups[:, 2] = np.maximum(groups[:, 2], self._least_factor)
        points, largest = found.interpolations.shape[1], int(groups[:, 2].max(initial=1))
        return found._replace(groups=groups, interpolations=interpolations(points, largest))
