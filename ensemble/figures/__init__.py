"""Figures for people: the phase diagram of a study, and what happened in a run.

Figures are built with matplotlib's objects alone, without pyplot, so that they need no display and leave no
state behind.
"""

from ensemble.figures.diagram import phase_diagram
from ensemble.figures.history import run_figure
from ensemble.figures.output import save

__all__ = ["phase_diagram", "run_figure", "save"]
