"""A map as a phase diagram: regions in the colors of their labels, and the cells that were run."""

from __future__ import annotations

from itertools import cycle

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap, to_hex, to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from ensemble.figures.style import BLACK, CLUSTER_COLORS, MARKS, STYLE, WIDTH
from ensemble.figures.symbols import AxisUnit, axis_label, describe
from ensemble.search.map_record import MapRecord
from solver.analysis.run import Array

_NARROW = 5.0  # inches
_TINT = 0.62  # of white in the color of a region, on which the cells that were run are darker


@matplotlib.rc_context(STYLE)
def map_diagram(record: MapRecord, width: float = WIDTH) -> Figure:
    """Draw a map.

    Parameters
    ----------
    record : MapRecord
    width : float
        Inches.  The legend of a narrow figure stands below it.

    Returns
    -------
    Figure
        The group ids of its artists are ``regions``, ``run`` and ``boundary``.
    """
    x, y = record.question.axes
    scene = record.scene
    figure = Figure(figsize=(width, 4.2), layout="constrained")
    axes = figure.add_subplot(xlabel=axis_label(x.parameter, scene), ylabel=axis_label(y.parameter, scene))
    axes.set_title(describe(scene, without=(x.parameter, y.parameter)), pad=10, wrap=True)
    for axis, scale in ((x, axes.set_xscale), (y, axes.set_yscale)):
        scale("linear" if axis.spacing == "linear" else "log")
    across, up = (AxisUnit.at(axis.parameter, scene).size for axis in (x, y))
    edges = across * np.array(x.edges), up * np.array(y.edges)
    colors = _colors(record.labels)
    tints = [_tint(color) for color in colors]
    axes.pcolormesh(
        *edges,
        record.numbers.T,
        cmap=ListedColormap(tints),
        vmin=-0.5,
        vmax=len(colors) - 0.5,
        rasterized=True,
        gid="regions",
    )
    for number, color in enumerate(colors):
        made = [each.cell for each in record.runs if record.cells[each.cell[0]][each.cell[1]] == number]
        if made:
            columns, rows = np.array(made).T
            places = across * np.array(x.values)[columns], up * np.array(y.values)[rows]
            axes.plot(*places, ".", color=color, markersize=2.6, gid="run")
    _draw_boundary(axes, record, *edges)
    patches = [Patch(color=tint, label=word) for tint, word in zip(tints, record.labels, strict=True)]
    dots = axes.plot([], [], ".", color=BLACK, markersize=2.6, label="run")
    if width < _NARROW:
        figure.legend(handles=[*patches, *dots], loc="outside lower center", ncols=3)
    else:
        figure.legend(handles=[*patches, *dots], loc="outside right center")
    return figure


def _colors(labels: list[str]) -> list[str]:
    """Return the color of each label: that of its mark if it is an outcome."""
    of_outcomes = {str(outcome): mark.color for outcome, mark in MARKS.items()}
    taken = {of_outcomes.get(label) for label in labels}
    others = cycle(color for color in CLUSTER_COLORS if color not in taken)
    return [of_outcomes.get(label) or next(others) for label in labels]


def _tint(color: str) -> str:
    red, green, blue = (_TINT + (1 - _TINT) * part for part in to_rgb(color))
    return to_hex((red, green, blue))


def _draw_boundary(axes: Axes, record: MapRecord, x: Array, y: Array) -> None:
    """Draw the edges between cells with different labels."""
    numbers = record.numbers
    upright = [[(x[i + 1], y[j]), (x[i + 1], y[j + 1])] for i, j in np.argwhere(numbers[1:] != numbers[:-1])]
    level = [
        [(x[i], y[j + 1]), (x[i + 1], y[j + 1])] for i, j in np.argwhere(numbers[:, 1:] != numbers[:, :-1])
    ]
    axes.add_collection(LineCollection([*upright, *level], colors=BLACK, linewidths=0.9, gid="boundary"))
