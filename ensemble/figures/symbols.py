"""Names and symbols of the parameters of a scene, for figures."""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass

from ensemble.config.measured import Measured, dimension_at
from solver.dimensions import Dimension
from solver.flows import ImposedFlow
from solver.scene import Scene


@dataclass(frozen=True)
class Quantity:
    """A parameter of a scene as figures show it.

    Attributes
    ----------
    label : str
        Label of an axis.
    symbol : str
        Symbol in TeX, without dollar signs.
    """

    label: str
    symbol: str

    @classmethod
    def named(cls, name: str, symbol: str) -> Quantity:
        """Return a quantity whose label is its name followed by its symbol.

        Parameters
        ----------
        name, symbol : str

        Returns
        -------
        Quantity
        """
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
_UNSEEN = re.compile(r"(?<=\\.)[A-Za-z]+|[${}\\]")  # a command of TeX counts as one character


def quantity(path: str, flow: ImposedFlow | type[ImposedFlow] | None = None) -> Quantity:
    """Return the quantity at a dotted path of a scene.

    Parameters
    ----------
    path : str
    flow : ImposedFlow or type of ImposedFlow, optional
        The flow of the scene, which has the names and symbols of its own parameters.

    Returns
    -------
    Quantity
        Named by its path if it has no established symbol.
    """
    if flow is not None and path.startswith(_OF_THE_FLOW):
        symbol = flow.symbols.get(path.removeprefix(_OF_THE_FLOW))
        if symbol is not None:
            return Quantity.named(symbol.name, symbol.tex)
    upright = r"\mathrm{" + path.replace("_", r"\_") + "}"
    return _BY_PATH.get(path, Quantity(path, upright))


@dataclass(frozen=True)
class AxisUnit:
    """The unit in which a figure shows numbers of a scene and its run.

    Attributes
    ----------
    size : float
        By which the numbers are multiplied; 1 if the scene does not say what its units are.
    name : str
        Such as ``µm``; empty without a unit.
    """

    size: float = 1.0
    name: str = ""

    @classmethod
    def of(cls, dimension: Dimension | None, scene: Scene) -> AxisUnit:
        """Return the unit of numbers of a dimension.

        Parameters
        ----------
        dimension : Dimension or None
            None if they have none.
        scene : Scene

        Returns
        -------
        AxisUnit
        """
        one = Measured.known(1.0, dimension, scene.units)
        return cls() if one is None else cls(*one)

    @classmethod
    def at(cls, path: str, scene: Scene) -> AxisUnit:
        """Return the unit of a parameter of a scene.

        Parameters
        ----------
        path : str
            Dotted path of the parameter.
        scene : Scene

        Returns
        -------
        AxisUnit
        """
        return cls.of(dimension_at(scene, path), scene)

    def label(self, name: str) -> str:
        """Return the label of an axis or a color bar.

        Parameters
        ----------
        name : str
            Of what it shows.

        Returns
        -------
        str
            With the unit in brackets, if there is one.
        """
        return f"{name} ({self.name})" if self.name else name

    def text(self, value: float, digits: int) -> str:
        """Write a number in this unit.

        Parameters
        ----------
        value : float
            In the unit of the scene.
        digits : int
            Significant ones, at most.

        Returns
        -------
        str
        """
        return f"{number_text(value * self.size, digits)} {self.name}".rstrip()

    def both(self, value: float, digits: int) -> str:
        """Write a number as it is, and in brackets in this unit, if there is one.

        Parameters
        ----------
        value : float
            In the unit of the scene.
        digits : int
            Significant ones, at most.

        Returns
        -------
        str
        """
        bare = number_text(value, digits)
        return f"{bare} ({self.text(value, digits)})" if self.name else bare


NO_UNIT = AxisUnit()


def axis_label(path: str, scene: Scene) -> str:
    """Return the label of an axis that shows a parameter of a scene.

    Parameters
    ----------
    path : str
        Dotted path of the parameter.
    scene : Scene

    Returns
    -------
    str
    """
    return AxisUnit.at(path, scene).label(quantity(path, scene.flow).label)


def describe(scene: Scene, without: Collection[str] = ()) -> str:
    """Describe a scene in one line: its vesicles, its flow, and its parameters.

    Parameters
    ----------
    scene : Scene
    without : collection of str
        Dotted paths of parameters to leave out, for instance because they are the axes of the figure.

    Returns
    -------
    str
        Symbols are in TeX.  Parameters that the scene does not have, or that have no effect, are left out.
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
    subject = [
        f"{count} vesicles" if count > 1 else "1 vesicle",
        f"in {scene.flow.title if scene.flow else 'quiescent fluid'}",
        *([scene.protocol.title] if scene.protocol else []),
    ]
    parameters = [
        f"${quantity(path, scene.flow).symbol}$ = {_numbers(numbers, AxisUnit.at(path, scene))}"
        for path, numbers in values.items()
        if path not in without
    ]
    return ", ".join([" ".join(subject), *parameters])


def _numbers(values: list[float], unit: AxisUnit) -> str:
    """Return all of a few numbers, or the smallest and largest of many; a single one with its unit, too."""
    if len(values) == 1:
        return unit.both(values[0], 6)
    if len(values) > _MOST_NUMBERS:
        return f"{number_text(values[0], 3)} to {number_text(values[-1], 3)}"
    return " and ".join(map(number_text, values))


def broken(description: str, characters: int) -> list[str]:
    """Break a description of a scene at its commas; what TeX does not show takes no room.

    Parameters
    ----------
    description : str
        As `describe` returns it.
    characters : int
        In a line, at most.

    Returns
    -------
    list of str
    """
    lines = [""]
    for part in description.split(", "):
        longer = f"{lines[-1]}, {part}" if lines[-1] else part
        if lines[-1] and len(_UNSEEN.sub("", longer)) > characters:
            lines[-1] += ","
            lines.append(part)
        else:
            lines[-1] = longer
    return lines


def number_text(value: float, digits: int = 6) -> str:
    """Write a number in text of a figure, with a true minus sign.

    Parameters
    ----------
    value : float
    digits : int
        Significant ones, at most.

    Returns
    -------
    str
    """
    return f"{value:.{digits}g}".replace("-", "−")
