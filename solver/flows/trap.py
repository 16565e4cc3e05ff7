"""A fluid trap: extension that follows the vesicles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np

from solver.flows.imposed_flow import Array, Symbol
from solver.flows.uniform_gradient import FollowingFlow

EXTENSION = np.array([[-1.0, 0.0], [0.0, 1.0]])


class Trap(FollowingFlow):
    """Velocity rate·(−(x − X), y − Y) about the mean (X, Y) of the vesicles' centers.

    The controlled stagnation point of (Quaife et al. 2019, section IV).
    """

    kind: Literal["trap"] = "trap"

    title: ClassVar[str] = "a fluid trap"
    symbols: ClassVar[Mapping[str, Symbol]] = {"rate": Symbol("extension rate", r"\dot{\epsilon}", "ε̇")}

    @property
    def unit_gradient(self) -> Array:
        """That of the extension, (2, 2)."""
        return EXTENSION

    @property
    def strains(self) -> bool:
        """True."""
        return True
