"""The boundary of a study that sweeps several parameters: curves of the first one, and a filled map."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure

from ensemble.figures.style import BLACK, STYLE, VERMILLION, WIDTH
from ensemble.figures.symbols import AxisUnit, axis_label, describe, quantity
from ensemble.search.boundary import Boundary, BoundaryPoint
from ensemble.search.critical_value import SearchStatus

_NARROW = 5.0  # inches
_HEIGHT = 3.6  # inches, of a panel
_MOST_NAMED = 10  # curves that the legend names one by one

# The pale end of viridis is cut off: a thin curve drawn in it would vanish on white.
SURFACE_COLORS = ListedColormap(matplotlib.colormaps["viridis"](np.linspace(0, 0.92, 256)), "surface")


@matplotlib.rc_context(STYLE)
def surface_diagram(boundary: Boundary, width: float = WIDTH) -> Figure:
    """Draw the critical values of a study over its swept parameters.

    Parameters
    ----------
    boundary : Boundary
        With two or more swept parameters.
    width : float
        Inches.  The panels of a narrow figure stand below each other.

    Returns
    -------
    Figure
        Its first axes show a curve of the first parameter, with brackets, for each value of the others; of
        two parameters the second ones are a filled map, with a cross at points that have not converged.  The
        group ids of the artists are ``curve``, ``bracket``, ``surface``, ``point`` and ``not converged``.
    """
    scene, is_map = boundary.scene, len(boundary.swept) == 2
    panels = (2, 1) if width < _NARROW else (1, 2)
    rows, columns = panels if is_map else (1, 1)
    figure = Figure(figsize=(width, _HEIGHT * rows), layout="constrained")
    figure.suptitle(describe(scene, without=(*boundary.swept, boundary.searched)), fontsize=10, wrap=True)
    curves, *others = figure.subplots(rows, columns, squeeze=False).flat
    _draw_curves(curves, boundary)
    for axes in others:
        _draw_map(figure, axes, boundary)
    return figure


def _draw_curves(axes: Axes, boundary: Boundary) -> None:
    scene, (first, *rest) = boundary.scene, boundary.swept
    axes.set_xlabel(axis_label(first, scene))
    axes.set_ylabel(axis_label(boundary.searched, scene))
    symbols = [quantity(path, scene.flow).symbol for path in rest]
    units = [AxisUnit.at(path, scene) for path in rest]
    across, up = (AxisUnit.at(path, scene).size for path in (first, boundary.searched))
    lines: dict[tuple[float, ...], list[BoundaryPoint]] = {}
    for point in sorted(boundary.points, key=boundary.place):
        if None not in point.bracket:
            lines.setdefault(boundary.place(point)[1:], []).append(point)
    shown = _evenly(len(lines), _MOST_NAMED)
    for index, (others, points) in enumerate(sorted(lines.items())):
        color = SURFACE_COLORS(index / max(len(lines) - 1, 1))
        x = across * np.array([point.parameters[first] for point in points])
        low, high = up * np.array([point.bracket for point in points], dtype=float).T
        name = ", ".join(
            f"${symbol}$ = {unit.text(value, 4)}"
            for symbol, unit, value in zip(symbols, units, others, strict=True)
        )
        axes.plot(
            x,
            up * np.array([point.critical_value for point in points], dtype=float),
            color=color,
            gid="curve",
            label=name if index in shown else None,
        )
        _, _, (bars,) = axes.errorbar(
            x, (low + high) / 2, yerr=(high - low) / 2, fmt="none", ecolor=color, capsize=2.5, elinewidth=1.0
        )
        bars.set_gid("bracket")
    axes.margins(0.05)
    if lines:
        axes.legend()


def _evenly(count: int, most: int) -> set[int]:
    """Return the numbers of so many of some things, from the first to the last."""
    return set(np.linspace(0, count - 1, min(count, most)).round().astype(int).tolist())


def _draw_map(figure: Figure, axes: Axes, boundary: Boundary) -> None:
    scene, swept = boundary.scene, boundary.swept
    axes.set_xlabel(axis_label(swept[0], scene))
    axes.set_ylabel(axis_label(swept[1], scene))
    across, up = (AxisUnit.at(path, scene).size for path in swept)
    searched = AxisUnit.at(boundary.searched, scene)
    places = {
        (across * at, up * other): point for point in boundary.points for at, other in [boundary.place(point)]
    }
    x, y = (sorted(set(values)) for values in zip(*places, strict=True))
    values = searched.size * np.array([[_critical(places.get((at, other))) for at in x] for other in y])
    if np.isfinite(values).any() and len(x) > 1 and len(y) > 1:
        filled = axes.contourf(x, y, np.ma.masked_invalid(values), levels=14, cmap=SURFACE_COLORS)
        filled.set_gid("surface")
        bar = figure.colorbar(filled, ax=axes)
        symbol = quantity(boundary.searched, scene.flow).critical
        bar.set_label(searched.label(f"critical value ${symbol}$"))
    for gid, chosen, mark, color in (
        ("point", [at for at, point in places.items() if _converged(point)], ".", BLACK),
        ("not converged", [at for at, point in places.items() if not _converged(point)], "x", VERMILLION),
    ):
        if chosen:
            axes.plot(*_columns(chosen), mark, color=color, markersize=4, clip_on=False, gid=gid)


def _critical(point: BoundaryPoint | None) -> float:
    return np.nan if point is None or point.critical_value is None else point.critical_value


def _converged(point: BoundaryPoint) -> bool:
    return point.status == SearchStatus.CONVERGED


def _columns(places: Sequence[tuple[float, ...]]) -> tuple[list[float], list[float]]:
    return [x for x, _ in places], [y for _, y in places]
