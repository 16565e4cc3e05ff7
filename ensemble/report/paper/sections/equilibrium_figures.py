"""Figures of doublets at equilibrium."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.collections import LineCollection
from matplotlib.colors import Normalize, TwoSlopeNorm
from matplotlib.figure import Figure

from ensemble.figures.membranes import add_tension_bar, frame_lines
from ensemble.figures.style import BLUE, GRAY, GREEN, ORANGE, STYLE, VERMILLION, WIDTH
from ensemble.report.paper.comparison import published
from ensemble.report.paper.sections.contact_region import ContactRegion
from ensemble.report.paper.sections.equilibrium_energies import DoubletEnergy
from solver.analysis.run import Run

_COLORS = (BLUE, GREEN, ORANGE, VERMILLION)
_LARGEST_PULL = 20.0  # force per length beyond which colors no longer change
_PUBLISHED_STRENGTH = 5.0


@matplotlib.rc_context(STYLE)
def shapes(runs: Sequence[Run]) -> Figure:
    """Draw the final shapes of runs side by side, colored by tension on one scale.

    Parameters
    ----------
    runs : sequence of Run

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(WIDTH, 2.9), layout="constrained")
    panels = list(figure.subplots(1, len(runs), squeeze=False)[0])
    tensions = np.concatenate([run.frames.tension[-1].ravel() for run in runs])
    scale = Normalize(tensions.min(), tensions.max())
    for axes, run in zip(panels, runs, strict=True):
        lines = frame_lines(run, -1, scale, 1.8)
        axes.add_collection(lines)
        axes.set(xlim=(-2.2, 2.2), ylim=(-1.5, 1.5), aspect="equal")
        axes.set_title(rf"$\Delta A$ = {run.scene.vesicles[0].reduced_area:g}")
        axes.set_axis_off()
    add_tension_bar(figure, lines, panels)
    return figure


@matplotlib.rc_context(STYLE)
def contacts(regions: Mapping[float, ContactRegion], distance: float) -> Figure:
    """Draw half the gap along contact regions, colored by the adhesive force.

    Parameters
    ----------
    regions : mapping of float to ContactRegion
        Contact regions by reduced area.
    distance : float
        Adhesion distance δ; half of it is drawn for comparison.

    Returns
    -------
    Figure
    """
    figure = Figure(figsize=(WIDTH, 2.7), layout="constrained")
    panels = figure.subplots(1, len(regions), sharey=True, sharex=True, squeeze=False)[0]
    scale = TwoSlopeNorm(0.0, -_LARGEST_PULL, _LARGEST_PULL)
    for axes, (area, region) in zip(panels, regions.items(), strict=True):
        for side in (-1, 1):
            places = np.stack([side * region.gap / 2, region.along], axis=1)
            ends = np.stack([places[:-1], places[1:]], axis=1)
            lines = LineCollection(list(ends), cmap="RdBu_r", norm=scale, linewidths=2.4, capstyle="round")
            lines.set_array((region.pull[:-1] + region.pull[1:]) / 2)
            axes.add_collection(lines)
            axes.axvline(side * distance / 2, color=GRAY, linewidth=0.7, linestyle="--")
        axes.set(xlim=(-0.16, 0.16), ylim=(-1.3, 1.3), title=rf"$\Delta A$ = {area:g}", xlabel="across")
        axes.set_facecolor("#EDEDED")
    panels[0].set_ylabel("along the contact region")
    figure.colorbar(lines, ax=list(panels), extend="both", label="adhesive pull")
    return figure


@matplotlib.rc_context(STYLE)
def energies_against_area(
    by_area: Mapping[float, Sequence[DoubletEnergy]], best_areas: Mapping[float, float | None]
) -> Figure:
    """Draw energies against reduced area, and the published ones.

    Parameters
    ----------
    by_area : mapping of float to sequence of DoubletEnergy
        For each Hamaker constant, energies by ascending reduced area.
    best_areas : mapping of float to float or None
        For each Hamaker constant, the reduced area of least total energy.

    Returns
    -------
    Figure
        Bending and adhesion energy on the left, their sum on the right.
    """
    figure = Figure(figsize=(WIDTH, 3.0), layout="constrained")
    left, right = figure.subplots(1, 2)
    known = np.array(published()["doublets"]["energies"])
    most_complete = max(
        by_area, key=lambda strength: len(by_area[strength]) + (strength == _PUBLISHED_STRENGTH)
    )
    energies = by_area[most_complete]
    areas = [energy.parameter for energy in energies]
    left.plot(areas, [energy.bending for energy in energies], "o-", color=BLUE, markersize=3, label="bending")
    left.plot(
        areas,
        [energy.adhesion for energy in energies],
        "o-.",
        color=VERMILLION,
        markersize=3,
        label="adhesion",
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
    for color, (strength, energies) in zip(_COLORS, by_area.items(), strict=False):
        areas = [energy.parameter for energy in energies]
        total = np.array([energy.total for energy in energies])
        label = rf"$\mathcal{{H}}$ = {strength:g}"
        right.plot(areas, total - total.min(), "o-", color=color, markersize=3, label=label)
        if best_areas[strength] is not None:
            right.axvline(best_areas[strength], color=color, linestyle=":", linewidth=0.9)
    right.set(xlabel=r"reduced area $\Delta A$", ylabel="total energy above its minimum", ylim=(0, 3))
    right.legend(loc="upper center", frameon=True, facecolor="white", framealpha=1, edgecolor="none")
    return figure


@matplotlib.rc_context(STYLE)
def energies_against_hamaker(by_hamaker: Mapping[float, Sequence[DoubletEnergy]]) -> Figure:
    """Draw energies against the Hamaker constant, one curve for each adhesion distance.

    Parameters
    ----------
    by_hamaker : mapping of float to sequence of DoubletEnergy
        For each adhesion distance, energies by ascending Hamaker constant.

    Returns
    -------
    Figure
        Bending energy on the left, adhesion energy on the right.
    """
    figure = Figure(figsize=(WIDTH, 2.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    for color, shape, (distance, energies) in zip(_COLORS, "^xo", by_hamaker.items(), strict=False):
        hamaker = [energy.parameter for energy in energies]
        label = rf"$\delta$ = {distance:g}"
        for axes, values in (
            (left, [energy.bending for energy in energies]),
            (right, [energy.adhesion for energy in energies]),
        ):
            axes.plot(hamaker, values, color=color, marker=shape, markersize=4, label=label)
    left.set(xlabel=r"Hamaker constant $\mathcal{H}$", ylabel="bending energy")
    right.set(xlabel=r"Hamaker constant $\mathcal{H}$", ylabel="adhesion energy")
    left.legend()
    return figure
