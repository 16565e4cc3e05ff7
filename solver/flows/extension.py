"""Planar extension."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np

from solver.flows.imposed_flow import Array, ImposedFlow, Symbol
from solver.flows.linear import LinearFlow
from solver.flows.trap import Trap


class Extension(LinearFlow):
    """Velocity rate·(−x, y): converges along x, diverges along y (Quaife et al. 2019, section IV)."""

    kind: Literal["extension"] = "extension"

    title: ClassVar[str] = "extensional flow"
    symbols: ClassVar[Mapping[str, Symbol]] = {"rate": Symbol("extension rate", r"\dot{\epsilon}", "ε̇")}
    strains: ClassVar[bool] = True
    unit_gradient: ClassVar[Array] = np.array([[-1.0, 0.0], [0.0, 1.0]])

    @property
    def comoving(self) -> ImposedFlow:
        """A trap: what the flow carries away it carries away as a whole."""
        return Trap(rate=self.rate)
