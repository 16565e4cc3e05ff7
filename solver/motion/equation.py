"""Which form of the equation of motion serves a scene: with a matrix over all points, or with sums."""

from __future__ import annotations

from solver.motion.dense import DenseEquation
from solver.motion.summed import SummedEquation
from solver.parallel import Parallel
from solver.scene import Scene

EquationOfMotion = DenseEquation | SummedEquation


def equation_of_motion(scene: Scene, parallel: Parallel) -> EquationOfMotion:
    """The terms of a scene, computed together by these ranks."""
    return SummedEquation.of(scene, parallel) if scene.many else DenseEquation.of(scene, parallel)
