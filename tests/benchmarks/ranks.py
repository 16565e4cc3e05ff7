"""One rank against two for scenes of M vesicles: an evaluation, a short run, and what the collectives cost.

    mpirun -n 2 python tests/benchmarks/ranks.py [--vesicles 64] [--points 64] [--horizon 0.5] [--json]

One rank and all of them take turns in one process group, so that both meet the same machine, and the best of
the repetitions counts.  Wall time means something on idle cores only.  The time of the processor that a rank
spends outside of collectives depends less on who else is there: the one of one rank over the largest of all
is what sharing out the work gains when communication costs nothing.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import time
from typing import Any

import numpy as np
from mpi4py import MPI
from numpy.typing import NDArray

from ensemble.mpi.ranks import Ranks
from solver.motion.terms import equation_of_motion
from solver.parallel import SERIAL, Parallel
from solver.scene import Scene
from solver.simulation.initial_state import placed_state
from solver.simulation.simulate import simulate

Array = NDArray[np.float64]


_EVALUATIONS = 20


class TimedCommunicator:
    """A communicator that adds up the processor's time spent in it."""

    def __init__(self, communicator: Any) -> None:
        self._communicator = communicator
        self.seconds = 0.0
        self.calls = 0

    def __getattr__(self, name: str) -> Any:
        method = getattr(self._communicator, name)
        if not callable(method):
            return method

        def timed(*arguments: Any) -> Any:
            began = time.process_time()
            try:
                return method(*arguments)
            finally:
                self.seconds += time.process_time() - began
                self.calls += 1

        return timed


def suspension(vesicles: int, points: int, area_fraction: float, horizon: float) -> Scene:
    """Vesicles at random places in shear, with adhesion."""
    return Scene.model_validate(
        {
            "horizon": horizon,
            "arrangement": {
                "kind": "random",
                "count": vesicles,
                "area_fraction": area_fraction,
                "minimum_distance": 0.3,
                "seed": 1,
            },
            "adhesion": {"hamaker": 1.0, "distance": 0.4},
            "flow": {"kind": "shear", "rate": 1.0},
            "numerics": {"points": points},
        }
    )


def evaluation_seconds(scene: Scene, parallel: Parallel, timed: TimedCommunicator) -> tuple[float, float]:
    """Wall time of a right-hand side from a known tension, and the processor's outside of collectives."""
    state = placed_state(scene)
    equation = equation_of_motion(scene, parallel)
    random = np.random.default_rng(0)
    equation.rate(state)
    equation.jacobian(state)
    best = best_processor = np.inf
    for _ in range(_EVALUATIONS):
        equation.rate(state + 1e-3 * random.standard_normal(state.size))
        near = state + 1e-13 * random.standard_normal(state.size)  # the motion in the state itself is known
        began, processor, waited = time.perf_counter(), time.process_time(), timed.seconds
        equation.rate(near)
        best = min(best, time.perf_counter() - began)
        best_processor = min(best_processor, time.process_time() - processor - (timed.seconds - waited))
    return best, best_processor


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--vesicles", type=int, default=64)
    parser.add_argument("--points", type=int, default=64)
    parser.add_argument("--area-fraction", type=float, default=0.2)
    parser.add_argument("--horizon", type=float, default=0.5)
    parser.add_argument("--repetitions", type=int, default=5)
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    options = parser.parse_args()
    world = MPI.COMM_WORLD
    scene = suspension(options.vesicles, options.points, options.area_fraction, options.horizon)
    found: dict[str, list[float]] = {}

    def note(name: str, value: float) -> None:
        found.setdefault(name, []).append(value)

    for _ in range(options.repetitions):
        for name in ("one", "all"):
            world.barrier()
            timed = TimedCommunicator(world)
            if name == "one" and world.rank > 0:
                # Waits without taking the processor from the first rank.
                request = world.irecv(source=0, tag=1)
                while not request.test()[0]:
                    time.sleep(0.01)
                continue
            parallel = SERIAL if name == "one" else Ranks(timed)
            wall, processor = evaluation_seconds(scene, parallel, timed)
            began, started, waited = time.perf_counter(), time.process_time(), timed.seconds
            run = simulate(scene, parallel=parallel)
            run_wall = time.perf_counter() - began
            run_processor = time.process_time() - started - (timed.seconds - waited)
            if name == "one":
                for other in range(1, world.size):
                    world.send(None, dest=other, tag=1)
            else:
                processor = world.allreduce(processor, MPI.MAX)
                run_processor = world.allreduce(run_processor, MPI.MAX)
            note(f"evaluation wall {name}", wall)
            note(f"evaluation processor {name}", processor)
            note(f"run wall {name}", run_wall)
            note(f"run processor {name}", run_processor)
    if world.rank:
        return
    best = {name: min(values) for name, values in found.items()}
    kinds = [f"{what} {clock}" for what in ("evaluation", "run") for clock in ("wall", "processor")]
    report = {
        "ranks": world.size,
        "vesicles": options.vesicles,
        "points": options.points,
        "load": os.getloadavg()[0],
        "memory_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        "steps": run.work.steps,
        "evaluations": run.work.rhs_evaluations,
        "tension_iterations": run.work.tension_iterations,
        "seconds": best,
        "one_over_all": {kind: best[f"{kind} one"] / best[f"{kind} all"] for kind in kinds},
    }
    if options.json:
        print(json.dumps(report, indent=2))
        return
    for name, value in report.items():
        if not isinstance(value, dict):
            print(f"{name:20} {value:.4g}")
    for kind in kinds:
        one, everyone = best[f"{kind} one"], best[f"{kind} all"]
        print(f"{kind:22} one {one:8.4f} s   all {everyone:8.4f} s   ratio {one / everyone:.2f}")


if __name__ == "__main__":
    main()
