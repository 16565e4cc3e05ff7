"""Which method reaches an error in the least time, and how the default method compares."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from ensemble.report.work_precision.work_precision_document import LeastTime, Measurement
from ensemble.report.work_precision.work_precision_plan import default_method, deferred_correction
from solver.scene import Scene

ERRORS = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)

# The order of the paper (Quaife et al. 2019, appendix on the integral equation formulation).
PUBLISHED_ORDER = deferred_correction(2).name


def least_times(scenes: Mapping[str, Scene], measurements: Sequence[Measurement]) -> list[LeastTime]:
    """Compare the methods in every scene at every error of `ERRORS`.

    Parameters
    ----------
    scenes : mapping of str to Scene
        Scenes by name.
    measurements : sequence of Measurement
        Measurements in these and perhaps other scenes.

    Returns
    -------
    list of LeastTime
        One for each scene and error.
    """
    comparisons = []
    for name, scene in scenes.items():
        default = default_method(len(scene.vesicles)).name
        for error in ERRORS:
            least = _least_seconds((point for point in measurements if point.scene == name), error)
            fastest = min(least, key=lambda method: least[method], default=None)
            comparisons.append(
                LeastTime(
                    scene=name,
                    error=error,
                    fastest=fastest,
                    fastest_seconds=None if fastest is None else least[fastest],
                    default=default,
                    default_seconds=least.get(default),
                    slowdown=_ratio(least.get(default), least.get(fastest or default)),
                    speedup=_ratio(least.get(PUBLISHED_ORDER), least.get(default)),
                )
            )
    return comparisons


def _least_seconds(measurements: Iterable[Measurement], error: float) -> dict[str, float]:
    """Return the least time of each method that reaches an error."""
    least: dict[str, float] = {}
    for measurement in measurements:
        if measurement.error_rms is not None and measurement.error_rms <= error:
            seconds = measurement.wall_seconds
            least[measurement.method] = min(least.get(measurement.method, seconds), seconds)
    return least


def _ratio(seconds: float | None, others: float | None) -> float | None:
    return None if seconds is None or others is None else seconds / others
