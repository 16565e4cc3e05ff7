"""Membranes colored by their tension, snapshot beside snapshot on one scale."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from ensemble.figures.style import CLUSTER_COLORS, PALE, TENSION_COLORS
from solver.analysis.run import Array, Frames
from solver.membrane.curve import positions
from solver.membrane.spectral import interpolation
from solver.scene import Scene

FEW = 4  # vesicles, up to which they are drawn large enough for many snapshots and thick lines
_SEGMENTS = 128  # of a drawn membrane, at least: a polygon of 64 sides shows its corners in print
_SEGMENTS_OF_MANY = 48
_SPACE = 0.5  # between neighboring snapshots, in the unit of length


def choose_snapshots(frames: Frames) -> list[int]:
    """Return the indices of at most eight finite frames, evenly spread in time, first and last among them.

    Of many vesicles there are at most three.
    """
    drawable = finite_frames(frames)
    times = frames.time[drawable]
    wanted = np.linspace(times[0], times[-1], 8 if frames.center.shape[1] <= FEW else 3)
    return sorted({int(drawable[np.abs(times - time).argmin()]) for time in wanted})


def finite_frames(frames: Frames) -> NDArray[np.intp]:
    """Return the indices of the frames of which every position is finite; failed runs may end with others."""
    finite = np.isfinite(frames.tangent_angle).all(axis=(1, 2)) & np.isfinite(frames.center).all(axis=(1, 2))
    return np.flatnonzero(finite)


def membrane_segments(
    scene: Scene, tangent_angle: Array, center: Array, tension: Array
) -> tuple[Array, Array]:
    """Cut closed membranes into short straight segments with a tension each.

    Parameters
    ----------
    scene : Scene
        Gives the vesicles' lengths.
    tangent_angle, tension : (..., vesicles, points)
    center : (..., vesicles, 2)

    Returns
    -------
    ends : (..., vesicles, segments, 2, 2)
        Start and end (x, y) of each segment, about the mean of the vesicles' centers.
    tension : (..., vesicles, segments)
        Mean of the tensions at the two ends.
    """
    vesicles, points = tangent_angle.shape[-2:]
    wanted = _SEGMENTS if vesicles <= FEW else _SEGMENTS_OF_MANY
    refine = interpolation(points, math.ceil(wanted / points))
    length = np.array([vesicle.length for vesicle in scene.vesicles])
    about_mean = center - center.mean(axis=-2, keepdims=True)
    start = np.swapaxes(positions(tangent_angle, about_mean, length) @ refine.T, -1, -2)
    ends = np.stack([start, np.roll(start, -1, axis=-2)], axis=-2)
    at_start = tension @ refine.T
    return ends, (at_start + np.roll(at_start, -1, axis=-1)) / 2


def draw_membranes(axes: Axes, scene: Scene, frames: Frames, clusters: Array | None = None) -> LineCollection:
    """Draw snapshots side by side, each centered on its vesicles and with its time.

    All of them share one unit of length and one color scale.  Snapshots much wider than high, as of a
    suspension that has been sheared, are drawn one below the other.

    Parameters
    ----------
    axes : Axes
    scene : Scene
    frames : Frames
    clusters : (frames, vesicles), optional
        Number of the cluster of each vesicle: the vesicles of one are filled with one color.

    Returns
    -------
    LineCollection
        The mappable for a color bar; its segments are ordered by snapshot, vesicle and arclength.
    """
    chosen = choose_snapshots(frames)
    ends, tension = membrane_segments(
        scene, frames.tangent_angle[chosen], frames.center[chosen], frames.tension[chosen]
    )
    reach = np.abs(ends).max(axis=(1, 2, 3))  # (snapshots, 2)
    stacked = len(chosen) > 1 and reach[:, 0].max() > 2 * reach[:, 1].max()
    arrange = _below_each_other if stacked else _beside_each_other
    ends += arrange(axes, reach, frames.time[chosen])[:, None, None, None, :]

    lines = LineCollection(
        list(ends.reshape(-1, 2, 2)),
        cmap=TENSION_COLORS,
        norm=tension_scale(tension),
        linewidths=1.6 if len(scene.vesicles) <= FEW else 0.8,
        capstyle="round",
    )
    lines.set_array(np.ma.masked_invalid(tension.ravel()))
    axes.add_collection(lines)
    if clusters is not None:
        axes.add_collection(_filled(ends, clusters[chosen]))
    axes.set(aspect="equal")
    axes.set_axis_off()
    return lines


def _beside_each_other(axes: Axes, reach: Array, times: Array) -> Array:
    """Lay snapshots out in a row, write their times above, and return their middles, (snapshots, 2)."""
    top = reach[:, 1].max()
    tight = reach[:, 0] + _SPACE / 2
    # Wide or tall figures are drawn small; the times above narrow snapshots must still fit.
    half_width = np.maximum(tight, max(tight.mean(), 0.2 * top))
    middle = np.cumsum(2 * half_width) - half_width
    # Bands show which vesicles belong together when they have drifted far apart.
    for x, half in list(zip(middle, half_width, strict=True))[1::2]:
        axes.axvspan(x - half, x + half, color=PALE, linewidth=0, zorder=0)
    for x, time in zip(middle, times, strict=True):
        axes.annotate(_time(time), (x, top), (0, 5), textcoords="offset points", ha="center", va="bottom")
    axes.set(xlim=(0, 2 * half_width.sum()), ylim=(-top - 0.1, top + 0.1))
    return np.stack([middle, np.zeros_like(middle)], axis=1)


def _below_each_other(axes: Axes, reach: Array, times: Array) -> Array:
    """Lay snapshots out in a column, write their times beside, and return their middles."""
    side = reach[:, 0].max()
    tight = reach[:, 1] + _SPACE / 2
    half_height = np.maximum(tight, 0.04 * side)
    middle = half_height - np.cumsum(2 * half_height)
    for y, half in list(zip(middle, half_height, strict=True))[1::2]:
        axes.axhspan(y - half, y + half, color=PALE, linewidth=0, zorder=0)
    for y, half, time in zip(middle, half_height, times, strict=True):
        axes.annotate(_time(time), (-side, y + half), (0, -3), textcoords="offset points", va="top")
    axes.set(xlim=(-side - 0.1, side + 0.1), ylim=(-2 * half_height.sum(), 0))
    return np.stack([np.zeros_like(middle), middle], axis=1)


def _time(time: float) -> str:
    return f"$t$ = {time:.4g}"


def _filled(ends: Array, clusters: Array) -> PolyCollection:
    """Areas of the vesicles that are not alone in their cluster, colored by it."""
    outlines, colors = [], []
    for outlines_of_snapshot, labels in zip(ends[..., 0, :], clusters.astype(int), strict=True):
        together = np.bincount(labels)[labels] > 1
        outlines += list(outlines_of_snapshot[together])
        colors += [CLUSTER_COLORS[label % len(CLUSTER_COLORS)] for label in labels[together]]
    return PolyCollection(outlines, facecolors=colors, edgecolors="none", alpha=0.35, zorder=0.6)


def extension(membranes: LineCollection) -> Literal["neither", "min", "max", "both"]:
    """Return the ends at which a color bar must say that there are tensions beyond its scale."""
    on_scale: Array = np.ma.asarray(membranes.norm(np.ma.asarray(membranes.get_array()))).compressed()
    below, above = np.any(on_scale < 0), np.any(on_scale > 1)
    if below and above:
        return "both"
    return "min" if below else "max" if above else "neither"


def tension_scale(tension: Array) -> Normalize:
    """Color scale over the finite tensions, never so narrow that it would show rounding errors.

    The first snapshot does not count where there are others: an ellipse that has not relaxed yet has
    tensions several times larger, which would leave a single color to the rest of the run.
    """
    counted = tension[1:] if len(tension) > 1 else tension
    known = counted[np.isfinite(counted)]
    low, high = (known.min(), known.max()) if known.size else (0.0, 0.0)
    margin = max(0.0, 1e-3 * (1 + abs(low)) - (high - low)) / 2
    return Normalize(low - margin, high + margin)
