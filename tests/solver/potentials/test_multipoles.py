"""Series about groups of vesicles: the sum over all points, as accurately as asked, wherever vesicles are."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.potentials.direct_sum import add_near_velocities
from solver.potentials.direct_sum import velocity as direct_velocity
from solver.potentials.multipoles import (
    LARGEST_OF_GROUP,
    LARGEST_ORDER,
    add_series,
    add_velocities,
    group_moments,
    write_moments,
)
from solver.potentials.vesicle_tree import FarNodes, VesicleTree, interactions, vesicle_tree

Array = NDArray[np.float64]
POINTS = 48


def ellipses(centers: Array) -> tuple[Array, Array]:
    """Points (2, M, N) of tilted ellipses and the radii of circles about them."""
    angles = 2 * np.pi * np.arange(POINTS) / POINTS
    tilts = np.arange(centers.shape[1])[:, None]
    x, y = 1.2 * np.cos(angles), 0.7 * np.sin(angles)
    shapes = np.stack([np.cos(tilts) * x - np.sin(tilts) * y, np.sin(tilts) * x + np.cos(tilts) * y])
    return centers[:, :, None] + shapes, np.full(centers.shape[1], 1.2)


def scattered(count: int) -> Array:
    """Centers on a jittered lattice, sheared as a flow shears them."""
    random = np.random.default_rng(count)
    columns = int(np.ceil(np.sqrt(count)))
    place = np.arange(count)
    centers = 3.0 * np.stack([place % columns, place // columns]) + random.uniform(-0.3, 0.3, (2, count))
    centers[0] += 2.0 * centers[1]
    return centers


def pushes(count: int) -> Array:
    return np.random.default_rng(count).standard_normal((2, count, POINTS))


def directly(points: Array, forces: Array) -> Array:
    flat = points.reshape(2, -1)
    return direct_velocity(flat, flat, forces.reshape(2, -1)).reshape(points.shape)


def by_series(centers: Array, accuracy: float, forces: Array) -> tuple[Array, FarNodes]:
    points, radii = ellipses(centers)
    count = radii.size
    tree = vesicle_tree(centers, radii)
    far, near = interactions(tree, accuracy, LARGEST_ORDER, LARGEST_OF_GROUP, 0, count)
    moments = np.empty((count, 4, LARGEST_ORDER + 1))
    write_moments(points, centers, radii, 0, forces, moments)
    of_groups = group_moments(tree, moments, LARGEST_OF_GROUP)
    series, orders, found = np.zeros_like(moments), np.zeros(count, dtype=np.int64), np.zeros_like(points)
    add_series(tree, far, 0, moments, of_groups, series, orders)
    add_velocities(points, centers, radii, 0, series, orders, found)
    by_vesicle = np.ascontiguousarray(forces.swapaxes(0, 1))
    add_near_velocities(points, by_vesicle, near, 0, found)
    return found, far


@pytest.mark.parametrize("accuracy", [1e-4, 1e-7, 1e-10])
def test_series_give_the_sum_over_points_as_accurately_as_asked(accuracy: float) -> None:
    centers, forces = scattered(60), pushes(60)
    found, far = by_series(centers, accuracy, forces)
    expected = directly(ellipses(centers)[0], forces)
    assert np.any(far.nodes >= 60)
    assert far.nodes.size < 0.9 * 60 * 59
    np.testing.assert_allclose(found, expected, rtol=0, atol=accuracy * np.max(np.abs(expected)))


def test_vesicles_whose_total_force_vanishes_are_summed_as_accurately() -> None:
    """What membranes do: the slowest terms of the series are missing."""
    centers, forces = scattered(60), pushes(60)
    forces -= forces.mean(axis=2, keepdims=True)
    found, _ = by_series(centers, 1e-7, forces)
    expected = directly(ellipses(centers)[0], forces)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-7 * np.max(np.abs(expected)))


def test_two_far_vesicles_converge_like_the_ratio_of_radius_and_distance() -> None:
    """Every power of two circles that are 5.5 radii apart gains the factor 1.2/(6.6 − 1.2) = 1/4.5."""
    centers, forces = np.array([[0.0, 6.6], [0.0, 0.0]]), pushes(2)
    points, radii = ellipses(centers)
    flat = [np.ascontiguousarray(points[:, k]) for k in range(2)]
    expected = direct_velocity(flat[0], flat[1], np.ascontiguousarray(forces[:, 1]))
    moments = np.empty((2, 4, LARGEST_ORDER + 1))
    write_moments(points, centers, radii, 0, forces, moments)
    tree, none = vesicle_tree(centers, radii), np.empty((0, 4, 1))
    errors = []
    for power in (4, 8, 12, 16):
        target, source, order = np.array([0]), np.array([1]), np.array([power])
        series, orders, found = (
            np.zeros((1, 4, LARGEST_ORDER + 1)),
            np.zeros(1, np.int64),
            np.zeros((2, 1, POINTS)),
        )
        add_series(tree, FarNodes(target, source, order, order), 0, moments, none, series, orders)
        add_velocities(points, centers, radii, 0, series, orders, found)
        errors.append(np.max(np.abs(found[:, 0] - expected)))
    rates = np.diff(np.log(errors)) / 4
    assert np.all(rates < -0.8 * np.log(4.5))
    assert errors[-1] < 1e-9


def test_velocities_of_some_vesicles_are_those_of_all() -> None:
    """So that ranks can share them."""
    centers, forces = scattered(30), pushes(30)
    points, radii = ellipses(centers)
    tree = vesicle_tree(centers, radii)
    everyone, _ = by_series(centers, 1e-7, forces)
    moments = np.empty((30, 4, LARGEST_ORDER + 1))
    write_moments(points, centers, radii, 0, forces, moments)
    far, near = interactions(tree, 1e-7, LARGEST_ORDER, LARGEST_OF_GROUP, 7, 19)
    series, orders, found = (
        np.zeros((12, 4, LARGEST_ORDER + 1)),
        np.zeros(12, np.int64),
        np.zeros((2, 12, POINTS)),
    )
    of_groups = group_moments(tree, moments, LARGEST_OF_GROUP)
    add_series(tree, far, 7, moments, of_groups, series, orders)
    add_velocities(points, centers, radii, 7, series, orders, found)
    add_near_velocities(points, np.ascontiguousarray(forces.swapaxes(0, 1)), near, 7, found)
    np.testing.assert_allclose(found, everyone[:, 7:19], rtol=0, atol=1e-12 * np.max(np.abs(everyone)))


# --- The tree ---------------------------------------------------------------------------------------------


def members(tree: VesicleTree, node: int) -> set[int]:
    count = len(tree.children) + 1
    if node < count:
        return {node}
    first, second = tree.children[node - count]
    return members(tree, first) | members(tree, second)


@pytest.mark.parametrize(
    "centers",
    [
        scattered(57),
        np.zeros((2, 5)),
        np.stack([2.0 ** np.arange(20), np.zeros(20)]),
        np.array([[0.0, 0.1, 50.0], [0.0, 0.0, 0.0]]),
        np.zeros((2, 1)),
    ],
    ids=["scattered", "in one place", "ever farther", "one far away", "one"],
)
def test_circles_and_boxes_hold_the_vesicles_of_their_nodes(centers: Array) -> None:
    count = centers.shape[1]
    radii = np.random.default_rng(0).uniform(0.5, 1.5, count)
    tree = vesicle_tree(centers, radii)
    assert tree.children.shape == (count - 1, 2)
    for node in range(2 * count - 1):
        inside = sorted(members(tree, node))
        away = centers[:, inside] - tree.centers[:, node, None]
        assert np.all(np.hypot(*away) + radii[inside] <= tree.radii[node] * (1 + 1e-14))
        assert np.all(np.abs(away) + radii[inside] <= tree.extents[:, node, None] * (1 + 1e-14))
    if count > 1:
        assert members(tree, count) == set(range(count))


def test_every_other_vesicle_acts_once_on_each() -> None:
    centers = scattered(57)
    tree = vesicle_tree(centers, np.full(57, 1.2))
    far, near = interactions(tree, 1e-7, LARGEST_ORDER, LARGEST_OF_GROUP, 0, 57)
    for target in range(57):
        acting = [members(tree, node) for node in far.nodes[far.targets == target]]
        acting += [{source} for source in near.sources[near.targets == target]]
        assert sorted(vesicle for group in acting for vesicle in group) == list(range(57))
