"""What becomes of the checkpoint of a run that is canceled."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pytest

from ensemble.config.checkpoint_interval import CHECKPOINT_SECONDS
from ensemble.mpi.checkpointed_run import CheckpointKeeper, Order, Stopped, checkpointed_run
from ensemble.store import RunStaging, Store
from ensemble.store.checkpoint import checkpoint_path
from solver.parallel import SERIAL
from tests.solver.restarts import PAIR


@pytest.fixture
def staging(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[RunStaging]:
    monkeypatch.setattr("ensemble.mpi.checkpointed_run._LOOK_SECONDS", 0.0)  # after every step
    monkeypatch.setenv(CHECKPOINT_SECONDS, "1e-6")
    Store.open(tmp_path / "store").close()
    with RunStaging(tmp_path / "store") as opened:
        yield opened


def stopped(staging: RunStaging, order: Order, steps: int) -> bool:
    """Whether there is a checkpoint after a run that gets an order after so many steps."""
    calls = count(1)
    keeper = CheckpointKeeper(
        staging.checkpoint(PAIR), lambda: order if next(calls) == steps else Order.GO_ON
    )
    with pytest.raises(Stopped):
        checkpointed_run(PAIR, SERIAL, keeper.record, keeper)
    return checkpoint_path(staging.path, keeper.key).exists()


def test_a_canceled_run_leaves_none(staging: RunStaging) -> None:
    assert not stopped(staging, Order.CANCEL, 5)


@pytest.mark.parametrize("steps", [1, 5])
def test_a_canceled_run_leaves_what_another_command_has_kept(staging: RunStaging, steps: int) -> None:
    assert stopped(staging, Order.SUSPEND, 5)
    kept = staging.checkpoint(PAIR).read()
    assert kept is not None
    assert stopped(staging, Order.CANCEL, steps)
    now = staging.checkpoint(PAIR).read()
    assert now is not None
    assert now["wall_seconds"] >= kept["wall_seconds"]


def test_a_canceled_run_leaves_none_that_is_of_no_use(staging: RunStaging) -> None:
    assert stopped(staging, Order.SUSPEND, 5)
    path = checkpoint_path(staging.path, staging.checkpoint(PAIR).key)
    path.write_bytes(path.read_bytes()[:1000])
    assert not stopped(staging, Order.CANCEL, 5)
