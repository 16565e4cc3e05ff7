"""Compiled sums of any pair potential: energy, force and its derivatives, over points and groups of points.

With weights w of the sources, q = r² and d = x − y, the potential's derivatives by q give for a target x

    force:                   −2 H Σ w φ_q d
    its derivative by x:     −2 H Σ w (φ_q I + 2 φ_qq d⊗d)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled, widest_vectors
from solver.forces.pair_formulas import PairFormula, derivatives
from solver.potentials.refinement import Refinement, interpolation_to, refined_points, selected_points

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


@compiled
def pair_energy(
    formula: PairFormula, parameters: Any, targets: Array, sources: Array, weights: Array
) -> float:
    """Compute Σ Σ w φ/H over targets and sources.

    Parameters
    ----------
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.
    targets : (2, t)
    sources : (2, s)
    weights : (s,)

    Returns
    -------
    float
    """
    widest_vectors()
    source_x, source_y = sources[0], sources[1]
    total = 0.0
    for i in range(targets.shape[1]):
        x, y = targets[0, i], targets[1, i]
        for j in range(weights.size):
            dx, dy = x - source_x[j], y - source_y[j]
            value, _, _ = derivatives(formula, dx * dx + dy * dy, parameters)
            total += weights[j] * value
    return total


@compiled
def add_forces(
    formula: PairFormula,
    parameters: Any,
    targets: Array,
    sources: Array,
    weights: Array,
    hamaker: float,
    out: Array,
) -> None:
    """Add the force of all sources on each target.

    Parameters
    ----------
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.
    targets : (2, t)
    sources : (2, s)
    weights : (s,)
    hamaker : float
    out : (2, t), added to
    """
    widest_vectors()
    source_x, source_y = sources[0], sources[1]
    for i in range(targets.shape[1]):
        x, y = targets[0, i], targets[1, i]
        force_x = 0.0
        force_y = 0.0
        for j in range(weights.size):
            dx, dy = x - source_x[j], y - source_y[j]
            _, first, _ = derivatives(formula, dx * dx + dy * dy, parameters)
            pull = weights[j] * first
            force_x += pull * dx
            force_y += pull * dy
        out[0, i] -= 2.0 * hamaker * force_x
        out[1, i] -= 2.0 * hamaker * force_y


@compiled
def add_stiffnesses(
    formula: PairFormula,
    parameters: Any,
    targets: Array,
    sources: Array,
    weights: Array,
    hamaker: float,
    out: Array,
) -> None:
    """Add the derivative of the force on each target by its own position.

    Parameters
    ----------
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.
    targets : (2, t)
    sources : (2, s)
    weights : (s,)
    hamaker : float
    out : (3, t), added to
        Its components xx, xy and yy.
    """
    widest_vectors()
    source_x, source_y = sources[0], sources[1]
    for i in range(targets.shape[1]):
        x, y = targets[0, i], targets[1, i]
        xx = 0.0
        xy = 0.0
        yy = 0.0
        for j in range(weights.size):
            dx, dy = x - source_x[j], y - source_y[j]
            _, first, second = derivatives(formula, dx * dx + dy * dy, parameters)
            isotropic, radial = weights[j] * first, 2.0 * weights[j] * second
            xx += isotropic + radial * dx * dx
            xy += radial * dx * dy
            yy += isotropic + radial * dy * dy
        out[0, i] -= 2.0 * hamaker * xx
        out[1, i] -= 2.0 * hamaker * xy
        out[2, i] -= 2.0 * hamaker * yy


@compiled
def pair_hessian(
    formula: PairFormula, parameters: Any, targets: Array, sources: Array, scale: float, out: Array
) -> None:
    """Fill the derivative of each pair's force by the target's position.

    Parameters
    ----------
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.
    targets : (2, t)
    sources : (2, s)
    scale : float
        H and the weight of the sources.
    out : (3, t, s), written
        Its components xx, xy and yy.
    """
    widest_vectors()
    source_x, source_y = sources[0], sources[1]
    for i in range(targets.shape[1]):
        x, y = targets[0, i], targets[1, i]
        # As rows: indexed in three dimensions the loop is not turned into SIMD code.
        xx, xy, yy = out[0, i], out[1, i], out[2, i]
        for j in range(source_x.size):
            dx, dy = x - source_x[j], y - source_y[j]
            _, first, second = derivatives(formula, dx * dx + dy * dy, parameters)
            isotropic, radial = -2.0 * scale * first, -4.0 * scale * second
            xx[j] = isotropic + radial * dx * dx
            xy[j] = radial * dx * dy
            yy[j] = isotropic + radial * dy * dy


@compiled
def _group(
    points: Array, spacing: Array, refinement: Refinement, g: int
) -> tuple[Indices, Array, Array, Array]:
    """Rows and points (2, ·) of a group's targets, and points and weights of the refined source."""
    groups = refinement.groups
    target, source, factor = groups[g, 0], groups[g, 1], groups[g, 2]
    rows = refinement.rows[refinement.starts[g] : refinement.starts[g + 1]]
    sources = refined_points(points, source, factor, refinement)
    weights = np.empty(sources.shape[1])
    for j in range(weights.size):
        weights[j] = spacing[source] / factor
    return rows, selected_points(points, target, rows), sources, weights


