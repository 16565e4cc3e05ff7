"""Boundary-integral simulation of adhering vesicles: a scene in, a run with its outcome out.

The package knows no files, no database and no MPI.  `Scene` describes what is simulated, `simulate` runs it
and returns a `Run`.  `README.md` beside this file states the method.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from solver.analysis.membrane_forces import MembraneForces, membrane_forces
    from solver.analysis.run import Energy, Errors, Frames, Outcome, Run, Series, Viscosity, Work
    from solver.revision import RESULTS_REVISION
    from solver.scene import Scene
    from solver.simulation.simulate import Simulation, simulate

__all__ = [
    "RESULTS_REVISION",
    "Energy",
    "Errors",
    "Frames",
    "MembraneForces",
    "Outcome",
    "Run",
    "Scene",
    "Series",
    "Simulation",
    "Viscosity",
    "Work",
    "membrane_forces",
    "simulate",
]

_MODULES = {
    "MembraneForces": "solver.analysis.membrane_forces",
    "RESULTS_REVISION": "solver.revision",
    "Scene": "solver.scene",
    "Simulation": "solver.simulation.simulate",
    "membrane_forces": "solver.analysis.membrane_forces",
    "simulate": "solver.simulation.simulate",
}  # of the others: that of results


def __getattr__(name: str) -> Any:
    # Names load their modules when they are used: the compiled kernels take seconds, and only those who
    # simulate wait for them.
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES.get(name, "solver.analysis.run")), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
