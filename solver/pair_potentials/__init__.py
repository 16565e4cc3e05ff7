"""Pair potentials of the adhesion between vesicles, one a module.  `solver/README.md` says how to add one."""

from typing import Annotated

from solver.pair_potentials.pair_potential import PairPotential
from solver.pair_potentials.power_law import PowerLaw
from solver.registry import Registry

PAIR_POTENTIALS: Registry[PairPotential] = Registry(default="power-law")
PAIR_POTENTIALS.add(PowerLaw)

Adhesion = Annotated[PairPotential, PAIR_POTENTIALS]  # the type of a field that holds any of them

__all__ = ["PAIR_POTENTIALS", "Adhesion", "PairPotential", "PowerLaw"]
