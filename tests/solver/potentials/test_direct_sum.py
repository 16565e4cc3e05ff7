"""Stokeslets summed without storing them."""

from __future__ import annotations

import llvmlite.binding as llvm
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import config, njit
from numpy.typing import NDArray

from solver.potentials.direct_sum import velocity
from solver.potentials.stokeslets import stokeslets

Array = NDArray[np.float64]

ACCURACY = 1e-14


def extended_velocity(targets: Array, sources: Array, point_forces: Array) -> NDArray[np.longdouble]:
    """`velocity` in extended precision."""
    targets, sources, forces = (array.astype(np.longdouble) for array in (targets, sources, point_forces))
    dx, dy = targets[:, :, None] - sources[:, None, :]
    r2 = dx**2 + dy**2
    r2[r2 == 0] = 1
    logarithm = -np.log(r2) / 2
    along = (dx * forces[0] + dy * forces[1]) / r2
    four_pi = 16 * np.arctan(np.longdouble(1))
    components = ((logarithm * forces[0] + along * dx), (logarithm * forces[1] + along * dy))
    return np.array([component.sum(axis=1) for component in components]) / four_pi


def relative_error(targets: Array, sources: Array, point_forces: Array) -> float:
    """Deviation from extended precision, over the largest velocity."""
    exact = extended_velocity(targets, sources, point_forces)
    return float(np.abs(velocity(targets, sources, point_forces) - exact).max() / np.abs(exact).max())


def cloud(seed: int, targets: int, sources: int) -> tuple[Array, Array, Array]:
    """Random targets, sources and forces."""
    random = np.random.default_rng(seed)
    return tuple(random.standard_normal((2, size)) for size in (targets, sources, sources))


@pytest.mark.parametrize("scale", [1e-30, 1e-3, 1.0, 1e3, 1e30])
def test_the_sum_is_accurate_at_any_scale(scale: float) -> None:
    targets, sources, forces = cloud(0, 300, 1000)
    assert relative_error(scale * targets, scale * sources, forces) < ACCURACY


# Whole vectors, none, and remainders of every kind.
@pytest.mark.parametrize("sources", [1, 2, 7, 8, 16, 31, 33, 128, 250])
def test_the_sum_is_accurate_for_any_number_of_sources(sources: int) -> None:
    assert relative_error(*cloud(sources, 5, sources)) < ACCURACY


def test_the_sum_is_accurate_close_to_sources() -> None:
    targets, sources, forces = cloud(1, 64, 64)
    close = sources + np.geomspace(1e-15, 1e-2, 64) * targets
    assert relative_error(close, sources, forces) < ACCURACY


def test_coincident_points_contribute_nothing() -> None:
    _, points, forces = cloud(2, 1, 40)
    alone = velocity(points[:, :1].copy(), points[:, :1].copy(), forces[:, :1].copy())
    assert np.array_equal(alone, np.zeros((2, 1)))
    assert relative_error(points, points, forces) < ACCURACY
    twice = np.concatenate([points, points], axis=1)
    doubled = velocity(points, twice, np.concatenate([forces, forces], axis=1))
    np.testing.assert_allclose(doubled, 2 * velocity(points, points, forces), rtol=1e-12, atol=1e-13)


def test_no_sources_cause_no_velocity() -> None:
    targets, _, _ = cloud(3, 4, 1)
    assert np.array_equal(velocity(targets, np.empty((2, 0)), np.empty((2, 0))), np.zeros((2, 4)))


def test_what_is_not_a_number_shows() -> None:
    targets, sources, forces = cloud(4, 3, 40)
    targets[0, 1] = np.nan
    assert np.array_equal(np.isnan(velocity(targets, sources, forces)).any(axis=0), [False, True, False])
    forces[1, 5] = np.nan
    assert np.isnan(velocity(targets, sources, forces)).any(axis=0).all()


def test_it_is_the_product_with_the_stored_stokeslets() -> None:
    targets, sources, (fx, fy) = cloud(5, 50, 90)
    xx, xy, yy = components = np.empty((3, 50, 90))
    stokeslets(targets, sources, components)
    stored = np.array([xx @ fx + xy @ fy, xy @ fx + yy @ fy])
    np.testing.assert_allclose(velocity(targets, sources, np.array([fx, fy])), stored, atol=1e-13)


seeds = st.integers(0, 2**32 - 1)
sizes = st.integers(1, 70)


@settings(max_examples=40, deadline=None)
@given(seeds, sizes, sizes, st.floats(0, 2 * np.pi))
def test_turning_everything_turns_the_velocity(seed: int, m: int, n: int, angle: float) -> None:
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    turned = velocity(*(turn @ array for array in cloud(seed, m, n)))
    np.testing.assert_allclose(turned, turn @ velocity(*cloud(seed, m, n)), atol=1e-11)


@settings(max_examples=40, deadline=None)
@given(seeds, sizes, sizes)
def test_reciprocity(seed: int, m: int, n: int) -> None:
    """Forces g on the targets do the same work in the flow of f as f in the flow of g."""
    targets, sources, forces = cloud(seed, m, n)
    others = np.random.default_rng(seed + 1).standard_normal((2, m))
    work = np.sum(others * velocity(targets, sources, forces))
    assert np.sum(forces * velocity(sources, targets, others)) == pytest.approx(work, abs=1e-11)


@settings(max_examples=40, deadline=None)
@given(seeds, sizes, sizes, st.floats(1e-6, 1e6))
def test_enlarging_everything_adds_a_uniform_flow(seed: int, m: int, n: int, factor: float) -> None:
    targets, sources, forces = cloud(seed, m, n)
    uniform = -np.log(factor) / (4 * np.pi) * forces.sum(axis=1, keepdims=True)
    expected = velocity(targets, sources, forces) + uniform
    np.testing.assert_allclose(velocity(factor * targets, factor * sources, forces), expected, atol=1e-11)


@settings(max_examples=40, deadline=None)
@given(seeds, sizes, st.integers(2, 70), st.data())
def test_the_flows_of_parts_add_up(seed: int, m: int, n: int, data: st.DataObject) -> None:
    targets, sources, forces = cloud(seed, m, n)
    cut = data.draw(st.integers(1, n - 1))
    first, second = (velocity(targets, sources[:, s], forces[:, s]) for s in (slice(cut), slice(cut, None)))
    np.testing.assert_allclose(velocity(targets, sources, forces), first + second, atol=1e-12)


@pytest.mark.skipif(
    config.CPU_NAME is not None or not llvm.get_host_cpu_features().get("avx512f", False),
    reason="compiled for a processor without wider vectors, or for a named one",
)
def test_the_widest_vectors_are_used() -> None:
    # A new compilation: one from the cache keeps no assembly.
    fresh = njit(error_model="numpy", fastmath=velocity.targetoptions["fastmath"])(velocity.py_func)
    fresh(*cloud(0, 1, 1))
    (assembly,) = fresh.inspect_asm().values()
    assert any("vdivpd" in line and "zmm" in line for line in assembly.splitlines())