@compiled
def summed_energy(
    points: Array, spacing: Array, refinement: Refinement, formula: PairFormula, parameters: Any
) -> float:
    """Compute ½∫∫ φ/H ds ds over groups: over those of all vesicles and all other curves, each pair once.

    Parameters
    ----------
    points : (2, C, N)
        Of all curves, those of the targets first.
    spacing : (C,)
    refinement : Refinement
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.

    Returns
    -------
    float
    """
    total = 0.0
    for g in range(refinement.groups.shape[0]):
        _, targets, sources, weights = _group(points, spacing, refinement, g)
        pair = pair_energy(formula, parameters, targets, sources, weights)
        total += 0.5 * spacing[refinement.groups[g, 0]] * pair
    return total


@compiled
def add_density(
    points: Array,
    spacing: Array,
    refinement: Refinement,
    formula: PairFormula,
    parameters: Any,
    hamaker: float,
    density: Array,
) -> None:
    """Add the force per length on the targets of groups.

    Parameters
    ----------
    points : (2, C, N)
        Of all curves, those of the targets first.
    spacing : (C,)
    refinement : Refinement
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.
    hamaker : float
    density : (2, M, N), added to
    """
    for g in range(refinement.groups.shape[0]):
        rows, targets, sources, weights = _group(points, spacing, refinement, g)
        force = np.zeros((2, rows.size))
        add_forces(formula, parameters, targets, sources, weights, hamaker, force)
        for component in range(2):
            for k in range(rows.size):
                density[component, refinement.groups[g, 0], rows[k]] += force[component, k]


@compiled
def add_stiffness(
    points: Array,
    spacing: Array,
    refinement: Refinement,
    formula: PairFormula,
    parameters: Any,
    hamaker: float,
    stiffness: Array,
) -> None:
    """Add the derivative of each target's `add_density` by its own position.

    Parameters
    ----------
    points : (2, C, N)
        Of all curves, those of the targets first.
    spacing : (C,)
    refinement : Refinement
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.
    hamaker : float
    stiffness : (3, M, N), added to
        Its components xx, xy and yy.
    """
    for g in range(refinement.groups.shape[0]):
        rows, targets, sources, weights = _group(points, spacing, refinement, g)
        change = np.zeros((3, rows.size))
        add_stiffnesses(formula, parameters, targets, sources, weights, hamaker, change)
        for component in range(3):
            for k in range(rows.size):
                stiffness[component, refinement.groups[g, 0], rows[k]] += change[component, k]


@compiled
def fill_hessian(
    points: Array,
    spacing: Array,
    refinement: Refinement,
    formula: PairFormula,
    parameters: Any,
    hamaker: float,
    hessian: Array,
) -> None:
    """Fill the derivative of `add_density` by the points of the vesicles, whose images move the opposite way.

    Parameters
    ----------
    points : (2, C, N)
        Of all curves, those of the targets first.
    spacing : (C,)
    refinement : Refinement
    formula : PairFormula
    parameters : tuple
        Of `formula_and_parameters`.
    hamaker : float
    hessian : (2, M·N, 2, M·N), written
    """
    size, count = points.shape[2], hessian.shape[1] // points.shape[2]
    hessian[:] = 0.0
    groups = refinement.groups
    for g in range(groups.shape[0]):
        target, source, factor = groups[g, 0], groups[g, 1], groups[g, 2]
        rows, targets, sources, weights = _group(points, spacing, refinement, g)
        pair = np.empty((3, rows.size, sources.shape[1]))
        pair_hessian(formula, parameters, targets, sources, hamaker * weights[0], pair)
        first = source % count * size
        sign = 1.0 if source < count else -1.0
        for component, (a, b) in enumerate(((0, 0), (0, 1), (1, 1))):
            each = pair[component]
            folded = each if factor == 1 else np.dot(each, interpolation_to(refinement, factor))
            for k in range(rows.size):
                row = target * size + rows[k]
                by_source, of_row = hessian[a, row, b], folded[k]
                for j in range(size):
                    by_source[first + j] -= sign * of_row[j]
                by_source[row] += each[k].sum()
    for row in range(hessian.shape[1]):
        for j in range(hessian.shape[3]):
            hessian[1, row, 0, j] = hessian[0, row, 1, j]
