"""What is simulated: validated, frozen models of vesicles, flow, adhesion, numerics and criteria."""

from solver.scene.arrangement import Arrangement
from solver.scene.model import Model, NonNegative, Positive
from solver.scene.scene import (
    LARGEST_DENSE,
    Adhesion,
    Criteria,
    Extension,
    Flow,
    Numerics,
    Output,
    Scene,
    Shear,
    Start,
    Trap,
)
from solver.scene.vesicle import Vesicle

__all__ = [
    "LARGEST_DENSE",
    "Adhesion",
    "Arrangement",
    "Criteria",
    "Extension",
    "Flow",
    "Model",
    "NonNegative",
    "Numerics",
    "Output",
    "Positive",
    "Scene",
    "Shear",
    "Start",
    "Trap",
    "Vesicle",
]
