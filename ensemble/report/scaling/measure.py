"""Measurements on a communicator: evaluations shared by some of its ranks, and its collectives."""

from __future__ import annotations

import resource
import sys
import time
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ensemble.mpi.groups import split
from ensemble.report.scaling.counting import Counted
from ensemble.report.scaling.profile import shares_of_time
from ensemble.report.scaling.scaling_document import Collective
from ensemble.report.scaling.scaling_plan import suspension
from solver.motion.form import equation_of_motion
from solver.parallel import SERIAL, Array, Ranks
from solver.potentials.direct_sum import velocity
from solver.simulation.initial_state import initial_ellipses

if TYPE_CHECKING:
    from mpi4py.MPI import Intracomm

_TIME_BETWEEN_STATES = 0.02  # by which the flow has moved the centers
_SIZES = tuple(8 * 8**power for power in range(7))  # bytes on each rank, 8 to 2 million
_MANY = 200  # collectives of the smallest size in one measurement
_MEBIBYTE = 1 << 20
_POINTS = 1024  # of the direct sum that is timed
_MEASUREMENTS = 20


class Measured(NamedTuple):
    """An evaluation as `ensemble.report.scaling.scaling_document.Evaluation` has it, and its result."""

    seconds: float
    shares: dict[str, float]
    gathers: float
    gathered_bytes: float
    sums: float
    rate: Array


def evaluation(communicator: Intracomm, vesicles: int, ranks: int, repeats: int) -> Measured | None:
    """Measure an evaluation by the first ranks of a communicator, on the first one; None on the others.

    Collective.  The states differ as those of a run do, so that nothing is known from the last one.
    """
    group = split(communicator, 0 if communicator.Get_rank() < ranks else None)
    found = None
    if group is not None:
        found = _evaluation(group, vesicles, repeats)
        group.Free()
    communicator.barrier()
    return found if communicator.Get_rank() == 0 else None


def _evaluation(group: Intracomm, vesicles: int, repeats: int) -> Measured:
    scene = suspension(vesicles)
    parallel = Counted(Ranks(group) if group.Get_size() > 1 else SERIAL)
    dynamics = equation_of_motion(scene, parallel)
    state = initial_ellipses(scene)
    rate = dynamics.rate(state)
    membranes, flow = dynamics.membranes, scene.flow
    assert flow is not None
    centers = membranes.center(state)
    along_flow = flow.velocity(centers.T, centers.T).T
    drift = membranes.pack(np.zeros_like(membranes.tangent_angle(state)), along_flow)
    states = (state + _TIME_BETWEEN_STATES * number * drift for number in range(1, repeats + 3))
    dynamics.rate(next(states))
    parallel.reset()
    iterations = dynamics.tension_iterations
    seconds = []
    for _ in range(repeats):
        moved = next(states)
        group.barrier()
        begun = time.perf_counter()
        dynamics.rate(moved)
        seconds.append(time.perf_counter() - begun)
    gathers, gathered = parallel.gathers / repeats, parallel.gathered_bytes / repeats
    # Of the forces without tension, and in each iteration.
    sums = 1 + (dynamics.tension_iterations - iterations) / repeats
    moved = next(states)
    shares = shares_of_time(lambda: dynamics.rate(moved))
    return Measured(min(seconds), shares, gathers, gathered, sums, rate)


def collectives(communicator: Intracomm, ranks: int) -> list[Collective]:
    """Time the gathering of messages of many sizes by the first ranks; an empty list on all but the first.

    Collective.
    """
    group = split(communicator, 0 if communicator.Get_rank() < ranks else None)
    found = []
    if group is not None:
        for size in _SIZES:
            seconds = _gathering(group, size)
            found.append(Collective(ranks=ranks, gathered_bytes=size * ranks, seconds=seconds))
        group.Free()
    communicator.barrier()
    return found if communicator.Get_rank() == 0 else []


def _gathering(group: Intracomm, size: int) -> float:
    part = np.zeros(size // 8)
    whole = np.empty((group.Get_size(), part.size))
    counts = [part.size] * group.Get_size()
    times = max(_MANY * _MEBIBYTE // (_MEBIBYTE + 64 * size), 5)
    group.Allgatherv(part, [whole, counts])
    group.barrier()
    begun = time.perf_counter()
    for _ in range(times):
        group.Allgatherv(part, [whole, counts])
    return (time.perf_counter() - begun) / times


def pair_seconds() -> float:
    """Time of a pair of points in the direct sum, the least of several measurements."""
    random = np.random.default_rng(0)
    targets, sources, forces = random.standard_normal((3, 2, _POINTS))
    velocity(targets, sources, forces)
    seconds = []
    for _ in range(_MEASUREMENTS):
        begun = time.perf_counter()
        velocity(targets, sources, forces)
        seconds.append(time.perf_counter() - begun)
    return min(seconds) / _POINTS**2


def peak_memory() -> int:
    """The most memory that this process has had, bytes."""
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return peak if sys.platform == "darwin" else peak * 1024
