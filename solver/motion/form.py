"""The one place where a scene gets its form of the equation of motion."""

from __future__ import annotations

from solver.motion.dense import DenseEquation
from solver.motion.equation import EquationOfMotion
from solver.motion.summed import SummedEquation
from solver.parallel import Parallel
from solver.scene import Scene


def equation_of_motion(scene: Scene, parallel: Parallel) -> EquationOfMotion:
    """Make the equation of motion of a scene: with a matrix over all points, or with sums.

    Parameters
    ----------
    scene : Scene
        Its number of points is given.
    parallel : Parallel
        The ranks that compute the run together.

    Returns
    -------
    EquationOfMotion
    """
    return SummedEquation.of(scene, parallel) if scene.many else DenseEquation.of(scene, parallel)
