"""What `test_ranks` runs under a launcher: the same computations on however many ranks, saved by each."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ensemble.mpi.ranks import Ranks
from ensemble.mpi.world import abort_guard, world
from solver.analysis.run import Run
from solver.motion.terms import dense_equation, summed_equation
from solver.parallel import SERIAL, Parallel
from solver.scene import LARGEST_DENSE, Numerics, PowerLaw, Scene, Shear, Trap, Vesicle
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate
from tests.solver.scenes import shear_pair, uneven_pair
from tests.solver.suspensions import suspension

Array = NDArray[np.float64]

# A vesicle alone; two alike, of which one is computed; two that differ, so close that the sums are refined.
SCENES = {
    "one": Scene(horizon=1.0, vesicles=(Vesicle(),), flow=Shear(rate=0.5)),
    "pair": shear_pair(1.5),
    "close": uneven_pair(
        flow=Trap(rate=0.3),
        vesicles=(Vesicle(center=(-0.8, 0.0)), Vesicle(length=5.0, center=(0.6, 0.0), angle=1.4)),
    ),
    "cutoff": uneven_pair(adhesion=PowerLaw(hamaker=1.5, distance=0.4, cutoff=1.1)),
}
CUTOFF = suspension(LARGEST_DENSE + 1, adhesion=PowerLaw(hamaker=1.0, distance=0.4, cutoff=1.2))
MANY = suspension(LARGEST_DENSE + 1, horizon=0.2)
DOUBLET = shear_pair(3.5, numerics=Numerics(points=32, tolerance=1e-3))


def linearized(scene: Scene, parallel: Parallel) -> tuple[Array, Array]:
    """Right-hand side and Jacobian where a scene begins."""
    dynamics, state = dense_equation(scene, parallel), placed_state(scene)
    return dynamics.rate(state), dynamics.jacobian(state).matrix


def summed(scene: Scene, parallel: Parallel) -> tuple[Array, Array]:
    """Right-hand side and energy of adhesion of many vesicles where a scene begins."""
    sums = summed_equation(scene, parallel)
    motion = sums.motion(placed_state(scene))
    assert sums.adhesion
    assert motion.closeness
    return motion.rate, np.array([sums.adhesion.energy(motion.geometry, motion.closeness)])


def summary(run: Run) -> Array:
    """What a run says, and the states that it recorded, as numbers."""
    said = [run.period or 0.0, run.time, run.energy.bending, run.energy.adhesion or 0.0, run.work.steps]
    return np.concatenate(
        [said, *(values.ravel() for values in (run.frames.center, run.frames.tangent_angle))]
    )


def computed(parallel: Parallel) -> dict[str, Array]:
    """Everything that is compared."""
    found = {}
    for name, scene in SCENES.items():
        found[f"{name} rate"], found[f"{name} jacobian"] = linearized(scene, parallel)
    found["many rate"], found["many energy"] = summed(MANY, parallel)
    found["many cutoff rate"], found["many cutoff energy"] = summed(CUTOFF, parallel)
    found["many"] = summary(simulate(MANY, parallel=parallel))
    found["doublet"] = summary(simulate(DOUBLET, parallel=parallel))
    return found


if __name__ == "__main__":
    communicator = world()
    with abort_guard(communicator):
        ranks = Ranks(communicator)
        np.savez(Path(sys.argv[1]) / f"{ranks.rank}.npz", **computed(ranks if ranks.size > 1 else SERIAL))
