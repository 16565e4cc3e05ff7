"""The energy of vesicles together, against that of the same vesicles at rest, each alone in the fluid."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.run import Energy, Outcome
from solver.membrane import curve
from solver.membrane.shapes import ellipse_tangent_angle
from solver.membrane.spectral import equispaced_angles, integration

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from solver.scene import Scene, Vesicle

Array = NDArray[np.float64]

_POINTS = 128
_MODES = 24  # of the tangent angle: 16 give the same energy to 1e-14 down to a reduced area of 0.3
_ROUND_OFF = 1e-12  # of the reduced area of a circle


def energy_of(scene: Scene, outcome: Outcome, sample: Mapping[str, float]) -> Energy:
    """Return the energies of a state.

    Parameters
    ----------
    scene : Scene
    outcome : Outcome
        Of a run that ends there.
    sample : mapping of str to float
        The diagnostics of the state, by the name of their series.

    Returns
    -------
    Energy
    """
    bending, adhesion = sample["bending_energy"], sample.get("adhesion_energy")
    if adhesion is None or outcome is not Outcome.EQUILIBRIUM:
        return Energy(bending, adhesion)
    return Energy(bending, adhesion, bending + adhesion - free_bending_energy(scene.vesicles))


def free_bending_energy(vesicles: Sequence[Vesicle]) -> float:
    """Return the least bending energy ½κ∫curvature² ds of vesicles with their lengths and reduced areas.

    Parameters
    ----------
    vesicles : sequence of Vesicle

    Returns
    -------
    float
        Of all of them together.
    """
    return sum(
        vesicle.bending_modulus * 2 * np.pi / vesicle.length * _least_energy(vesicle.reduced_area)
        for vesicle in vesicles
    )


@lru_cache(maxsize=64)
def _least_energy(reduced_area: float) -> float:
    """Return the energy of a free vesicle of length 2π and bending modulus 1.

    Its shape has two axes of symmetry, so its tangent angle is α + Σ b_k sin 2kα.  It closes, whatever the
    b_k, and its energy ½∫θ_s² is a sum of squares.
    """
    from scipy.optimize import minimize  # for the reason that `solver.membrane.shapes` gives

    if 1 - reduced_area < _ROUND_OFF:
        return float(np.pi)
    alpha, wavenumbers = equispaced_angles(_POINTS), 2 * np.arange(1, _MODES + 1)
    modes = np.sin(np.outer(alpha, wavenumbers))
    weight = 2 * np.pi / _POINTS

    def area_error(amplitudes: Array) -> float:
        angle = alpha + modes @ amplitudes
        tangents = curve.tangents(angle)
        return float(curve.area(curve.positions(angle, np.zeros(2), 2 * np.pi), tangents, 2 * np.pi)) - area

    def area_slope(amplitudes: Array) -> Array:
        tangents = curve.tangents(alpha + modes @ amplitudes)
        return np.asarray(weight * np.sum(tangents * (tangents @ integration(_POINTS).T), axis=0) @ modes)

    area = np.pi * reduced_area
    ellipse = ellipse_tangent_angle(reduced_area, 2 * np.pi, 0.0, _POINTS) - np.pi / 2 - alpha
    found = minimize(
        lambda amplitudes: np.pi / 2 * np.sum((wavenumbers * amplitudes) ** 2),
        2 / _POINTS * (ellipse @ modes),
        jac=lambda amplitudes: np.pi * wavenumbers**2 * amplitudes,
        method="SLSQP",
        constraints={"type": "eq", "fun": area_error, "jac": area_slope},
        options={"ftol": 1e-14, "maxiter": 500},
    )
    return float(np.pi + found.fun)
