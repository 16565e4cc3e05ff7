"""Few points that stand for many vesicles: the same sums, as accurately as asked."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.forces.clustered_sources import (
    Clusters,
    SourceLists,
    chebyshev_points,
    clusters_of,
    write_sources,
)
from solver.forces.clustered_sums import add_clustered_density, add_clustered_stiffness, clustered_energy
from solver.forces.pair_formulas import formula_and_parameters
from solver.forces.pair_sums import add_forces, add_stiffnesses, pair_energy
from solver.potentials.vesicle_tree import vesicle_tree
from solver.scene import PowerLaw

Array = NDArray[np.float64]
COLUMNS, POINTS = 14, 32
COUNT = COLUMNS**2


@pytest.fixture(scope="module")
def points() -> Array:
    """Ellipses on a jittered lattice, (2, M, N)."""
    random = np.random.default_rng(3)
    angles = 2 * np.pi * np.arange(POINTS) / POINTS
    place, tilts = np.arange(COUNT), random.uniform(0, np.pi, (COUNT, 1))
    centers = 3.0 * np.stack([place % COLUMNS, place // COLUMNS]) + random.uniform(-0.2, 0.2, (2, COUNT))
    x, y = 1.2 * np.cos(angles), 0.8 * np.sin(angles)
    shapes = np.stack([np.cos(tilts) * x - np.sin(tilts) * y, np.sin(tilts) * x + np.cos(tilts) * y])
    return centers[:, :, None] + shapes


def clustered(points: Array, order: int, accuracy: float) -> tuple[Clusters, Array]:
    centers = np.ascontiguousarray(points.mean(axis=2))
    radii = np.hypot(*(points - centers[:, :, None])).max(axis=1)
    spacing = np.full(points.shape[1], 0.2)
    return clusters_of(vesicle_tree(centers, radii), points, spacing, order, accuracy), spacing


@pytest.mark.parametrize("order", [3, 6])
def test_points_of_a_group_sum_polynomials_like_its_vesicles(points: Array, order: int) -> None:
    """Those up to the degree order − 1 in each coordinate, over all vesicles together."""
    clusters, spacing = clustered(points, order, 1e-7)
    grid = chebyshev_points(clusters.tree, COUNT, clusters.nodes)
    place = clusters.tree.centers[:, COUNT, None]
    power = order - 1
    for first, second in ((0, 0), (1, 0), (power, 0), (0, power), (power, power)):
        x, y = (points.reshape(2, -1) - place) / 20.0
        expected = spacing[0] * np.sum(x**first * y**second)
        x, y = (grid - place) / 20.0
        found = np.sum(clusters.weights[0].ravel() * x**first * y**second)
        assert found == pytest.approx(expected, rel=1e-11, abs=1e-9)


@pytest.mark.parametrize("accuracy", [1e-5, 1e-7])
@pytest.mark.parametrize("exponents", [(4, 2), (12, 6)])
def test_far_vesicles_need_few_points(points: Array, accuracy: float, exponents: tuple[int, int]) -> None:
    law = formula_and_parameters(PowerLaw(hamaker=1.0, distance=0.4, exponents=exponents))
    clusters, spacing = clustered(points, 5, 0.3 * accuracy)
    everyone = (*law, clusters, points, spacing, 0, COUNT * POINTS)
    density, stiffness = np.zeros_like(points), np.zeros((3, COUNT, POINTS))
    add_clustered_density(*everyone, 1.0, density)
    add_clustered_stiffness(*everyone, 1.0, stiffness)
    exact, derivative, energy = np.zeros_like(points), np.zeros_like(stiffness), 0.0
    for vesicle in range(COUNT):
        others = np.arange(COUNT) != vesicle
        sources = np.ascontiguousarray(points[:, others].reshape(2, -1))
        own, weights = np.ascontiguousarray(points[:, vesicle]), np.full(sources.shape[1], 0.2)
        force, change = np.zeros((2, POINTS)), np.zeros((3, POINTS))
        add_forces(*law, own, sources, weights, 1.0, force)
        add_stiffnesses(*law, own, sources, weights, 1.0, change)
        exact[:, vesicle], derivative[:, vesicle] = force, change
        energy += 0.5 * 0.2 * pair_energy(*law, own, sources, weights)
    np.testing.assert_allclose(density, exact, rtol=0, atol=accuracy * np.max(np.abs(exact)))
    np.testing.assert_allclose(stiffness, derivative, rtol=0, atol=accuracy * np.max(np.abs(derivative)))
    assert clustered_energy(*everyone) == pytest.approx(energy, rel=10 * accuracy)
    lists = SourceLists(np.empty((3, COUNT * POINTS)), np.empty((3, COUNT * POINTS)))
    near, far = write_sources(*everyone[:5], COUNT // 2, lists)
    assert far > 0
    assert POINTS * near + 25 * far < 0.5 * POINTS * POINTS * COUNT


def test_points_in_a_range_get_what_they_get_among_all(points: Array) -> None:
    """Also where the range begins and ends within a vesicle, as shares of ranks do."""
    law = formula_and_parameters(PowerLaw(hamaker=1.0, distance=0.4))
    clusters, spacing = clustered(points, 5, 1e-7)
    whole, part = np.zeros_like(points), np.zeros_like(points)
    add_clustered_density(*law, clusters, points, spacing, 0, COUNT * POINTS, 1.0, whole)
    first, last = 5 * POINTS + 7, 9 * POINTS - 3
    add_clustered_density(*law, clusters, points, spacing, first, last, 1.0, part)
    flat, expected = part.reshape(2, -1), whole.reshape(2, -1)
    scale = np.max(np.abs(expected))
    np.testing.assert_allclose(flat[:, first:last], expected[:, first:last], rtol=0, atol=1e-13 * scale)
    assert not flat[:, :first].any()
    assert not flat[:, last:].any()
