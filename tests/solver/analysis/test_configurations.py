"""Configurations of pairs: what is measured is exact, and tells apart what the literature names."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.polynomial.legendre import legval
from numpy.typing import NDArray

from solver import Run, simulate
from solver.analysis.configurations import CONFIGURATIONS, configuration_of, contact_shape
from solver.analysis.run import Arrangement, Configuration, Outcome
from solver.scene import Numerics, Output, PowerLaw, Scene, Vesicle
from tests.solver.scenes import shear_pair

Array = NDArray[np.float64]


def strips(bow: float, twist: float, turn: float = 0.0) -> Array:
    """Two thin closed curves along a line of length 2 with these coefficients, 0.2 apart."""
    angle = 2 * np.pi * np.arange(128) / 128
    place, thickness = np.cos(angle), 0.03
    line = 2 * legval(place, [0.0, 0.0, bow, twist])
    curves = [
        np.stack([place, line + side * (0.1 + thickness) + thickness * np.sin(angle)]) for side in (1, -1)
    ]
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    return rotation @ np.array(curves)


@pytest.mark.parametrize(("bow", "twist"), [(0.0, 0.0), (0.04, 0.0), (0.0, 0.03), (-0.03, 0.02)])
@pytest.mark.parametrize("turn", [0.0, 1.0])
def test_the_bend_of_a_contact_is_measured(bow: float, twist: float, turn: float) -> None:
    found = contact_shape(strips(bow, twist, turn), 0.3)
    assert found is not None
    assert np.abs(found) == pytest.approx(np.abs([bow, twist]), abs=3e-3)


def test_membranes_that_are_apart_have_no_contact() -> None:
    assert contact_shape(strips(0.0, 0.0), 0.1) is None


@pytest.mark.parametrize(
    ("measured", "name"),
    [
        ({"opening": 1.7, "own_turns": (0.0, 0.0)}, Configuration.SLIDING),
        ({"opening": 1.1, "own_turns": (0.0, 0.0)}, Configuration.ROLLING),
        ({"opening": 1.4, "own_turns": (1.0, 1.0)}, Configuration.TUMBLING),
        ({"opening": 1.4, "own_turns": (0.0, 1.0)}, None),
        ({"opening": 1.4}, None),
        ({"bow": 1e-4, "twist": -1e-3}, Configuration.FLAT),
        ({"bow": -0.2, "twist": 0.01}, Configuration.MALE_FEMALE),
        ({"bow": 0.0, "twist": -0.07}, Configuration.SIGMOID),
    ],
)
def test_what_is_measured_has_one_name(measured: dict[str, Any], name: Configuration | None) -> None:
    arrangement = Arrangement(**measured)
    assert configuration_of(arrangement) is name
    assert sum(holds(arrangement) for holds in CONFIGURATIONS.values()) == (name is not None)


def test_every_configuration_has_a_criterion() -> None:
    assert set(CONFIGURATIONS) == set(Configuration)
    assert configuration_of(None) is None


@pytest.fixture(scope="module")
def beside_the_resonance() -> list[Run]:
    """2 s: the period is greatest between these two strengths."""
    output = Output(interval=0.2, frame_interval=100.0)
    return [simulate(shear_pair(hamaker, output=output)) for hamaker in (2.0, 2.05)]


def test_own_turns_jump_at_the_resonance(beside_the_resonance: list[Run]) -> None:
    sliding, tumbling = beside_the_resonance
    assert [run.configuration for run in beside_the_resonance] == ["sliding", "tumbling"]
    assert sliding.arrangement is not None
    assert tumbling.arrangement is not None
    assert sliding.arrangement.own_turns == pytest.approx((0.0, 0.0), abs=1e-3)
    assert tumbling.arrangement.own_turns == pytest.approx((1.0, 1.0), abs=1e-3)


def test_the_opening_is_that_of_what_is_recorded(beside_the_resonance: list[Run]) -> None:
    for run in beside_the_resonance:
        assert run.period is not None
        assert run.arrangement is not None
        in_turn = run.series["time"] >= run.time - run.period
        distance = run.series["center_distance"][in_turn]
        assert run.arrangement.opening == pytest.approx(distance.max() / distance.min(), rel=5e-3)


def test_it_does_not_depend_on_what_is_recorded(beside_the_resonance: list[Run]) -> None:
    """A second."""
    again = simulate(shear_pair(2.05, output=Output(interval=5.0, frame_interval=100.0)))
    assert again.arrangement == beside_the_resonance[1].arrangement


def test_round_vesicles_roll() -> None:
    """A second."""
    scene = shear_pair(3.0)
    round_ones = tuple(vesicle.model_copy(update={"reduced_area": 0.99}) for vesicle in scene.vesicles)
    assert simulate(scene.model_copy(update={"vesicles": round_ones})).configuration == "rolling"


def test_what_does_not_stay_together_has_none() -> None:
    run = simulate(shear_pair(0.2))
    assert run.outcome is Outcome.SEPARATED
    assert run.configuration is None
    assert run.arrangement is None


def at_rest(hamaker: float, first: Vesicle, second: Vesicle, distance: float = 0.4, points: int = 64) -> Run:
    adhesion = PowerLaw(hamaker=hamaker, distance=distance)
    numerics = Numerics(points=points)
    return simulate(Scene(horizon=1e3, vesicles=(first, second), adhesion=adhesion, numerics=numerics))


def test_equal_vesicles_touch_flat_and_unequal_ones_like_male_and_female() -> None:
    """2 s."""
    soft = Vesicle(reduced_area=0.7, bending_modulus=0.3, center=(-1.0, 0.0))
    firm = Vesicle(reduced_area=0.98, length=4.0, center=(0.8, 0.0))
    flat = at_rest(1.0, Vesicle(center=(-1.2, 0.0)), Vesicle(center=(1.2, 0.0)))
    bowed = at_rest(2.0, soft, firm)
    assert (flat.outcome, flat.configuration) == ("equilibrium", "flat")
    assert (bowed.outcome, bowed.configuration) == ("equilibrium", "male-female")
    assert bowed.arrangement is not None
    assert bowed.arrangement.twist == pytest.approx(0.0, abs=1e-3)


def test_a_contact_buckles_under_strong_adhesion() -> None:
    """2 s: a flat one that is unstable is left for a sigmoid one."""
    left, right = (Vesicle(reduced_area=0.5, center=(x, 0.0)) for x in (-1.2, 1.2))
    weak, strong = (at_rest(hamaker, left, right, distance=0.3, points=96) for hamaker in (10.0, 15.0))
    assert (weak.configuration, weak.perturbations) == ("flat", ())
    assert strong.configuration == "sigmoid"
    assert strong.perturbations
