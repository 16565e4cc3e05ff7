"""What a finished run says about its scene, from the series that were recorded and the orbit of a pair."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from solver.analysis.revolutions import RevolutionTracker
from solver.analysis.run import Outcome, Series, Viscosity
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
    """Degrees: of the long axis of a single vesicle against x, or of a trapped pair as the paper defines it.

    For the pair it is 180° when the line of centers lies on the diverging axis and 90° when it lies on the
    converging one (paper, figure 6).
    """
    if "inclination_angle" in series:
        return float(np.degrees(series["inclination_angle"][-1]))
    if scene.flow and scene.flow.strains and "center_angle" in series:
        return float(pair_inclination(series["center_angle"][-1]))
    return None


def viscosity(
    scene: Scene, series: Series, outcome: Outcome, turns: RevolutionTracker | None
) -> Viscosity | None:
    """As `solver.analysis.run.Viscosity` says which average it is; None while it does not exist."""
    if "viscosity_bending_tension" not in series:
        return None
    if outcome is Outcome.STEADY:

        def average(name: str) -> float:
            return float(series[name][-1])

    else:
        interval = _averaged_over(scene, series, turns)
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
    scene: Scene, series: Series, turns: RevolutionTracker | None
) -> tuple[float, float] | None:
    """From when to when the viscosity of a run that is not steady is averaged; None while it cannot be."""
    if turns:
        return (turns.half_turns[-3], turns.half_turns[-1]) if turns.period else None
    if len(scene.vesicles) == 1 or len(series["time"]) < 2:
        return None
    return float(series["time"][-1]) / 2, float(series["time"][-1])
