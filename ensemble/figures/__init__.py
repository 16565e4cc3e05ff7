"""Figures: the phase diagram or surface of a study, snapshots and diagnostics of a run, and movies.

Figures are built from matplotlib's objects without pyplot, so they need no display and leave no state behind.
"""

from ensemble.figures.diagram import phase_diagram
from ensemble.figures.figure_files import save, width_of
from ensemble.figures.history import run_figure
from ensemble.figures.map_diagram import map_diagram
from ensemble.figures.run_drawing import draw_run, refuse_movie
from ensemble.figures.surface import surface_diagram

__all__ = [
    "draw_run",
    "map_diagram",
    "phase_diagram",
    "refuse_movie",
    "run_figure",
    "save",
    "surface_diagram",
    "width_of",
]
