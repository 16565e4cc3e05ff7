"""A store with runs and a boundary, made without simulations."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

from ensemble.config.documents import load_study
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.store import Store
from solver.analysis.run import Outcome
from tests.ensemble.runs import failed_run, shear_run, shear_scene

RATES = (0.5, 0.625, 0.75, 0.875, 1.0)
FRAMES = 10
SWEEP = (0.25, 0.5, 1.0, 1.5)


def critical(rate: float) -> float:
    """Return the critical value of the example boundary, a parabola."""
    return 0.1 + 0.5 * rate + 0.05 * rate**2


def example_boundary() -> Boundary:
    """Return a boundary of four converged points on `critical` and one whose search is not finished."""
    study = load_study("critical-hamaker")
    points = [
        BoundaryPoint(
            parameters={"flow.rate": rate},
            bracket=(critical(rate) / 1.005, critical(rate) * 1.005),
            outcomes=("separated", "bound"),
            status="converged",
            certified=False,
            runs=[],
        )
        for rate in SWEEP
    ]
    searching = BoundaryPoint(
        parameters={"flow.rate": 2.0},
        bracket=(0.5, None),
        outcomes=("separated", None),
        status="searching",
        certified=False,
        runs=[],
    )
    return Boundary(
        study_key=study.key,
        study=study.model_dump(mode="json"),
        name=study.name,
        points=[*points, searching],
        updated=datetime.now(UTC),
    )


def fill(path: Path) -> Path:
    """Make a store with a run at each of `RATES` (bound from 0.75), a failed run and the example boundary."""
    with Store.open(path) as store:
        for number, rate in enumerate(RATES):
            outcome = Outcome.BOUND if rate >= 0.75 else Outcome.SEPARATED
            store.save(shear_run(shear_scene(rate=rate), outcome, seed=number, frames=FRAMES))
        store.save(failed_run())
        store.save_boundary(example_boundary())
    return path
