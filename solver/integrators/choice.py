"""From what a scene asks for to the integrator that does it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from solver.integrators.integrator import FACTORIES, InitialValueProblem, Integrator

if TYPE_CHECKING:
    from solver.scene import Numerics


def usual_integrator(vesicles: int) -> Literal["bdf", "rosenbrock"]:
    """Return what "auto" stands for; `ensemble report work-precision` measures why.

    One vesicle settles, so that its errors die out, and its Jacobian is cheap: there long steps win.

    Parameters
    ----------
    vesicles : int
        How many are in the fluid.

    Returns
    -------
    str
        Name of an integrator.
    """
    return "rosenbrock" if vesicles == 1 else "bdf"


def integrator_for(problem: InitialValueProblem, numerics: Numerics, vesicles: int) -> Integrator:
    """Make the integrator that a scene asks for.

    Parameters
    ----------
    problem : InitialValueProblem
    numerics : Numerics
        Of the scene.
    vesicles : int
        How many are in the fluid; it decides what "auto" stands for.

    Returns
    -------
    Integrator
    """
    name = usual_integrator(vesicles) if numerics.integrator == "auto" else numerics.integrator
    return FACTORIES[name](problem, numerics)
