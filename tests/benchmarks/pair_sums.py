"""Pairs per second of the sums that adhesion consists of, beside the loop that one writes down.

    python -m tests.benchmarks.pair_sums [--json]

As in `tests.benchmarks.direct_sum` only ratios within one run mean something.  What the plain loop has in the
place of a formula is the power law (4, 2), with exponents known at run time.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable

import numpy as np
from numba import njit

from solver.forces.pair_formulas import formula_and_parameters
from solver.forces.pair_sums import add_forces, add_stiffnesses, pair_energy, pair_hessian
from solver.pair_potentials import PAIR_POTENTIALS, PairPotential, PowerLaw
from tests.benchmarks.direct_sum import best_seconds

POINTS = 128
PLAIN = "plain Numba force, (4, 2)"


@njit(fastmath=True)
def plain(targets, sources, weights, distance, m, n, out):  # type: ignore[no-untyped-def]
    """The force of a power law as one writes it down."""
    for i in range(targets.shape[1]):
        for j in range(sources.shape[1]):
            dx = targets[0, i] - sources[0, j]
            dy = targets[1, i] - sources[1, j]
            square = dx * dx + dy * dy
            ratio = distance / np.sqrt(square)
            pull = m * weights[j] / square * (ratio**m - ratio**n)
            out[0, i] += pull * dx
            out[1, i] += pull * dy


def potentials() -> dict[str, PairPotential]:
    """Every registered potential with its defaults, and power laws that differ in how they are computed."""
    common = {"hamaker": 1.0, "distance": 0.4}
    found: dict[str, PairPotential] = {model(**common).kind: model(**common) for model in PAIR_POTENTIALS}
    for exponents in ((12, 6), (5, 3)):
        found[f"power-law {exponents}"] = PowerLaw(**common, exponents=exponents)
    found["power-law, cutoff"] = PowerLaw(**common, cutoff=3.0)
    return found


def tasks() -> dict[str, Callable[[], object]]:
    """The sums over random points that lie apart, by name."""
    random = np.random.default_rng(0)
    targets, sources = random.uniform(0, 1, (2, POINTS)), random.uniform(1.5, 2.5, (2, POINTS))
    weights, out = np.full(POINTS, 0.05), np.zeros((3, POINTS))
    hessian = np.empty((3, POINTS, POINTS))
    result: dict[str, Callable[[], object]] = {
        PLAIN: lambda: plain(targets, sources, weights, 0.4, 4, 2, out[:2])
    }
    for name, potential in potentials().items():
        law = formula_and_parameters(potential)
        result[f"{name}: energy"] = lambda law=law: pair_energy(*law, targets, sources, weights)
        result[f"{name}: force"] = lambda law=law: add_forces(*law, targets, sources, weights, 1.0, out[:2])
        result[f"{name}: stiffness"] = lambda law=law: add_stiffnesses(
            *law, targets, sources, weights, 1.0, out
        )
        result[f"{name}: Hessian"] = lambda law=law: pair_hessian(*law, targets, sources, 0.05, hessian)
    return result


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON document")
    as_json = parser.parse_args().json
    seconds = best_seconds(tasks(), 500)
    rows = {
        name: {"pairs_per_second": POINTS**2 / best, "over_plain": seconds[PLAIN] / best}
        for name, best in seconds.items()
    }
    if as_json:
        print(json.dumps(rows, indent=2))
        return
    for name, row in rows.items():
        print(f"{name:32} {row['pairs_per_second']:9.2e} pairs/s; {row['over_plain']:5.2f} times plain")


if __name__ == "__main__":
    main()
