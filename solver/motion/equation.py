"""Which form of the equation of motion serves a scene: with a matrix over all points, or with sums."""

from __future__ import annotations

from solver.motion.dense import Dynamics
from solver.motion.summed import Suspension
from solver.parallel import Parallel
from solver.scene import Scene

EquationOfMotion = Dynamics | Suspension


def equation_of_motion(scene: Scene, parallel: Parallel) -> EquationOfMotion:
    """The terms of a scene, computed together by these ranks."""
    return Suspension.of(scene, parallel) if scene.many else Dynamics.of(scene, parallel)
