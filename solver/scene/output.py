"""How often a run is recorded, as a scene describes it."""

from __future__ import annotations

from solver.model import Model, Positive


class Output(Model):
    """How often diagnostics (``interval``) and states (``frame_interval``) are recorded."""

    interval: Positive = 0.5
    frame_interval: Positive = 1.0
