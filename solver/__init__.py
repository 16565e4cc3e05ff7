"""Boundary-integral simulation of adhering vesicles: a scene in, a run with its outcome out.

The package knows no files, no database and no MPI.  `Scene` describes what is simulated, `simulate` runs it
and returns a `Run`.  `README.md` beside this file states the method.
"""

from typing import TYPE_CHECKING, Any

from solver.analysis.run import Energy, Errors, Frames, Outcome, Run, Series, Viscosity, Work
from solver.revision import RESULTS_REVISION
from solver.scene import Scene

if TYPE_CHECKING:
    from solver.simulation.simulate import simulate

__all__ = [
    "RESULTS_REVISION",
    "Energy",
    "Errors",
    "Frames",
    "Outcome",
    "Run",
    "Scene",
    "Series",
    "Viscosity",
    "Work",
    "simulate",
]


def __getattr__(name: str) -> Any:
    # The compiled kernels take seconds to load: only those who simulate wait for them.
    if name == "simulate":
        from solver.simulation.simulate import simulate

        return simulate
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
