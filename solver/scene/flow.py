"""The imposed flows, as a scene describes them."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from solver.model import Model, NonNegative


class Shear(Model):
    """Velocity rate·(y, 0)."""

    kind: Literal["shear"] = "shear"
    rate: NonNegative


class Extension(Model):
    """Velocity rate·(−x, y): converges along x, diverges along y."""

    kind: Literal["extension"] = "extension"
    rate: NonNegative


class Trap(Model):
    """Extension whose stagnation point follows the mean of the vesicle centers."""

    kind: Literal["trap"] = "trap"
    rate: NonNegative


Flow = Annotated[Shear | Extension | Trap, Field(discriminator="kind")]
