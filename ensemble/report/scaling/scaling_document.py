"""The scaling report as data."""

from __future__ import annotations

from ensemble.mpi.scaling_model import ScalingModel
from ensemble.report.report_model import Machine, ReportModel


class Evaluation(ReportModel):
    """One evaluation of the right-hand side, shared by ranks.

    efficiency : speed-up over one rank, divided by the ranks.
    kernels, collectives, solves, other : shares of its time on the first rank; waiting for other ranks is in
        the collectives.
    gathers, gathered_bytes : collectives in it, and what they bring together in all.
    predicted : seconds, by the report's model.
    difference : of the result from one rank's, relative to its largest entry.
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


class Weak(ReportModel):
    """An evaluation with as many pairs of points on each rank as on one alone."""

    vesicles: int
    ranks: int
    seconds: float
    efficiency: float


class Collective(ReportModel):
    """An Allgatherv that brings together this many bytes."""

    ranks: int
    gathered_bytes: int
    seconds: float


class Cost(ReportModel):
    """What an evaluation costs one rank; memory is the largest that the process has had by then.

    sums : velocities of all points by all points in it.
    """

    vesicles: int
    seconds: float
    sums: float
    peak_memory_bytes: int
    with_fast_summation: float | None  # seconds, predicted


class Prediction(ReportModel):
    """Efficiency by the model at many ranks."""

    vesicles: int
    ranks: int
    efficiency: float


class Recommendation(ReportModel):
    """The most ranks on which a run is efficient, of as many as there may be, by the model."""

    vesicles: int
    ranks: int


class Crossover(ReportModel):
    """From where on a fast multipole method would sum faster than series of vesicles and their near points.

    pairs_a_point : what it costs for each point, in pairs of the direct sum.
    pair_seconds : of a pair of the direct sum.
    point_seconds : of all its sums in an evaluation, for each point.
    vesicles : None where the measured times do not grow like the pairs.
    """

    terms: int
    pairs_a_point: float
    pair_seconds: float
    point_seconds: float
    vesicles: int | None
    assumption: str


class Scaling(ReportModel):
    """The whole report."""

    report: str = "scaling"
    machine: Machine
    ranks: int
    points: int
    oversubscribed: bool
    evaluations: list[Evaluation]
    weak: list[Weak]
    collectives: list[Collective]
    model: ScalingModel
    largest_misprediction: float
    predictions: list[Prediction]
    recommendations: list[Recommendation]
    costs: list[Cost]
    crossover: Crossover
