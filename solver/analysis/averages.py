"""Summary values of a finished run, from what was followed from step to step and from its last state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from solver.analysis.rheology import viscosity_of
from solver.analysis.run import Outcome, Viscosity

if TYPE_CHECKING:
    from collections.abc import Mapping

    from solver.analysis.revolutions import RevolutionTracker
    from solver.analysis.viscosity_history import ViscosityHistory
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


def inclination(
    scene: Scene, sample: Mapping[str, float], tracker: RevolutionTracker | None = None
) -> float | None:
    """Return the inclination at the end: of a single vesicle's long axis against x, or of a pair in strain.

    Parameters
    ----------
    scene : Scene
    sample : mapping of str to float
        The last diagnostics, by the name of their series.
    tracker : RevolutionTracker or None
        See `revolves`; None for a state at rest.

    Returns
    -------
    float or None
        Degrees; of a pair that of `pair_inclination`.  None where neither exists.
    """
    if "inclination_angle" in sample:
        return float(np.degrees(sample["inclination_angle"]))
    strains = scene.imposed_flow is not None and scene.imposed_flow.strains
    if strains and "center_angle" in sample and not revolves(scene, tracker):
        return float(pair_inclination(np.array(sample["center_angle"])))
    return None


def steady_viscosity(sample: Mapping[str, float]) -> Viscosity | None:
    """Return the intrinsic viscosity of a steady state.

    Parameters
    ----------
    sample : mapping of str to float
        The last diagnostics, by the name of their series.

    Returns
    -------
    Viscosity or None
        None without shear.
    """
    parts = {name: value for name, value in sample.items() if name.startswith("viscosity_")}
    return viscosity_of(parts) if parts else None


def revolves(scene: Scene, tracker: RevolutionTracker | None) -> bool:
    """Return whether a run has ended in revolutions that repeat themselves.

    Parameters
    ----------
    scene : Scene
    tracker : RevolutionTracker or None
        Of the pair's line of centers or the single vesicle's long axis, where one was followed.

    Returns
    -------
    bool
    """
    return tracker is not None and tracker.has_settled(scene.criteria.settled_change)


def is_at_rest(scene: Scene, outcome: Outcome, tracker: RevolutionTracker | None) -> bool:
    """Return whether a run in a flow has ended at rest, and not in a motion that repeats itself.

    Parameters
    ----------
    scene : Scene
    outcome : Outcome
    tracker : RevolutionTracker or None
        Of the pair's line of centers or the single vesicle's long axis, where one was followed.

    Returns
    -------
    bool
    """
    if outcome is Outcome.BOUND:  # of a pair that may revolve, or rest side by side
        return not revolves(scene, tracker)
    return outcome in (Outcome.STEADY, Outcome.END_TO_END)


def viscosity(
    scene: Scene,
    sample: Mapping[str, float],
    outcome: Outcome,
    tracker: RevolutionTracker | None,
    history: ViscosityHistory | None,
) -> Viscosity | None:
    """Return the average of the intrinsic viscosity that `solver.analysis.run.Viscosity` describes.

    Parameters
    ----------
    scene : Scene
    sample : mapping of str to float
        The diagnostics at the end of the run.
    outcome : Outcome
    tracker : RevolutionTracker or None
        Of the pair's line of centers or the single vesicle's long axis, where one was followed.
    history : ViscosityHistory or None
        Where the scene has a viscosity.

    Returns
    -------
    Viscosity or None
        None without a viscosity, and while there is no full turn to average over.
    """
    if history is None:
        return None
    if is_at_rest(scene, outcome, tracker):
        return steady_viscosity(sample)
    if tracker:
        return history.average(*tracker.last_turn) if tracker.last_turn else None
    return history.average(scene.horizon / 2, sample["time"])
