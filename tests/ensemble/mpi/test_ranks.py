"""Ranks that compute one run together: the results of one rank, to round-off, and no hanging."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from solver.analysis.run import Outcome
from solver.parallel import SERIAL
from solver.simulation.simulate import simulate
from tests.ensemble.mpi.rank_comparison import DOUBLET, computed

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def serial() -> dict[str, Array]:
    return computed(SERIAL)


@pytest.mark.parametrize("ranks", [1, 2, *(pytest.param(count, marks=pytest.mark.long) for count in (3, 4))])
def test_any_number_of_ranks_computes_the_same(
    launcher: Any, serial: dict[str, Array], ranks: int, tmp_path: Path
) -> None:
    """More ranks than vesicles, and shares that are uneven, are among them."""
    result = launcher.run(ranks, [sys.executable, "-m", "tests.ensemble.mpi.rank_comparison", str(tmp_path)])
    assert result.returncode == 0, result.stderr
    saved = [np.load(tmp_path / f"{rank}.npz") for rank in range(ranks)]
    for name, expected in serial.items():
        for rank in range(ranks):
            np.testing.assert_array_equal(saved[rank][name], saved[0][name], err_msg=f"{name}, rank {rank}")
        instant = any(word in name for word in ("rate", "jacobian", "energy"))
        tolerance = (1e-13 if instant else 1e-6) * np.max(np.abs(expected))
        np.testing.assert_allclose(saved[0][name], expected, rtol=0, atol=tolerance, err_msg=name)


def test_the_doublet_that_is_compared_is_bound(serial: dict[str, Array]) -> None:
    run = simulate(DOUBLET)
    assert run.outcome is Outcome.BOUND
    assert serial["doublet"][0] == run.period


MORE_RANKS_THAN_ROWS = """
import numpy as np
from ensemble.mpi.world import abort_guard, world
from ensemble.mpi.ranks import Ranks
communicator = world()
with abort_guard(communicator):
    shares = Ranks(communicator).divide(2)
    part = 10.0 * np.arange(2)[None, shares.own] + np.zeros((3, 1))
    assert np.array_equal(shares.gather(part, axis=1), [[0.0, 10.0]] * 3)
print("right", end=" ")
"""

FAILING = """
import sys
from itertools import pairwise
from ensemble.mpi.world import abort_guard, world
from ensemble.mpi.ranks import Ranks
from solver.simulation.simulate import simulate
from tests.ensemble.mpi.rank_comparison import DOUBLET
communicator = world()
with abort_guard(communicator):
    def break_down(simulation):
        if communicator.Get_rank() == 1:
            raise ValueError("this rank broke")
    simulate(DOUBLET, parallel=Ranks(communicator), after_step=break_down)
"""

CANCELLED = """
import sys
from pathlib import Path
from ensemble.mpi.world import abort_guard, world
from ensemble.mpi.checkpointed_run import CheckpointKeeper, Order, Stopped, checkpointed_run
from solver.analysis.record import Forgetful
from ensemble.mpi.ranks import Ranks
from ensemble.store import RunStaging
from tests.ensemble.mpi.rank_comparison import DOUBLET
communicator = world()
with abort_guard(communicator), RunStaging(Path(sys.argv[1])) as staging:
    asked = []
    def order():
        asked.append(1)
        return Order.CANCEL if len(asked) == 3 else Order.GO_ON
    keeper = CheckpointKeeper(staging.checkpoint(DOUBLET), order) if communicator.Get_rank() == 0 else None
    try:
        sink = keeper.record if keeper else Forgetful()
        checkpointed_run(DOUBLET, Ranks(communicator), sink, keeper)
    except Stopped:
        print(f" cancelled {len(asked)} ", end="")
"""


DIFFERING = """
from ensemble.mpi.world import abort_guard, world
from ensemble.mpi.ranks import Ranks
from solver.simulation.simulate import simulate
from tests.ensemble.mpi.rank_comparison import DOUBLET
communicator = world()
with abort_guard(communicator):
    tolerance = DOUBLET.numerics.tolerance * (1 + 1e-9 * communicator.Get_rank())
    numerics = DOUBLET.numerics.model_copy(update={"tolerance": tolerance})
    simulate(DOUBLET.model_copy(update={"numerics": numerics}), parallel=Ranks(communicator))
"""

DISTORTED = """
import numpy as np
from ensemble.mpi.world import abort_guard, world
from solver.motion.terms import equation_of_motion
from ensemble.mpi.ranks import Ranks
from solver.simulation.initial_state import placed_state
from solver.forces.tension import TensionNotFoundError
from tests.solver.suspensions import suspension
communicator = world()
with abort_guard(communicator):
    scene = suspension(7, 32)
    state = placed_state(scene)
    state[6 * 32 : 7 * 32] += 10 * np.random.default_rng(1).standard_normal(32)
    equation = equation_of_motion(scene, Ranks(communicator))
    try:
        equation.rate(state)
    except TensionNotFoundError as error:
        print(f"[{error}]", end=" ", flush=True)
"""


def run(launcher: Any, ranks: int, code: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    completed: subprocess.CompletedProcess[str] = launcher.run(
        ranks, [sys.executable, "-c", code, *arguments]
    )
    return completed


def test_more_ranks_than_rows(launcher: Any) -> None:
    result = run(launcher, 4, MORE_RANKS_THAN_ROWS)
    assert result.stdout.count("right") == 4, result.stderr


def test_an_exception_on_one_rank_of_a_run_ends_the_job(launcher: Any) -> None:
    result = run(launcher, 2, FAILING)
    assert result.returncode != 0
    assert "this rank broke" in result.stderr


def test_ranks_that_no_longer_agree_end_the_job(launcher: Any) -> None:
    result = run(launcher, 2, DIFFERING)
    assert result.returncode != 0
    assert "do their processors round alike?" in result.stderr


def test_the_first_rank_alone_is_asked_whether_to_stop_and_stops_all(launcher: Any, tmp_path: Path) -> None:
    result = run(launcher, 2, CANCELLED, str(tmp_path))
    assert result.stdout.count("cancelled") == 2, result.stderr
    assert {"0", "3"} <= set(result.stdout.split())


def test_a_vesicle_that_fails_on_one_rank_fails_on_all(launcher: Any) -> None:
    result = run(launcher, 2, DISTORTED)
    assert result.returncode == 0, result.stderr
    assert result.stdout.count("vesicle 6 is too distorted") == 2, result.stdout
