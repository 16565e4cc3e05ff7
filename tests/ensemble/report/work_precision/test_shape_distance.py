"""Distances between shapes do not depend on how points are spread along them."""

from __future__ import annotations

import numpy as np
import pytest

from ensemble.report.work_precision.shape_distance import shape_distance
from solver.membrane import curve
from solver.membrane.shapes import ellipse_tangent_angle


def ellipse(points: int, shift: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Points of an ellipse, the first ``shift`` spacings beyond the tip, and the normals there."""
    finely = 256
    alpha = 2 * np.pi * (np.arange(points) + shift) / points
    theta = ellipse_tangent_angle(0.9, 2 * np.pi, 0.3, finely)
    place = curve.positions(theta, np.array([0.2, -0.1]), 2 * np.pi)
    spectrum = np.fft.fft(place[0] + 1j * place[1]) / finely
    wavenumber = np.fft.fftfreq(finely, 1 / finely)
    waves = np.exp(1j * np.outer(alpha, wavenumber))
    at, along = waves @ spectrum, waves @ (1j * wavenumber * spectrum)
    normal = 1j * along / np.abs(along)
    return np.array([at.real, at.imag]), np.array([normal.real, normal.imag])


@pytest.mark.parametrize("shift", [0.0, 1.0, 0.37])
def test_a_relabelled_curve_is_the_same_shape(shift):
    other, _ = ellipse(128)
    points, _ = ellipse(128, shift)
    if shift:
        assert np.abs(points - other).max() > 0.01
    assert shape_distance(points, other).max() < 1e-12


@pytest.mark.parametrize("offset", [1e-9, 1e-3, 0.1])
def test_a_curve_offset_along_its_normals_is_that_far_away(offset):
    points, normals = ellipse(48, 0.3)
    other, _ = ellipse(160)
    for side in (-1, 1):
        distances = shape_distance(points + side * offset * normals, other)
        np.testing.assert_allclose(distances, offset, rtol=1e-10, atol=1e-13)
