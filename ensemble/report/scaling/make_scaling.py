"""Makes the scaling report on all ranks and writes it into the store."""

from __future__ import annotations

import math
import os
from typing import TYPE_CHECKING

import numpy as np

from ensemble.mpi.scaling_model import ScalingModel
from ensemble.mpi.store_on_ranks import whole_store
from ensemble.report import ReportName
from ensemble.report.report_files import FinishedReport, report_directory, write_report
from ensemble.report.report_model import Machine
from ensemble.report.report_progress import Tell
from ensemble.report.scaling.measure import Measured, collectives, evaluation, pair_seconds, peak_memory
from ensemble.report.scaling.model_fit import (
    crossover,
    model_of,
    predictions,
    recommendations,
    with_fast_summation,
)
from ensemble.report.scaling.scaling_document import Collective, Cost, Evaluation, Scaling, Weak
from ensemble.report.scaling.scaling_figures import scaling_figures
from ensemble.report.scaling.scaling_plan import FULL, POINTS, QUICK, ScalingPlan
from ensemble.report.scaling.scaling_text import scaling_text
from solver.scene import LARGEST_DENSE

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from ensemble.mpi.store_on_ranks import StoreOnRank


_ROUNDS = 3  # in which numbers of ranks take turns: a machine's speed changes within minutes


def make_scaling(
    communicator: Intracomm, store: StoreOnRank, quick: bool, tell: Tell
) -> FinishedReport | None:
    """Measure on 1, 2, 4, … and all ranks, then write ``reports/scaling/`` in the store.

    Collective.  The files are ``report.md``, ``report.json`` and the figures, as PNG and as SVG.

    Parameters
    ----------
    communicator : Intracomm
    store : Store
    quick : bool
        Fewer and smaller scenes.
    tell : callable
        Takes a line about every measurement, on the first rank.

    Returns
    -------
    FinishedReport
        On the first rank; None elsewhere.
    """
    document = measured(communicator, QUICK if quick else FULL, tell)
    if document is None:
        return None
    figures = scaling_figures(document)
    text = scaling_text(document, [f"{name}.png" for name in figures])
    report = FinishedReport(report_directory(whole_store(store), ReportName.SCALING), document, text)
    write_report(report, figures)
    return report


def measured(communicator: Intracomm, plan: ScalingPlan, tell: Tell) -> Scaling | None:
    """Measure everything and fit the model; None on all ranks but the first.  Collective."""
    say = tell if communicator.Get_rank() == 0 else _say_nothing
    sizes = _sizes(communicator.Get_size())
    costs = _costs(communicator, plan, say)
    evaluations: list[Evaluation] = []
    for vesicles in plan.shared:
        evaluations += _shared(communicator, vesicles, sizes, plan.repeats, say)
    weak = _weak(communicator, plan, sizes, say)
    gathered: list[Collective] = []
    for ranks in sizes[1:]:
        say(f"collectives of {ranks} ranks")
        gathered += collectives(communicator, ranks)
    # Bound to a core, a rank sees that one alone.
    cores = len(set().union(*communicator.allgather(os.sched_getaffinity(0))))
    if communicator.Get_rank() != 0:
        return None
    model = model_of(costs, evaluations, gathered)
    evaluations = [_predicted(model, found) for found in evaluations]
    fast = crossover(model, costs, pair_seconds())
    return Scaling(
        machine=Machine.here(),
        ranks=communicator.Get_size(),
        points=POINTS,
        oversubscribed=communicator.Get_size() > cores,
        evaluations=evaluations,
        weak=weak,
        collectives=gathered,
        model=model,
        largest_misprediction=max(
            abs(found.predicted / found.seconds - 1) for found in evaluations if found.predicted is not None
        ),
        predictions=predictions(model),
        recommendations=recommendations(model),
        costs=[
            cost.model_copy(update={"with_fast_summation": with_fast_summation(model, fast, cost.vesicles)})
            for cost in costs
        ],
        crossover=fast,
    )


def _say_nothing(line: str) -> None:
    pass


def _sizes(ranks: int) -> list[int]:
    """1, 2, 4, … and all ranks."""
    return sorted({2**power for power in range(ranks.bit_length())} | {ranks})


def _costs(communicator: Intracomm, plan: ScalingPlan, say: Tell) -> list[Cost]:
    found = []
    for vesicles in plan.alone:
        say(f"{vesicles} vesicles alone")
        one = evaluation(communicator, vesicles, 1, plan.repeats)
        if one is not None:
            found.append(
                Cost(
                    vesicles=vesicles,
                    seconds=one.seconds,
                    sums=one.sums,
                    peak_memory_bytes=peak_memory(),
                    with_fast_summation=None,
                )
            )
    return found


def _shared(
    communicator: Intracomm, vesicles: int, sizes: list[int], repeats: int, say: Tell
) -> list[Evaluation]:
    fastest: dict[int, Measured] = {}
    for _ in range(_ROUNDS):
        for ranks in sizes:
            say(f"{vesicles} vesicles, ranks: {ranks}")
            one = evaluation(communicator, vesicles, ranks, repeats)
            if one is not None and (ranks not in fastest or one.seconds < fastest[ranks].seconds):
                fastest[ranks] = one
    return [
        Evaluation(
            vesicles=vesicles,
            ranks=ranks,
            seconds=one.seconds,
            efficiency=fastest[1].seconds / (ranks * one.seconds),
            gathers=one.gathers,
            gathered_bytes=one.gathered_bytes,
            difference=float(np.abs(one.rate - fastest[1].rate).max() / np.abs(fastest[1].rate).max()),
            **one.shares,
        )
        for ranks, one in fastest.items()
    ]


def _weak(communicator: Intracomm, plan: ScalingPlan, sizes: list[int], say: Tell) -> list[Weak]:
    found: list[Weak] = []
    for ranks in sizes:
        vesicles = round(plan.weak * math.sqrt(ranks))
        say(f"{vesicles} vesicles, ranks: {ranks}, as many pairs on each as on one")
        one = evaluation(communicator, vesicles, ranks, plan.repeats)
        if one is not None:
            alone = found[0].seconds if found else one.seconds
            found.append(
                Weak(vesicles=vesicles, ranks=ranks, seconds=one.seconds, efficiency=alone / one.seconds)
            )
    return found


def _predicted(model: ScalingModel, found: Evaluation) -> Evaluation:
    """With the model's seconds, where the model holds: for scenes that keep no matrix of all points."""
    if found.vesicles <= LARGEST_DENSE:
        return found
    return found.model_copy(update={"predicted": model.seconds(POINTS * found.vesicles, found.ranks)})
