"""Figures of doublets at equilibrium."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize, TwoSlopeNorm
from matplotlib.figure import Figure

from ensemble.figures.membranes import membrane_segments
from ensemble.figures.style import BLUE, GRAY, GREEN, ORANGE, STYLE, TENSION_COLORS, VERMILLION, WIDTH
from ensemble.report.paper.contact import Contact
from ensemble.report.paper.published import published
from solver.analysis.run import Run

if TYPE_CHECKING:
    from ensemble.report.paper.doublets import Energies

_COLORS = (BLUE, GREEN, ORANGE, VERMILLION)
_SHOWN_PULL = 20.0  # force per length beyond which colors no longer change


@matplotlib.rc_context(STYLE)
def shapes(runs: Sequence[Run]) -> Figure:
    """Draw the last shapes of runs side by side, colored by tension on one scale."""
    figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
    panels = figure.subplots(1, len(runs), squeeze=False)[0]
    tensions = np.concatenate([run.frames.tension[-1].ravel() for run in runs])
    scale = Normalize(tensions.min(), tensions.max())
    for axes, run in zip(panels, runs, strict=True):
        frames = run.frames
        ends, tension = membrane_segments(
            run.scene, frames.tangent_angle[-1], frames.center[-1], frames.tension[-1]
        )
        lines = LineCollection(
            list(ends.reshape(-1, 2, 2)), cmap=TENSION_COLORS, norm=scale, linewidths=1.8, capstyle="round"
        )
        lines.set_array(tension.ravel())
        axes.add_collection(lines)
        axes.set(xlim=(-2.2, 2.2), ylim=(-1.5, 1.5), aspect="equal")
        axes.set_title(rf"$\Delta A$ = {run.scene.vesicles[0].reduced_area:g}")
        axes.set_axis_off()
    figure.colorbar(
        lines, ax=list(panels), location="bottom", shrink=0.5, aspect=40, label=r"tension $\sigma$"
    )
    return figure


@matplotlib.rc_context(STYLE)
def contacts(measured: Mapping[float, Contact], distance: float) -> Figure:
    """Draw half the gap along the contact region by reduced area, colored by the adhesive force."""
    figure = Figure(figsize=(WIDTH, 2.7), layout="constrained")
    panels = figure.subplots(1, len(measured), sharey=True, sharex=True, squeeze=False)[0]
    scale = TwoSlopeNorm(0.0, -_SHOWN_PULL, _SHOWN_PULL)
    for axes, (area, contact) in zip(panels, measured.items(), strict=True):
        for side in (-1, 1):
            places = np.stack([side * contact.gap / 2, contact.along], axis=1)
            ends = np.stack([places[:-1], places[1:]], axis=1)
            lines = LineCollection(list(ends), cmap="RdBu_r", norm=scale, linewidths=2.4, capstyle="round")
            lines.set_array((contact.pull[:-1] + contact.pull[1:]) / 2)
            axes.add_collection(lines)
            axes.axvline(side * distance / 2, color=GRAY, linewidth=0.7, linestyle="--")
        axes.set(xlim=(-0.16, 0.16), ylim=(-1.3, 1.3), title=rf"$\Delta A$ = {area:g}", xlabel="across")
        axes.set_facecolor("#EDEDED")
    panels[0].set_ylabel("along the contact region")
    figure.colorbar(lines, ax=list(panels), extend="both", label="adhesive pull")
    return figure


@matplotlib.rc_context(STYLE)
def against_area(of_area: Mapping[float, Sequence[Energies]], best: Mapping[float, float | None]) -> Figure:
    """Draw the energies against reduced area, with the published ones."""
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    known = np.array(published()["doublets"]["energies"])
    energies = of_area[max(of_area, key=lambda strength: len(of_area[strength]) + (strength == 5.0))]
    at = [point.at for point in energies]
    left.plot(at, [point.bending for point in energies], "o-", color=BLUE, markersize=3, label="bending")
    left.plot(
        at, [point.adhesion for point in energies], "o-.", color=VERMILLION, markersize=3, label="adhesion"
    )
    left.plot(
        np.tile(known[:, 0], 2),
        known[:, 1:].T.ravel(),
        "D",
        color=GRAY,
        markerfacecolor="white",
        label="published",
    )
    left.set(xlabel=r"reduced area $\Delta A$", ylabel="energy")
    left.legend()
    for color, (strength, points) in zip(_COLORS, of_area.items(), strict=False):
        total = np.array([point.total for point in points])
        label = rf"$\mathcal{{H}}$ = {strength:g}"
        right.plot(
            [point.at for point in points], total - total.min(), "o-", color=color, markersize=3, label=label
        )
        if best[strength] is not None:
            right.axvline(best[strength], color=color, linestyle=":", linewidth=0.9)
    right.set(xlabel=r"reduced area $\Delta A$", ylabel="total energy above its minimum", ylim=(0, 3))
    right.legend(loc="upper center", frameon=True, facecolor="white", framealpha=1, edgecolor="none")
    return figure


@matplotlib.rc_context(STYLE)
def against_hamaker(of_hamaker: Mapping[float, Sequence[Energies]]) -> Figure:
    """Draw the energies against the Hamaker constant, one curve a separation distance."""
    figure = Figure(figsize=(WIDTH, 2.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    for color, shape, (distance, energies) in zip(_COLORS, "^xo", of_hamaker.items(), strict=False):
        at = [point.at for point in energies]
        label = rf"$\delta$ = {distance:g}"
        for axes, values in (
            (left, [point.bending for point in energies]),
            (right, [point.adhesion for point in energies]),
        ):
            axes.plot(at, values, color=color, marker=shape, markersize=4, label=label)
    left.set(xlabel=r"Hamaker constant $\mathcal{H}$", ylabel="bending energy")
    right.set(xlabel=r"Hamaker constant $\mathcal{H}$", ylabel="adhesion energy")
    left.legend()
    return figure
