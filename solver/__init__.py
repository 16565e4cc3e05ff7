"""Boundary-integral simulation of adhering vesicles: a scene in, a run with its outcome out.

The package knows no files, no database and no MPI.  `Scene` describes what is simulated, `simulate` runs it
and returns a `Run`.
"""

from solver.run import Energy, Errors, Frames, Outcome, Run, Series, Viscosity, Work
from solver.scene import Scene
from solver.simulate import Cancelled, simulate

__all__ = [
    "Cancelled",
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
