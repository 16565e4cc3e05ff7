"""Planar extension."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

from solver.flows.imposed_flow import Array, ImposedFlow, Symbol
from solver.flows.trap import EXTENSION, Trap
from solver.flows.uniform_gradient import UniformGradient


class Extension(UniformGradient):
    """Velocity rate·(−x, y): converges along x, diverges along y (Quaife et al. 2019, section IV)."""

    kind: Literal["extension"] = "extension"

    title: ClassVar[str] = "extensional flow"
    symbols: ClassVar[Mapping[str, Symbol]] = {"rate": Symbol("extension rate", r"\dot{\epsilon}", "ε̇")}

    @property
    def unit_gradient(self) -> Array:
        """That of the extension, (2, 2)."""
        return EXTENSION

    @property
    def strains(self) -> bool:
        """True."""
        return True

    @property
    def comoving(self) -> ImposedFlow:
        """A trap: what the flow carries away it carries away as a whole."""
        return Trap(rate=self.rate)
