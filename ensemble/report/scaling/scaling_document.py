"""The scaling report as data."""

from __future__ import annotations

from ensemble.mpi.scaling_model import ScalingModel
from ensemble.report.report_model import Machine, ReportModel


class SharedEvaluation(ReportModel):
    """One evaluation of the right-hand side that ranks share.

    Attributes
    ----------
    vesicles, ranks : int
        Number of vesicles, and of ranks that share the evaluation.
    seconds : float
        Its time.
    efficiency : float
        Speed-up over one rank, divided by the number of ranks.
    kernels, collectives, solves, other : float
        Shares of its parts in its time, on the first rank; waiting for other ranks counts as collectives.
    gathers, gathered_bytes : float
        Collectives in it, and the bytes that they gather.
    predicted : float or None
        Its time by the model of the report; None where the model does not apply.
    difference : float
        Largest difference of the result from that of one rank, relative to its largest entry.
    """

    vesicles: int
    ranks: int
    seconds: float
    efficiency: float
    kernels: float
    collectives: float
    solves: float
    other: float
    gathers: float
    gathered_bytes: float
    predicted: float | None = None
    difference: float


class WeakScaling(ReportModel):
    """An evaluation in which each rank has as many vesicles as one rank alone.

    Attributes
    ----------
    vesicles, ranks : int
        Number of vesicles and of ranks.
    seconds : float
        Time of the evaluation.
    efficiency : float
        Time on one rank over this time.
    """

    vesicles: int
    ranks: int
    seconds: float
    efficiency: float


class CollectiveTime(ReportModel):
    """An Allgatherv.

    Attributes
    ----------
    ranks : int
        Number of ranks.
    gathered_bytes : int
        Bytes that it gathers from all ranks.
    seconds : float
        Its time.
    """

    ranks: int
    gathered_bytes: int
    seconds: float


class EvaluationCost(ReportModel):
    """Cost of an evaluation on one rank.

    Attributes
    ----------
    vesicles : int
        Number of vesicles.
    seconds : float
        Time of the evaluation.
    sums : float
        How often it sums the velocities of all points from all points.
    peak_memory_bytes : int
        Largest memory of the process up to now.
    """

    vesicles: int
    seconds: float
    sums: float
    peak_memory_bytes: int

    @property
    def seconds_a_vesicle(self) -> float:
        """Time of the evaluation over the number of vesicles."""
        return self.seconds / self.vesicles


class EfficiencyPrediction(ReportModel):
    """Efficiency by the model.

    Attributes
    ----------
    vesicles, ranks : int
        Number of vesicles and of ranks.
    efficiency : float
        Speed-up over one rank, divided by the number of ranks.
    """

    vesicles: int
    ranks: int
    efficiency: float


class RankRecommendation(ReportModel):
    """The largest number of ranks on which a run is efficient by the model.

    Attributes
    ----------
    vesicles, ranks : int
        Number of vesicles and of ranks.
    """

    vesicles: int
    ranks: int


class GroupsUse(ReportModel):
    """What groups of ranks and their dispatcher do while a boundary is traced, in simulated time.

    Attributes
    ----------
    groups, points : int
        Number of groups and of the boundary's points.
    run_seconds : float
        Mean time of a run.
    runs : int
        How many were made.
    wall_seconds : float
        Until the boundary was traced.
    busy : float
        Share of the time, until a group finds nothing to do, in which groups simulate; their mean.
    dispatcher_share : float
        Share of the time in which the dispatcher works, on a processor that it shares with rank 0.
    dispatcher_seconds_a_run : float
        Its work for each run.
    """

    groups: int
    points: int
    run_seconds: float
    runs: int
    wall_seconds: float
    busy: float
    dispatcher_share: float
    dispatcher_seconds_a_run: float


class Scaling(ReportModel):
    """The whole report.

    Attributes
    ----------
    report : str
        Name of the report.
    machine : Machine
        The computer that made it.
    ranks : int
        Number of all ranks.
    points : int
        Points on each vesicle.
    oversubscribed : bool
        Whether there are more ranks than processor cores.
    evaluations : list of SharedEvaluation
        By number of vesicles and of ranks.
    weak : list of WeakScaling
        By number of ranks.
    collectives : list of CollectiveTime
        By number of ranks and size.
    model : ScalingModel
        Fitted to all these times.
    largest_misprediction : float
        Largest relative difference of a time by the model from the measured one.
    predictions : list of EfficiencyPrediction
        For more ranks than there are.
    recommendations : list of RankRecommendation
        By number of vesicles.
    costs : list of EvaluationCost
        By number of vesicles.
    groups : list of GroupsUse
        By number of groups; empty if the store has too few runs to take their times from.
    """

    report: str = "scaling"
    machine: Machine
    ranks: int
    points: int
    oversubscribed: bool
    evaluations: list[SharedEvaluation]
    weak: list[WeakScaling]
    collectives: list[CollectiveTime]
    model: ScalingModel
    largest_misprediction: float
    predictions: list[EfficiencyPrediction]
    recommendations: list[RankRecommendation]
    costs: list[EvaluationCost]
    groups: list[GroupsUse]
