"""Membranes as lines that are colored by tension."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ensemble.figures.style import TENSION_COLORS
from ensemble.figures.symbols import AxisUnit
from solver.analysis.run import Array, Run
from solver.dimensions import TENSION
from solver.membrane.curve import positions
from solver.membrane.spectral import interpolation
from solver.scene import Scene

FEW = 4  # up to so many vesicles are drawn large: in many snapshots, with thick lines
_SEGMENTS = 128  # of a drawn membrane, at least: a polygon of 64 sides shows its corners in print
_SEGMENTS_OF_MANY = 48


def membrane_segments(
    scene: Scene, tangent_angle: Array, center: Array, tension: Array
) -> tuple[Array, Array]:
    """Cut closed membranes into short straight segments, each with a tension.

    Parameters
    ----------
    scene : Scene
        Has the lengths of the vesicles.
    tangent_angle : (..., vesicles, points)
        Radians.
    center : (..., vesicles, 2)
    tension : (..., vesicles, points)

    Returns
    -------
    ends : (..., vesicles, segments, 2, 2)
        Start and end (x, y) of each segment, relative to the mean of the centers of all vesicles.
    tension : (..., vesicles, segments)
        Mean of the tensions at both ends, in the unit in which figures show it.
    """
    vesicles, points = tangent_angle.shape[-2:]
    wanted = _SEGMENTS if vesicles <= FEW else _SEGMENTS_OF_MANY
    refine = interpolation(points, math.ceil(wanted / points))
    length = np.array([vesicle.length for vesicle in scene.vesicles])
    about_mean = center - center.mean(axis=-2, keepdims=True)
    start = np.swapaxes(positions(tangent_angle, about_mean, length) @ refine.T, -1, -2)
    ends = np.stack([start, np.roll(start, -1, axis=-2)], axis=-2)
    at_start = AxisUnit.of(TENSION, scene).size * tension @ refine.T
    return ends, (at_start + np.roll(at_start, -1, axis=-1)) / 2


def membrane_lines(ends: Array, tension: Array, norm: Normalize, width: float) -> LineCollection:
    """Return membranes as lines that are colored by tension.

    Parameters
    ----------
    ends : (..., 2, 2)
        Start and end of each segment, as `membrane_segments` returns them.
    tension : (...)
        Tension of each segment; what is not finite is drawn gray.
    norm : Normalize
        Scale of the colors.
    width : float
        Width of the lines, in points.

    Returns
    -------
    LineCollection
        Its segments have the order of ``ends``.
    """
    lines = LineCollection(
        list(ends.reshape(-1, 2, 2)), cmap=TENSION_COLORS, norm=norm, linewidths=width, capstyle="round"
    )
    lines.set_array(np.ma.masked_invalid(tension.ravel()))
    return lines


def frame_lines(run: Run, index: int, norm: Normalize, width: float) -> LineCollection:
    """Return the membranes in one frame of a run as lines that are colored by tension.

    Parameters
    ----------
    run : Run
    index : int
        Index of the frame.
    norm : Normalize
        Scale of the colors.
    width : float
        Width of the lines, in points.

    Returns
    -------
    LineCollection
        Positions are relative to the mean of the centers of all vesicles.
    """
    frames = run.frames
    ends, tension = membrane_segments(
        run.scene, frames.tangent_angle[index], frames.center[index], frames.tension[index]
    )
    return membrane_lines(ends, tension, norm, width)


def add_tension_bar(
    figure: Figure,
    membranes: LineCollection,
    axes: Axes | list[Axes],
    extend: Literal["neither", "min", "max", "both"] = "neither",
    shrink: float = 0.5,
) -> Colorbar:
    """Add a color bar for tension below some axes; the label of its own axes is ``tension``.

    Parameters
    ----------
    figure : Figure
    membranes : LineCollection
        Membranes that are colored by tension.
    axes : Axes or list of Axes
        The axes that make room for the bar.
    extend : str
        The ends at which there are tensions beyond the scale.
    shrink : float
        Length of the bar over the width of the axes.

    Returns
    -------
    Colorbar
    """
    bar = figure.colorbar(
        membranes, ax=axes, location="bottom", extend=extend, shrink=shrink, aspect=40, pad=0.05
    )
    bar.ax.set_label("tension")
    bar.set_label(r"tension $\sigma$")
    return bar


def extended_ends(membranes: LineCollection) -> Literal["neither", "min", "max", "both"]:
    """Return the ends of the color scale beyond which there are tensions.

    Parameters
    ----------
    membranes : LineCollection
        Membranes that are colored by tension.

    Returns
    -------
    {"neither", "min", "max", "both"}
        What ``extend`` of a color bar takes.
    """
    on_scale: Array = np.ma.asarray(membranes.norm(np.ma.asarray(membranes.get_array()))).compressed()
    below, above = np.any(on_scale < 0), np.any(on_scale > 1)
    if below and above:
        return "both"
    return "min" if below else "max" if above else "neither"


def tension_scale(tension: Array) -> Normalize:
    """Return a color scale over the finite tensions, but never so narrow that it would show rounding errors.

    If there are several snapshots, the first does not count: an ellipse that has not relaxed yet has tensions
    several times larger, which would leave a single color for the rest of the run.

    Parameters
    ----------
    tension : (snapshots, ...)

    Returns
    -------
    Normalize
    """
    counted = tension[1:] if len(tension) > 1 else tension
    finite = counted[np.isfinite(counted)]
    low, high = (finite.min(), finite.max()) if finite.size else (0.0, 0.0)
    margin = max(0.0, 1e-3 * (1 + abs(low)) - (high - low)) / 2
    return Normalize(low - margin, high + margin)
