"""The same membranes with more points are the same curves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.membrane.geometry import Geometry, Membranes
from solver.membrane.resampling import resampled_angle, resampled_state
from solver.scene import Numerics, Vesicle
from solver.simulation.initial_state import placed_state
from tests.solver.scenes import uneven_pair

Array = NDArray[np.float64]


@pytest.mark.parametrize(("points", "finer"), [(32, 48), (48, 64), (64, 96), (64, 256)])
def test_a_band_limited_state_is_resampled_exactly(points: int, finer: int) -> None:
    random = np.random.default_rng(points)
    degree = points // 2 - 1
    amplitudes = random.standard_normal((2, 2, degree)) / np.arange(1, degree + 1) ** 2

    def state(count: int) -> tuple[Membranes, Array]:
        membranes = Membranes.of((Vesicle(), Vesicle(length=4.0, center=(3.0, 1.0))), count)
        alpha = 2 * np.pi * np.arange(count) / count
        waves = np.stack([np.cos(np.outer(np.arange(1, degree + 1), alpha) + phase) for phase in (0.0, 1.0)])
        angle = 3.0 + alpha + np.einsum("vpk,pkn->vn", amplitudes, waves)
        return membranes, membranes.pack(angle, np.array([[0.0, 0.2], [3.0, 1.0]]))

    (coarse, given), (fine, expected) = state(points), state(finer)
    np.testing.assert_allclose(resampled_state(coarse, given, fine), expected, rtol=0, atol=1e-13)
    np.testing.assert_array_equal(resampled_state(coarse, given, coarse), given)


def test_the_highest_mode_is_resampled_as_the_wave_it_is() -> None:
    """On 16 points cos 8α has no sine beside it; on more it is still that cosine, and of that amplitude."""
    alpha, finer = (2 * np.pi * np.arange(n) / n for n in (16, 24))
    angle = resampled_angle(alpha + 0.1 * np.cos(8 * alpha), 24)
    np.testing.assert_allclose(angle, finer + 0.1 * np.cos(8 * finer), rtol=0, atol=1e-14)


def test_a_resampled_start_is_the_same_curve() -> None:
    coarse, fine = (Membranes.of_scene(uneven_pair(numerics=Numerics(points=n))) for n in (192, 384))
    state = placed_state(uneven_pair(numerics=Numerics(points=192)))
    finer = Geometry(fine, resampled_state(coarse, state, fine))
    np.testing.assert_allclose(finer.points[:, :, ::2], Geometry(coarse, state).points, rtol=0, atol=1e-13)
