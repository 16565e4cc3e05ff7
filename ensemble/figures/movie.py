"""Movies of a run: membranes colored by tension in the imposed flow, with diagnostics at their side."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from pathlib import Path
from subprocess import CalledProcessError
from typing import Any, Final, NamedTuple

import matplotlib
import numpy as np
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.gridspec import SubplotSpec
from matplotlib.quiver import Quiver

from ensemble.config.figure_options import OnPicture
from ensemble.disk import replacing
from ensemble.errors import EnsembleError
from ensemble.figures.membranes import (
    FEW,
    add_tension_bar,
    extended_ends,
    membrane_lines,
    membrane_segments,
    tension_scale,
)
from ensemble.figures.panels import PANELS
from ensemble.figures.snapshots import finite_frames
from ensemble.figures.style import GRAY, INSIDE, STYLE, VERMILLION
from ensemble.figures.symbols import AxisUnit, broken, describe
from solver.analysis.run import Array, Frames, Run
from solver.dimensions import TENSION, TIME
from solver.flows import ImposedFlow

_PACE = 8.0  # units of time a second: a doublet at shear rate 0.5 takes about five seconds a turn
_DURATION = (5.0, 20.0)  # seconds, at least and at most
_HOLD = 1.0  # seconds for which the last state is shown before a player starts again

_SIZE = (16 / 3, 3.0)  # inches: letters of ten points can be read where the picture is small
_CHARACTERS = 85  # in a line of the title
_TRACES = 2  # diagnostics beside the membranes, at most
_MARGIN = 0.5  # around the membranes, in the unit of length
_ARROWS = 12  # of the flow, along the longer side of the view


class _Format(NamedTuple):
    """How movies of one format are written."""

    writer: Callable[..., AbstractMovieWriter]
    options: dict[str, Any]
    rate: int  # pictures per second
    resolution: int  # dots per inch
    needs_encoder: bool


_FORMATS: Final = {
    ".mp4": _Format(FFMpegWriter, {"codec": "h264", "extra_args": ["-crf", "18"]}, 30, 240, True),
    ".gif": _Format(PillowWriter, {}, 20, 120, False),
}
MOVIE_SUFFIXES: Final = tuple(_FORMATS)


def save_movie(run: Run, path: Path, on_progress: OnPicture | None = None) -> None:
    """Write a movie of a run, in the format that the suffix of the file names.

    It lasts from 5 to 20 seconds.  States between two frames are interpolated, so this does not depend on how
    often the run was recorded.  The file appears complete or not at all, replacing an earlier one.

    Parameters
    ----------
    run : Run
    path : Path
        Its suffix is ``.mp4`` (1280 × 720, 30 pictures per second) or ``.gif`` (640 × 360, 20 per second).
    on_progress : callable, optional
        Takes the number of pictures that are drawn, and of all.

    Raises
    ------
    ValueError
        If the run has no finite state, or ``.mp4`` is asked for without the extra ``movies``.
    EnsembleError
        If the file cannot be written; it says what the encoder said.
    """
    form = _FORMATS[path.suffix.lower()]
    # The encoder of the package imageio-ffmpeg, whether or not the machine has one.
    encoder = matplotlib.RcParams({"animation.ffmpeg_path": _encoder()} if form.needs_encoder else {})
    with matplotlib.rc_context(STYLE), matplotlib.rc_context(encoder), replacing(path) as unfinished:
        picture = Picture(run, form.resolution)
        writer = form.writer(fps=form.rate, **form.options)
        try:
            with writer.saving(picture.figure, str(unfinished), dpi=form.resolution):
                times = picture_times(picture.frames, form.rate)
                for drawn, time in enumerate(times, start=1):
                    picture.show(time)
                    writer.grab_frame()
                    if on_progress is not None:
                        on_progress(drawn, len(times))
        except CalledProcessError as error:
            words = (error.stderr or b"").decode(errors="replace").strip().splitlines()
            raise EnsembleError(
                f"output: ffmpeg could not write {path} ({words[-1] if words else error})"
            ) from error


def picture_times(frames: Frames, rate: int) -> Array:
    """Return the times that the pictures of a movie show.

    Parameters
    ----------
    frames : Frames
    rate : int
        Pictures per second.

    Returns
    -------
    (pictures,)
        Equally spaced; the last time is repeated for a while.
    """
    first, last = frames.time[[0, -1]]
    duration = np.clip((last - first) / _PACE, *_DURATION) if last > first else 0.0
    moving = np.linspace(first, last, round(rate * duration) + 1)
    return np.append(moving, np.full(round(rate * _HOLD), last))


def _encoder() -> str:
    """Return the encoder, which weighs more than the rest of an installation: it is an extra."""
    try:
        import imageio_ffmpeg
    except ImportError:
        raise ValueError(
            "output: .mp4 needs the extra movies, pip install 'vesicle-ensemble[movies]'; .gif does not"
        ) from None
    return str(imageio_ffmpeg.get_ffmpeg_exe())


class Picture:
    """One picture that can show a run at any time.

    Parameters
    ----------
    run : Run
    resolution : float
        Dots per inch.

    Attributes
    ----------
    figure : Figure
        Its axes have the labels ``membranes``, ``tension`` (the color bar) and the names of the series that
        they show.  Whatever does not move is drawn once and is an image in it.
    frames : Frames
        The frames of the run in which all numbers are finite; `show` interpolates between them.
    membranes : LineCollection
        Its segments are ordered by vesicle and arclength.

    Raises
    ------
    ValueError
        If the run has no frame in which all numbers are finite.
    """

    @matplotlib.rc_context(STYLE)
    def __init__(self, run: Run, resolution: float) -> None:
        self._scene = run.scene
        self.frames = _drawable(run.frames)
        self._between = [
            _interpolant(self.frames.time, values)
            for values in (self.frames.tangent_angle, self.frames.center, self.frames.tension)
        ]
        ends, tension = membrane_segments(
            run.scene, self.frames.tangent_angle, self.frames.center, self.frames.tension
        )
        traced = [name for name in PANELS if name in run.series][:_TRACES]

        self.figure = Figure(figsize=_SIZE, dpi=resolution, layout="constrained")
        self.figure.suptitle("\n".join(broken(describe(run.scene), _CHARACTERS)), fontsize="medium")
        columns = self.figure.add_gridspec(1, 2, width_ratios=(1.7, 1))
        axes = self._add_view(columns[0], tension)
        self._cursors = []
        cells = columns[1].subgridspec(len(traced), 1)
        for row, name in enumerate(traced):
            panel = self.figure.add_subplot(cells[row], label=name)
            PANELS[name](panel, run)
            self._cursors.append(panel.axvline(0.0, color=VERMILLION, linewidth=1.0))
        self._unit = AxisUnit.of(TIME, run.scene)
        panel.set_xlabel(self._unit.label("time $t$"))

        self.figure.draw_without_rendering()
        self.figure.set_layout_engine("none")  # or labels would shift from picture to picture
        _fit(axes, np.abs(ends).max(axis=(0, 1, 2, 3)) + _MARGIN)
        self._flow = None
        if run.scene.flow is not None and run.scene.flow.rate > 0:
            self._flow = _FlowArrows(axes, run.scene.flow)
        arrows = [self._flow.arrows] if self._flow else []
        self._freeze([*arrows, self._inside, self.membranes, self._time, *self._cursors])

    def show(self, time: float) -> None:
        """Show the state at a time.

        Parameters
        ----------
        time : float
            Between the times of the first and the last frame.
        """
        tangent_angle, centers, tension_at_points = (values(time) for values in self._between)
        ends, tension = membrane_segments(self._scene, tangent_angle, centers, tension_at_points)
        self.membranes.set_segments(list(ends.reshape(-1, 2, 2)))
        self.membranes.set_array(tension.ravel())
        self._inside.set_verts(list(ends[:, :, 0]))
        shown = self._unit.size * time
        decimals = max(1 - math.floor(math.log10(self._unit.size)), 0)
        self._time.set_text(f"$t$ = {shown:.{decimals}f} {self._unit.name}".rstrip())
        if self._flow:
            protocol = self._scene.protocol
            self._flow.show(centers.T, math.copysign(1.0, protocol.factor(time)) if protocol else 1.0)
        for cursor in self._cursors:
            cursor.set_xdata([shown, shown])

    def _add_view(self, cell: SubplotSpec, tension: Array) -> Axes:
        """Add the axes that the membranes will move in, and a color bar for tensions (frames, ...)."""
        axes = self.figure.add_subplot(cell, label="membranes")
        axes.set_axis_off()
        self._time = axes.text(0.0, 1.0, "", transform=axes.transAxes, va="top")
        self._inside = PolyCollection([], facecolor=INSIDE)
        # All tensions of the run for now: the bar shows whether its scale holds them.
        width = 2.0 if len(self._scene.vesicles) <= FEW else 1.0
        self.membranes = membrane_lines(np.empty((0, 2, 2)), tension, tension_scale(tension), width)
        axes.add_collection(self._inside, autolim=False)
        axes.add_collection(self.membranes, autolim=False)
        bar = add_tension_bar(self.figure, self.membranes, axes, extended_ends(self.membranes), shrink=0.6)
        bar.set_label(AxisUnit.of(TENSION, self._scene).label(r"tension $\sigma$"))
        return axes

    def _freeze(self, moving: Collection[Artist]) -> None:
        """Turn everything that does not move into an image: drawing axes takes most of the time."""
        for artist in moving:
            artist.set_visible(False)
        canvas = FigureCanvasAgg(self.figure)
        canvas.draw()
        still = np.array(canvas.buffer_rgba())
        for axes in self.figure.axes:
            for artist in axes.get_children():
                artist.set_visible(artist in moving)
        self.figure.suptitle("")
        self.figure.figimage(still, zorder=-1)


def _drawable(frames: Frames) -> Frames:
    kept = finite_frames(frames)
    kept = kept[np.isfinite(frames.tension[kept]).all(axis=(1, 2))]
    if not kept.size:
        raise ValueError("output: the run has no finite state to show")
    return Frames(*(values[kept] for values in vars(frames).values()))


def _interpolant(time: Array, values: Array) -> Callable[[float], Array]:
    """Return values (frames, ...) as a function of time: cubic between frames, without overshooting."""
    if len(time) == 1:
        return lambda _: values[0]
    from scipy.interpolate import Akima1DInterpolator  # every drawing asks this module what a movie is

    return Akima1DInterpolator(time, values, method="makima")


def _fit(axes: Axes, reach: Array) -> None:
    """Fill the axes with equal scales so that they show everything within ``reach`` (2,) of the origin."""
    shape = np.array(axes.bbox.size)
    x, y = shape * (reach / shape).max()
    axes.set(xlim=(-x, x), ylim=(-y, y))


class _FlowArrows:
    """Faint arrows of the imposed velocity, relative to its value at the mean of the centers."""

    arrows: Quiver

    def __init__(self, axes: Axes, flow: ImposedFlow) -> None:
        x, y = (np.array(limits) for limits in (axes.get_xlim(), axes.get_ylim()))
        self._flow = flow
        self._spacing = max(np.ptp(x), np.ptp(y)) / _ARROWS
        self._places = np.stack(np.meshgrid(*(_inner(limits, self._spacing) for limits in (x, y))))
        self.arrows = axes.quiver(
            *self._places,
            *np.zeros_like(self._places),
            angles="xy",
            scale_units="xy",
            scale=1,
            pivot="middle",
            color=GRAY,
            alpha=0.35,
            width=0.004,
            zorder=0.5,
            label="imposed flow",
        )

    def show(self, centers: Array, sense: float) -> None:
        """Show the flow for vesicles with these centers, (2, vesicles), or for -1 the reversed one."""
        middle = centers.mean(axis=1)[:, None, None]
        velocity = self._flow.velocity(middle + self._places, centers) - self._flow.velocity(middle, centers)
        fastest = np.hypot(*velocity).max() or 1.0  # a uniform flow has no relative velocity
        self.arrows.set_UVC(*(velocity * (sense * 0.9 * self._spacing / fastest)))


def _inner(limits: Array, spacing: float) -> Array:
    """Return the multiples of the spacing between two limits, without those at their very edge."""
    most = np.floor((limits[1] - spacing / 2) / spacing)
    return spacing * np.arange(-most, most + 1)
