"""Snapshots of a run: its membranes colored by tension, side by side on one scale."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from numpy.typing import NDArray

from ensemble.figures.membranes import FEW, membrane_lines, membrane_segments, tension_scale
from ensemble.figures.style import CLUSTER_COLORS, PALE, WIDTH
from ensemble.figures.symbols import AxisUnit
from solver.analysis.run import Array, Frames
from solver.dimensions import TIME
from solver.scene import Scene

_SPACE = 0.5  # between neighboring snapshots, in the unit of length


def choose_snapshots(frames: Frames, width: float = WIDTH) -> list[int]:
    """Return the indices of the frames that a figure shows: finite, evenly spread in time, with both ends.

    Parameters
    ----------
    frames : Frames
    width : float
        Of the figure, in inches.

    Returns
    -------
    list of int
        At most eight, and at most three of more than `FEW` vesicles, in ascending order; fewer in a narrow
        figure.
    """
    drawable = finite_frames(frames)
    times = frames.time[drawable]
    most = min(8 if frames.center.shape[1] <= FEW else 3, max(2, round(8 * width / WIDTH)))
    wanted = np.linspace(times[0], times[-1], most)
    return sorted({int(drawable[np.abs(times - time).argmin()]) for time in wanted})


def finite_frames(frames: Frames) -> NDArray[np.intp]:
    """Return the indices of the frames in which all positions are finite; in a failed run not all may be.

    Parameters
    ----------
    frames : Frames

    Returns
    -------
    (finite frames,) array of int
    """
    finite = np.isfinite(frames.tangent_angle).all(axis=(1, 2)) & np.isfinite(frames.center).all(axis=(1, 2))
    return np.flatnonzero(finite)


def draw_snapshots(
    axes: Axes, scene: Scene, frames: Frames, chosen: Sequence[int], clusters: Array | None = None
) -> LineCollection:
    """Draw snapshots side by side, each centered on its vesicles and labeled with its time.

    All snapshots share one unit of length and one color scale.  Snapshots that are much wider than high, as
    those of a sheared suspension, are drawn one below the other.

    Parameters
    ----------
    axes : Axes
        Where to draw; its limits are set.
    scene : Scene
    frames : Frames
    chosen : sequence of int
        Indices of the frames, as `choose_snapshots` returns them.
    clusters : (frames, vesicles), optional
        Number of the cluster of each vesicle.  The vesicles of a cluster are filled with one color.

    Returns
    -------
    LineCollection
        The mappable for a color bar; its segments are ordered by snapshot, vesicle and arclength.
    """
    chosen = list(chosen)
    ends, tension = membrane_segments(
        scene, frames.tangent_angle[chosen], frames.center[chosen], frames.tension[chosen]
    )
    reach = np.abs(ends).max(axis=(1, 2, 3))  # (snapshots, 2)
    stacked = len(chosen) > 1 and reach[:, 0].max() > 2 * reach[:, 1].max()
    arrange = _below_each_other if stacked else _beside_each_other
    unit = AxisUnit.of(TIME, scene)
    times = [f"$t$ = {unit.text(time, 4)}" for time in frames.time[chosen]]
    ends += arrange(axes, reach, times)[:, None, None, None, :]

    lines = membrane_lines(ends, tension, tension_scale(tension), 1.6 if len(scene.vesicles) <= FEW else 0.8)
    axes.add_collection(lines)
    if clusters is not None:
        axes.add_collection(_cluster_areas(ends, clusters[chosen]))
    axes.set(aspect="equal")
    axes.set_axis_off()
    return lines


def _beside_each_other(axes: Axes, reach: Array, times: Sequence[str]) -> Array:
    """Arrange snapshots in a row with their times above them; return their centers, (snapshots, 2)."""
    top = reach[:, 1].max()
    tight = reach[:, 0] + _SPACE / 2
    # Wide or tall figures are drawn small; the times above narrow snapshots must still fit.
    half_width = np.maximum(tight, max(tight.mean(), 0.2 * top))
    middle = np.cumsum(2 * half_width) - half_width
    # Bands show which vesicles belong together when they have drifted far apart.
    for x, half in list(zip(middle, half_width, strict=True))[1::2]:
        axes.axvspan(x - half, x + half, color=PALE, linewidth=0, zorder=0)
    for x, time in zip(middle, times, strict=True):
        axes.annotate(time, (x, top), (0, 5), textcoords="offset points", ha="center", va="bottom")
    axes.set(xlim=(0, 2 * half_width.sum()), ylim=(-top - 0.1, top + 0.1))
    return np.stack([middle, np.zeros_like(middle)], axis=1)


def _below_each_other(axes: Axes, reach: Array, times: Sequence[str]) -> Array:
    """Arrange snapshots in a column with their times left of it; return their centers, (snapshots, 2)."""
    side = reach[:, 0].max()
    tight = reach[:, 1] + _SPACE / 2
    half_height = np.maximum(tight, 0.04 * side)
    middle = half_height - np.cumsum(2 * half_height)
    for y, half in list(zip(middle, half_height, strict=True))[1::2]:
        axes.axhspan(y - half, y + half, color=PALE, linewidth=0, zorder=0)
    for y, time in zip(middle, times, strict=True):
        axes.annotate(time, (-side, y), (-6, 0), textcoords="offset points", ha="right", va="center")
    axes.set(xlim=(-side - 0.1, side + 0.1), ylim=(-2 * half_height.sum(), 0))
    return np.stack([np.zeros_like(middle), middle], axis=1)


def _cluster_areas(ends: Array, clusters: Array) -> PolyCollection:
    """Return the areas of the vesicles in clusters of two or more, one color for each cluster."""
    outlines, colors = [], []
    for outlines_of_snapshot, labels in zip(ends[..., 0, :], clusters.astype(int), strict=True):
        together = np.bincount(labels)[labels] > 1
        outlines += list(outlines_of_snapshot[together])
        colors += [CLUSTER_COLORS[label % len(CLUSTER_COLORS)] for label in labels[together]]
    return PolyCollection(outlines, facecolors=colors, edgecolors="none", alpha=0.35, zorder=0.6)
