"""Figures of the scaling report."""

from __future__ import annotations

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from ensemble.figures.style import BLACK, BLUE, GRAY, GREEN, ORANGE, PURPLE, STYLE, VERMILLION, WIDTH
from ensemble.report.scaling.scaling_document import Scaling
from ensemble.report.scaling.time_shares import PARTS

_COLORS = (BLACK, BLUE, VERMILLION, GREEN, PURPLE, ORANGE)
_PART_COLORS = dict(zip(PARTS, (BLUE, VERMILLION, GREEN, GRAY), strict=True))


def scaling_figures(report: Scaling) -> dict[str, Figure]:
    """Draw the report.

    Parameters
    ----------
    report : Scaling
        The report as data.

    Returns
    -------
    dict of str to Figure
        Figures by name: efficiency against ranks, the parts of the time of an evaluation, and cost against
        the number of vesicles.
    """
    return {"efficiency": _efficiency(report), "parts": _parts(report), "cost": _cost(report)}


@matplotlib.rc_context(STYLE)
def _efficiency(report: Scaling) -> Figure:
    figure = Figure(figsize=(WIDTH, 3.2), layout="constrained")
    axes = figure.subplots()
    axes.set(xscale="log", xlabel="ranks", ylabel="parallel efficiency", ylim=(0, 1.1))
    ranks = np.unique(np.geomspace(1, 10_000, 200).astype(int))
    measured_numbers = {point.vesicles for point in report.evaluations}
    numbers = sorted(measured_numbers | {point.vesicles for point in report.predictions})
    for color, vesicles in zip(_COLORS, numbers, strict=False):
        label = f"{vesicles} vesicles"
        if any(point.vesicles == vesicles for point in report.predictions):
            model = [report.model.efficiency(report.points * vesicles, int(count)) for count in ranks]
            axes.plot(ranks, model, color=color, label=label)
            label = "_measured"
        measured = [(p.ranks, p.efficiency) for p in report.evaluations if p.vesicles == vesicles]
        if measured:
            axes.plot(*np.array(measured).T, color=color, marker="o", linestyle="none", label=label)
    figure.legend(loc="outside right center", title="lines: model\ndots: measured")
    return figure


@matplotlib.rc_context(STYLE)
def _parts(report: Scaling) -> Figure:
    figure = Figure(figsize=(WIDTH, 0.9 + 0.28 * len(report.evaluations)), layout="constrained")
    axes = figure.subplots()
    names = [
        f"{point.vesicles} vesicles, {point.ranks} rank{'s' * (point.ranks > 1)}"
        for point in report.evaluations
    ]
    left = np.zeros(len(names))
    for part in PARTS:
        shares = np.array([getattr(point, part) for point in report.evaluations])
        axes.barh(names, shares, left=left, color=_PART_COLORS[part], label=part, height=0.7)
        left += shares
    axes.invert_yaxis()
    axes.set(xlabel="share of the time of an evaluation", xlim=(0, 1))
    figure.legend(loc="outside upper center", ncols=len(PARTS))
    return figure


@matplotlib.rc_context(STYLE)
def _cost(report: Scaling) -> Figure:
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    time, memory = figure.subplots(1, 2)
    vesicles = [cost.vesicles for cost in report.costs]
    time.plot(vesicles, [cost.seconds for cost in report.costs], "o", color=BLACK, label="measured")
    between = np.geomspace(vesicles[0], vesicles[-1], 100)
    model = [report.model.seconds(report.points * number, 1) for number in between]
    time.plot(between, model, color=BLUE, label="model")
    time.set(xscale="log", yscale="log", xlabel="vesicles", ylabel="seconds an evaluation, 1 rank")
    time.legend(loc="upper left")
    peaks = [cost.peak_memory_bytes / 2**20 for cost in report.costs]
    memory.plot(vesicles, peaks, "o-", color=BLACK)
    memory.set(xscale="log", xlabel="vesicles", ylabel="peak memory of the process (MiB)")
    memory.set_ylim(0, 1.1 * max(peaks))
    return figure
