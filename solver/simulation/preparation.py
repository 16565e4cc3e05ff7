"""Compiling what runs need, by several processes at once.

Only one process compiles a function, while others that need it wait (`solver.compilation`).  If all took the
same path they would wait all the time.  So each begins with another part of a run, and leaves one for later
that another process is at.
"""

from __future__ import annotations

from collections import deque
from contextlib import suppress
from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np

from solver.analysis.diagnostics import measures
from solver.compilation import CompiledElsewhereError, without_waiting
from solver.integrators.backward_differences import ROWS, append, extrapolate, interpolant, rescaling
from solver.integrators.propagated_error import PropagatedError, complete_source, separate
from solver.membrane.geometry import Geometry
from solver.membrane.inclination import inclination_by_angle
from solver.motion.equation import Motion
from solver.motion.terms import dense_equation
from solver.potentials.proximity import Closeness, waist_error
from solver.simulation.blas_threads import one_blas_thread
from solver.simulation.initial_state import placed_state
from solver.simulation.resolution import resolution_of, with_points

if TYPE_CHECKING:
    from collections.abc import Callable

    from solver.scene import Scene


def compile_for(scene: Scene, process: int) -> None:
    """Call each function that a run of few vesicles compiles.

    Parameters
    ----------
    scene : Scene
        For one of many vesicles nothing is done: its first evaluation takes longer than the others' waits.
    process : int
        Number of this process among those that do the same; each begins with another part.
    """
    if scene.many:
        return
    # What fails here fails in the run, too, which says why.
    with one_blas_thread(), suppress(ArithmeticError, np.linalg.LinAlgError):
        parts = deque(_parts(with_points(scene, resolution_of(scene).points)))
        parts.rotate(-process)
        busy = 0  # parts in a row that others are at
        while parts:
            try:
                with without_waiting():
                    parts[0]()
            except CompiledElsewhereError as elsewhere:
                parts.rotate(-1)
                busy += 1
                if busy >= len(parts) and not elsewhere.wait():
                    return
            else:
                parts.popleft()
                busy = 0


def _parts(scene: Scene) -> list[Callable[[], object]]:
    """Return what compiles the functions of a run, in parts."""
    equation, state = dense_equation(scene), placed_state(scene)
    membranes, adhesion = equation.membranes, equation.adhesion
    several = membranes.curves > 1

    @cache
    def geometry() -> Geometry:
        return Geometry(membranes, state)

    @cache
    def closeness() -> Closeness:
        return Closeness(geometry())

    @cache
    def at_rest() -> Motion:
        scalar, vector = np.zeros_like(geometry().tangent_angle), np.zeros_like(geometry().points)
        density = vector if adhesion else None
        return Motion(geometry(), None, vector, scalar, scalar, vector, density, None)

    def follow() -> None:
        inclination_by_angle(membranes.tangent_angle(state))
        if several:  # several vesicles are integrated by backward differentiation
            rescaling(1, 1.0)
            table = np.zeros((ROWS, state.size))
            extrapolate(table, np.ones(1), state.copy(), state.copy())
            append(table, 1, state)
            interpolant(table, 1, 0.0, 1.0)(0.0)
            equation.symmetries(state)
            directions = np.zeros((ROWS, 1 + membranes.count, state.size))
            errors, error = np.zeros((ROWS, state.size, 2)), np.zeros((state.size, 2))
            complete_source(1.0, state, 1.0, error, error.copy())
            separate(0, errors, directions, np.zeros((1 + membranes.count, 2)))
            PropagatedError(equation.rate, error, directions, 0.0).interpolant(1, 0.0, 1.0)

    parts: list[Callable[[], object]] = [
        lambda: equation.rate(state),
        follow,
        lambda: waist_error(geometry()),
        lambda: equation.linearize(at_rest(), None),
    ]
    if adhesion and several:
        of_adhesion = adhesion.jacobian, adhesion.energy, adhesion.density
        parts += [partial(lambda compute: compute(geometry(), closeness()), each) for each in of_adhesion]
    if (restoring := equation.restoring) is not None:
        parts.append(lambda: restoring.rate(geometry()))
    for measure in measures(scene, equation).values():
        parts.append(partial(lambda measured: measured(at_rest()), measure))
    return parts
