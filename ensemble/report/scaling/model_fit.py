"""From measurements to a model, and from the model to what cannot be measured here."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.optimize import nnls

from ensemble.mpi.scaling_model import MEASURED, ScalingModel
from ensemble.report.scaling.scaling_document import (
    Collective,
    Cost,
    Crossover,
    Evaluation,
    Prediction,
    Recommendation,
)
from ensemble.report.scaling.scaling_plan import POINTS
from solver.scene import LARGEST_DENSE

_RANKS = (10, 32, 100, 316, 1_000, 3_162, 10_000)
_VESICLES = (2, 16, 64, 256, 1_024, 10_000)

_TERMS = 24  # of an expansion: an error like 2^−p of 1e-7, as sums have at the default tolerance
_SUMS = 3  # of a harmonic potential each, that make a Stokeslet's velocity
ASSUMPTION = (
    "Greengard and Rokhlin, J. Comput. Phys. 73, 325 (1987): with s points in a box and p terms, each point "
    "sums over 9s neighbors, and its box's share of 27 translations costs 27p²/s; s = √3·p is best.  "
    f"Assumed: p = {_TERMS} (an error of about 2^−p), {_SUMS} harmonic sums for a Stokeslet's velocity, and "
    "a multiplication of a translation as dear as a pair of the direct sum, and adhesion summed as fast."
)


def model_of(
    costs: Sequence[Cost], evaluations: Sequence[Evaluation], collectives: Sequence[Collective]
) -> ScalingModel:
    """Fit the constants, each measured time counting by its relative error.

    Latency and bandwidth are those of an earlier measurement where there is a single rank, and what is
    shared then counts as repeated.
    """
    shared = [found for found in evaluations if found.vesicles > LARGEST_DENSE]
    latency, bandwidth = _of_collectives(collectives)
    exchanging = ScalingModel(
        pair=0.0,
        point=0.0,
        repeated=0.0,
        fixed=0.0,
        gathers=float(np.mean([found.gathers for found in shared])),
        bytes_a_point=float(
            np.mean([found.gathered_bytes / found.gathers / (POINTS * found.vesicles) for found in shared])
        ),
        latency=latency,
        bandwidth=bandwidth,
    )
    times = [(found.vesicles, 1, found.seconds) for found in costs if found.vesicles > LARGEST_DENSE]
    times += [(found.vesicles, found.ranks, found.seconds) for found in shared]
    vesicles, ranks, seconds = np.array(times, dtype=float).T
    points = POINTS * vesicles
    exchanged = [exchanging.seconds(POINTS * of_one, on) for of_one, on, _ in times]
    several = np.any(ranks > 1)
    terms = np.stack([points**2 / ranks, points / ranks * several, points, np.ones_like(points)], axis=1)
    computed = np.maximum(seconds - exchanged, 0.0)
    pair, point, repeated, fixed = nnls(terms / seconds[:, None], computed / seconds)[0]
    return exchanging.model_copy(update={"pair": pair, "point": point, "repeated": repeated, "fixed": fixed})


def _of_collectives(collectives: Sequence[Collective]) -> tuple[float, float]:
    several = [found for found in collectives if found.ranks > 1]
    if not several:
        return MEASURED.latency, MEASURED.bandwidth
    depth = np.array([math.ceil(math.log2(found.ranks)) for found in several], dtype=float)
    volume = np.array([found.gathered_bytes * (found.ranks - 1) / found.ranks for found in several])
    seconds = np.array([found.seconds for found in several])
    terms = np.stack([depth, volume], axis=1) / seconds[:, None]
    latency, each_byte = nnls(terms, np.ones_like(seconds))[0]
    return float(latency), 1 / float(max(each_byte, 1e-15))


def predictions(model: ScalingModel) -> list[Prediction]:
    """Efficiencies at 10 to 10,000 ranks."""
    return [
        Prediction(vesicles=vesicles, ranks=ranks, efficiency=model.efficiency(POINTS * vesicles, ranks))
        for vesicles in _VESICLES[1:]
        for ranks in _RANKS
    ]


def recommendations(model: ScalingModel) -> list[Recommendation]:
    """How many ranks scenes of different sizes are worth."""
    return [
        Recommendation(vesicles=vesicles, ranks=model.recommended_ranks(POINTS * vesicles, _RANKS[-1]))
        for vesicles in _VESICLES
    ]


def crossover(model: ScalingModel, costs: Sequence[Cost], pair_seconds: float) -> Crossover:
    """Where a fast multipole method begins to pay; `ASSUMPTION` says of what cost."""
    in_a_box = math.sqrt(3) * _TERMS
    pairs = _SUMS * (9 * in_a_box + 27 * _TERMS**2 / in_a_box)
    sums = float(np.mean([cost.sums for cost in costs if cost.vesicles > LARGEST_DENSE]))
    point_seconds = sums * pairs * pair_seconds
    return Crossover(
        terms=_TERMS,
        pairs_a_point=pairs,
        pair_seconds=pair_seconds,
        point_seconds=point_seconds,
        vesicles=math.ceil(point_seconds / model.pair / POINTS) if model.pair > 0 else None,
        assumption=ASSUMPTION,
    )


def with_fast_summation(model: ScalingModel, fast: Crossover, vesicles: int) -> float:
    """Seconds of an evaluation on one rank whose sums are made by a fast multipole method."""
    return (fast.point_seconds + model.point + model.repeated) * POINTS * vesicles + model.fixed
