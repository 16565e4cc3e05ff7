"""The figure of a run: snapshots of its membranes and, below them, its diagnostics against time."""

from __future__ import annotations

import math
import textwrap

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ensemble.figures.membranes import add_tension_bar, extended_ends
from ensemble.figures.panels import PANELS
from ensemble.figures.snapshots import choose_snapshots, draw_snapshots
from ensemble.figures.style import GRAY, STYLE, WIDTH
from ensemble.figures.symbols import AxisUnit, broken, describe
from solver.analysis.contacts import CONTACT
from solver.analysis.run import Array, Run
from solver.dimensions import TENSION, TIME

# Heights in inches.
_PANEL = 1.8
_LINE = 0.2
_SNAPSHOTS = (0.3, 3.0)  # of the snapshots, at least and at most
_AROUND_SNAPSHOTS = 0.85  # for the times above them and the color bar below

_CLUSTERS = (
    f"filled: vesicles nearer than {CONTACT:g} adhesion distances to each other, a color for each cluster"
)
_CHARACTERS = 105  # in a line of the heading of the usual width


@matplotlib.rc_context(STYLE)
def run_figure(run: Run, width: float = WIDTH, in_one_column: bool = False) -> Figure:
    """Draw snapshots colored by tension, and the diagnostics of a run against time.

    Parameters
    ----------
    run : Run
    width : float
        Inches.  A narrow figure has fewer snapshots.
    in_one_column : bool
        Whether all panels stand below each other.

    Returns
    -------
    Figure
        Its axes have the labels ``membranes``, ``tension`` (the color bar) and, for each panel below, the
        name of the first series that it shows: ``gap``, ``center_angle``, ``inclination_angle``,
        ``clusters``, ``bending_energy``, ``viscosity_bending_tension``.  A panel whose series the run does
        not have is left out.
    """
    panels = {name: draw for name, draw in PANELS.items() if name in run.series}
    columns = 1 if in_one_column else 3 if len(panels) == 3 else 2
    rows = math.ceil(len(panels) / columns)
    characters = int(_CHARACTERS * width / WIDTH)
    heading = _heading(run, characters)
    chosen = choose_snapshots(run.frames, width)

    figure = Figure(layout="constrained")
    figure.suptitle("\n".join(heading), fontsize="medium")
    grid = figure.add_gridspec(2, 1)
    snapshots = figure.add_subplot(grid[0], label="membranes")
    clusters = _clusters(run)
    membranes = draw_snapshots(snapshots, run.scene, run.frames, chosen, clusters)
    if clusters is not None:
        explained = textwrap.fill(_CLUSTERS, characters)
        snapshots.annotate(
            explained, (0, 0), (0, -2), "axes fraction", "offset points", va="top", fontsize="small"
        )
    bar = add_tension_bar(figure, membranes, snapshots, extended_ends(membranes))
    bar.set_label(AxisUnit.of(TENSION, run.scene).label(r"tension $\sigma$"))

    unit = AxisUnit.of(TIME, run.scene)
    cells = grid[1].subgridspec(rows, columns)
    for position, (name, draw) in enumerate(panels.items()):
        row, column = divmod(position, columns)
        axes = figure.add_subplot(cells[row, column], label=name)
        draw(axes, run)
        if row == rows - 1:
            axes.set_xlabel(unit.label("time $t$"))
        for time in run.frames.time[chosen]:
            axes.axvline(unit.size * time, color=GRAY, alpha=0.3, linewidth=0.7, zorder=0.5)

    height = np.clip(width * np.ptp(snapshots.get_ylim()) / np.ptp(snapshots.get_xlim()), *_SNAPSHOTS)
    grid.set_height_ratios([height, rows * _PANEL])
    figure.set_size_inches(width, len(heading) * _LINE + height + _AROUND_SNAPSHOTS + rows * _PANEL)
    return figure


def _clusters(run: Run) -> Array | None:
    """Return the number of the cluster of each vesicle in each frame, from the record nearest in time."""
    labels = run.vesicle_series.get("vesicle_cluster")
    if labels is None:
        return None
    nearest = np.abs(run.series["time"][:, None] - run.frames.time).argmin(axis=0)
    return np.asarray(labels[nearest])


def _heading(run: Run, characters: int) -> list[str]:
    """Return the scene, and the outcome with the reason of a failure, in lines that fit."""
    unit = AxisUnit.of(TIME, run.scene)
    outcome = f"{run.outcome} at $t$ = {unit.both(run.time, 4)}"
    if run.period is not None:
        outcome += f", period {unit.both(run.period, 4)}" + (" (not settled)" if run.settled is False else "")
    if reason := run.failure or run.undecided:
        outcome += ": " + reason.replace("$", r"\$")
    return [*broken(describe(run.scene), characters), *textwrap.wrap(outcome, characters)]
