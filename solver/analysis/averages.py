"""What a finished run says about its scene, from the series that were recorded and the orbit of a pair."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline

from solver.analysis.revolutions import RevolutionTracker
from solver.analysis.run import Outcome, Series, Viscosity
from solver.scene import Extension, Scene, Shear, Trap


def effective_aspect_ratio(period: float | None, scene: Scene) -> float | None:
    """Aspect ratio λ ≥ 1 of the rigid ellipse with this period, p = 2π/rate·(λ + 1/λ) (paper, eq. 9)."""
    if period is None or not isinstance(scene.flow, Shear):
        return None
    half_sum = period * scene.flow.rate / (4 * np.pi)
    return float(half_sum + np.sqrt(half_sum**2 - 1)) if half_sum >= 1 else None


def inclination(scene: Scene, series: Series) -> float | None:
    """Degrees: of the long axis of a single vesicle against x, or of a trapped pair as the paper defines it.

    For the pair it is 180° when the line of centers lies on the diverging axis and 90° when it lies on the
    converging one (paper, figure 6).
    """
    if "inclination_angle" in series:
        return float(np.degrees(series["inclination_angle"][-1]))
    if isinstance(scene.flow, Extension | Trap) and "center_angle" in series:
        return 90 + float(np.degrees(np.arcsin(abs(np.sin(series["center_angle"][-1])))))
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
