"""A measurement: the rate at which a trap ended side by side, and how well each input is known."""

from __future__ import annotations

from types import MappingProxyType
from typing import Annotated, Final, Self

from pydantic import Field, model_validator

from ensemble.config.dotted_paths import parameter_value
from ensemble.config.overrides import LONGEST_NAME
from solver.scene import Model, PairPotential, Scene

_REDUCED_AREA: Final = "vesicles.reduced_area"

# Dotted paths of the inputs in the scene, by the names of their errors.
INPUTS: Final = MappingProxyType(
    {
        "rate": "flow.rate",
        "reduced_area": _REDUCED_AREA,
        "distance": "adhesion.distance",
        "radius": "units.radius",
        "bending_modulus": "units.bending_modulus",
        "viscosity": "units.viscosity",
    }
)

Fraction = Annotated[float, Field(ge=0, lt=1)]


class InputErrors(Model):
    """Relative standard errors of what was measured: 0.05 are five percent.

    Attributes
    ----------
    rate : float
        Relative standard error of the critical rate: 0.05 are five percent.
    reduced_area : float
        Relative standard error of the reduced area.
    distance : float
        Relative standard error of the distance of the potential.
    radius : float
        Relative standard error of the unit of length.
    bending_modulus : float
        Relative standard error of the bending modulus.
    viscosity : float
        Relative standard error of the viscosity outside.
    """

    rate: Fraction = 0.0
    reduced_area: Fraction = 0.0
    distance: Fraction = 0.0
    radius: Fraction = 0.0
    bending_modulus: Fraction = 0.0
    viscosity: Fraction = 0.0


class AdhesionMeasurement(Model):
    """A critical extension rate that was measured in a trap.

    Attributes
    ----------
    name : str
        What it is called; at most 100 characters.
    errors : InputErrors
        How well each input is known.
    scene : Scene
        The pair in the trap at the critical rate.  Its Hamaker constant is not used.
    """

    name: Annotated[str, Field(min_length=1, max_length=LONGEST_NAME, pattern=r"^[^\x00-\x1f\x7f-\x9f]+$")]
    errors: InputErrors
    scene: Scene

    @model_validator(mode="after")
    def _can_be_measured(self) -> Self:
        scene, flow = self.scene, self.scene.imposed_flow
        if flow is None or not flow.strains or flow.comoving or len(scene.vesicles) != 2:
            raise ValueError("scene.flow: a measurement takes a pair in a trap, at the critical rate")
        if scene.protocol is not None:
            raise ValueError("scene.protocol: a measurement takes one rate, the critical one; leave it out")
        if self.adhesion.cutoff is not None:
            raise ValueError("scene.adhesion.cutoff: a measurement takes a potential without it")
        try:
            parameter_value(scene, _REDUCED_AREA)
        except ValueError as error:
            raise ValueError(f"scene.{error}") from None
        for name, path in INPUTS.items():
            if path.startswith("units.") and name in self.relative_errors and scene.units is None:
                raise ValueError(f"errors.{name}: the scene has no units, such as units.radius")
        return self

    @property
    def adhesion(self) -> PairPotential:
        """The potential, with a strength that is not used."""
        if self.scene.adhesion is None:
            raise ValueError("scene.adhesion: a measurement needs the potential's distance")
        return self.scene.adhesion

    @property
    def relative_errors(self) -> dict[str, float]:
        """The errors that are not zero, by their names."""
        return {name: error for name, error in self.errors.model_dump().items() if error > 0}
