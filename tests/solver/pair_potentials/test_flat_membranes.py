"""The adhesion energy of flat membranes against closed forms, quadrature and the compiled sum over points."""

from __future__ import annotations

import math

import pytest
from scipy.integrate import quad
from scipy.optimize import minimize_scalar

from solver.scene import PairPotential, PowerLaw, Scene


def closed_form(m: int, n: int) -> tuple[float, float]:
    """Energy over Hδ and distance over δ, from ∫ (h² + s²)^(−m/2) ds = h^(1 − m) √π Γ((m − 1)/2)/Γ(m/2)."""

    def line(power: int) -> float:
        return math.sqrt(math.pi) * math.gamma((power - 1) / 2) / math.gamma(power / 2)

    height = ((m - 1) * line(m) * n / (m * (n - 1) * line(n))) ** (1 / (m - n))
    return -(line(m) * height ** (1 - m) - m / n * line(n) * height ** (1 - n)), height


@pytest.mark.parametrize("exponents", [(4, 2), (12, 6), (8, 6), (3, 2), (9, 5), (60, 40)])
@pytest.mark.parametrize("distance", [0.1, 0.4])
def test_power_laws_have_their_closed_form(exponents: tuple[int, int], distance: float) -> None:
    flat = PowerLaw(hamaker=3.0, distance=distance, exponents=exponents).flat_membranes
    energy, height = closed_form(*exponents)
    assert flat.energy == pytest.approx(energy * distance, rel=1e-12)
    assert flat.distance == pytest.approx(height * distance, rel=1e-9)


def test_the_numbers_of_the_readme() -> None:
    expected = {(4, 2): (4.8368, 0.8660), (12, 6): (1.68623, 0.9471), (8, 6): (0.62666, 0.9354)}
    for exponents, (energy, height) in expected.items():
        flat = PowerLaw(hamaker=1.0, distance=1.0, exponents=exponents).flat_membranes
        assert flat.energy == pytest.approx(energy, abs=6e-5)
        assert flat.distance == pytest.approx(height, abs=6e-5)


@pytest.mark.parametrize("cutoff", [0.5, 1.0, 3.0])
def test_a_cutoff_is_integrated_up_to_where_it_ends(cutoff: float) -> None:
    potential: PairPotential = PowerLaw(hamaker=0.7, distance=0.4, cutoff=cutoff)

    def energy(height: float) -> float:
        end = math.sqrt(cutoff**2 - height**2)
        kink = math.sqrt(max(0.4**2 - height**2, 0.0))
        return (
            2
            * quad(lambda s: potential.evaluate(height**2 + s**2)[0], 0, end, points=[kink], epsabs=1e-13)[0]
        )

    least = minimize_scalar(energy, bounds=(0.2, 0.4), method="bounded", options={"xatol": 1e-9})
    flat = potential.flat_membranes
    assert flat.energy == pytest.approx(-least.fun, rel=1e-10)
    assert flat.distance == pytest.approx(least.x, rel=1e-5)


def test_an_energy_stands_for_the_hamaker_constant() -> None:
    energy = PowerLaw(hamaker=1.0, distance=0.4).flat_membranes.energy
    document = {"horizon": 1.0, "vesicles": [{"center": [-2, 0]}, {"center": [2, 0]}]}
    given = Scene.model_validate(document | {"adhesion": {"adhesion_energy": 0.7 * energy, "distance": 0.4}})
    assert given == Scene.model_validate(document | {"adhesion": {"hamaker": 0.7, "distance": 0.4}})
    assert Scene.model_validate_json(given.model_dump_json(), strict=True) == given


@pytest.mark.parametrize("strength", [{}, {"hamaker": 1.0, "adhesion_energy": 1.0}])
def test_a_potential_has_one_strength(strength: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="either hamaker or adhesion_energy"):
        PowerLaw.model_validate({"distance": 0.4} | strength)


@pytest.mark.parametrize("distance", [1e-300, 1e-160, 1e160, 1e300])
def test_a_distance_beyond_the_numbers_is_refused_by_its_name(distance: float) -> None:
    potential = PowerLaw(hamaker=1.0, distance=distance)
    with pytest.raises(ValueError, match=r"distance 1e.* is too small or too large"):
        _ = potential.flat_membranes
    with pytest.raises(ValueError, match=r"distance 1e.* is too small or too large"):
        PowerLaw.model_validate({"adhesion_energy": 1.0, "distance": distance})


@pytest.mark.parametrize(("energy", "distance"), [(1e300, 1e-20), (1e-320, 1e20)])
def test_an_energy_whose_hamaker_constant_is_no_number_is_refused(energy: float, distance: float) -> None:
    with pytest.raises(ValueError, match=r"adhesion_energy .* is too small or too large"):
        PowerLaw.model_validate({"adhesion_energy": energy, "distance": distance})
    assert PowerLaw.model_validate({"adhesion_energy": 0.0, "distance": distance}).hamaker == 0


@pytest.mark.parametrize("distance", [1e-100, 1e-14, 1e100])
def test_the_distance_at_rest_is_a_part_of_any_distance(distance: float) -> None:
    flat = PowerLaw(hamaker=1.0, distance=distance).flat_membranes
    assert flat.distance / distance == pytest.approx(0.75**0.5, rel=1e-9)
