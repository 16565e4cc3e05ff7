"""The look of all figures: fonts, sizes, a colorblind-safe palette and the mark of each outcome."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import matplotlib
import numpy as np
from matplotlib.colors import ListedColormap

from solver.analysis.run import Configuration, Outcome

WIDTH: Final = 7.2  # inches, the text width of a two-column journal

# Settings of the process, not of a figure: where windows appear, what keys do, where files are looked for.
_OF_THE_PROCESS = (
    "backend",
    "interactive",
    "toolbar",
    "keymap",
    "webagg",
    "tk.",
    "macosx",
    "docstring",
    "savefig.directory",
)

# Applied while a figure is built and again while it is written, because ticks are made only then.  It
# begins with the defaults of the library, so that a user's own settings change none of these figures.
STYLE: Final = matplotlib.RcParams(
    {
        name: value
        for name, value in matplotlib.rcParamsDefault.items()
        if not name.startswith(_OF_THE_PROCESS)
    }
    | {
        "font.family": "STIXGeneral",
        "mathtext.fontset": "stix",
        "font.size": 10,
        "axes.labelsize": 9.5,
        "axes.titlesize": 10,
        "legend.fontsize": 9,
        "xtick.labelsize": 9,
        "ytick.labelsize": 9,
        "axes.linewidth": 0.7,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "lines.linewidth": 1.2,
        "legend.frameon": False,
        "pdf.fonttype": 42,
        "svg.hashsalt": "vesicle-ensemble",
    }
)

# Okabe and Ito, https://jfly.uni-koeln.de/color/ (2008).
BLUE: Final = "#0072B2"
VERMILLION: Final = "#D55E00"
GREEN: Final = "#009E73"
ORANGE: Final = "#E69F00"
SKY: Final = "#56B4E9"
YELLOW: Final = "#F0E442"
PURPLE: Final = "#CC79A7"
BLACK: Final = "#000000"
GRAY: Final = "#8C8C8C"
PALE: Final = "#F4F4F4"
INSIDE: Final = "#EAF3F9"  # of a vesicle

CLUSTER_COLORS: Final = (BLUE, ORANGE, GREEN, PURPLE, SKY, VERMILLION)

# The pale end of plasma is cut off: a thin membrane drawn in it would vanish on white.
TENSION_COLORS: Final = ListedColormap(
    matplotlib.colormaps["plasma"](np.linspace(0, 0.86, 256)), "tension"
).with_extremes(bad=GRAY)


@dataclass(frozen=True)
class Mark:
    """The mark of an outcome, which differs from all others in color and in shape.

    Attributes
    ----------
    color, shape : str
        As matplotlib names them.
    face, edge : str
        Colors of its area and of its rim.
    edge_width : float
        Width of the rim, in points.
    """

    color: str
    shape: str
    face: str
    edge: str
    edge_width: float

    @classmethod
    def filled(cls, color: str, shape: str) -> Mark:
        """Return a solid mark with a thin white rim, which separates marks that overlap.

        Parameters
        ----------
        color, shape : str

        Returns
        -------
        Mark
        """
        return cls(color, shape, face=color, edge="white", edge_width=0.5)

    @classmethod
    def hollow(cls, color: str, shape: str) -> Mark:
        """Return an outlined mark, for runs that do not decide about the boundary.

        Parameters
        ----------
        color, shape : str

        Returns
        -------
        Mark
        """
        return cls(color, shape, face="white", edge=color, edge_width=1.2)


MARKS: Final[dict[Outcome, Mark]] = {
    Outcome.BOUND: Mark.filled(BLUE, "o"),
    Outcome.END_TO_END: Mark.filled(GREEN, "s"),
    Outcome.SEPARATED: Mark.filled(VERMILLION, "X"),
    Outcome.EQUILIBRIUM: Mark.filled(SKY, "^"),
    Outcome.STEADY: Mark.filled(PURPLE, "v"),
    Outcome.TUMBLING: Mark.filled(GRAY, "P"),
    Outcome.COMPLETED: Mark(YELLOW, "h", face=YELLOW, edge=BLACK, edge_width=0.5),
    Outcome.UNDECIDED: Mark.hollow(ORANGE, "D"),
    Outcome.FAILED: Mark.hollow(BLACK, "+"),
}
# Those of tumbling pairs and tumbling vesicles are the same.
CONFIGURATION_MARKS: Final[dict[Configuration, Mark]] = {
    Configuration.SLIDING: Mark.filled(BLUE, "<"),
    Configuration.ROLLING: Mark.filled(GREEN, ">"),
    Configuration.TUMBLING: MARKS[Outcome.TUMBLING],
    Configuration.FLAT: Mark.filled(SKY, "_"),
    Configuration.MALE_FEMALE: Mark.filled(PURPLE, "p"),
    Configuration.SIGMOID: Mark.filled(ORANGE, "d"),
}
# By the name of what counts in a study.
ALL_MARKS: Final[Mapping[str, Mark]] = {str(name): mark for name, mark in MARKS.items()} | {
    str(name): mark for name, mark in CONFIGURATION_MARKS.items()
}
