"""Imposed flows have the velocities that the scene names, and exact Jacobians."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.flows.imposed import imposed_flow
from solver.membrane.geometry import Geometry
from solver.scene import Extension, Shear, Trap
from solver.simulation.initial_state import initial_ellipses
from tests.solver.scenes import geometry_of, smooth_direction, uneven_pair

Array = NDArray[np.float64]
SCENE = uneven_pair()
FLOWS = [Shear(rate=0.7), Extension(rate=0.7), Trap(rate=0.7)]


def test_shear() -> None:
    geometry = geometry_of(SCENE)
    velocity = imposed_flow(Shear(rate=0.7), geometry.membranes).velocity(geometry)
    np.testing.assert_allclose(velocity[0], 0.7 * geometry.points[1], rtol=1e-15)
    assert not velocity[1].any()


def test_extension_converges_along_x_and_diverges_along_y() -> None:
    geometry = geometry_of(SCENE)
    velocity = imposed_flow(Extension(rate=0.7), geometry.membranes).velocity(geometry)
    np.testing.assert_allclose(velocity, [-0.7 * geometry.points[0], 0.7 * geometry.points[1]], rtol=1e-15)


def test_the_trap_stagnates_at_the_mean_of_the_centers() -> None:
    geometry = geometry_of(SCENE)
    stagnation = np.mean([vesicle.center for vesicle in SCENE.vesicles], axis=0)
    x, y = geometry.points - stagnation[:, None, None]
    velocity = imposed_flow(Trap(rate=0.7), geometry.membranes).velocity(geometry)
    np.testing.assert_allclose(velocity, [-0.7 * x, 0.7 * y], rtol=0, atol=1e-14)


def test_the_trap_follows_the_vesicles() -> None:
    state, membranes = initial_ellipses(SCENE), geometry_of(SCENE).membranes
    shifted = membranes.pack(membranes.tangent_angle(state), membranes.center(state) + np.array([3.0, -2.0]))
    trap, extension = (imposed_flow(flow(rate=0.7), membranes) for flow in (Trap, Extension))
    here, there = Geometry(membranes, state), Geometry(membranes, shifted)
    np.testing.assert_allclose(trap.velocity(there), trap.velocity(here), rtol=0, atol=1e-14)
    assert np.max(np.abs(extension.velocity(there) - extension.velocity(here))) > 1


@pytest.mark.parametrize("flow", FLOWS, ids=lambda flow: flow.kind)
def test_the_jacobian_is_exact(flow: Shear | Extension | Trap) -> None:
    """The velocity is linear in the points, so a difference has no truncation error."""
    state, membranes = initial_ellipses(SCENE), geometry_of(SCENE).membranes
    term = imposed_flow(flow, membranes)
    before, after = Geometry(membranes, state), Geometry(membranes, state + smooth_direction(membranes))
    moved = (after.points - before.points).reshape(2, -1, 1)
    change = term.velocity(after) - term.velocity(before)
    jacobian = term.jacobian(moved).reshape(change.shape)
    np.testing.assert_allclose(jacobian, change, rtol=0, atol=1e-13)
    assert np.max(np.abs(change)) > 0.01
