"""Boundary-integral simulation of adhering vesicles: a scene in, a run with its outcome out.

The package knows no files, no database and no MPI.  `Scene` describes what is simulated;
`solver.simulation.simulate.simulate` runs it and returns a `Run`.  That module loads the compiled kernels, so it is
imported by those who simulate and by nobody else.
"""

from solver.analysis.run import Energy, Errors, Frames, Outcome, Run, Series, Viscosity, Work
from solver.scene import Scene

__all__ = ["Energy", "Errors", "Frames", "Outcome", "Run", "Scene", "Series", "Viscosity", "Work"]
