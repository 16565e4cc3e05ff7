"""Pairs per second and error of Stokeslet direct sums, and the time of one evaluation beside them.

    python tests/benchmarks/direct_sum.py [--json]

Everything runs on one thread in one process, in turns, and the best of many repetitions counts: on a machine
that others use, only ratios within one run mean something.  pykeops takes part if it is installed.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import os
import sys
import time
from collections.abc import Callable, Mapping
from itertools import cycle
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from ensemble.config.documents import load_scene
from solver.motion.terms import dense_equation
from solver.potentials.direct_sum import velocity
from solver.simulation.simulate import simulate

Array = NDArray[np.float64]
Sum = Callable[[Array, Array, Array], Array]

POINTS = 2048
RESOLUTIONS = (64, 128)
_STATES = 8  # that are evaluated in turns
BASELINE = "plain Numba"


@njit(fastmath=True)
def plain(targets, sources, forces):  # type: ignore[no-untyped-def]
    """The direct sum as one writes it down."""
    result = np.empty_like(targets)
    for i in range(targets.shape[1]):
        ux = uy = 0.0
        for j in range(sources.shape[1]):
            dx = targets[0, i] - sources[0, j]
            dy = targets[1, i] - sources[1, j]
            r2 = dx * dx + dy * dy
            if r2 > 0.0:
                logarithm = -0.5 * np.log(r2)
                along = (dx * forces[0, j] + dy * forces[1, j]) / r2
                ux += logarithm * forces[0, j] + along * dx
                uy += logarithm * forces[1, j] + along * dy
        result[0, i] = ux / (4.0 * np.pi)
        result[1, i] = uy / (4.0 * np.pi)
    return result


def pykeops_sum() -> Sum | None:
    """The direct sum by pykeops, None if that is not installed.  It knows no coincident points."""
    try:
        import pykeops
        from pykeops.numpy import Genred
    except ImportError:
        return None
    pykeops.set_verbose(False)
    reduction = Genred(
        "((x - y) | f) / SqDist(x, y) * (x - y) - IntInv(2) * Log(SqDist(x, y)) * f",
        ["x = Vi(2)", "y = Vj(2)", "f = Vj(2)"],
        reduction_op="Sum",
        axis=1,
    )

    def total(targets: Array, sources: Array, forces: Array) -> Array:
        rows = (np.ascontiguousarray(array.T) for array in (targets, sources, forces))
        return reduction(*rows, backend="CPU").T / (4.0 * np.pi)

    return total


def extended(targets: Array, sources: Array, forces: Array) -> NDArray[np.longdouble]:
    """The direct sum in extended precision."""
    targets, sources, forces = (array.astype(np.longdouble) for array in (targets, sources, forces))
    dx, dy = targets[:, :, None] - sources[:, None, :]
    r2 = dx**2 + dy**2
    logarithm = -np.log(r2) / 2
    along = (dx * forces[0] + dy * forces[1]) / r2
    four_pi = 16 * np.arctan(np.longdouble(1))
    components = ((logarithm * forces[0] + along * dx), (logarithm * forces[1] + along * dy))
    return np.array([component.sum(axis=1) for component in components]) / four_pi


def best_seconds(tasks: Mapping[str, Callable[[], Any]], repetitions: int) -> dict[str, float]:
    """Shortest time of each task, all run in turns."""
    best = dict.fromkeys(tasks, np.inf)
    for _ in range(repetitions):
        for name, task in tasks.items():
            began = time.perf_counter()
            task()
            best[name] = min(best[name], time.perf_counter() - began)
    return best


def direct_sums() -> dict[str, dict[str, float]]:
    """Rate and error of every sum, and its rate over those of the others."""
    random = np.random.default_rng(0)
    arrays = tuple(random.standard_normal((2, POINTS)) for _ in range(3))
    sums: dict[str, Sum] = {"ours": velocity, BASELINE: plain}
    if keops := pykeops_sum():
        sums["pykeops"] = keops
    exact = extended(*arrays)
    errors = {
        name: float(np.abs(total(*arrays) - exact).max() / np.abs(exact).max())
        for name, total in sums.items()
    }
    seconds = best_seconds({name: lambda total=total: total(*arrays) for name, total in sums.items()}, 40)
    return {
        name: {
            "pairs_per_second": POINTS**2 / seconds[name],
            "ours_over_this": seconds[name] / seconds["ours"],
            "relative_error": errors[name],
        }
        for name in sums
    }


def evaluation(points: int) -> dict[str, float]:
    """Time of `DenseEquation.rate` for a tumbling doublet, and of the baseline for as many pairs of points.

    More states take turns than there are whose motions are kept.  The preconditioner for the tension is from
    another one, as it may be in a run.
    """
    scene = load_scene("doublet-shear", [f"numerics.points={points}", "horizon=20"])
    frames = simulate(scene).frames
    dynamics = dense_equation(scene)
    membranes = dynamics.membranes
    states = cycle(
        [
            membranes.pack(frames.tangent_angle[k, : membranes.count], frames.center[k, : membranes.count])
            for k in range(-_STATES, 0)
        ]
    )
    random = np.random.default_rng(0)
    arrays = tuple(random.standard_normal((2, 2 * points)) for _ in range(3))
    tasks = {
        "evaluation": lambda: dynamics.rate(next(states)),
        "baseline": lambda: plain(*arrays),
        "ours": lambda: velocity(*arrays),
    }
    seconds = best_seconds(tasks, 1000)
    if dynamics.evaluations < 1000:
        raise RuntimeError("motions that were known have been timed: more states have to take turns")
    return {
        "points": points,
        "pairs": (2 * points) ** 2,
        "evaluation_ms": 1e3 * seconds["evaluation"],
        "baseline_ms": 1e3 * seconds["baseline"],
        "direct_sum_ms": 1e3 * seconds["ours"],
        "evaluation_over_baseline": seconds["evaluation"] / seconds["baseline"],
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    as_json = parser.parse_args().json
    # pykeops reads this when it loads its compiled sum, and announces what it does on standard output.
    os.environ["OMP_NUM_THREADS"] = "1"
    with threadpool_limits(1), contextlib.redirect_stdout(sys.stderr):
        sums = direct_sums()
        evaluations = [evaluation(points) for points in RESOLUTIONS]
    if as_json:
        print(json.dumps({"direct_sums": sums, "evaluations": evaluations}, indent=2))
        return
    print(f"Stokeslet direct sum, {POINTS} sources and targets")
    for name, row in sums.items():
        print(
            f"  {name:12} {row['pairs_per_second']:9.2e} pairs/s; ours {row['ours_over_this']:5.2f} times;"
            f" error {row['relative_error']:.1e}"
        )
    print("Evaluation of doublet-shear, and direct sums of (2N)² pairs")
    for row in evaluations:
        print(
            f"  N = {row['points']:3}   evaluation {row['evaluation_ms']:.3f} ms"
            f" = {row['evaluation_over_baseline']:.2f} × {BASELINE} ({row['baseline_ms']:.3f} ms);"
            f" ours {row['direct_sum_ms']:.3f} ms"
        )


if __name__ == "__main__":
    main()
