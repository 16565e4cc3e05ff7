"""The figure of the stability report."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter

from ensemble.figures.style import BLUE, GRAY, ORANGE, PURPLE, STYLE, VERMILLION, WIDTH
from ensemble.report.stability.stability_document import Stability, StabilityVerdict

_MARKS = {  # color and shape
    StabilityVerdict.FINE: (BLUE, "o"),
    StabilityVerdict.SPACE: (ORANGE, "D"),
    StabilityVerdict.TIME: (PURPLE, "v"),
    StabilityVerdict.FAILED: (VERMILLION, "X"),
}


@matplotlib.rc_context(STYLE)
def stability_figure(report: Stability) -> Figure:
    """Draw evaluations and errors of every scene, marked by its verdict.

    Parameters
    ----------
    report : Stability
        The report as data.

    Returns
    -------
    Figure
        Evaluations on the left; spatial error (filled) and area drift (open) on the right.
    """
    figure = Figure(figsize=(WIDTH, 0.8 + 0.17 * len(report.rows)), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    left.set(xscale="log", xlabel="evaluations")
    right.set(xscale="log", xlabel="spatial error and area drift")
    names = [row.scene for row in report.rows]
    left.xaxis.set_minor_formatter(NullFormatter())
    left.set_yticks(range(len(names)), names, fontsize=6)
    left.set_ylim(len(names) - 0.5, -0.5)
    for verdict, (color, shape) in _MARKS.items():
        rows = [(at, row) for at, row in enumerate(report.rows) if row.verdict is verdict]
        left.plot(
            [row.evaluations or np.nan for _, row in rows],
            [at for at, _ in rows],
            color=color,
            marker=shape,
            linestyle="none",
            markersize=4,
            label=str(verdict),
        )
        for errors, face in (("spatial_error", color), ("area_error", "none")):
            right.plot(
                [getattr(row, errors) or np.nan for _, row in rows],
                [at for at, _ in rows],
                color=color,
                marker=shape,
                markerfacecolor=face,
                linestyle="none",
                markersize=4,
            )
    right.set_title("filled: spatial, open: drift", fontsize=8)
    for axes in (left, right):
        axes.grid(axis="y", linewidth=0.3, color=GRAY, alpha=0.4)
    figure.legend(loc="outside lower center", ncols=len(_MARKS))
    return figure
