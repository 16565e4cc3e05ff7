"""How often a run is recorded, as a scene describes it."""

from __future__ import annotations

from typing import Annotated

from solver.dimensions import TIME
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

    interval: Annotated[Positive, TIME] = 0.5
    frame_interval: Annotated[Positive, TIME] = 1.0
