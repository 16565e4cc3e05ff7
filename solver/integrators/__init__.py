"""Time integrators, one method a module.

Every module of this folder is imported here, so that its integrators are registered (`integrator.register`).
"""

from importlib import import_module
from pkgutil import iter_modules

from solver.integrators.choice import integrator_for, usual_integrator
from solver.integrators.integrator import InitialValueProblem, Integrator, Step, StepFailedError

__all__ = [
    "InitialValueProblem",
    "Integrator",
    "Step",
    "StepFailedError",
    "integrator_for",
    "usual_integrator",
]

for _module in iter_modules(__path__):
    import_module(f"{__name__}.{_module.name}")
