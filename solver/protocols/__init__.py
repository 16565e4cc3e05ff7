"""How the rate of a flow changes with time, one protocol a module.  See `solver/README.md`."""

from typing import Annotated

from solver.protocols.constant import Constant
from solver.protocols.ramp import Ramp
from solver.protocols.rate_protocol import Piece, RateProtocol
from solver.protocols.sine import Sine
from solver.protocols.steps import Steps
from solver.registry import Registry

PROTOCOLS: Registry[RateProtocol] = Registry()
PROTOCOLS.add(Constant)
PROTOCOLS.add(Ramp)
PROTOCOLS.add(Steps)
PROTOCOLS.add(Sine)

FlowProtocol = Annotated[RateProtocol, PROTOCOLS]  # the type of a field that holds any of them

__all__ = ["PROTOCOLS", "Constant", "FlowProtocol", "Piece", "Ramp", "RateProtocol", "Sine", "Steps"]
