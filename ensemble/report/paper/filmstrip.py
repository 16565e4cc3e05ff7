"""Snapshots of runs, one run in each row, as the paper shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ensemble.figures.membranes import add_tension_bar, frame_lines
from ensemble.figures.style import BLACK, STYLE, WIDTH
from solver.analysis.run import Run

_QUANTILES = (0.02, 0.98)  # of the tensions after the start: an ellipse that has not relaxed exceeds them far


@matplotlib.rc_context(STYLE)
def filmstrip(
    runs: Mapping[str, Run],
    times: Sequence[float] = (),
    fractions: Sequence[float] = (),
    reach: float = 2.6,
) -> Figure:
    """Draw each run at some times, or as close to them as it was recorded, colored by tension.

    Panels are centered on the vesicles.  Where it is in view, a square marks the origin, which is the
    stagnation point of the flow.

    Parameters
    ----------
    runs : mapping of str to Run
        One row for each, with its title.
    times : sequence of float
        One column for each; empty where a run has ended before.
    fractions : sequence of float
        Instead of ``times``: fractions of the time of each run.
    reach : float
        Half the side of a panel, in the unit of length.

    Returns
    -------
    Figure
    """
    tensions = np.concatenate([run.frames.tension[1:].ravel() for run in runs.values()])
    scale = Normalize(*np.nanquantile(tensions, _QUANTILES))
    columns = len(times or fractions)
    panel = WIDTH / columns
    figure = Figure(figsize=(WIDTH, panel * len(runs) + 0.8), layout="constrained")
    panels = figure.subplots(len(runs), columns, squeeze=False)
    lines = None
    for row, (title, run) in zip(panels, runs.items(), strict=True):
        for axes, time in zip(row, times or [fraction * run.time for fraction in fractions], strict=True):
            axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
            axes.set_axis_off()
            if time > run.time + run.scene.output.frame_interval:
                continue
            lines = _draw_frame(axes, run, int(np.abs(run.frames.time - time).argmin()), scale)
        row[0].annotate(title, (-0.06, 0.5), xycoords="axes fraction", rotation=90, ha="right", va="center")
    if lines is not None:
        add_tension_bar(figure, lines, list(panels.ravel()), extend="both")
    return figure


def _draw_frame(axes: Axes, run: Run, index: int, scale: Normalize) -> LineCollection:
    lines = frame_lines(run, index, scale, 1.4)
    axes.add_collection(lines)
    origin = -run.frames.center[index].mean(axis=0)
    axes.plot(*origin, "s", color=BLACK, markersize=2.5)
    axes.set_title(f"$t$ = {run.frames.time[index]:.4g}", fontsize=8, pad=2)
    return lines
