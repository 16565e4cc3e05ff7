"""The energy of free vesicles, and of a doublet against theirs."""

from __future__ import annotations

import numpy as np
import pytest

from solver import Outcome, Scene, simulate
from solver.analysis.free_energy import energy_of, free_bending_energy
from solver.scene import PowerLaw, Vesicle

# ∫curvature² ds of a free vesicle of length 2π, from the Euler–Lagrange equation solved as one of ordinary
# differential equations, to 1e-6.
INDEPENDENT = {0.95: 7.239195, 0.85: 9.237801, 0.75: 11.365472, 0.65: 13.641882}


@pytest.mark.parametrize("reduced_area", INDEPENDENT)
def test_it_is_that_of_the_free_shape(reduced_area: float) -> None:
    energy = free_bending_energy([Vesicle(reduced_area=reduced_area)])
    assert 2 * energy == pytest.approx(INDEPENDENT[reduced_area], abs=1e-6)


def test_it_scales_and_adds_up_and_a_circle_has_the_least() -> None:
    one = Vesicle(reduced_area=0.8)
    other = Vesicle(reduced_area=0.8, length=3.0, bending_modulus=2.5)
    together = free_bending_energy([one, other])
    assert together == pytest.approx((1 + 2.5 * 2 * np.pi / 3) * free_bending_energy([one]), rel=1e-14)
    assert free_bending_energy([Vesicle(reduced_area=1.0)]) == np.pi
    near = free_bending_energy([Vesicle(reduced_area=1 - 1e-9)])
    assert np.pi < near < np.pi * (1 + 1e-7)


def test_a_vesicle_alone_comes_to_it() -> None:
    """A second."""
    run = simulate(Scene(horizon=500.0, vesicles=(Vesicle(reduced_area=0.7),)))
    assert run.outcome is Outcome.EQUILIBRIUM
    assert run.energy.binding is None
    assert run.energy.bending == pytest.approx(free_bending_energy(run.scene.vesicles), rel=1e-5)


def test_a_doublet_is_bound_by_the_difference() -> None:
    scene = Scene(
        horizon=1.0,
        vesicles=(Vesicle(center=(-1.2, 0.0)), Vesicle(center=(1.2, 0.0))),
        adhesion=PowerLaw(hamaker=1.0, distance=0.4),
    )
    sample = {"bending_energy": 9.0, "adhesion_energy": -2.0}
    energy = energy_of(scene, Outcome.EQUILIBRIUM, sample)
    assert energy.binding == 7.0 - free_bending_energy(scene.vesicles)
    assert energy_of(scene, Outcome.UNDECIDED, sample).binding is None
