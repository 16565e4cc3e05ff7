"""The scaling model fitted to measurements, and what it predicts."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls

from ensemble.mpi.scaling_model import MEASURED, ScalingModel
from ensemble.report.scaling.scaling_document import (
    CollectiveTime,
    EfficiencyPrediction,
    EvaluationCost,
    RankRecommendation,
    SharedEvaluation,
)
from ensemble.report.scaling.scaling_plan import POINTS
from solver.scene import LARGEST_DENSE

_RANKS = (10, 32, 100, 316, 1_000, 3_162, 10_000)
_VESICLES = (2, 16, 64, 256, 1_024, 10_000)


def fit_model(
    costs: Sequence[EvaluationCost],
    evaluations: Sequence[SharedEvaluation],
    collectives: Sequence[CollectiveTime],
) -> ScalingModel:
    """Fit the constants of the scaling model to measured times, by least squares of the relative errors.

    The model is the formula of `ensemble.mpi.scaling_model`.  If there is a single rank, latency and
    bandwidth are those of an earlier measurement, and work that ranks could share counts as repeated.

    Parameters
    ----------
    costs : sequence of EvaluationCost
        Times on one rank.
    evaluations : sequence of SharedEvaluation
        Times on several ranks.
    collectives : sequence of CollectiveTime
        Times of collectives.

    Returns
    -------
    ScalingModel
        The fitted model.
    """
    shared = [evaluation for evaluation in evaluations if evaluation.vesicles > LARGEST_DENSE]
    latency, bandwidth = _latency_and_bandwidth(collectives)
    exchanging = ScalingModel(
        level=0.0,
        point=0.0,
        repeated=0.0,
        fixed=0.0,
        gathers=float(np.mean([each.gathers for each in shared])),
        bytes_a_point=float(
            np.mean([each.gathered_bytes / each.gathers / (POINTS * each.vesicles) for each in shared])
        ),
        latency=latency,
        bandwidth=bandwidth,
    )
    times = [(cost.vesicles, 1, cost.seconds) for cost in costs if cost.vesicles > LARGEST_DENSE]
    times += [(each.vesicles, each.ranks, each.seconds) for each in shared]
    vesicles, ranks, seconds = np.array(times, dtype=float).T
    points = POINTS * vesicles
    exchanged = [exchanging.seconds(POINTS * count, ranks_of_one) for count, ranks_of_one, _ in times]
    several = np.any(ranks > 1)
    terms = np.stack(
        [points * np.log2(points) / ranks, points / ranks * several, points, np.ones_like(points)], axis=1
    )
    computed = np.maximum(seconds - exchanged, 0.0)
    level, point, repeated, fixed = nnls(terms / seconds[:, None], computed / seconds)[0]
    return exchanging.model_copy(
        update={"level": level, "point": point, "repeated": repeated, "fixed": fixed}
    )


def _latency_and_bandwidth(collectives: Sequence[CollectiveTime]) -> tuple[float, float]:
    several = [collective for collective in collectives if collective.ranks > 1]
    if not several:
        return MEASURED.latency, MEASURED.bandwidth
    depth = np.array([math.ceil(math.log2(each.ranks)) for each in several], dtype=float)
    volume = np.array([each.gathered_bytes * (each.ranks - 1) / each.ranks for each in several])
    seconds = np.array([each.seconds for each in several])
    terms = np.stack([depth, volume], axis=1) / seconds[:, None]
    latency, seconds_a_byte = nnls(terms, np.ones_like(seconds))[0]
    return float(latency), 1 / float(max(seconds_a_byte, 1e-15))


def predict_efficiencies(model: ScalingModel) -> list[EfficiencyPrediction]:
    """Return efficiencies on 10 to 10,000 ranks.

    Parameters
    ----------
    model : ScalingModel
        The model.

    Returns
    -------
    list of EfficiencyPrediction
        By number of vesicles and of ranks.
    """
    return [
        EfficiencyPrediction(
            vesicles=vesicles, ranks=ranks, efficiency=model.efficiency(POINTS * vesicles, ranks)
        )
        for vesicles in _VESICLES[1:]
        for ranks in _RANKS
    ]


def recommend_ranks(model: ScalingModel) -> list[RankRecommendation]:
    """Return the largest numbers of ranks on which runs of several sizes are efficient.

    Parameters
    ----------
    model : ScalingModel
        The model.

    Returns
    -------
    list of RankRecommendation
        By number of vesicles.
    """
    return [
        RankRecommendation(vesicles=vesicles, ranks=model.recommended_ranks(POINTS * vesicles, _RANKS[-1]))
        for vesicles in _VESICLES
    ]
