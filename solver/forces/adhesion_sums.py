"""Compiled sums of an adhesion potential over the groups of a `Refinement`.

They are written once for both potentials: which kernels they are compiled with is the potential's type.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import overload
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.forces.power_law import Potential, adhesion_energy, adhesion_force, adhesion_hessian
from solver.forces.truncated_power_law import (
    TruncatedPotential,
    truncated_energy,
    truncated_force,
    truncated_hessian,
)
from solver.potentials.refinement import Refinement, interpolation_to, refined_points

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
AnyPotential = Potential | TruncatedPotential

_ENERGY = {Potential: adhesion_energy, TruncatedPotential: truncated_energy}
_FORCE = {Potential: adhesion_force, TruncatedPotential: truncated_force}
_HESSIAN = {Potential: adhesion_hessian, TruncatedPotential: truncated_hessian}

# These three are what the sums below are written with; `overload` says what they are when compiled.
_COMPILED_ONLY = "a kernel is chosen by the potential's type when a sum is compiled"


def _energy(targets: Array, sources: Array, potential: AnyPotential) -> float:
    """The potential's energy of a group."""
    raise NotImplementedError(_COMPILED_ONLY)


def _force(targets: Array, sources: Array, potential: AnyPotential, scale: float, out: Array) -> None:
    raise NotImplementedError(_COMPILED_ONLY)


def _hessian(
    targets: Array, sources: Array, potential: AnyPotential, scale: float, xx: Array, xy: Array, yy: Array
) -> None:
    raise NotImplementedError(_COMPILED_ONLY)


@overload(_energy, strict=False)
def _(targets: Any, sources: Any, potential: Any) -> Any:
    kernel = _ENERGY[potential.instance_class]
    return lambda targets, sources, potential: kernel(targets, sources, potential)


@overload(_force, strict=False)
def _(targets: Any, sources: Any, potential: Any, scale: Any, out: Any) -> Any:
    kernel = _FORCE[potential.instance_class]
    return lambda targets, sources, potential, scale, out: kernel(targets, sources, potential, scale, out)


@overload(_hessian, strict=False)
def _(targets: Any, sources: Any, potential: Any, scale: Any, xx: Any, xy: Any, yy: Any) -> Any:
    kernel = _HESSIAN[potential.instance_class]
    return lambda targets, sources, potential, scale, xx, xy, yy: kernel(
        targets, sources, potential, scale, xx, xy, yy
    )


@compiled
def _group(points: Array, refinement: Refinement, g: int) -> tuple[Indices, Array, Array]:
    """Rows and points (2, ·) of a group's targets, and the points of the curve that they see."""
    target, source, factor = refinement.groups[g]
    rows = refinement.rows[refinement.starts[g] : refinement.starts[g + 1]]
    return rows, points[:, target][:, rows], refined_points(points, source, factor, refinement)


@compiled
def summed_energy(points: Array, spacing: Array, refinement: Refinement, potential: AnyPotential) -> float:
    """½∫∫ φ/H ds ds over the groups: over those of all vesicles and all other curves, each pair once."""
    total = 0.0
    for g in range(refinement.groups.shape[0]):
        target, source, factor = refinement.groups[g]
        _, targets, sources = _group(points, refinement, g)
        pair = _energy(targets, sources, potential)
        total += 0.5 * spacing[target] * spacing[source] / factor * pair
    return total


@compiled
def add_density(
    points: Array,
    spacing: Array,
    refinement: Refinement,
    potential: AnyPotential,
    strength: float,
    density: Array,
) -> None:
    """Add the force per length on the targets to ``density`` (2, M, N)."""
    for g in range(refinement.groups.shape[0]):
        target, source, factor = refinement.groups[g]
        rows, targets, sources = _group(points, refinement, g)
        scale = strength * spacing[source] / factor
        force = np.empty((2, rows.size))
        _force(targets, sources, potential, scale, force)
        for k in range(rows.size):
            density[0, target, rows[k]] += force[0, k]
            density[1, target, rows[k]] += force[1, k]


@compiled
def add_stiffness(
    points: Array,
    spacing: Array,
    refinement: Refinement,
    potential: AnyPotential,
    strength: float,
    stiffness: Array,
) -> None:
    """Add the derivative of each target's `add_density` by its own position: xx, xy and yy (3, M, N)."""
    for g in range(refinement.groups.shape[0]):
        target, source, factor = refinement.groups[g]
        rows, targets, sources = _group(points, refinement, g)
        scale = strength * spacing[source] / factor
        pair = np.empty((3, rows.size, sources.shape[1]))
        _hessian(targets, sources, potential, scale, pair[0], pair[1], pair[2])
        for component in range(3):
            for k in range(rows.size):
                stiffness[component, target, rows[k]] += pair[component, k].sum()


@compiled
def fill_hessian(
    points: Array,
    spacing: Array,
    refinement: Refinement,
    potential: AnyPotential,
    strength: float,
    hessian: Array,
) -> None:
    """Fill the derivative (2, M·N, 2, C·N) of `add_density` by all curves' points."""
    size = points.shape[2]
    hessian[:] = 0.0
    for g in range(refinement.groups.shape[0]):
        target, source, factor = refinement.groups[g]
        rows, targets, sources = _group(points, refinement, g)
        scale = strength * spacing[source] / factor
        pair = np.empty((3, rows.size, sources.shape[1]))
        _hessian(targets, sources, potential, scale, pair[0], pair[1], pair[2])
        first, last = source * size, (source + 1) * size
        for component, (a, b) in enumerate(((0, 0), (0, 1), (1, 1))):
            each = pair[component]
            folded = each if factor == 1 else np.dot(each, interpolation_to(refinement, factor))
            for k in range(rows.size):
                row = target * size + rows[k]
                hessian[a, row, b, first:last] = -folded[k]
                hessian[a, row, b, row] += each[k].sum()
    hessian[1, :, 0] = hessian[0, :, 1]
