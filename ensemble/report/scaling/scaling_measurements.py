"""Measurements on MPI ranks: evaluations that some of them share, and their collectives."""

from __future__ import annotations

import resource
import sys
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ensemble.mpi.groups import split
from ensemble.mpi.ranks import Ranks
from ensemble.report.scaling.counting_ranks import CountingRanks
from ensemble.report.scaling.scaling_document import CollectiveTime
from ensemble.report.scaling.scaling_plan import suspension
from ensemble.report.scaling.time_shares import time_shares
from solver.motion.terms import equation_of_motion
from solver.parallel import SERIAL, Array
from solver.simulation.initial_state import placed_state

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

_TIME_BETWEEN_STATES = 0.02  # during which the flow moves the centers
_ACROSS = np.array([0.0, 1e-3])  # velocity
_SIZES = tuple(8 * 8**power for power in range(7))  # bytes on each rank, 8 to 2 million
_MANY = 200  # collectives of the smallest size in one measurement
_MEBIBYTE = 1 << 20


class EvaluationMeasurement(NamedTuple):
    """An evaluation that was measured on the first of its ranks.

    Attributes
    ----------
    seconds : float
        The least time of several evaluations.
    shares : dict of str to float
        Shares of the parts of an evaluation in its time.
    gathers, gathered_bytes : float
        Collectives in an evaluation, and the bytes that they gather.
    sums : float
        How often an evaluation sums the velocities of all points from all points.
    rate : (n,)
        The result of an evaluation of the initial state.
    """

    seconds: float
    shares: dict[str, float]
    gathers: float
    gathered_bytes: float
    sums: float
    rate: Array


def measure_evaluation(
    communicator: Intracomm, vesicles: int, ranks: int, repeats: int
) -> EvaluationMeasurement | None:
    """Measure an evaluation that the first ranks of a communicator share.

    Collective.  The states differ as those of a run do, so that no evaluation can use results of the one
    before.

    Parameters
    ----------
    communicator : Intracomm
        All ranks.
    vesicles : int
        Number of vesicles.
    ranks : int
        How many ranks share the evaluation.
    repeats : int
        How many evaluations are measured.

    Returns
    -------
    EvaluationMeasurement or None
        On the first rank; None elsewhere.
    """
    group = split(communicator, 0 if communicator.Get_rank() < ranks else None)
    measurement = None
    if group is not None:
        measurement = _measure_on_group(group, vesicles, repeats)
        group.Free()
    communicator.barrier()
    return measurement if communicator.Get_rank() == 0 else None


def _measure_on_group(group: Intracomm, vesicles: int, repeats: int) -> EvaluationMeasurement:
    scene = suspension(vesicles)
    ranks = CountingRanks(Ranks(group) if group.Get_size() > 1 else SERIAL)
    equation = equation_of_motion(scene, ranks)
    state = placed_state(scene)
    rate = equation.rate(state)
    membranes, flow = equation.membranes, scene.flow
    assert flow is not None
    centers = membranes.center(state)
    along_flow = flow.velocity(centers.T, centers.T).T
    # And a little across it: no state may be the one before, whose motion is known.
    drift = membranes.pack(np.zeros_like(membranes.tangent_angle(state)), along_flow + _ACROSS)
    states = (state + _TIME_BETWEEN_STATES * number * drift for number in range(1, repeats + 3))
    equation.rate(next(states))
    ranks.reset()
    iterations = equation.tension_iterations
    seconds = []
    for _ in range(repeats):
        moved = next(states)
        group.barrier()
        begin = time.perf_counter()
        equation.rate(moved)
        seconds.append(time.perf_counter() - begin)
    gathers, gathered_bytes = ranks.gathers / repeats, ranks.gathered_bytes / repeats
    # One sum for the forces without tension, and one in each iteration.
    sums = 1 + (equation.tension_iterations - iterations) / repeats
    moved = next(states)
    shares = time_shares(lambda: equation.rate(moved))
    return EvaluationMeasurement(min(seconds), shares, gathers, gathered_bytes, sums, rate)


def measure_collectives(communicator: Intracomm, ranks: int) -> list[CollectiveTime]:
    """Measure how long the first ranks of a communicator take to gather messages of several sizes.

    Collective.

    Parameters
    ----------
    communicator : Intracomm
        All ranks.
    ranks : int
        How many ranks gather.

    Returns
    -------
    list of CollectiveTime
        One for each size, on the first rank; empty elsewhere.
    """
    group = split(communicator, 0 if communicator.Get_rank() < ranks else None)
    times = []
    if group is not None:
        for size in _SIZES:
            seconds = _gather_seconds(group, size)
            times.append(CollectiveTime(ranks=ranks, gathered_bytes=size * ranks, seconds=seconds))
        group.Free()
    communicator.barrier()
    return times if communicator.Get_rank() == 0 else []


def _gather_seconds(group: Intracomm, size: int) -> float:
    part = np.zeros(size // 8)
    whole = np.empty((group.Get_size(), part.size))
    counts = [part.size] * group.Get_size()
    repeats = max(_MANY * _MEBIBYTE // (_MEBIBYTE + 64 * size), 5)
    group.Allgatherv(part, [whole, counts])
    group.barrier()
    begin = time.perf_counter()
    for _ in range(repeats):
        group.Allgatherv(part, [whole, counts])
    return (time.perf_counter() - begin) / repeats


def peak_memory() -> int:
    """Return the most memory that this process has had, in bytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
