"""Figures of the work-precision report."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from itertools import groupby

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from ensemble.figures.style import BLACK, BLUE, GRAY, GREEN, ORANGE, PURPLE, SKY, STYLE, VERMILLION, WIDTH
from ensemble.report.work_precision.work_precision_document import Measurement, WorkPrecision

_COLORS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, SKY, BLACK)  # by method
_SHAPES = ("o", "s", "^", "D", "v")  # by number of points


def work_precision_figures(report: WorkPrecision) -> dict[str, Figure]:
    """Draw errors against cost.

    Parameters
    ----------
    report : WorkPrecision
        The report as data.

    Returns
    -------
    dict of str to Figure
        Figures by name: position error against time and against evaluations, one panel for each scene, and
        errors of period and viscosity against time.
    """
    return {
        "error-against-time": _errors(report, "wall time (s)", lambda point: point.wall_seconds),
        "error-against-evaluations": _errors(report, "evaluations", lambda point: point.evaluations),
        "answers": _answers(report),
    }


@matplotlib.rc_context(STYLE)
def _errors(report: WorkPrecision, label: str, cost: Callable[[Measurement], float]) -> Figure:
    scenes = [reference.scene for reference in report.references]
    rows = (len(scenes) + 1) // 2
    figure = Figure(figsize=(WIDTH, 0.6 + 2.6 * rows), layout="constrained")
    panels = figure.subplots(rows, min(len(scenes), 2), squeeze=False).ravel()
    methods = list(dict.fromkeys(point.method for point in report.measurements))
    resolutions = sorted({point.points for point in report.measurements})
    for axes, reference in zip(panels, report.references, strict=False):
        axes.set(
            title=reference.scene, xscale="log", yscale="log", xlabel=label, ylabel="position error (RMS)"
        )
        axes.axhline(reference.uncertainty, color=GRAY, linestyle=":", label="converged run's uncertainty")
        _label_cost(axes)
        of_scene = [point for point in report.measurements if point.scene == reference.scene]
        for (method, points), series in groupby(of_scene, lambda point: (point.method, point.points)):
            known = [(cost(point), point.error_rms) for point in series if point.error_rms is not None]
            if known:
                axes.plot(
                    *np.array(known).T,
                    color=_COLORS[methods.index(method) % len(_COLORS)],
                    marker=_SHAPES[resolutions.index(points) % len(_SHAPES)],
                    markersize=4,
                    label=f"{method}, N = {points}",
                )
    for unused in panels[len(scenes) :]:
        unused.remove()
    _shared_legend(figure, panels[: len(scenes)])
    return figure


def _label_cost(axes: Axes) -> None:
    """Plain numbers on a logarithmic axis, a few a decade."""
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())


def _shared_legend(figure: Figure, panels: Iterable[Axes]) -> None:
    """One legend below all panels, each label once."""
    entries: dict[str, Artist] = {}
    for axes in panels:
        handles, labels = axes.get_legend_handles_labels()
        entries |= dict(zip(labels, handles, strict=True))
    figure.legend(list(entries.values()), list(entries), loc="outside lower center", ncols=3)


@matplotlib.rc_context(STYLE)
def _answers(report: WorkPrecision) -> Figure:
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    panels = figure.subplots(1, 2)
    for axes, name in zip(panels, ("period", "viscosity"), strict=True):
        axes.set(title=name, xscale="log", yscale="log", xlabel="wall time (s)", ylabel="relative error")
        _label_cost(axes)
        for index, (method, series) in enumerate(groupby(report.answers, lambda answer: answer.method)):
            known = [
                (answer.wall_seconds, error)
                for answer in series
                if (error := getattr(answer, f"{name}_error")) is not None
            ]
            if known:
                axes.plot(
                    *np.array(known).T,
                    color=_COLORS[index % len(_COLORS)],
                    marker="o",
                    markersize=4,
                    label=method,
                )
    _shared_legend(figure, panels)
    return figure
