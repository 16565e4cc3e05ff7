"""Resolution in space and time, as a scene describes it."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from solver.model import Model, Positive
from solver.registry import RegisteredNames

# "auto", and the names that the modules of `solver.integrators` register.
INTEGRATORS = RegisteredNames("auto", "bdf", "rosenbrock", "sdc", "imex-euler")


class Numerics(Model):
    """Resolution in space and time.

    Attributes
    ----------
    points : int or "auto"
        Points on each vesicle, or "auto": as many as the tolerance needs, and more when a run needs them.
    tolerance : float
        Largest estimated error of a step, absolute, in tangent angles (radians) and centers.
    integrator : str
        Method of integration in time, or "auto": the fastest one.
    order : int or None
        Order of the integrator "sdc".  Without one it has its usual order.
    step_control : str
        What steps are chosen by: "embedded", the estimated error of each step, or "area-length", the drift of
        areas and lengths over the run (Quaife & Biros 2016).
    work_limit : int
        Number of evaluations of the equation of motion after which a run is given up.
    wall_limit : float or None
        Seconds of computing after which a run is given up; without it none is.  Whether a run reaches it
        depends on the machine.  A run that does not is not changed by it.
    """

    points: Annotated[int, Field(ge=16, le=1024, multiple_of=2)] | Literal["auto"] = 64
    tolerance: float = Field(1e-4, ge=1e-12, le=0.01)
    integrator: Annotated[str, INTEGRATORS] = "auto"
    order: int | None = Field(None, ge=2, le=8)
    step_control: Literal["embedded", "area-length"] = "embedded"
    work_limit: int = Field(1_000_000, ge=1)
    wall_limit: Positive | None = None

    @model_validator(mode="after")
    def _options_of_the_integrator(self) -> Self:
        if self.order is not None and self.integrator != "sdc":
            raise ValueError(
                f"order can be chosen for integrator 'sdc' only, got {self.order} with {self.integrator!r}"
            )
        if self.step_control == "area-length" and self.integrator not in ("sdc", "imex-euler"):
            raise ValueError(
                f"step_control 'area-length' needs integrator 'sdc' or 'imex-euler', got {self.integrator!r}"
            )
        return self
