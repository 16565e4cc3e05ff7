"""Whether a steady state is stable: the eigenvalues of its small perturbations.

All vesicles are perturbed, each on its own.  So what breaks the symmetry of a pair is seen, though the pair
may be computed as a vesicle and its image.  Perturbations keep what the motion keeps; those that lead to the
same state elsewhere, a shift of points or a motion of all vesicles together, are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig, eigvals

from solver.membrane.spectral import equispaced_angles

if TYPE_CHECKING:
    from solver.membrane.geometry import Membranes
    from solver.steady_states.steady_equations import SteadyEquations

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

# A perturbation that grows more slowly than this, in the unit of rates, is taken for neutral.
NEUTRAL = 1e-6

# Shorter waves on a membrane decay at once, by bending: of more points only these modes are perturbed.
_HIGHEST_WAVENUMBER = 46

_RANK = 1e-10  # relative size below which a direction is taken for one that others span


@dataclass(frozen=True)
class Perturbations:
    """The small perturbations of a steady state that can grow or decay.

    Attributes
    ----------
    equations : SteadyEquations
        Of all vesicles.
    state : (n,)
        The steady state of all vesicles.
    basis : (n, m)
        Orthonormal; of the perturbations.
    growth : (m, m)
        Their derivative by time, in this basis.
    """

    equations: SteadyEquations
    state: Array
    basis: Array
    growth: Array

    @classmethod
    def of(cls, equations: SteadyEquations, state: Array) -> Perturbations:
        """Linearize the motion about a steady state.

        Parameters
        ----------
        equations : SteadyEquations
            Of all vesicles.
        state : (n,)
            Of all vesicles.

        Returns
        -------
        Perturbations
        """
        motion, determining = equations.linearization(state)
        basis = _perturbations(determining, equations.membranes)
        return cls(equations, state, basis, basis.T @ motion @ basis)

    @cached_property
    def eigenvalues(self) -> ComplexArray:
        """Growth rates, the one with the largest real part first, (m,)."""
        values = eigvals(self.growth)
        return np.asarray(values[_by_growth(values)])

    @cached_property
    def _modes(self) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        """Eigenvalues (m,), the fastest growing first, with left and right eigenvectors as columns."""
        values, left, right = eig(self.growth, left=True, right=True)
        order = _by_growth(values)
        return values[order], left[:, order], right[:, order]

    @property
    def fastest_growth(self) -> float:
        """The largest real part."""
        return float(self.eigenvalues[0].real)

    @property
    def stable(self) -> bool:
        """Whether no perturbation grows, but for what is `NEUTRAL`."""
        return self.fastest_growth <= NEUTRAL

    @property
    def unstable(self) -> int:
        """The number of perturbations that grow."""
        return int(np.sum(self.eigenvalues.real > NEUTRAL))

    def direction(self, index: int) -> Array:
        """Return the perturbation that belongs to an eigenvalue.

        Parameters
        ----------
        index : int

        Returns
        -------
        (n,)
            Its largest element is 1; of a complex one the real part.
        """
        vector = self._modes[2][:, index]
        vector = self.basis @ vector
        largest = vector[np.argmax(np.abs(vector) > np.abs(vector).max() * (1 - 1e-6))]
        return np.asarray((vector / largest).real)

    def component(self, difference: Array, index: int) -> float:
        """Return how much of a perturbation a difference of two states holds.

        Parameters
        ----------
        difference : (n,)
        index : int
            Of the eigenvalue to which the perturbation belongs.

        Returns
        -------
        float
            Multiple of `direction`, whatever other perturbations the difference holds.
        """
        adjoint = self._modes[1][:, index]
        scale = np.vdot(adjoint, self.basis.T @ self.direction(index))
        return float((np.vdot(adjoint, self.basis.T @ difference) / scale).real)

    def refined(self, index: int) -> complex:
        """Return an eigenvalue to more digits than the Jacobian has.

        The Jacobian drops how refined quadratures depend on the points.  The derivative of the rate along the
        eigenvector, by differences, drops nothing, and the error of the eigenvectors enters as its square.

        Parameters
        ----------
        index : int

        Returns
        -------
        complex
        """
        values, left, right = self._modes
        adjoint, vector = left[:, index], self.basis @ right[:, index]
        derivative = self._derivative(vector.real)
        if values[index].imag != 0:
            derivative = derivative + 1j * self._derivative(vector.imag)
        return complex(np.vdot(adjoint, self.basis.T @ derivative) / np.vdot(adjoint, right[:, index]))

    def _derivative(self, direction: Array) -> Array:
        """Return the derivative of the relative rate along a direction, by differences of order 4."""
        step = 1e-3 / np.abs(direction).max()

        def difference(size: float) -> Array:
            ahead, behind = (self.equations.residual(self.state + s * direction) for s in (size, -size))
            return np.asarray((ahead - behind)[: self.state.size] / (2 * size))

        return (4 * difference(step) - difference(2 * step)) / 3


def _by_growth(eigenvalues: ComplexArray) -> NDArray[np.int64]:
    """Return the order in which the fastest growing one is the first."""
    return np.lexsort((-eigenvalues.imag, -eigenvalues.real))


def _perturbations(determining: Array, membranes: Membranes) -> Array:
    """Return an orthonormal basis (n, m) of the perturbations that the rows (k, n) leave free."""
    count, points = membranes.count, membranes.points
    smooth = _smooth_modes(points)
    size = smooth.shape[1]
    modes = np.zeros((determining.shape[1], count * size + 2 * count))
    for vesicle in range(count):
        rows = slice(vesicle * points, (vesicle + 1) * points)
        modes[rows, vesicle * size : (vesicle + 1) * size] = smooth
    modes[count * points :, count * size :] = np.eye(2 * count)
    _, sizes, directions = np.linalg.svd(determining @ modes)
    rank = int(np.sum(sizes > _RANK * sizes[0]))
    return np.asarray(modes @ directions[rank:].T)


def _smooth_modes(points: int) -> Array:
    """Return an orthonormal basis of the modes that are perturbed, (points, k)."""
    angle = equispaced_angles(points)
    highest = min(points // 2 - 2, _HIGHEST_WAVENUMBER)
    waves = np.arange(1, highest + 1) * angle[:, None]
    constant = np.full((points, 1), 1 / np.sqrt(points))
    return np.concatenate(
        [constant, np.sqrt(2 / points) * np.cos(waves), np.sqrt(2 / points) * np.sin(waves)], 1
    )
