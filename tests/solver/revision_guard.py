"""Short runs whose digits tell one revision of the results from the next.

``python -m tests.solver.revision_guard`` computes them and writes `revision_results.json`.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np

from solver import RESULTS_REVISION, Run, Scene, simulate
from solver.flows import Extension, Shear, Trap
from solver.scene import Numerics, PowerLaw, Start, Vesicle
from tests.solver.scenes import shear_pair, uneven_pair, with_contrasts
from tests.solver.suspensions import suspension

STORED = Path(__file__).with_name("revision_results.json")

# Between processors results differ by less than a tenth of this, most by less than a thousandth; measured.
TOLERANCE = 1e-9


def _numerics(integrator: str, **fields: object) -> Numerics:
    return Numerics.model_validate({"points": 32, "tolerance": 1e-4, "integrator": integrator, **fields})


SHORT = {"horizon": 1.0}
CLOSE = (Vesicle(center=(-0.8, 0.0)), Vesicle(length=5.0, center=(0.6, 0.0), angle=1.4))
SCENES = {
    "one": Scene(vesicles=(Vesicle(reduced_area=0.8),), flow=Shear(rate=1.0), **SHORT),
    "pair": shear_pair(1.5, numerics=Numerics(points="auto"), horizon=3.0),
    "bdf": uneven_pair(flow=Shear(rate=0.5), numerics=_numerics("bdf"), **SHORT),
    "rosenbrock": uneven_pair(flow=Extension(rate=0.3), numerics=_numerics("rosenbrock"), **SHORT),
    "sdc": uneven_pair(flow=Trap(rate=0.3), numerics=_numerics("sdc"), **SHORT),
    "sdc-area": uneven_pair(numerics=_numerics("sdc", order=2, step_control="area-length"), **SHORT),
    "imex-euler": uneven_pair(numerics=_numerics("imex-euler", tolerance=1e-3), **SHORT),
    "exponents": uneven_pair(exponents=(5, 3), numerics=_numerics("bdf"), **SHORT),
    "cutoff": uneven_pair(
        adhesion=PowerLaw(hamaker=1.5, distance=0.4, cutoff=1.1), numerics=_numerics("bdf"), **SHORT
    ),
    "close": uneven_pair(vesicles=CLOSE, adhesion=None, flow=Shear(rate=0.5), horizon=0.5),
    "contrast": with_contrasts(
        uneven_pair(flow=Shear(rate=0.5), numerics=_numerics("bdf"), **SHORT), 3.0, 0.5
    ),
    "relaxed": uneven_pair(
        flow=Trap(rate=0.02),
        start=Start(relaxed=True, tilt=0.05),
        numerics=_numerics("bdf", tolerance=1e-3),
        **SHORT,
    ),
    "many-bdf": suspension(7, numerics=_numerics("bdf"), horizon=0.3),
    "many-sdc": suspension(7, numerics=_numerics("sdc"), horizon=0.3),
    "many-cutoff": suspension(
        7,
        adhesion=PowerLaw(hamaker=1.0, distance=0.4, cutoff=1.2),
        numerics=_numerics("bdf"),
        horizon=0.3,
    ),
}


def results(scene: Scene) -> dict[str, list[float]]:
    """Run a scene; return numbers of order 1 that stand for its results, by name."""
    run: Run = simulate(scene)
    if run.failure:
        raise AssertionError(run.failure)
    frames = run.frames
    every = max(frames.tangent_angle.shape[-1] // 4, 1)
    samples = {name: [float(values[-1])] for name, values in run.series.items() if "error" not in name}
    return samples | {
        "points": [float(run.work.points or 0)],
        "tangent_angle": frames.tangent_angle[-1, :, ::every].ravel().tolist(),
        "center": frames.center[-1].ravel().tolist(),
        "tension": frames.tension[-1, :, ::every].ravel().tolist(),
    }


def largest_change(found: dict[str, list[float]], stored: dict[str, list[float]]) -> float:
    """Return the largest difference of a number, relative if it is more than 1; infinite if one is new."""
    if {name: len(values) for name, values in found.items()} != {
        name: len(values) for name, values in stored.items()
    }:
        return float("inf")
    changes = [
        np.abs(np.subtract(values, stored[name])) / np.maximum(np.abs(stored[name]), 1.0)
        for name, values in found.items()
    ]
    return float(max(change.max() for change in changes))


def main() -> None:
    """Write the results of this revision, unless they are those of the one that is stored."""
    found = {name: results(scene) for name, scene in SCENES.items()}
    stored = json.loads(STORED.read_text()) if STORED.exists() else {"revision": 0, "results": {}}
    shared = found.keys() & stored["results"].keys()
    changes = {name: largest_change(found[name], stored["results"][name]) for name in sorted(shared)}
    for name, change in changes.items():
        print(f"{name}: {change:.1e}")
    changed = [name for name, change in changes.items() if change > TOLERANCE]
    if changed and stored["revision"] >= RESULTS_REVISION:
        sys.exit(f"raise RESULTS_REVISION first: the results of {', '.join(changed)} have changed")
    STORED.write_text(json.dumps({"revision": RESULTS_REVISION, "results": found}, indent=1) + "\n")


if __name__ == "__main__":
    main()
