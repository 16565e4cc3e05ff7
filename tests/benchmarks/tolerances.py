"""Measures what a tolerance in time costs and leaves: evaluations and errors of the default integrator.

Run it from the repository's root with ``python -m tests.benchmarks.tolerances``.  Errors are those of the
centers at all recorded frames, root mean square, against a run at a tolerance of 1e-9.
"""

from __future__ import annotations

import numpy as np

from ensemble.config.documents import load_scene
from solver.analysis.run import Array, Run
from solver.simulation.simulate import simulate

REFERENCE = 1e-9
TOLERANCES = (1e-4, 3e-5, 1e-5)
_ON = ("criteria.revolutions=20", "output.frame_interval=2.0")
SCENES = {
    "shear, H = 1.5": ("doublet-shear", (*_ON, "horizon=100")),
    "shear, H = 0.7": ("doublet-shear", (*_ON, "horizon=100", "adhesion.hamaker=0.7")),
    "shear, H = 0.38": ("doublet-shear", (*_ON, "horizon=260", "adhesion.hamaker=0.38")),
    "shear, adhesion distance 0.1": (
        "doublet-shear",
        (*_ON, "horizon=100", "adhesion.distance=0.1", "adhesion.hamaker=2.5"),
    ),
    "shear, contrast 6": (
        "doublet-shear",
        (*_ON, "horizon=100", "adhesion.hamaker=0.6", "vesicles.viscosity_contrast=6.0"),
    ),
    "trap": ("doublet-trap", (*_ON, "horizon=20", "criteria.steady_time=500")),
    "unequal pair": ("doublet-unequal", (*_ON, "horizon=60")),
    "extension": ("pair-extension", (*_ON, "horizon=20")),
}


def _run(name: str, tolerance: float) -> Run:
    preset, changes = SCENES[name]
    return simulate(load_scene(preset, [*changes, f"numerics.tolerance={tolerance}"]))


def _places(run: Run) -> dict[float, Array]:
    times = np.round(run.frames.time, 6)
    return dict(zip(times.tolist(), run.frames.center, strict=True))


def _error(run: Run, exact: dict[float, Array]) -> float:
    common = [(place, exact[time]) for time, place in _places(run).items() if time in exact]
    largest = [np.abs(place - other).max() for place, other in common]
    return float(np.sqrt(np.mean(np.square(largest))))


def measure() -> None:
    """Print a row for each scene and the mean ratios to the first tolerance."""
    ratios: dict[float, list[tuple[float, float]]] = {tolerance: [] for tolerance in TOLERANCES}
    print("| scene | tolerance | evaluations | error |\n|---|---|---|---|")
    for name in SCENES:
        exact, first = _places(_run(name, REFERENCE)), None
        for tolerance in TOLERANCES:
            run = _run(name, tolerance)
            found = run.work.rhs_evaluations, _error(run, exact)
            first = found if first is None else first
            ratios[tolerance].append((found[0] / first[0], first[1] / found[1]))
            print(f"| {name} | {tolerance:g} | {found[0]} | {found[1]:.1e} |", flush=True)
    for tolerance, pairs in ratios.items():
        more, less = np.exp(np.log(pairs).mean(axis=0))
        print(f"{tolerance:g}: {100 * (more - 1):.0f} % more evaluations for {less:.1f} times less error")


if __name__ == "__main__":
    measure()
