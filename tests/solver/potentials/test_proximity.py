"""Distances between membranes, and which points are refined because of them."""

from __future__ import annotations

import numpy as np
import pytest

from solver.membrane.geometry import Geometry
from solver.membrane.spectral import interpolations
from solver.potentials.neighbors import gap
from solver.potentials.proximity import Closeness
from solver.potentials.refinement import refinement_factors
from solver.scene import Numerics, Scene, Vesicle
from tests.solver.references import Ellipse, nearest_parameter
from tests.solver.scenes import geometry_of, uneven_pair


def circles(separation: float, direction: float, points: int = 64) -> Geometry:
    """Unit circles whose membranes are ``separation`` apart."""
    offset = (2 + separation) * np.exp(1j * direction)
    return geometry_of(
        Scene(
            horizon=1.0,
            vesicles=(
                Vesicle(reduced_area=1.0),
                Vesicle(reduced_area=1.0, center=(offset.real, offset.imag)),
            ),
            numerics=Numerics(points=points),
        )
    )


@pytest.mark.parametrize("direction", [0.0, 0.31, 1.0, 2.5])
@pytest.mark.parametrize("separation", [0.05, 0.4, 3.0])
def test_gap_between_circles(separation: float, direction: float) -> None:
    """To second order in the spacing of the refined points: (h/2)²/2 over the radius, h = 2π/256."""
    assert gap(circles(separation, direction)) == pytest.approx(separation, abs=8e-5)


def test_gap_is_of_second_order() -> None:
    errors = [abs(gap(circles(0.4, 0.31, points)) - 0.4) for points in (32, 128)]
    assert errors[1] < errors[0] / 8


def test_gap_between_ellipses() -> None:
    scene = uneven_pair(numerics=Numerics(points=128))
    first, second = (
        Ellipse.of(v.reduced_area, v.length, complex(*v.center), v.angle) for v in scene.vesicles
    )
    alpha = np.linspace(0, 2 * np.pi, 4000)
    nearest = [
        np.hypot(*(second.points(np.array([nearest_parameter(second, p)]))[:, 0] - p))
        for p in first.points(alpha[::10]).T
    ]
    assert gap(geometry_of(scene)) == pytest.approx(min(nearest), abs=1e-4)


def test_distances_are_those_to_the_other_membrane_in_its_spacing() -> None:
    geometry = circles(0.1, 0.3)
    closeness = Closeness(geometry)
    distance = np.hypot(*(geometry.points[:, 0] - geometry.centers[:, 1:2])) - 1
    # The distance to the chord's tangent is short by less than (h/2)²/2 where it is small.
    np.testing.assert_allclose(closeness.distances[0, 1] * 2 * np.pi / 64, distance, atol=1.3e-3)
    assert np.all(np.isinf(closeness.distances[[0, 1], [0, 1]]))


def test_interpolations_reach_the_largest_factor_that_is_needed() -> None:
    closeness = Closeness(circles(0.1, 0.3))
    ratio = 3.0
    largest = refinement_factors(closeness.distances[0, 1], ratio).max()
    assert largest == 4
    np.testing.assert_array_equal(closeness.refinement(ratio).interpolations, interpolations(64, largest))


def test_vesicles_far_apart_need_no_interpolation() -> None:
    assert Closeness(circles(3.0, 0.3)).refinement(5.0).interpolations.shape == (0, 64)


def test_every_target_is_in_one_group_of_its_factor() -> None:
    closeness = Closeness(circles(0.1, 0.3))
    refinement = closeness.refinement(3.0)
    for target, source in ((0, 1), (1, 0)):
        factors = refinement_factors(closeness.distances[target, source], 3.0)
        for factor in (1, 2, 4):
            (g,) = np.flatnonzero((refinement.groups == (target, source, factor)).all(axis=1))
            rows = refinement.rows[refinement.starts[g] : refinement.starts[g + 1]]
            np.testing.assert_array_equal(rows, np.flatnonzero(factors == factor))
    assert len(refinement.groups) == 6
