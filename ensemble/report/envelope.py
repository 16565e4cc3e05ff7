"""Which method reaches an error in the least time, and how the default one compares."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ensemble.report.measurement import Measurement
from ensemble.report.methods import deferred_correction, usual
from ensemble.report.report_model import Document
from solver.scene import Scene

ERRORS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)

LOW_ORDER = deferred_correction(2).name  # the order that the paper uses


class Envelope(Document):
    """Least times in which an error is reached, at whatever tolerance and number of points; None if never.

    slowdown : of the default method against the fastest one.
    speedup : of the default method against spectral deferred correction of order 2.
    """

    scene: str
    error: float
    fastest: str | None
    fastest_seconds: float | None
    default: str
    default_seconds: float | None
    slowdown: float | None
    speedup: float | None


def envelopes(scenes: Mapping[str, Scene], measurements: Sequence[Measurement]) -> list[Envelope]:
    """Compare the methods in every scene at every error of `ERRORS`."""
    found = []
    for name, scene in scenes.items():
        default = usual(len(scene.vesicles)).name
        for error in ERRORS:
            least = least_seconds((point for point in measurements if point.scene == name), error)
            fastest = min(least, key=lambda method: least[method], default=None)
            found.append(
                Envelope(
                    scene=name,
                    error=error,
                    fastest=fastest,
                    fastest_seconds=None if fastest is None else least[fastest],
                    default=default,
                    default_seconds=least.get(default),
                    slowdown=_ratio(least.get(default), least.get(fastest or default)),
                    speedup=_ratio(least.get(LOW_ORDER), least.get(default)),
                )
            )
    return found


def least_seconds(measurements: Iterable[Measurement], error: float) -> dict[str, float]:
    """Least time of each method that reaches an error."""
    least: dict[str, float] = {}
    for point in measurements:
        if point.error_rms is not None and point.error_rms <= error:
            least[point.method] = min(least.get(point.method, point.wall_seconds), point.wall_seconds)
    return least


def _ratio(seconds: float | None, others: float | None) -> float | None:
    return None if seconds is None or others is None else seconds / others
