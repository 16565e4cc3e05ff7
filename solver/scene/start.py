"""The state in which a run begins, as a scene describes it."""

from __future__ import annotations

from solver.model import Model, Positive


class Start(Model):
    """How the run begins: as placed, or relaxed at rest first and then turned.

    ``relaxed`` relaxes the vesicles without flow to equilibrium and turns them so that the line of centers
    lies on the diverging axis (y) plus ``tilt`` radians.
    """

    relaxed: bool = False
    horizon: Positive = 1000.0  # by which the relaxation must have come to rest
    tilt: float = 1e-3
