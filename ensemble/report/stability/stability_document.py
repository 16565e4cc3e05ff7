"""The stability report as data, and the criteria of its verdicts."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum

from ensemble.report.report_model import Machine, ReportModel
from solver.analysis.run import LARGEST_SPATIAL, Outcome

LARGEST_DRIFT = 1e-2  # of area (relative) and closure (over length)
LARGEST_RISE = 1e-3  # of the energy at rest, over its largest magnitude


class StabilityVerdict(StrEnum):
    """How far a run can be trusted; `CRITERIA` states when."""

    FINE = "fine"
    SPACE = "unresolved in space"
    TIME = "unresolved in time"
    FAILED = "failed"


# In the order in which they are tested: the first one that holds is the verdict.
CRITERIA: Mapping[StabilityVerdict, str] = {
    StabilityVerdict.FAILED: "the run gave up, for the reason stated, or raised an error",
    StabilityVerdict.SPACE: (
        f"the spatial error exceeds {LARGEST_SPATIAL:g}: that is the error of positions that the points "
        "leave, or the relative error across a vesicle's waist or of adhesion at the smallest gap, whichever "
        "is largest"
    ),
    StabilityVerdict.TIME: (
        f"resolved in space, but area or closure drift by more than {LARGEST_DRIFT:g}, or the energy of a "
        f"scene at rest rises by more than {LARGEST_RISE:g} of its largest magnitude"
    ),
    StabilityVerdict.FINE: "none of these",
}


class SceneVerdict(ReportModel):
    """How far the run of one scene can be trusted.

    Results have the names and units of `solver.analysis.run.Run`.  A quantity that the scene does not have,
    or that is not finite, is None.

    Attributes
    ----------
    group, scene : str
        Names of the scene and of its group.
    verdict : StabilityVerdict
        How far the run can be trusted.
    reason : str
        What the verdict rests on; empty if there is nothing to object to.
    outcome : Outcome
        Outcome of the run.
    failure : str or None
        Why the run failed.
    time, horizon : float or None
        Time that the run reached, and the latest time that it may reach.
    area_error, closure_error, temporal_error, spatial_error, global_error : float or None
        Errors of the run.
    smallest_gap : float or None
        Smallest recorded distance between two membranes.
    energy_rise : float or None
        Largest rise of the energy at rest above an earlier value, over its largest magnitude.
    smallest_step : float or None
        Smallest accepted time step.
    steps, evaluations : int or None
        Accepted time steps and evaluations of the right-hand side.
    wall_seconds : float or None
        Time that the simulation took.
    run_key : str or None
        Key of the run; None if it raised an error.
    """

    group: str
    scene: str
    verdict: StabilityVerdict
    reason: str
    outcome: Outcome
    failure: str | None
    time: float | None = None
    horizon: float
    area_error: float | None = None
    closure_error: float | None = None
    temporal_error: float | None = None
    global_error: float | None = None
    spatial_error: float | None = None
    smallest_gap: float | None = None
    energy_rise: float | None = None
    smallest_step: float | None = None
    steps: int | None = None
    evaluations: int | None = None
    wall_seconds: float | None = None
    run_key: str | None = None


class PairSymmetry(ReportModel):
    """Whether a bound pair in shear returns to the symmetry in which it is computed.

    Attributes
    ----------
    group, scene : str
        Names of the scene and of its group.
    outcome : Outcome
        Outcome of the run, which computes one vesicle and its image.
    period : float or None
        Of the motion to which it has settled.
    growth_rate : float or None
        Of a difference between the vesicles, mean over a period, 1/time; None if the motion has not settled
        or a step failed.
    growth_factor : float or None
        By how much the difference grows in a period.
    stable : bool or None
        Whether the difference decays.
    reason : str
        Why it was not followed; empty if it was.
    wall_seconds : float
        Time of the run.
    run_key : str
        Key of the run.
    """

    group: str
    scene: str
    outcome: Outcome
    period: float | None = None
    growth_rate: float | None = None
    growth_factor: float | None = None
    stable: bool | None = None
    reason: str = ""
    wall_seconds: float
    run_key: str


class Stability(ReportModel):
    """The whole report.

    Attributes
    ----------
    report : str
        Name of the report.
    machine : Machine
        The computer that made it.
    criteria : mapping of StabilityVerdict to str
        When each verdict is given, in the order in which the criteria are tested.
    rows : list of SceneVerdict
        One for each scene.
    pairs : list of PairSymmetry
        One for each bound pair.
    """

    report: str = "stability"
    machine: Machine
    criteria: Mapping[StabilityVerdict, str]
    rows: list[SceneVerdict]
    pairs: list[PairSymmetry]
