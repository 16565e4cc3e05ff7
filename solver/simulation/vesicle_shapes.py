"""Shapes and places of the vesicles of a scene at one instant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shapes:
    """The membranes of a scene at one instant.

    Attributes
    ----------
    tangent_angle : (vesicles, points)
    center : (vesicles, 2)
    """

    tangent_angle: Array
    center: Array
