"""What the units of a scene are in the laboratory."""

from __future__ import annotations

import math
from typing import Annotated, Self

from pydantic import AfterValidator, model_validator

from solver.dimensions import BENDING_MODULUS, LENGTH, Dimension, rounded, si_value, with_prefix
from solver.model import Model

# With these all units that follow are numbers, too: that of time is between 1e-150 and 1e150 s.
_LEAST, _MOST = 1e-30, 1e30  # of the SI


def _stated(si: str, name: str) -> AfterValidator:
    """Check a text that states a unit of the scene."""

    def check(text: str) -> str:
        if not _LEAST <= si_value(text, si, name) <= _MOST:
            raise ValueError(f"must be at least {_LEAST:g} and at most {_MOST:g} {si}")
        return text

    return AfterValidator(check)


_Length = Annotated[str, _stated(LENGTH.si, LENGTH.name)]
_BendingModulus = Annotated[str, _stated(BENDING_MODULUS.si, BENDING_MODULUS.name)]
_Viscosity = Annotated[str, _stated("Pa*s", "viscosity")]


class Units(Model):
    """What the units of a scene are, from 1e-30 to 1e30 in the SI.  They enter no computation, and no key.

    All other units follow: with R the radius, κ the bending modulus and μ the viscosity, that of time is
    μR³/κ, of tension and of energy per area κ/R², of the Hamaker constant κ/R³.

    Attributes
    ----------
    radius : str or None
        Unit of length, such as ``10 um``: the radius of a circle of the perimeter of a vesicle.
    length : str or None
        Perimeter of a vesicle, 2π units of length; may be given instead of the radius.
    bending_modulus : str
        Bending modulus of a membrane (in three dimensions), such as ``1e-19 J``.
    viscosity : str
        Viscosity of the fluid outside, such as ``1 mPa*s``.
    """

    radius: _Length | None = None
    length: _Length | None = None
    bending_modulus: _BendingModulus
    viscosity: _Viscosity

    @model_validator(mode="after")
    def _one_size(self) -> Self:
        if (self.radius is None) == (self.length is None):
            raise ValueError("give either radius or length, which is 2π times as much")
        return self

    def scale(self, dimension: Dimension) -> float:
        """Return the unit of a dimension.

        Parameters
        ----------
        dimension : Dimension

        Returns
        -------
        float
            In SI units.
        """
        radius = si_value(self.radius or self.length or "", LENGTH.si, LENGTH.name)
        radius /= 1.0 if self.radius else 2 * math.pi
        bending_modulus = si_value(self.bending_modulus, BENDING_MODULUS.si, BENDING_MODULUS.name)
        time = si_value(self.viscosity, "Pa*s", "viscosity") * radius**3 / bending_modulus
        return rounded(
            radius**dimension.length * time**dimension.time * bending_modulus**dimension.bending_modulus
        )

    def shown(self, dimension: Dimension) -> tuple[float, str]:
        """Return the unit of a dimension as people write it.

        Parameters
        ----------
        dimension : Dimension

        Returns
        -------
        factor : float
            By which a number of the scene is multiplied.
        unit : str
            Such as ``µm``.
        """
        return with_prefix(self.scale(dimension), dimension.si)
