"""Snapshots of runs, one run a row, as the paper shows them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from ensemble.figures.membranes import membrane_segments
from ensemble.figures.style import BLACK, STYLE, TENSION_COLORS, WIDTH
from solver.analysis.run import Run

_QUANTILES = (0.02, 0.98)  # of the tensions after the start: an ellipse that has not relaxed exceeds them far


@matplotlib.rc_context(STYLE)
def filmstrip(
    runs: Mapping[str, Run],
    times: Sequence[float] = (),
    shares: Sequence[float] = (),
    reach: float = 2.6,
) -> Figure:
    """Draw each run at some times, or as close to them as it was recorded, colored by tension.

    Parameters
    ----------
    runs : mapping from title to Run
        A row each.
    times : sequence of float
        A column each; left out where a run has ended before.
    shares : sequence of float
        Instead: the shares of each run's own time.
    reach : float
        Half the side of a panel, in the unit of length.  Panels are centered on the vesicles; a square
        marks the origin (the stagnation point) where it is in sight.
    """
    tensions = np.concatenate([run.frames.tension[1:].ravel() for run in runs.values()])
    scale = Normalize(*np.nanquantile(tensions, _QUANTILES))
    columns = len(times or shares)
    panel = WIDTH / columns
    figure = Figure(figsize=(WIDTH, panel * len(runs) + 0.8), layout="constrained")
    panels = figure.subplots(len(runs), columns, squeeze=False)
    lines = None
    for row, (title, run) in zip(panels, runs.items(), strict=True):
        for axes, time in zip(row, times or [share * run.time for share in shares], strict=True):
            axes.set(xlim=(-reach, reach), ylim=(-reach, reach), aspect="equal")
            axes.set_axis_off()
            if time > run.time + run.scene.output.frame_interval:
                continue
            lines = _draw(axes, run, int(np.abs(run.frames.time - time).argmin()), scale)
        row[0].annotate(title, (-0.06, 0.5), xycoords="axes fraction", rotation=90, ha="right", va="center")
    if lines is not None:
        figure.colorbar(
            lines,
            ax=list(panels.ravel()),
            location="bottom",
            extend="both",
            shrink=0.5,
            aspect=40,
            label=r"tension $\sigma$",
        )
    return figure


def _draw(axes: matplotlib.axes.Axes, run: Run, index: int, scale: Normalize) -> LineCollection:
    frames = run.frames
    ends, tension = membrane_segments(
        run.scene, frames.tangent_angle[index], frames.center[index], frames.tension[index]
    )
    lines = LineCollection(
        list(ends.reshape(-1, 2, 2)), cmap=TENSION_COLORS, norm=scale, linewidths=1.4, capstyle="round"
    )
    lines.set_array(tension.ravel())
    axes.add_collection(lines)
    origin = -frames.center[index].mean(axis=0)
    axes.plot(*origin, "s", color=BLACK, markersize=2.5)
    axes.set_title(f"$t$ = {frames.time[index]:.4g}", fontsize=8, pad=2)
    return lines
