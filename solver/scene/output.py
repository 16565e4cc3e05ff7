"""How often a run is recorded, as a scene describes it."""

from __future__ import annotations

from solver.model import Model, Positive


class Output(Model):
    """How often a run is recorded.

    Attributes
    ----------
    interval : float
        Time between diagnostics.
    frame_interval : float
        Time between recorded states.
    """

    interval: Positive = 0.5
    frame_interval: Positive = 1.0
