"""Membranes through points: length, area and shape of curves that are known, however the points lie."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import ellipe

from solver.membrane import curve
from solver.membrane.traced_curve import traced_curve

Array = NDArray[np.float64]


def ellipse(count: int, uneven: float = 0.4) -> Array:
    """Points of an ellipse with semiaxes 2 and 1 about (3, -1), at uneven distances."""
    angle = 2 * np.pi * np.arange(count) / count
    angle = angle + uneven * np.sin(angle)
    return np.column_stack([3 + 2 * np.cos(angle), -1 + np.sin(angle)])


def dumbbell(neck: float) -> Array:
    """Points of a dumbbell whose walls are 2·neck apart in its middle; below 0 they have changed sides."""
    angle = 2 * np.pi * np.arange(64) / 64
    return np.column_stack([2 * np.cos(angle), np.sin(angle) * (1.3 * np.cos(angle) ** 2 + neck)])


LENGTH = 8 * ellipe(0.75)


@pytest.mark.parametrize("backwards", [False, True])
@pytest.mark.parametrize("repeated", [False, True])
def test_an_ellipse(backwards: bool, repeated: bool) -> None:
    points = ellipse(100)
    points = np.concatenate([points, points[:1]]) if repeated else points
    found = traced_curve(points[::-1] if backwards else points)
    assert found.length == pytest.approx(LENGTH, rel=1e-6)
    assert found.reduced_area == pytest.approx(8 * np.pi**2 / LENGTH**2, rel=1e-5)
    np.testing.assert_allclose(found.center, [3, -1], atol=1e-5)
    assert found.tangent_angle.size == 100
    assert found.distance < 1e-4
    x, y = curve.positions(found.tangent_angle, found.center, found.length)
    np.testing.assert_allclose(((x - 3) / 2) ** 2 + (y + 1) ** 2, 1, atol=1e-4)
    assert curve.closure(curve.tangents(found.tangent_angle)) < 1e-13


def test_more_points_are_nearer() -> None:
    errors = [abs(traced_curve(ellipse(count)).length - LENGTH) for count in (20, 40, 80)]
    assert np.all(np.log2(np.array(errors[:-1]) / errors[1:]) > 3)


def test_the_distance_says_what_is_smoothed_away() -> None:
    """Points off the curve by turns are a wave that is too short for them."""
    points = ellipse(64, uneven=0.0)
    points[::2] += 0.01 * (points[::2] - [3, -1])
    assert 0.002 < traced_curve(points).distance < 0.05


def test_walls_may_be_near_but_may_not_cross() -> None:
    assert traced_curve(dumbbell(0.02)).reduced_area > 0.2
    with pytest.raises(ValueError, match="the curve through the points crosses itself"):
        traced_curve(dumbbell(-0.02))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [1e-90, 1e90])
def test_a_curve_of_any_size_has_the_same_shape(size: float) -> None:
    np.testing.assert_allclose(
        traced_curve(size * ellipse(40)).tangent_angle, traced_curve(ellipse(40)).tangent_angle, atol=1e-9
    )


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("points", "message"),
    [
        (ellipse(7), "at least 8 different points are needed, got 7"),
        (np.zeros((20, 3)), r"two columns, x and y, got shape \(20, 3\)"),
        (np.full((20, 2), np.nan), "finite"),
        (1e200 * ellipse(20), r"within 1e\+100 of the origin"),
        (3e307 * ellipse(20), r"within 1e\+100 of the origin"),
        (1e-200 * ellipse(20), "over 1e-100 at least"),
        (ellipse(20)[[0, *range(20)]] + 1e-14 * np.eye(21, 2), "neighboring points must differ"),
        (np.repeat(ellipse(20), 2, axis=0), "neighboring points must differ"),
        (ellipse(20)[np.arange(20) * 7 % 20], "not in order along a simple closed curve"),
    ],
)
def test_bad_points_are_refused(points: Array, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        traced_curve(points)
