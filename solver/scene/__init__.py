"""What is simulated: validated, frozen models of vesicles, flow, adhesion, numerics and criteria."""

from solver.flows import Extension, Flow, Linear, Shear, Trap
from solver.model import Model, NonNegative, Positive
from solver.pair_potentials import Adhesion, PairPotential, PowerLaw
from solver.scene.arrangement import Arrangement
from solver.scene.criteria import Criteria
from solver.scene.numerics import Numerics
from solver.scene.output import Output
from solver.scene.scene import LARGEST_DENSE, Scene
from solver.scene.start import Start
from solver.scene.units import Units
from solver.scene.vesicle import Vesicle

__all__ = [
    "LARGEST_DENSE",
    "Adhesion",
    "Arrangement",
    "Criteria",
    "Extension",
    "Flow",
    "Linear",
    "Model",
    "NonNegative",
    "Numerics",
    "Output",
    "PairPotential",
    "Positive",
    "PowerLaw",
    "Scene",
    "Shear",
    "Start",
    "Trap",
    "Units",
    "Vesicle",
]
