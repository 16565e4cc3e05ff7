"""Panels that show a diagnostic of a run against time."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MultipleLocator

from ensemble.figures.style import BLACK, BLUE, GRAY, GREEN, VERMILLION
from ensemble.figures.symbols import DISTANCE, NO_UNIT, AxisUnit, axis_label
from solver.analysis.run import Array, Run
from solver.dimensions import ENERGY_PER_DEPTH, LENGTH, TIME

_ANGLE_STEPS = (1, 2, 5, 10, 15, 30, 45, 90, 180, 360, 720)  # degrees between ticks
_MOST_TICKS = 5


def _times(run: Run) -> Array:
    return AxisUnit.of(TIME, run.scene).size * run.series["time"]


def _draw_gap(axes: Axes, run: Run) -> None:
    unit = AxisUnit.of(LENGTH, run.scene)
    axes.plot(_times(run), unit.size * run.series["gap"], color=BLACK)
    axes.set(ylabel=unit.label("gap"), ylim=(0, None))
    if run.scene.adhesion is not None:
        distance = unit.size * run.scene.adhesion.distance
        axes.set_ylim(top=max(axes.get_ylim()[1], 1.05 * distance))
        axes.axhline(distance, color=GRAY, linewidth=0.9, linestyle="--")
        beside = axes.get_yaxis_transform()
        axes.annotate(f"${DISTANCE.symbol}$", (1, distance), (3, 0), beside, "offset points", va="center")


def _draw_angle(axes: Axes, run: Run, name: str) -> None:
    angle = np.degrees(run.series[name])
    axes.plot(_times(run), angle, color=BLACK)
    step = next((step for step in _ANGLE_STEPS if np.ptp(angle) <= _MOST_TICKS * step), _ANGLE_STEPS[-1])
    axes.yaxis.set_major_locator(MultipleLocator(step))


def _draw_center_angle(axes: Axes, run: Run) -> None:
    _draw_angle(axes, run, "center_angle")
    axes.set_ylabel("center angle (deg)")


def _draw_inclination(axes: Axes, run: Run) -> None:
    _draw_angle(axes, run, "inclination_angle")
    axes.set_ylabel("inclination (deg)")


def _draw_parts(
    axes: Axes, run: Run, membrane: str, label: str, adhesion: str, unit: AxisUnit = NO_UNIT
) -> None:
    """Draw the contribution of the membranes and, if there is adhesion, that of adhesion."""
    time = _times(run)
    axes.plot(time, unit.size * run.series[membrane], color=BLUE, label=label)
    if adhesion in run.series:
        values = unit.size * run.series[adhesion]
        axes.plot(time, values, color=VERMILLION, linestyle="-.", label="adhesion")
    _label_parts(axes)


def _label_parts(axes: Axes) -> None:
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=3, borderaxespad=0.2, columnspacing=1.0)


def _draw_rate(axes: Axes, run: Run) -> None:
    unit = AxisUnit.at("flow.rate", run.scene)
    axes.plot(_times(run), unit.size * run.series["flow_rate"], color=BLACK)
    axes.set_ylabel(axis_label("flow.rate", run.scene))


def _draw_energy(axes: Axes, run: Run) -> None:
    unit = AxisUnit.of(ENERGY_PER_DEPTH, run.scene)
    _draw_parts(axes, run, "bending_energy", "bending", "adhesion_energy", unit)
    axes.set_ylabel(unit.label("energy"))


def _draw_viscosity(axes: Axes, run: Run) -> None:
    _draw_parts(axes, run, "viscosity_bending_tension", "bending + tension", "viscosity_adhesion")
    if "viscosity_contrast" in run.series:
        contrast = run.series["viscosity_contrast"]
        axes.plot(_times(run), contrast, color=GREEN, linestyle=":", label="contrast")
        _label_parts(axes)
    axes.set_ylabel(r"intrinsic viscosity $[\mu]$")


def _draw_clusters(axes: Axes, run: Run) -> None:
    time = _times(run)
    axes.step(time, run.series["clusters"], where="mid", color=BLUE, label="clusters")
    axes.step(
        time,
        run.series["largest_cluster"],
        where="mid",
        color=VERMILLION,
        linestyle="-.",
        label="largest",
    )
    axes.set(ylabel="number", ylim=(0, None))
    axes.legend(loc="lower left", bbox_to_anchor=(0, 1), ncols=2, borderaxespad=0.2)


# By the series that a run must have.
PANELS: Final[dict[str, Callable[[Axes, Run], None]]] = {
    "flow_rate": _draw_rate,
    "gap": _draw_gap,
    "center_angle": _draw_center_angle,
    "inclination_angle": _draw_inclination,
    "clusters": _draw_clusters,
    "bending_energy": _draw_energy,
    "viscosity_bending_tension": _draw_viscosity,
}
