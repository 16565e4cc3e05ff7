"""Names and symbols, as the field writes them, of a scene's parameters."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from solver.flows import ImposedFlow
from solver.scene import Scene


@dataclass(frozen=True)
class Quantity:
    """A parameter's words for an axis, and its symbol in TeX without dollar signs."""

    label: str
    symbol: str

    @classmethod
    def named(cls, name: str, symbol: str) -> Quantity:
        """Return a quantity whose label is its name followed by its symbol."""
        return cls(f"{name}, ${symbol}$", symbol)

    @property
    def critical(self) -> str:
        """Symbol of the critical value."""
        return f"{{{self.symbol}}}_c"


DISTANCE = Quantity.named("separation distance", r"\delta")

_BY_PATH = {
    "adhesion.hamaker": Quantity.named("Hamaker constant", r"\mathcal{H}"),
    "adhesion.distance": DISTANCE,
    "vesicles.reduced_area": Quantity.named("reduced area", r"\Delta A"),
    "vesicles.length": Quantity.named("vesicle length", "L"),
    "vesicles.bending_modulus": Quantity.named("bending modulus", r"\kappa_b"),
    "vesicles.viscosity_contrast": Quantity.named("viscosity contrast", r"\lambda"),
    "adhesion.cutoff": Quantity.named("cutoff of the attraction", r"r_c"),
}

_MOST_NUMBERS = 3  # that are listed

_OF_THE_FLOW = "flow."


def quantity(path: str, flow: ImposedFlow | type[ImposedFlow] | None = None) -> Quantity:
    """Return the quantity at a dotted path of a scene.

    A path that has no established symbol stands for itself.

    Parameters
    ----------
    path : str
    flow : ImposedFlow, optional
        The scene's flow, or its class: it names its own parameters.
    """
    if flow is not None and path.startswith(_OF_THE_FLOW):
        symbol = flow.symbols.get(path.removeprefix(_OF_THE_FLOW))
        if symbol is not None:
            return Quantity.named(symbol.name, symbol.tex)
    upright = r"\mathrm{" + path.replace("_", r"\_") + "}"
    return _BY_PATH.get(path, Quantity(path, upright))


def describe(scene: Scene, without: Collection[str] = ()) -> str:
    """One line on a scene: its flow, and its parameters as far as it has them and they tell it from others.

    Parameters
    ----------
    scene : Scene
    without : collection of str
        Dotted paths of parameters to leave out, for instance because they are the figure's axes.
    """
    values: dict[str, list[float]] = {}
    if scene.flow is not None:
        for field in scene.flow.symbols:
            values[_OF_THE_FLOW + field] = [getattr(scene.flow, field)]
    values["vesicles.reduced_area"] = sorted({vesicle.reduced_area for vesicle in scene.vesicles})
    contrasts = sorted({vesicle.viscosity_contrast for vesicle in scene.vesicles})
    if contrasts != [1.0]:
        values["vesicles.viscosity_contrast"] = contrasts
    if scene.adhesion is not None:
        values["adhesion.hamaker"] = [scene.adhesion.hamaker]
        values["adhesion.distance"] = [scene.adhesion.distance]
        if scene.adhesion.cutoff is not None:
            values["adhesion.cutoff"] = [scene.adhesion.cutoff]
    count = len(scene.vesicles)
    words = [
        f"{count} vesicles" if count > 1 else "1 vesicle",
        f"in {scene.flow.title if scene.flow else 'quiescent fluid'}",
    ]
    parameters = [
        f"${quantity(path, scene.flow).symbol}$ = {_numbers(numbers)}"
        for path, numbers in values.items()
        if path not in without
    ]
    return ", ".join([" ".join(words), *parameters])


def _numbers(values: list[float]) -> str:
    """Each of a few numbers, the ends of many."""
    if len(values) > _MOST_NUMBERS:
        return f"{values[0]:.3g} to {values[-1]:.3g}"
    return " and ".join(f"{number:g}" for number in values)
