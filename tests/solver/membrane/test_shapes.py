"""Starting ellipses have exactly the reduced area and length asked for, and equispaced points."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.membrane.curve import area, positions, tangents
from solver.membrane.shapes import ellipse_tangent_angle, of_reduced_area
from solver.scene.ellipses import semi_axes
from tests.solver.references import Ellipse

Array = NDArray[np.float64]

REDUCED_AREAS = [0.2, 0.5, 0.65, 0.9, 0.9044, 0.985, 1 - 1e-9, 1.0]
LENGTHS = [2 * np.pi, 0.7, 25.0]


def perimeter(major: float, minor: float) -> float:
    """By the trapezoid rule, which converges geometrically for a periodic function."""
    alpha = 2 * np.pi * np.arange(4096) / 4096
    return float(2 * np.pi * np.mean(np.hypot(major * np.sin(alpha), minor * np.cos(alpha))))


@pytest.mark.parametrize("length", LENGTHS)
@pytest.mark.parametrize("reduced_area", REDUCED_AREAS)
def test_semi_axes_are_exact(reduced_area: float, length: float) -> None:
    major, minor = semi_axes(reduced_area, length)
    assert major >= minor > 0
    assert perimeter(major, minor) == pytest.approx(length, rel=4e-15)
    assert 4 * np.pi * (np.pi * major * minor) / length**2 == pytest.approx(reduced_area, rel=4e-15)


@pytest.mark.parametrize("points", [16, 64])
@pytest.mark.parametrize("reduced_area", REDUCED_AREAS)
def test_points_are_equispaced_in_arclength(reduced_area: float, points: int) -> None:
    length = 5.0
    ellipse = Ellipse(*semi_axes(reduced_area, length))
    alpha = np.unwrap(ellipse.parameters(ellipse_tangent_angle(reduced_area, length, 0.0, points)))
    x, w = np.polynomial.legendre.leggauss(40)
    start, end = alpha, np.append(alpha[1:], alpha[0] + 2 * np.pi)
    nodes = (start + end)[:, None] / 2 + (end - start)[:, None] / 2 * x
    arcs = (end - start) / 2 * (ellipse.speed(nodes) @ w)
    np.testing.assert_allclose(arcs, length / points, rtol=1e-12)


@pytest.mark.parametrize("angle", [0.0, 0.7, np.pi / 2, -2.0])
def test_the_curve_is_the_ellipse_with_its_first_point_at_the_tip(angle: float) -> None:
    tangent_angle = ellipse_tangent_angle(0.8, 5.0, angle, 256)
    center = np.array([0.3, -1.2])
    ellipse = Ellipse(*semi_axes(0.8, 5.0), complex(*center), angle)
    points = positions(tangent_angle, center, 5.0)
    np.testing.assert_allclose(points, ellipse.points(ellipse.parameters(tangent_angle)), rtol=0, atol=1e-13)
    tip = center + ellipse.major * np.array([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(points[:, 0], tip, rtol=0, atol=1e-13)


def reduced_area_of(tangent_angle: Array) -> float:
    place = positions(tangent_angle, np.zeros(2), 2 * np.pi)
    return float(area(place, tangents(tangent_angle), 2 * np.pi)) / np.pi


@pytest.mark.parametrize(("reduced_area", "points"), [(0.3, 64), (0.45, 128), (0.9, 32), (0.999999, 64)])
def test_the_reduced_area_is_exact_where_the_tips_are_not_resolved(reduced_area: float, points: int) -> None:
    sampled = ellipse_tangent_angle(reduced_area, 2 * np.pi, 0.7, points)
    exact = of_reduced_area(sampled, reduced_area)
    assert reduced_area_of(exact) == pytest.approx(reduced_area, abs=1e-14)
    miss = abs(reduced_area_of(sampled) - reduced_area)
    assert np.max(np.abs(exact - sampled)) < 3 * miss + 1e-12


def test_what_is_resolved_is_left_alone() -> None:
    for reduced_area in (1.0, 0.95, 0.8):
        sampled = ellipse_tangent_angle(reduced_area, 2 * np.pi, 0.7, 256)
        np.testing.assert_allclose(of_reduced_area(sampled, reduced_area), sampled, rtol=0, atol=2e-13)


def test_the_tangent_turns_once_counterclockwise() -> None:
    tangent_angle = ellipse_tangent_angle(0.6, 2 * np.pi, 1.0, 64)
    assert np.all(np.diff(tangent_angle) > 0)
    assert tangent_angle[0] + 2 * np.pi - tangent_angle[-1] > 0
