"""How far a run in progress has come, over HTTP."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import httpx2
import numpy as np
import pytest

from ensemble.store import RunStaging
from solver import Simulation, simulate
from solver.scene import Output
from tests.solver.restarts import PAIR

SCENE = PAIR.model_copy(update={"output": Output(interval=0.02, frame_interval=0.5)})
STEPS = 20


@pytest.fixture(autouse=True)
def _small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("solver.analysis.record.BLOCK_BYTES", 1000)


@contextmanager
def kept(store: Path) -> Iterator[str]:
    """Keep a run as far as it is; this process makes it until the context ends."""
    with RunStaging(store) as staging:
        checkpoint = staging.checkpoint(SCENE)
        simulation = Simulation(SCENE, sink=checkpoint.record)
        for _ in range(STEPS):
            simulation.step()
        checkpoint.write(simulation.saved())
        yield checkpoint.key


@pytest.fixture
def unfinished(filled_store: Path) -> Iterator[str]:
    """Key of a run that this process makes."""
    with kept(filled_store) as key:
        yield key
    with RunStaging(filled_store) as staging:
        staging.checkpoint(SCENE).remove()


def test_it_says_how_far_it_is(reading: httpx2.Client, unfinished: str) -> None:
    assert reading.get(f"/runs/{unfinished}").status_code == 404
    document = reading.get(f"/unfinished-runs/{unfinished}").json()
    assert document["run_key"] == unfinished
    assert document["status"] == "in progress"
    assert 0 < document["time"] < document["horizon"] == SCENE.horizon
    assert document["scene"]["flow"]["rate"] == SCENE.flow.rate
    assert document["last"]["gap"] > 0
    assert reading.get(f"/unfinished-runs/{unfinished}/units").json() == {"sizes": {}}


def test_its_series_are_the_beginning_of_those_of_the_run(reading: httpx2.Client, unfinished: str) -> None:
    whole = simulate(SCENE).series
    address = f"/unfinished-runs/{unfinished}/series"
    document = reading.get(address).json()
    total = document["total"]
    assert 10 < total < len(whole["time"])
    assert document["series"].keys() == whole.keys()
    for name, values in document["series"].items():
        np.testing.assert_array_equal(values, whole[name][:total], err_msg=name)
    some = reading.get(address, params={"name": "gap", "start": 1, "stop": total, "stride": 3}).json()
    assert some["series"] == {"gap": whole["gap"][1:total:3].tolist()}
    refused = reading.get(address, params={"name": "gaps"})
    assert refused.status_code == 422
    assert "must be one of" in refused.text


def test_another_one_is_not_found(reading: httpx2.Client) -> None:
    for address in (
        f"/unfinished-runs/{'0' * 32}",
        f"/unfinished-runs/{'0' * 32}/series",
        f"/unfinished-runs/{'0' * 32}/units",
    ):
        assert reading.get(address).status_code == 404


def test_what_cannot_be_read_needs_no_repair(reading: httpx2.Client, filled_store: Path) -> None:
    with kept(filled_store) as key:
        (blocks,) = (filled_store / "checkpoints" / key).iterdir()
        moved = blocks.rename(filled_store / "moved")
        in_progress = reading.get(f"/unfinished-runs/{key}/series")
        moved.rename(blocks)
    (blocks / "series-000000.h5").unlink()
    interrupted = reading.get(f"/unfinished-runs/{key}/series")
    with RunStaging(filled_store) as staging:
        staging.checkpoint(SCENE).remove()
    for answer, end in ((in_progress, "; try again"), (interrupted, "that needs the run begins anew")):
        assert answer.status_code == 409
        detail = answer.json()["detail"]
        assert detail.startswith(f"run {key}: ")
        assert detail.endswith(end)
        assert str(filled_store) not in detail
