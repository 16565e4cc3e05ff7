"""The single-layer potential of one membrane at points outside it, however close to it they lie.

For targets that are not very close the source is refined.  For closer ones Barnett, Wu & Veerapaneni 2015
reduce the Stokes potential to Cauchy integrals, take the boundary values of these from outside, where they
are smooth, and continue them to the target by a barycentric sum, whose error does not depend on how close the
target is.  In complex numbers, with r = x − y from a point y of the membrane to the target x,

    r⊗r/r² = ½ I + ½ [[Re w, −Im w], [−Im w, −Re w]],    w = conj(r)/r,

so two integrals are left to evaluate:

- ∫ w f ds is the Cauchy integral V[τ](x) = ∫ τ/(x − y) ds of τ = conj(r) f.  This is one integral instead of
  the three of that reference, and its density vanishes at the target, so nothing large cancels.
- ∫ log|r| f ds is what the rule of Kress (2014) gives for the nearest source, plus Re ∫ V[f] dx along the
  line from there to the target.  The reference instead subtracts from the density the logarithm of the whole
  charge at a point inside; a thin or curved vesicle has no good such point.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from solver.compilation import compiled
from solver.membrane.spectral import equispaced_angles, logarithm_weights
from solver.potentials.logarithm import logarithm
from solver.potentials.refinement import (
    LARGEST_REFINED,
    Refinement,
    interpolation_to,
    refined_points,
    selected_points,
)
from solver.potentials.stokeslets import stokeslets

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

# Fractions and weights of rules on the line from the nearest source to the target: its end, Gauss–Legendre.
END = np.ones((2, 1))
_SHORT_LINE, _LONG_LINE = (
    np.stack([(nodes + 1) / 2, weights / 2])
    for nodes, weights in (np.polynomial.legendre.leggauss(order) for order in (6, 16))
)
_SHORT = 1.5  # spacings: up to here 6 nodes leave 1e-14, as 16 do at 10 spacings


@cache
def logarithm_correction(points: int) -> Array:
    """Return what the rule of Kress (2014) adds to −log r/(4π) between the points of one membrane.

    On the diagonal, where log r is infinite, r = length/2π takes its place.

    Parameters
    ----------
    points : int

    Returns
    -------
    (points, points)
        Not to be written to.
    """
    alpha = equispaced_angles(points)
    sine = np.sin((alpha[:, None] - alpha) / 2)
    np.fill_diagonal(sine, 0.5)  # makes the logarithm vanish there
    weights = logarithm_weights(points) * points / (2 * np.pi)
    correction: Array = (0.5 * np.log(4 * sine**2) + weights) / (4 * np.pi)
    correction.setflags(write=False)
    return correction


@compiled
def _boundary_values(points: Array, tangents: Array, derivative: Array) -> tuple[Array, Array]:
    """Return the limit of V[τ] from outside, as a matrix (2, n, n) with zero diagonal and a vector (2, n).

    Of the density τ/t (t the tangent, as dy = t ds) its value at the point itself can be subtracted, since
    the Cauchy integral of a constant vanishes outside.  What is left is smooth; with h the spacing

        V_i = Σ_{j≠i} (hτ_j − hτ_i t_j/t_i)/(y_i − y_j) − h (τ/t)'_i = (matrix·hτ + vector·hτ − hτ'/t)_i.

    The caller adds the last term, since it knows τ' better than a differentiation of τ/t would.

    Parameters
    ----------
    points, tangents : (2, n)
    derivative : (n, n)
        Matrix of the derivative by arclength.
    """
    n = points.shape[1]
    matrix, vector = np.empty((2, n, n)), np.empty((2, n))
    rotation_rate = np.dot(tangents, derivative.T)
    for i in range(n):
        for j in range(n):
            dx = points[0, i] - points[0, j]
            dy = points[1, i] - points[1, j]
            inverse = 1.0 / (dx * dx + dy * dy)
            matrix[0, i, j] = dx * inverse
            matrix[1, i, j] = -dy * inverse
        matrix[0, i, i] = matrix[1, i, i] = 0.0
        total = 0j
        for j in range(n):
            total += complex(matrix[0, i, j], matrix[1, i, j]) * complex(tangents[0, j], tangents[1, j])
        inverse_tangent = complex(tangents[0, i], -tangents[1, i])
        value = (
            complex(rotation_rate[0, i], rotation_rate[1, i]) * inverse_tangent - total
        ) * inverse_tangent
        vector[0, i], vector[1, i] = value.real, value.imag
    return matrix, vector


@compiled
def continuation_weights(
    offsets: Array,
    tangents: Array,
    spacing: float,
    step: complex,
    factor: complex,
    rule: Array,
    work: Array,
    weights: Array,
) -> None:
    """Write the weights that give factor·Σ_k w_k v(x_k) of a function v from its values on the membrane.

    The function is analytic outside and vanishes at infinity.  Cauchy's formula for its difference from the
    value sought has a smooth integrand; solved for that value it is v(x) = Σ v_j c_j / (Σ c_j − 2πi) with
    c_j = h t_j/(y_j − x) (Barnett, Wu & Veerapaneni 2015).

    Parameters
    ----------
    offsets : (2, n)
        From one point of the membrane to all.
    tangents : (2, n)
    spacing : float
        Arclength between neighboring points.
    step : complex
        From that point to the target.  Given as a difference it is exact however short it is.
    factor : complex
    rule : (2, k)
        The x_k as fractions of ``step``, and the w_k.
    work : (2, n)
        Overwritten.
    weights : (2, n)
        Written to: real and imaginary parts.
    """
    weights[:] = 0.0
    for k in range(rule.shape[1]):
        # In real numbers: this is most of the work, and sums of complex ones do not become SIMD code.
        step_x, step_y = rule[0, k] * step.real, rule[0, k] * step.imag
        total_real = 0.0
        total_imaginary = 0.0
        for j in range(offsets.shape[1]):
            dx = offsets[0, j] - step_x
            dy = offsets[1, j] - step_y
            inverse = spacing / (dx * dx + dy * dy)
            work[0, j] = (tangents[0, j] * dx + tangents[1, j] * dy) * inverse
            work[1, j] = (tangents[1, j] * dx - tangents[0, j] * dy) * inverse
            total_real += work[0, j]
            total_imaginary += work[1, j]
        scale = factor * rule[1, k] / complex(total_real, total_imaginary - 2 * np.pi)
        for j in range(offsets.shape[1]):
            weights[0, j] += scale.real * work[0, j] - scale.imag * work[1, j]
            weights[1, j] += scale.real * work[1, j] + scale.imag * work[0, j]


@compiled
def _continuations(
    targets: Array, sources: Array, tangents: Array, spacing: float
) -> tuple[Array, Array, Indices]:
    """Return the weights of the boundary values, and where the lines to the targets begin.

    These are the weights (m, 2, n) of the value at each target, those of the integral along the line from
    its nearest source, and the indices (m,) of these sources.
    """
    m, n = targets.shape[1], sources.shape[1]
    at, along = np.zeros((m, 2, n)), np.zeros((m, 2, n))
    starts = np.empty(m, dtype=np.int64)
    offsets, work, squares = np.empty((2, n)), np.empty((2, n)), np.empty(n)
    for i in range(m):
        for j in range(n):
            squares[j] = (targets[0, i] - sources[0, j]) ** 2 + (targets[1, i] - sources[1, j]) ** 2
        start = np.argmin(squares)
        starts[i] = start
        if squares[start] == 0.0:
            at[i, 0, start] = 1.0
            continue
        for j in range(n):
            offsets[0, j] = sources[0, j] - sources[0, start]
            offsets[1, j] = sources[1, j] - sources[1, start]
        step = complex(targets[0, i] - sources[0, start], targets[1, i] - sources[1, start])
        line = _SHORT_LINE if squares[start] < (_SHORT * spacing) ** 2 else _LONG_LINE
        continuation_weights(offsets, tangents, spacing, step, 1.0 + 0.0j, END, work, at[i])
        continuation_weights(offsets, tangents, spacing, step, step, line, work, along[i])
    return at, along, starts


@compiled
def close_stokeslets(
    targets: Array,
    sources: Array,
    tangents: Array,
    spacing: float,
    correction: Array,
    differentiation: Array,
    components: Array,
) -> None:
    """Fill the components of the single-layer potential of one membrane at targets outside it.

    They act on point forces, as those of `stokeslets.stokeslets` do, and take their place where targets are
    close.  They are as accurate as the membrane and the forces are resolved, at any distance.  On the
    membrane itself they give the limit from outside.

    Parameters
    ----------
    targets : (2, m)
    sources, tangents : (2, n)
        Equispaced in arclength, counterclockwise.
    spacing : float
        Arclength between neighboring sources.
    correction : (n, n)
        `logarithm_correction`.
    differentiation : (n, n)
        `spectral.differentiation`.
    components : (3, m, n)
        Written to.
    """
    m, n = targets.shape[1], sources.shape[1]
    scale = 1.0 / (4.0 * np.pi)
    radius = n * spacing / (2.0 * np.pi)
    points, directions = np.ascontiguousarray(sources), np.ascontiguousarray(tangents)
    derivative = differentiation / radius
    matrix, vector = _boundary_values(points, directions, derivative)
    at, along, starts = _continuations(targets, points, directions, spacing)

    # V = matrix·hτ + vector·hτ − hτ'/t, for τ = conj(r) f with τ' = conj(r) f' − conj(t) f, and for τ = f:
    # real rows that the matrix, and that the derivative, are applied to, for all targets at once.
    of_values, of_derivatives = np.empty((3, m, 2 * n)), np.empty((3, m, n))
    for i in range(m):
        for j in range(n):
            of_values[0, i, j], of_values[0, i, n + j] = at[i, 0, j], -at[i, 1, j]
            of_values[1, i, j], of_values[1, i, n + j] = at[i, 1, j], at[i, 0, j]
            of_values[2, i, j], of_values[2, i, n + j] = along[i, 0, j], -along[i, 1, j]
            inverse_tangent = complex(directions[0, j], -directions[1, j])
            conjugate = complex(targets[0, i] - points[0, j], points[1, j] - targets[1, i])
            weight = complex(at[i, 0, j], at[i, 1, j]) * inverse_tangent * conjugate
            of_derivatives[0, i, j], of_derivatives[1, i, j] = weight.real, weight.imag
            of_derivatives[2, i, j] = (complex(along[i, 0, j], along[i, 1, j]) * inverse_tangent).real
    sums = np.dot(of_values.reshape(3 * m, 2 * n), matrix.reshape(2 * n, n)).reshape(3, m, n)
    derivatives = np.dot(of_derivatives.reshape(3 * m, n), derivative).reshape(3, m, n)

    for i in range(m):
        start = starts[i]
        for j in range(n):
            inverse_tangent = complex(directions[0, j], -directions[1, j])
            conjugate = complex(targets[0, i] - points[0, j], points[1, j] - targets[1, i])
            local = complex(vector[0, j], vector[1, j])
            weight = complex(at[i, 0, j], at[i, 1, j])
            w = (complex(sums[0, i, j], sums[1, i, j]) + weight * local) * conjugate
            w += weight * inverse_tangent * inverse_tangent  # of conj(t)/t
            w -= complex(derivatives[0, i, j], derivatives[1, i, j])
            line = (complex(along[i, 0, j], along[i, 1, j]) * local).real
            line += sums[2, i, j] - derivatives[2, i, j]
            dx = points[0, start] - points[0, j]
            dy = points[1, start] - points[1, j]
            square = dx * dx + dy * dy if j != start else radius * radius
            isotropic = correction[start, j] - scale * (0.5 * logarithm(square) + line)
            components[0, i, j] = isotropic + 0.5 * scale * (1.0 + w.real)
            components[1, i, j] = -0.5 * scale * w.imag
            components[2, i, j] = isotropic + 0.5 * scale * (1.0 - w.real)


@compiled
def refine_single_layer(points: Array, refinement: Refinement, components: Array, first: int) -> None:
    """Replace the rows of components for targets that need a factor up to `LARGEST_REFINED`.

    Refined columns are folded back to the curve's own points.  For closer targets `close_single_layer`
    costs less.

    Parameters
    ----------
    points : (2, C, n)
        Of all curves.
    refinement : Refinement
    components : (3, ·, C·n)
        As of `stokeslets`, changed in place.
    first : int
        Number of the point in the first row.
    """
    n = points.shape[2]
    groups = refinement.groups
    for g in range(groups.shape[0]):
        target, source, factor = groups[g, 0], groups[g, 1], groups[g, 2]
        if factor == 1 or factor > LARGEST_REFINED:
            continue
        rows = refinement.rows[refinement.starts[g] : refinement.starts[g + 1]]
        fine = refined_points(points, source, factor, refinement)
        refined = np.empty((3, rows.size, fine.shape[1]))
        stokeslets(selected_points(points, target, rows), fine, refined)
        for component in range(3):
            folded = np.dot(refined[component], interpolation_to(refinement, factor))
            for k in range(rows.size):
                row = target * n + rows[k] - first
                for j in range(n):
                    components[component, row, source * n + j] = folded[k, j] / factor


@compiled
def close_single_layer(
    points: Array,
    tangents: Array,
    spacing: Array,
    refinement: Refinement,
    correction: Array,
    differentiation: Array,
    components: Array,
    first: int,
) -> None:
    """Replace the rows of components for targets too close for `refine_single_layer`.

    Parameters
    ----------
    points, tangents : (2, C, n)
        Of all curves.
    spacing : (C,)
    refinement : Refinement
    correction, differentiation : (n, n)
        As for `close_stokeslets`.
    components : (3, ·, C·n)
        Changed in place.
    first : int
        Number of the point in the first row.
    """
    n = points.shape[2]
    groups = refinement.groups
    for g in range(groups.shape[0]):
        target, source, factor = groups[g, 0], groups[g, 1], groups[g, 2]
        if factor <= LARGEST_REFINED:
            continue
        rows = refinement.rows[refinement.starts[g] : refinement.starts[g + 1]]
        close = np.empty((3, rows.size, n))
        close_stokeslets(
            selected_points(points, target, rows),
            np.ascontiguousarray(points[:, source]),
            np.ascontiguousarray(tangents[:, source]),
            spacing[source],
            correction,
            differentiation,
            close,
        )
        for component in range(3):
            for k in range(rows.size):
                for j in range(n):
                    row = target * n + rows[k] - first
                    components[component, row, source * n + j] = close[component, k, j]
