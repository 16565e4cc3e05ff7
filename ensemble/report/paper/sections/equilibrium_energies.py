"""Energies of doublets at equilibrium, and the parameter at which their sum is smallest."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar

from ensemble.report.paper.case import Case
from ensemble.report.paper.results import Results


class DoubletEnergy(NamedTuple):
    """Energies of a doublet at one value of the parameter that is varied.

    Attributes
    ----------
    parameter : float
        The reduced area or the Hamaker constant.
    bending : float
        Of both vesicles together: ∫κ² ds of one of them if its bending modulus is 1.
    adhesion : float
        The adhesion energy.
    """

    parameter: float
    bending: float
    adhesion: float

    @property
    def total(self) -> float:
        """Sum of both energies."""
        return self.bending + self.adhesion


def doublet_energies(results: Results, cases: Mapping[float, Case]) -> list[DoubletEnergy]:
    """Return the energies of all runs that did not fail.

    Parameters
    ----------
    results : Results
    cases : mapping of float to Case
        Runs by the value of the parameter.

    Returns
    -------
    list of DoubletEnergy
        By ascending parameter.
    """
    energies = []
    for parameter, case in sorted(cases.items()):
        energy = results.summary(case).energy
        if not results.failed(case) and energy.adhesion is not None:
            energies.append(DoubletEnergy(parameter, energy.bending, energy.adhesion))
    return energies


def least_energy_parameter(energies: Sequence[DoubletEnergy]) -> float | None:
    """Return the parameter at which the total energy is smallest, on a cubic spline.

    Parameters
    ----------
    energies : sequence of DoubletEnergy
        By ascending parameter.

    Returns
    -------
    float or None
        None if the energy is smallest at an end of the range.
    """
    parameters = [energy.parameter for energy in energies]
    first, last = parameters[0], parameters[-1]
    total = CubicSpline(parameters, [energy.total for energy in energies])
    minimum = minimize_scalar(total, bounds=(first, last), method="bounded", options={"xatol": 1e-6})
    inside = first + 1e-3 < minimum.x < last - 1e-3
    return float(minimum.x) if inside else None
