"""The state in which a run begins, as a scene describes it."""

from __future__ import annotations

from typing import Annotated

from solver.dimensions import ANGLE, TIME
from solver.model import Model, Positive


class Start(Model):
    """How a run begins: with the vesicles as placed, or with a pair that has relaxed without flow.

    Attributes
    ----------
    relaxed : bool
        Whether the pair relaxes to equilibrium first and is then rotated, so that its line of centers lies on
        the diverging axis y plus ``tilt``.
    horizon : float
        Time by which the relaxation must have come to rest.
    tilt : float
        Radians.
    """

    relaxed: bool = False
    horizon: Annotated[Positive, TIME] = 1000.0
    tilt: Annotated[float, ANGLE] = 1e-3
