"""The integrators that the work-precision report compares, and their resolutions and tolerances."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from solver.integrators import usual_integrator
from solver.scene import Numerics


@dataclass(frozen=True)
class ComparedMethod:
    """An integrator that is compared with others.

    Attributes
    ----------
    name : str
        Its name in the report.
    numerics : mapping of str to any
        The fields of `solver.scene.Numerics` that choose it.
    """

    name: str
    numerics: Mapping[str, Any]

    def at(self, points: int, tolerance: float, work_limit: int) -> Numerics:
        """Return the numerics of one run with this method.

        Parameters
        ----------
        points : int
            Points on each vesicle.
        tolerance : float
            Tolerance of the time steps.
        work_limit : int
            Evaluations after which the run is given up.

        Returns
        -------
        Numerics
            All numerics of the run.
        """
        return Numerics.model_validate(
            {"points": points, "tolerance": tolerance, "work_limit": work_limit} | dict(self.numerics)
        )


def default_method(vesicles: int) -> ComparedMethod:
    """Return the method that a scene has by default.

    Parameters
    ----------
    vesicles : int
        Number of vesicles in the scene.

    Returns
    -------
    ComparedMethod
        One of `BDF` and `ROSENBROCK`.
    """
    return {"bdf": BDF, "rosenbrock": ROSENBROCK}[usual_integrator(vesicles)]


def deferred_correction(order: int) -> ComparedMethod:
    """Return spectral deferred correction of an order.

    Parameters
    ----------
    order : int
        From 2 to 8.

    Returns
    -------
    ComparedMethod
        The method.
    """
    return ComparedMethod(f"SDC, order {order}", {"integrator": "sdc", "order": order})


BDF = ComparedMethod("BDF", {"integrator": "bdf"})
ROSENBROCK = ComparedMethod("Rosenbrock, order 5", {"integrator": "rosenbrock"})
EULER = ComparedMethod("IMEX-Euler", {"integrator": "imex-euler"})
# The paper's method (Quaife et al. 2019, appendix on the integral equation formulation).
PUBLISHED = ComparedMethod(
    "SDC, order 2, steps by area and length",
    {"integrator": "sdc", "order": 2, "step_control": "area-length"},
)


@dataclass(frozen=True)
class WorkPrecisionPlan:
    """What is run: every method at every number of points, from the loosest tolerance to the tightest.

    Attributes
    ----------
    methods : tuple of ComparedMethod
        The first one makes the converged runs.
    points : tuple of int
        Points on each vesicle.
    tolerances : tuple of float
        In descending order.
    work_limit : int
        Evaluations after which a run is given up, and with it the tighter tolerances.
    reference : (int, float)
        Points and tolerance of the converged run.
    control : (int, float)
        Points and tolerance of the run that shows how far the converged run can be trusted.
    answer_points : int
        Points on each vesicle of the runs for period and viscosity.
    answer_tolerances : tuple of float
        Tolerances of these runs, in descending order.
    answer_reference : (int, float)
        Points and tolerance of the converged run for period and viscosity.
    search_tolerances : tuple of float
        Tolerances of the runs in searches for the critical Hamaker constant.
    bracket : float
        Relative width at which these searches end.
    """

    methods: tuple[ComparedMethod, ...]
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


QUICK = WorkPrecisionPlan(
    methods=(BDF, ROSENBROCK, deferred_correction(2), deferred_correction(4), EULER),
    points=(48, 96),
    tolerances=(1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7),
    work_limit=2_500,
    reference=(128, 1e-9),
    control=(112, 1e-8),
    answer_points=64,
    answer_tolerances=(1e-2, 1e-3, 1e-4),
    answer_reference=(80, 1e-7),
    search_tolerances=(),
    bracket=0.002,
)
FULL = WorkPrecisionPlan(
    methods=(BDF, ROSENBROCK, *map(deferred_correction, range(2, 7)), PUBLISHED, EULER),
    points=(32, 64, 128),
    tolerances=(1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 3e-5, 1e-5, 1e-6, 1e-7, 1e-8),
    work_limit=100_000,
    reference=(160, 1e-10),
    control=(128, 1e-9),
    answer_points=64,
    answer_tolerances=(1e-2, 3e-3, 1e-3, 3e-4, 1e-4, 1e-5, 1e-6),
    answer_reference=(128, 1e-8),
    search_tolerances=(1e-2, 1e-3, 1e-4, 1e-5),
    bracket=0.002,  # narrow enough to see what the tolerance does
)
