"""Time integrators: one method a module, all behind `Integrator`; `integrator_for` chooses."""

from solver.integrators.base import Integrator, Step, StepFailedError
from solver.integrators.bdf import BackwardDifferentiation
from solver.integrators.choice import integrator_for, usual_integrator

__all__ = [
    "BackwardDifferentiation",
    "Integrator",
    "Step",
    "StepFailedError",
    "integrator_for",
    "usual_integrator",
]
