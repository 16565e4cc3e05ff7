"""Imposed flows, one a module.  `solver/README.md` says how to add one."""

from typing import Annotated

from solver.flows.extension import Extension
from solver.flows.imposed_flow import ImposedFlow, Symbol
from solver.flows.linear import Linear
from solver.flows.poiseuille import Poiseuille
from solver.flows.shear import Shear
from solver.flows.trap import Trap
from solver.registry import Registry

FLOWS: Registry[ImposedFlow] = Registry()
FLOWS.add(Shear)
FLOWS.add(Extension)
FLOWS.add(Trap)
FLOWS.add(Linear)
FLOWS.add(Poiseuille)

Flow = Annotated[ImposedFlow, FLOWS]  # the type of a field that holds any of them

__all__ = ["FLOWS", "Extension", "Flow", "ImposedFlow", "Linear", "Poiseuille", "Shear", "Symbol", "Trap"]
