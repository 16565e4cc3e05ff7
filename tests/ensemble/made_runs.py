"""Made-up runs whose figures are known, and how to find what a figure shows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from solver.analysis.run import Energy, Errors, Frames, Outcome, Run, Work
from solver.scene import Scene

POINTS = 64
ALPHA = 2 * np.pi * np.arange(POINTS) / POINTS


def scene(vesicles: int = 2, flow: str | None = "shear", adhesion: bool = True) -> Scene:
    return Scene.model_validate(
        {
            "horizon": 40.0,
            "vesicles": [{"center": (3.0 * i, 0.0)} for i in range(vesicles)],
            "flow": {"kind": flow, "rate": 0.5} if flow else None,
            "adhesion": {"hamaker": 1.5, "distance": 0.4} if adhesion else None,
        }
    )


def orbit(vesicles: int = 2, flow: str | None = "shear", adhesion: bool = True) -> Run:
    """A made-up run: ovals on a turning line, whose tension is a known function of arclength and time."""
    time = np.arange(0.0, 41.0)
    turn = -0.2 * time[:, None, None]
    tangent_angle = ALPHA + np.pi / 2 - 0.3 * np.sin(2 * ALPHA) + turn + np.zeros((1, vesicles, 1))
    place = (np.arange(vesicles) - (vesicles - 1) / 2)[:, None]
    center = 2.6 * place * np.stack([np.cos(turn[..., 0]), np.sin(turn[..., 0])], axis=-1) + (5.0, 1.0)
    tension = known_tension(ALPHA, time[:, None, None], np.arange(vesicles)[:, None])
    series = {
        "time": time,
        "bending_energy": 8 + np.cos(time),
        "area_error": 0 * time,
        "closure_error": 0 * time,
    }
    if vesicles > 1:
        series["gap"] = 0.5 + 0.1 * np.cos(time)
    if vesicles == 2:
        series |= {"center_distance": 2.6 + 0 * time, "center_angle": -0.2 * time}
    if vesicles == 1:
        series["inclination_angle"] = 0.4 + 0.1 * np.cos(time)
    if adhesion:
        series["adhesion_energy"] = -3 + 0.1 * np.cos(time)
    if flow == "shear":
        series["viscosity_bending_tension"] = 1.8 + 0.1 * np.cos(time)
        if adhesion:
            series["viscosity_adhesion"] = 0.2 + 0.1 * np.cos(time)
    return Run(
        scene=scene(vesicles, flow, adhesion),
        outcome=Outcome.BOUND,
        failure=None,
        time=40.0,
        period=31.4,
        effective_aspect_ratio=None,
        inclination_angle=None,
        gap=0.5,
        viscosity=None,
        energy=Energy(8.0, -3.0),
        error=Errors(0.0, 0.0, 0.0, 0.0),
        work=Work(1, 0, 1, 1, 1, 0.1),
        series=series,
        frames=Frames(time, tangent_angle, center, tension),
    )


def known_tension(alpha: Any, time: Any, vesicle: Any) -> Any:
    return np.cos(2 * alpha + vesicle) + 0.1 * time


def suspension(spread: float = 1.0) -> Run:
    """A made-up run of six vesicles of which, at the end, three are together and two others are."""
    run = orbit(6)
    place = np.array([(3.0 * column, 3.0 * row) for row in range(2) for column in range(3)])
    center = np.tile(place * (spread, 1.0), (len(run.frames.time), 1, 1))
    labels = np.tile(np.arange(6.0), (len(run.series["time"]), 1))
    labels[-5:] = (0, 0, 1, 0, 2, 2)
    sizes = {"clusters": labels.max(axis=1) + 1, "largest_cluster": np.where(labels[:, 1] == 0, 3.0, 1.0)}
    return replace(
        run,
        series={**run.series, **sizes},
        frames=replace(run.frames, center=center),
        vesicle_series={"vesicle_cluster": labels},
    )


def artist(axes: Axes, group: str) -> Any:
    (found,) = axes.findobj(lambda candidate: candidate.get_gid() == group)
    return found


def panel(figure: Figure, name: str) -> Axes:
    (found,) = (axes for axes in figure.axes if axes.get_label() == name)
    return found


def snapshots(figure: Figure) -> tuple[LineCollection, Axes]:
    axes = panel(figure, "membranes")
    (lines,) = (found for found in axes.collections if isinstance(found, LineCollection))
    return lines, axes


def segments(figure: Figure, vesicles: int = 2, pieces: int = 128) -> Any:
    """Ends of the drawn segments, shape (snapshots, vesicles, segments, 2 ends, 2)."""
    return np.array(snapshots(figure)[0].get_segments()).reshape(-1, vesicles, pieces, 2, 2)


def snapshot_times(axes: Axes) -> list[float]:
    return [float(text.get_text().split("=")[1]) for text in axes.texts]
