"""Time integrators: one method a module, all behind `Integrator`."""

from solver.integrators.base import Integrator, Step, StepFailedError
from solver.integrators.bdf import BackwardDifferentiation

__all__ = ["BackwardDifferentiation", "Integrator", "Step", "StepFailedError"]
