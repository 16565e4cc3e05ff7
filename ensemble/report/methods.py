"""The integrators that the work-precision report compares, and at which resolutions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from solver.integrators import usual_integrator
from solver.scene import Numerics


@dataclass(frozen=True)
class Method:
    """An integrator as a scene chooses it: its name in the report, and the fields of `Numerics`."""

    name: str
    numerics: Mapping[str, Any]

    def at(self, points: int, tolerance: float, work_limit: int) -> Numerics:
        """Return the numerics of one run."""
        return Numerics.model_validate(
            {"points": points, "tolerance": tolerance, "work_limit": work_limit} | dict(self.numerics)
        )


def usual(vesicles: int) -> Method:
    """Return the method that a scene with this number of vesicles gets by default."""
    return {"bdf": BDF, "rosenbrock": ROSENBROCK}[usual_integrator(vesicles)]


def deferred_correction(order: int) -> Method:
    """Return spectral deferred correction of an order."""
    return Method(f"SDC, order {order}", {"integrator": "sdc", "order": order})


BDF = Method("BDF", {"integrator": "bdf"})
ROSENBROCK = Method("Rosenbrock, order 5", {"integrator": "rosenbrock"})
EULER = Method("IMEX-Euler", {"integrator": "imex-euler"})
PUBLISHED = Method(
    "SDC, order 2, steps by area and length",
    {"integrator": "sdc", "order": 2, "step_control": "area-length"},
)


@dataclass(frozen=True)
class Plan:
    """What is run: every method at every number of points, from the loosest tolerance to the tightest.

    methods : the first makes the converged runs.
    work_limit : evaluations after which a run is given up, and tighter tolerances with it.
    reference : points and tolerance of the converged run.
    control : those of the run whose distance from it tells how far the converged run can be trusted.
    answer_tolerances, answer_reference : the same for period and viscosity.
    search_tolerances : of the runs in searches for the critical adhesion strength.
    bracket : relative width to which these searches go.
    """

    methods: tuple[Method, ...]
    points: tuple[int, ...]
    tolerances: tuple[float, ...]
    work_limit: int
    reference: tuple[int, float]
    control: tuple[int, float]
    answer_points: int
    answer_tolerances: tuple[float, ...]
    answer_reference: tuple[int, float]
    search_tolerances: tuple[float, ...]
    bracket: float


QUICK = Plan(
    methods=(BDF, ROSENBROCK, deferred_correction(2), deferred_correction(4), EULER),
    points=(48, 96),
    tolerances=(1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7),
    work_limit=5_000,
    reference=(128, 1e-9),
    control=(112, 1e-8),
    answer_points=64,
    answer_tolerances=(1e-2, 1e-3, 1e-4),
    answer_reference=(80, 1e-7),
    search_tolerances=(),
    bracket=0.002,
)
FULL = Plan(
    methods=(BDF, ROSENBROCK, *map(deferred_correction, range(2, 7)), PUBLISHED, EULER),
    points=(32, 64, 128),
    tolerances=(1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6, 1e-7, 1e-8),
    work_limit=100_000,
    reference=(160, 1e-10),
    control=(128, 1e-9),
    answer_points=64,
    answer_tolerances=(1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6),
    answer_reference=(128, 1e-8),
    search_tolerances=(1e-2, 1e-3, 1e-4, 1e-5),
    bracket=0.002,  # narrow enough to see what the tolerance does
)
