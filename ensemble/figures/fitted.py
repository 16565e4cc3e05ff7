"""The figure of a run in a size that is asked for."""

from __future__ import annotations

import itertools
import warnings
from bisect import bisect_left
from collections.abc import Sequence

import matplotlib
from matplotlib.figure import Figure
from matplotlib.transforms import BboxBase

from ensemble.config.figure_options import INCH
from ensemble.figures.figure_files import NO_ROOM
from ensemble.figures.history import run_figure
from ensemble.figures.style import STYLE, WIDTH
from solver.analysis.run import Run

_LEAST_AXES = (0.7, 0.3)  # inches, of what a panel shows
_LARGEST = 100  # centimeters
_USUAL_WIDTHS = (8.6, 12.0, WIDTH * INCH)  # of a column, of one and a half, and of a page


def fitted_run_figure(run: Run, size: tuple[float, float]) -> Figure:
    """Draw the figure of a run in a size, with panels side by side if they fit, else below each other.

    Parameters
    ----------
    run : Run
    size : (float, float)
        Width and height in centimeters.

    Returns
    -------
    Figure
        See `run_figure`.

    Raises
    ------
    ValueError
        If letters, which keep their size, would overlap or be cut.  The message names a height that suffices.
    """
    figure = _fitting(run, size)
    if figure is None:
        width, height = size
        raise ValueError(f"size: {width:g}x{height:g} is too small for this run; {_sufficient(run, width)}")
    return figure


@matplotlib.rc_context(STYLE)
def _fitting(run: Run, size: tuple[float, float]) -> Figure | None:
    width, height = (side / INCH for side in size)
    for in_one_column in (False, True):
        figure = run_figure(run, width, in_one_column)
        figure.set_size_inches(width, height)
        if _fits(figure):
            return figure
    return None


def _fits(figure: Figure) -> bool:
    """Tell whether a figure can be laid out so that no letters overlap or are cut."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", NO_ROOM)  # the boxes show it
        figure.draw_without_rendering()
    membranes, _, *panels = figure.axes
    page = figure.bbox.padded(1)
    boxes = [text.get_window_extent() for text in figure.texts]
    boxes += [box for axes in figure.axes if (box := axes.get_tightbbox())]
    width, height = (side * figure.dpi for side in _LEAST_AXES)
    return (
        all(page.x0 <= box.x0 and box.x1 <= page.x1 for box in boxes)
        and all(page.y0 <= box.y0 and box.y1 <= page.y1 for box in boxes)
        and not _overlap(boxes)
        and not _overlap([text.get_window_extent() for text in membranes.texts])
        and all(axes.bbox.width >= width and axes.bbox.height >= height for axes in panels)
    )


def _overlap(boxes: Sequence[BboxBase]) -> bool:
    return any(one.overlaps(other) for one, other in itertools.combinations(boxes, 2))


def _sufficient(run: Run, width: float) -> str:
    """Name the least height, in whole centimeters, at a width or at the next usual one that suffices."""
    for wide in (width, *(usual for usual in _USUAL_WIDTHS if usual > width)):
        heights = range(3, _LARGEST + 1)
        index = bisect_left(heights, True, key=lambda height: _fitting(run, (wide, height)) is not None)
        if index < len(heights):
            return f"at a width of {wide:.3g} cm it needs a height of {heights[index]} cm"
    return f"it needs a width of more than {_USUAL_WIDTHS[-1]:.3g} cm"
