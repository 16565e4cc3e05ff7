"""Summary values of a finished run, from recorded series and from the revolutions that were followed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from solver.analysis.run import Outcome, Series, Viscosity

if TYPE_CHECKING:
    from solver.analysis.revolutions import RevolutionTracker
    from solver.scene import Scene

Array = NDArray[np.float64]


def pair_inclination(center_angle: Array) -> Array:
    """Return the inclination of a pair from the angles of its line of centers (Quaife et al. 2019, fig. 6).

    Parameters
    ----------
    center_angle : (...)
        Against x, radians.

    Returns
    -------
    (...)
        Degrees: 180 on the diverging axis y, 90 on the converging axis x.
    """
    return np.asarray(90 + np.degrees(np.arcsin(np.abs(np.sin(center_angle)))))


def inclination(scene: Scene, series: Series) -> float | None:
    """Return the inclination at the end: of a single vesicle's long axis against x, or of a pair in strain.

    Parameters
    ----------
    scene : Scene
    series : Series

    Returns
    -------
    float or None
        Degrees; of a pair that of `pair_inclination`.  None where neither exists.
    """
    if "inclination_angle" in series:
        return float(np.degrees(series["inclination_angle"][-1]))
    if scene.imposed_flow and scene.imposed_flow.strains and "center_angle" in series:
        return float(pair_inclination(series["center_angle"][-1]))
    return None


def viscosity(
    scene: Scene, series: Series, outcome: Outcome, tracker: RevolutionTracker | None
) -> Viscosity | None:
    """Return the average of the intrinsic viscosity that `solver.analysis.run.Viscosity` describes.

    Parameters
    ----------
    scene : Scene
    series : Series
    outcome : Outcome
    tracker : RevolutionTracker or None
        Of the pair's line of centers or the single vesicle's long axis, where one was followed.

    Returns
    -------
    Viscosity or None
        None without a viscosity, and while there is no full turn to average over.
    """
    if "viscosity_bending_tension" not in series:
        return None
    if outcome is Outcome.STEADY:

        def average(name: str) -> float:
            return float(series[name][-1])

    else:
        interval = _averaged_over(scene, series, tracker)
        if interval is None:
            return None
        first, last = interval

        def average(name: str) -> float:
            return float(CubicSpline(series["time"], series[name]).integrate(first, last)) / (last - first)

    membrane = average("viscosity_bending_tension")
    adhesion, contrast = (
        average(name) if name in series else None for name in ("viscosity_adhesion", "viscosity_contrast")
    )
    total = membrane + (adhesion or 0.0) + (contrast or 0.0)
    return Viscosity(total=total, bending_tension=membrane, adhesion=adhesion, contrast=contrast)


def _averaged_over(
    scene: Scene, series: Series, tracker: RevolutionTracker | None
) -> tuple[float, float] | None:
    """Return the interval over which the viscosity of an unsteady run is averaged, if there is one."""
    if tracker:
        return (tracker.half_turns[-3], tracker.half_turns[-1]) if tracker.period else None
    if len(scene.vesicles) == 1 or len(series["time"]) < 2:
        return None
    return float(series["time"][-1]) / 2, float(series["time"][-1])
