"""Geometry of curves given by tangent angle and center."""

from __future__ import annotations

import numpy as np
import pytest

from solver.membrane.curve import area, closure, inclination, positions, tangents
from solver.membrane.shapes import ellipse_tangent_angle
from solver.scene.ellipses import semi_axes

ALPHA = 2 * np.pi * np.arange(64) / 64


def test_a_circle() -> None:
    radius, center = 1.7, np.array([0.4, -2.0])
    points = positions(ALPHA + np.pi / 2, center, 2 * np.pi * radius)
    np.testing.assert_allclose(points[0], 0.4 + radius * np.cos(ALPHA), rtol=0, atol=1e-14)
    np.testing.assert_allclose(points[1], -2.0 + radius * np.sin(ALPHA), rtol=0, atol=1e-14)
    assert area(points, tangents(ALPHA + np.pi / 2), 2 * np.pi * radius) == pytest.approx(
        np.pi * radius**2, rel=1e-14
    )
    assert closure(tangents(ALPHA + np.pi / 2)) < 1e-15


@pytest.mark.parametrize("reduced_area", [0.6, 0.9])
def test_the_area_of_an_ellipse_does_not_depend_on_its_place(reduced_area: float) -> None:
    major, minor = semi_axes(reduced_area, 5.0)
    tangent_angle = ellipse_tangent_angle(reduced_area, 5.0, 0.3, 256)
    for center in (np.zeros(2), np.array([7.0, -3.0])):
        points = positions(tangent_angle, center, 5.0)
        assert area(points, tangents(tangent_angle), 5.0) == pytest.approx(np.pi * major * minor, rel=1e-12)


def test_several_curves_at_once_of_different_lengths() -> None:
    tangent_angle = np.stack([ALPHA, ellipse_tangent_angle(0.8, 3.0, 0.1, 64)])
    center, length = np.array([[0.0, 1.0], [2.0, 3.0]]), np.array([2 * np.pi, 3.0])
    together = positions(tangent_angle, center, length)
    assert together.shape == (2, 2, 64)
    for k in range(2):
        alone = positions(tangent_angle[k], center[k], length[k])
        np.testing.assert_allclose(together[k], alone, rtol=0, atol=1e-15)
        np.testing.assert_allclose(together[k].mean(axis=-1), center[k], rtol=0, atol=1e-14)
    np.testing.assert_allclose(area(together, tangents(tangent_angle), length)[0], np.pi, rtol=1e-14)


def test_closure_is_the_missing_part_relative_to_the_length() -> None:
    """An arc that turns by less than 2π: its tangents have the mean of the chord over the arc."""
    assert closure(tangents(np.zeros(16))) == pytest.approx(1.0)
    fine = np.linspace(0, np.pi, 200_001)
    midpoints = (fine[1:] + fine[:-1]) / 2
    assert closure(tangents(midpoints)) == pytest.approx(2 / np.pi, rel=1e-9)  # half circle: 2R over πR


@pytest.mark.parametrize(
    ("angle", "expected"), [(0.0, 0.0), (0.5, 0.5), (-1.2, -1.2), (2.0, 2.0 - np.pi), (4.0, 4.0 - np.pi)]
)
def test_inclination_is_the_long_axis(angle: float, expected: float) -> None:
    points = positions(ellipse_tangent_angle(0.8, 2 * np.pi, angle, 64), np.array([5.0, 1.0]), 2 * np.pi)
    assert inclination(points) == pytest.approx(expected, abs=1e-12)


def test_tangents_are_unit_vectors_along_the_angle() -> None:
    np.testing.assert_allclose(tangents(np.array([0.0, np.pi / 2])), [[1, 0], [0, 1]], rtol=0, atol=1e-15)
