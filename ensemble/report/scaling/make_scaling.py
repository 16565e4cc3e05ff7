"""Makes the scaling report on all ranks and writes it into the store."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ensemble.mpi.scaling_model import ScalingModel
from ensemble.mpi.store_on_ranks import whole_store
from ensemble.report import ReportName, report_directory
from ensemble.report.report_files import FinishedReport, write_report
from ensemble.report.report_model import Machine
from ensemble.report.scaling.scaling_document import (
    CollectiveTime,
    EvaluationCost,
    GroupsUse,
    Scaling,
    SharedEvaluation,
    WeakScaling,
)
from ensemble.report.scaling.scaling_figures import scaling_figures
from ensemble.report.scaling.scaling_fit import (
    fit_model,
    predict_efficiencies,
    recommend_ranks,
)
from ensemble.report.scaling.scaling_measurements import (
    EvaluationMeasurement,
    measure_collectives,
    measure_evaluation,
    peak_memory,
)
from ensemble.report.scaling.scaling_plan import FULL, POINTS, QUICK, ScalingPlan
from ensemble.report.scaling.scaling_text import scaling_conclusions, scaling_text
from ensemble.report.scaling.simulated_groups import FEWEST_RUNS, MeasuredCosts, simulate_groups
from solver.scene import LARGEST_DENSE

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

    from ensemble.mpi.store_on_ranks import StoreOnRank
    from ensemble.store import Store


_ROUNDS = 3  # in which the numbers of ranks take turns, because a machine's speed changes within minutes


def make_scaling(
    communicator: Intracomm, store: StoreOnRank, quick: bool, log: Callable[[str], None]
) -> FinishedReport | None:
    """Measure on 1, 2, 4, … and all ranks, then write ``reports/scaling/`` in the store.

    Collective.  The files are ``report.md``, ``report.html``, ``report.json`` and the figures, as PNG and as
    SVG.

    Parameters
    ----------
    communicator : Intracomm
        All ranks.
    store : Store or RunStaging
        From `ensemble.mpi.store_on_ranks.store_on_ranks`; it keeps the report.
    quick : bool
        Measure fewer and smaller scenes.
    log : callable
        Called on the first rank with one line of text before each measurement.

    Returns
    -------
    FinishedReport or None
        The report on the first rank; None elsewhere.
    """
    plan = QUICK if quick else FULL
    document = measure_scaling(communicator, plan, log)
    if document is None:
        return None
    directory = report_directory(whole_store(store).path, ReportName.SCALING)
    groups = _simulate_groups(whole_store(store), plan, directory, log)
    document = document.model_copy(update={"groups": groups})
    figures = scaling_figures(document)
    text = scaling_text(document, [f"{name}.png" for name in figures])
    report = FinishedReport(directory, document, text, scaling_conclusions(document))
    write_report(report, figures)
    return report


def measure_scaling(communicator: Intracomm, plan: ScalingPlan, log: Callable[[str], None]) -> Scaling | None:
    """Measure everything that a plan names, and fit the scaling model.

    Collective.

    Parameters
    ----------
    communicator : Intracomm
        All ranks.
    plan : ScalingPlan
        What to measure.
    log : callable
        Called on the first rank with one line of text before each measurement.

    Returns
    -------
    Scaling or None
        The report as data on the first rank; None elsewhere.
    """
    log = log if communicator.Get_rank() == 0 else _log_nothing
    sizes = _numbers_of_ranks(communicator.Get_size())
    costs = _measure_costs(communicator, plan, log)
    evaluations: list[SharedEvaluation] = []
    for vesicles in plan.shared:
        evaluations += _measure_shared(communicator, vesicles, sizes, plan.repeats, log)
    weak = _measure_weak(communicator, plan, sizes, log)
    collectives: list[CollectiveTime] = []
    for ranks in sizes[1:]:
        log(f"collectives of {ranks} ranks")
        collectives += measure_collectives(communicator, ranks)
    # A rank that is bound to a core sees only this one.
    cores = len(set().union(*communicator.allgather(os.sched_getaffinity(0))))
    if communicator.Get_rank() != 0:
        return None
    model = fit_model(costs, evaluations, collectives)
    evaluations = [_with_prediction(model, evaluation) for evaluation in evaluations]
    return Scaling(
        machine=Machine.here(),
        ranks=communicator.Get_size(),
        points=POINTS,
        oversubscribed=communicator.Get_size() > cores,
        evaluations=evaluations,
        weak=weak,
        collectives=collectives,
        model=model,
        largest_misprediction=max(
            abs(each.predicted / each.seconds - 1) for each in evaluations if each.predicted is not None
        ),
        predictions=predict_efficiencies(model),
        recommendations=recommend_ranks(model),
        costs=costs,
        groups=[],
    )


def _simulate_groups(
    store: Store, plan: ScalingPlan, place: Path, log: Callable[[str], None]
) -> list[GroupsUse]:
    recorded = [summary.work.wall_seconds for summary in store.summaries()]
    if len(recorded) < FEWEST_RUNS:
        return []
    place.mkdir(parents=True, exist_ok=True)
    costs = MeasuredCosts.here(store, place)
    uses = []
    for groups, times in plan.groups:
        log(f"{groups} groups in simulated time, runs {times:g} times as long as stored ones")
        uses.append(simulate_groups(groups, [times * seconds for seconds in recorded], costs, place))
    return uses


def _log_nothing(line: str) -> None:
    pass


def _numbers_of_ranks(available: int) -> list[int]:
    """Return 1, 2, 4, … and all ranks."""
    return sorted({2**power for power in range(available.bit_length())} | {available})


def _measure_costs(
    communicator: Intracomm, plan: ScalingPlan, log: Callable[[str], None]
) -> list[EvaluationCost]:
    costs = []
    for vesicles in plan.single:
        log(f"{vesicles} vesicles on one rank")
        measurement = measure_evaluation(communicator, vesicles, 1, plan.repeats)
        if measurement is not None:
            costs.append(
                EvaluationCost(
                    vesicles=vesicles,
                    seconds=measurement.seconds,
                    sums=measurement.sums,
                    peak_memory_bytes=peak_memory(),
                )
            )
    return costs


def _measure_shared(
    communicator: Intracomm, vesicles: int, sizes: list[int], repeats: int, log: Callable[[str], None]
) -> list[SharedEvaluation]:
    fastest: dict[int, EvaluationMeasurement] = {}
    for _ in range(_ROUNDS):
        for ranks in sizes:
            log(f"{vesicles} vesicles, ranks: {ranks}")
            measurement = measure_evaluation(communicator, vesicles, ranks, repeats)
            if measurement is not None and (
                ranks not in fastest or measurement.seconds < fastest[ranks].seconds
            ):
                fastest[ranks] = measurement
    return [
        SharedEvaluation(
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


def _measure_weak(
    communicator: Intracomm, plan: ScalingPlan, sizes: list[int], log: Callable[[str], None]
) -> list[WeakScaling]:
    measured: list[WeakScaling] = []
    for ranks in sizes:
        vesicles = plan.weak * ranks
        log(f"{vesicles} vesicles, ranks: {ranks}, as many on each as on one")
        measurement = measure_evaluation(communicator, vesicles, ranks, plan.repeats)
        if measurement is not None:
            on_one_rank = measured[0].seconds if measured else measurement.seconds
            measured.append(
                WeakScaling(
                    vesicles=vesicles,
                    ranks=ranks,
                    seconds=measurement.seconds,
                    efficiency=on_one_rank / measurement.seconds,
                )
            )
    return measured


def _with_prediction(model: ScalingModel, evaluation: SharedEvaluation) -> SharedEvaluation:
    """Add the time by the model, which holds for scenes that keep no matrix over all points."""
    if evaluation.vesicles <= LARGEST_DENSE:
        return evaluation
    seconds = model.seconds(POINTS * evaluation.vesicles, evaluation.ranks)
    return evaluation.model_copy(update={"predicted": seconds})
