"""Arrangements become vesicles that lie where they should, apart, and the same for the same seed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.optimize import minimize

from solver.scene import Scene, Vesicle
from solver.scene.arrangement import Lattice, Random
from solver.scene.ellipses import Ellipses, clearances, distances, overlapping_pair, semi_axes


def boundary(vesicle: Vesicle, parameter: np.ndarray) -> np.ndarray:
    major, minor = semi_axes(vesicle.reduced_area, vesicle.length)
    local = major * np.cos(parameter) + 1j * minor * np.sin(parameter)
    return complex(*vesicle.center) + np.exp(1j * vesicle.angle) * local


def nearest(first: Vesicle, second: Vesicle) -> float:
    """Distance between two ellipses that are apart, by searching the parameters of both boundaries."""
    alpha = np.linspace(0, 2 * np.pi, 120, endpoint=False)
    apart = np.abs(boundary(first, alpha)[:, None] - boundary(second, alpha))
    begin = alpha[list(np.unravel_index(apart.argmin(), apart.shape))]

    def distance(at: np.ndarray) -> float:
        return float(np.abs(boundary(first, at[:1]) - boundary(second, at[1:]))[0])

    return float(minimize(distance, begin, method="Nelder-Mead", options={"xatol": 1e-9, "fatol": 1e-12}).fun)


def pairs(count: int, seed: int) -> list[tuple[Vesicle, Vesicle]]:
    random = np.random.default_rng(seed)
    found = []
    while len(found) < count:
        areas, lengths, angles = random.uniform((0.5, 4, 0), (1, 7, np.pi), (2, 3)).T
        first = Vesicle(reduced_area=areas[0], length=lengths[0], angle=angles[0])
        center = tuple(random.uniform(-4, 4, 2))
        second = Vesicle(reduced_area=areas[1], length=lengths[1], angle=angles[1], center=center)
        if math.hypot(*center) > (lengths[0] + lengths[1]) / math.pi / 2:
            found.append((first, second))
    return found


def test_the_distance_between_ellipses_is_that_of_their_nearest_points() -> None:
    found = [pair for pair in pairs(30, seed=3) if overlapping_pair(pair) is None]
    assert len(found) > 10
    first, second = (Ellipses.of(column) for column in zip(*found, strict=True))
    expected = [nearest(*pair) for pair in found]
    np.testing.assert_allclose(distances(first, second), expected, atol=1e-8)
    bounds = clearances(first, second)
    assert np.all(bounds <= distances(first, second) + 1e-12)
    np.testing.assert_allclose(bounds, expected, atol=1e-2)


@pytest.mark.parametrize("distance", [1e-9, 1e-4, 0.5])
@pytest.mark.parametrize("angle", [0.0, 1.1])
def test_aligned_ellipses_touch_where_their_tips_meet(distance: float, angle: float) -> None:
    major, _ = semi_axes(0.7, 2 * math.pi)
    for sign in (-1, 1):
        along = 2 * major + sign * distance
        center = (along * math.cos(angle), along * math.sin(angle))
        pair = Vesicle(reduced_area=0.7, angle=angle), Vesicle(reduced_area=0.7, angle=angle, center=center)
        assert (overlapping_pair(pair) is None) == (sign == 1)


def random_arrangements() -> list[Random]:
    varied = Random.model_validate(
        {
            "count": 40,
            "area_fraction": 0.3,
            "seed": 7,
            "minimum_distance": 0.1,
            "reduced_area": {"kind": "uniform", "low": 0.6, "high": 1.0},
            "length": {"kind": "normal", "mean": 5.0, "deviation": 0.5},
        }
    )
    dilute = Random(count=30, area_fraction=0.15, seed=2)
    dense = Random(count=30, area_fraction=0.6, minimum_distance=0.1)
    dense_aligned = Random(count=25, area_fraction=0.5, minimum_distance=0.1, angle=0.3)
    return [varied, dilute, dense, dense_aligned, Random(count=1, area_fraction=0.3)]


@pytest.mark.parametrize("arrangement", random_arrangements())
def test_random_vesicles_keep_their_distance_and_fill_their_square(arrangement: Random) -> None:
    vesicles = arrangement.vesicles()
    assert len(vesicles) == arrangement.count
    areas = [v.reduced_area * v.length**2 / (4 * math.pi) for v in vesicles]
    side = math.sqrt(sum(areas) / arrangement.area_fraction)
    alpha = np.linspace(0, 2 * np.pi, 200)
    for vesicle in vesicles:
        points = boundary(vesicle, alpha)
        assert max(np.abs(points.real).max(), np.abs(points.imag).max()) <= side / 2 + 1e-12
        assert arrangement.angle is None or vesicle.angle == pytest.approx(arrangement.angle)
    first, second = np.triu_indices(len(vesicles), 1)
    ellipses = Ellipses.of(vesicles)
    apart = distances(ellipses[first], ellipses[second])
    assert apart.min(initial=np.inf) >= arrangement.minimum_distance


def test_distributions_are_followed() -> None:
    arrangement = random_arrangements()[0]
    areas = np.array([vesicle.reduced_area for vesicle in arrangement.vesicles()])
    lengths = np.array([vesicle.length for vesicle in arrangement.vesicles()])
    assert 0.6 <= areas.min() < 0.65
    assert 0.95 < areas.max() <= 1.0
    assert 4.0 <= lengths.min() < lengths.max() <= 6.0
    assert lengths.mean() == pytest.approx(5.0, abs=0.2)
    assert 0.3 < lengths.std() < 0.6


def test_the_same_seed_gives_the_same_scene_and_another_one_another() -> None:
    first, again, other = (
        Scene(horizon=1.0, arrangement=Random(count=8, area_fraction=0.2, seed=seed)) for seed in (4, 4, 5)
    )
    assert first == again
    assert first.model_dump_json() == again.model_dump_json()
    assert first.vesicles != other.vesicles


def test_a_dense_arrangement_forgets_its_lattice() -> None:
    arrangement = Random(count=30, area_fraction=0.6, minimum_distance=0.1)
    angles = np.array([vesicle.angle for vesicle in arrangement.vesicles()])
    assert np.ptp(angles) > 0.3
    heights = np.array([vesicle.center[1] for vesicle in arrangement.vesicles()])
    assert len(np.unique(heights.round(6))) > 20


@pytest.mark.parametrize("staggered", [False, True])
def test_a_lattice_lies_about_its_vesicle(staggered: bool) -> None:
    vesicle = Vesicle(reduced_area=0.8, center=(1.0, -2.0), angle=0.2)
    lattice = Lattice(columns=3, rows=2, spacing=(3.0, 2.5), staggered=staggered, vesicle=vesicle)
    vesicles = lattice.vesicles()
    centers = np.array([v.center for v in vesicles])
    np.testing.assert_allclose(centers.mean(axis=0), (1.0, -2.0))
    np.testing.assert_allclose(np.diff(centers[:3, 0]), 3.0)
    np.testing.assert_allclose(centers[3:] - centers[:3], [(-1.5 if staggered else 0.0, 2.5)] * 3)
    assert {v.model_copy(update={"center": (0.0, 0.0)}) for v in vesicles} == {
        vesicle.model_copy(update={"center": (0.0, 0.0)})
    }


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"area_fraction": 0.95}, "area_fraction is too high"),
        ({"area_fraction": 0.5, "minimum_distance": 2.0}, "at a distance of 2"),
        ({"area_fraction": 1.0}, "less than 1"),
        ({"count": 0}, "count"),
        ({"count": 5000}, "count"),
        ({"reduced_area": 1.1}, "reduced_area"),
        ({"reduced_area": {"kind": "uniform", "low": 0.9, "high": 0.8}}, "low must not be more than high"),
        ({"reduced_area": {"kind": "normal", "mean": 0.9, "deviation": 0.1}}, "0.7 to 1.1"),
        ({"length": {"kind": "normal", "mean": 1.0, "deviation": 0.5}}, "length"),
        ({"length": {"kind": "lognormal", "mean": 1.0}}, "lognormal"),
        ({"minimum_distance": 0.0}, "minimum_distance"),
        ({"radius": 1.0}, "radius"),
    ],
)
def test_an_arrangement_that_cannot_be_is_refused(changes: dict, message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        Random.model_validate({"count": 10, "area_fraction": 0.2} | changes)


def test_a_lattice_of_too_many_is_refused() -> None:
    with pytest.raises(ValidationError, match="columns times rows"):
        Lattice(columns=100, rows=100, spacing=(3.0, 3.0))


def test_a_scene_that_has_been_checked_has_vesicles_only() -> None:
    document = {"horizon": 1.0, "arrangement": {"kind": "random", "count": 5, "area_fraction": 0.2}}
    scene = Scene.model_validate(document)
    assert scene.arrangement is None
    assert "arrangement" not in scene.model_dump()
    listed = Scene(horizon=1.0, vesicles=scene.vesicles)
    assert scene == listed
    assert Scene.model_validate_json(scene.model_dump_json(), strict=True) == scene
    with pytest.raises(ValidationError, match="not both"):
        Scene.model_validate(document | {"vesicles": [{}]})
    with pytest.raises(ValidationError, match="at least one vesicle"):
        Scene.model_validate({"horizon": 1.0})


def test_only_neighbors_are_compared(monkeypatch: pytest.MonkeyPatch) -> None:
    compared = []

    def count(first: Ellipses, second: Ellipses) -> np.ndarray:
        compared.append(len(first.center))
        return clearances(first, second)

    monkeypatch.setattr("solver.scene.ellipses.clearances", count)
    for side in (8, 16):
        assert overlapping_pair(Lattice(columns=side, rows=side, spacing=(2.0, 2.8)).vesicles()) is None
    assert compared[0] <= 4 * 64
    assert compared[1] <= 4 * 256
