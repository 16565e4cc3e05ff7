"""Compiling what runs need, by several processes at once.

Only one process compiles a function, while others that need it wait (`solver.compilation`).  If all took the
same path they would wait all the time.  So each goes through the parts of a run in another order.
"""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from solver.analysis.diagnostics import measures
from solver.integrators.backward_differences import ROWS, interpolant, rescaling
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
        parts = _parts(with_points(scene, resolution_of(scene).points))
        first = process % len(parts)
        for part in parts[first:] + parts[:first]:
            part()


def _parts(scene: Scene) -> list[Callable[[], object]]:
    """Return what compiles the functions of a run, in parts."""
    equation, state = dense_equation(scene), placed_state(scene)
    membranes, adhesion = equation.membranes, equation.adhesion
    geometry = Geometry(membranes, state)
    closeness = Closeness(geometry) if membranes.curves > 1 else None
    scalar, vector = np.zeros_like(geometry.tangent_angle), np.zeros_like(geometry.points)
    density = vector if adhesion else None
    at_rest = Motion(geometry, closeness, vector, scalar, scalar, vector, density, None)

    def measure() -> None:
        waist_error(geometry)
        for each in measures(scene, equation).values():
            each(at_rest)

    def follow() -> None:
        inclination_by_angle(geometry.tangent_angle)
        if closeness:  # several vesicles are integrated by backward differentiation
            rescaling(1, 1.0)
            interpolant(np.zeros((ROWS, state.size)), 1, 0.0, 1.0)(0.0)

    parts: list[Callable[[], object]] = [
        lambda: equation.rate(state),
        lambda: equation.linearize(at_rest, None),
        measure,
        follow,
    ]
    if adhesion and closeness:
        parts.append(lambda: adhesion.jacobian(geometry, closeness))
    return parts
