"""What every pair potential states about itself."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Annotated, Any, Self

from pydantic import Field, model_validator

from solver.dimensions import ADHESION_ENERGY, HAMAKER, LENGTH, rounded
from solver.model import Model, NonNegative, Positive
from solver.pair_potentials.cutoff import truncate
from solver.pair_potentials.flat_membranes import FlatMembranes, at_rest

# φ/H and its first and second derivative by q = r².
Derivatives = tuple[float, float, float]

# From q and the potential's parameters; Numba compiles it.
Formula = Callable[[float, Any], Derivatives]


class PairPotential(Model, ABC):
    """Energy φ(r) per squared length of membrane between points of different vesicles at the distance r.

    The force per length at x is −∇ ∫ φ ds_y = −2 ∫ φ_q (x − y) ds_y over all other vesicles, with q = r².

    Attributes
    ----------
    kind : str
        Which potential it is.
    hamaker : float
        Strength of the potential, which is proportional to it.
    adhesion_energy : float or None
        Energy per area that two flat membranes gain.  It may be given instead of H, which follows from it.
    distance : float
        Distance at which the potential is least: closer points repel each other, farther ones attract.
    cutoff : float or None
        Distance from which on points no longer attract each other.  Without one they attract at any distance.
    """

    kind: str
    # Required, unless the energy is given.
    hamaker: Annotated[NonNegative, HAMAKER] = Field(default_factory=float)
    adhesion_energy: Annotated[NonNegative, ADHESION_ENERGY] | None = Field(None, exclude=True)
    distance: Annotated[Positive, LENGTH]
    cutoff: Annotated[Positive, LENGTH] | None = None

    @property
    @abstractmethod
    def formula(self) -> Formula:
        """The function that computes φ/H and its first and second derivative by q.

        A plain function of a module, from q and `parameters` to three numbers.  Numba compiles it: arithmetic
        and the functions of `math` and NumPy, without calls of other functions.  The loops over pairs of
        points become SIMD code if it has neither branches that depend on q nor library functions.
        """

    @property
    @abstractmethod
    def parameters(self) -> tuple[float, ...]:
        """What `formula` is given besides q."""

    @property
    def singularity(self) -> float:
        """The k of the 1/(s² + d²)^k that the force resembles along a straight membrane at the distance d.

        With s the arclength along it, both are singular at s = ±id.  That decides how finely membranes are
        sampled for each other, and the spatial error does not see a value that is too small.  This default is
        for forces that are finite at r = 0 and change little within their own distance.

        Returns
        -------
        float
        """
        return 1.0

    def evaluate(self, square: float) -> Derivatives:
        """Compute φ/H, cut off if the potential is, and its first and second derivative by r².

        Parameters
        ----------
        square : float
            r², length².

        Returns
        -------
        tuple of three floats
        """
        derivatives = self.formula(square, self.parameters)
        if self.cutoff is None:
            return derivatives
        return truncate(square, self.distance, self.cutoff, *derivatives)

    @property
    def flat_membranes(self) -> FlatMembranes:
        """Two long parallel membranes that adhere; a ValueError if they do not keep a distance."""
        return at_rest(self.evaluate, self.distance, self.cutoff)

    @model_validator(mode="after")
    def _cutoff_beyond_the_repulsion(self) -> Self:
        if self.cutoff is not None and self.cutoff <= self.distance:
            raise ValueError(f"cutoff must be more than the distance {self.distance}, got {self.cutoff}")
        return self

    @model_validator(mode="after")
    def _one_strength(self) -> Self:
        given = {"hamaker", "adhesion_energy"} & self.model_fields_set
        if len(given) != 1:
            raise ValueError("give either hamaker or adhesion_energy")
        if self.adhesion_energy is not None:
            energy = self.adhesion_energy
            hamaker = rounded(energy / self.flat_membranes.energy)
            if not 0 < hamaker < math.inf and energy > 0:
                raise ValueError(
                    f"adhesion_energy {energy:g} is too small or too large: hamaker is {hamaker:g}"
                )
            # As in `Scene._drop_arrangement`: equal potentials are equal, however they were given.
            object.__setattr__(self, "hamaker", hamaker)
            object.__setattr__(self, "adhesion_energy", None)
            self.model_fields_set.symmetric_difference_update(("hamaker", "adhesion_energy"))
        return self
