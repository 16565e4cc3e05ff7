"""Imposed flows, one a module.

To add a flow, for example a Poiseuille flow:

1.  Write ``solver/flows/poiseuille.py`` with a subclass of `ImposedFlow` (`solver.flows.base`): its ``kind``,
    its parameters beside ``rate``, ``title`` and ``symbols``, ``velocity`` and ``velocity_gradient``.  A flow
    whose gradient is the same everywhere derives from `LinearFlow` and states ``unit_gradient`` alone.
2.  State its facts where they differ from the defaults: ``odd``, ``rotates``, ``strains``, ``extends_pairs``,
    ``shear_rate``, ``effective_aspect_ratio``.  The time loop, the outcome criteria, the diagnostics, the
    figures and the page ask for these; none of them asks which flow it is.
3.  Import it here and register it below.

That is all: TOML documents, ``--set``, the service and its description know the new ``kind``.
`tests/solver/flows/test_flows.py` checks velocity, gradient, Jacobian and oddness of every registered flow.
"""

from typing import Annotated

from solver.flows.base import ImposedFlow, Symbol
from solver.flows.extension import Extension
from solver.flows.shear import Shear
from solver.flows.trap import Trap
from solver.registry import Registry

FLOWS: Registry[ImposedFlow] = Registry()
FLOWS.add(Shear)
FLOWS.add(Extension)
FLOWS.add(Trap)

Flow = Annotated[ImposedFlow, FLOWS]  # the type of a field that holds any of them

__all__ = ["FLOWS", "Extension", "Flow", "ImposedFlow", "Shear", "Symbol", "Trap"]
