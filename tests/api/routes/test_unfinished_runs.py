"""How far a run in progress has come, over HTTP."""

from __future__ import annotations

from collections.abc import Iterator
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


@pytest.fixture
def unfinished(filled_store: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Key of a run that this process makes."""
    monkeypatch.setattr("solver.analysis.record.BLOCK_BYTES", 1000)
    with RunStaging(filled_store) as staging:
        checkpoint = staging.checkpoint(SCENE)
        simulation = Simulation(SCENE, sink=checkpoint.record)
        for _ in range(STEPS):
            simulation.step()
        checkpoint.write(simulation.saved())
        yield checkpoint.key
        checkpoint.remove()


def test_it_says_how_far_it_is(reading: httpx2.Client, unfinished: str) -> None:
    assert reading.get(f"/runs/{unfinished}").status_code == 404
    document = reading.get(f"/unfinished-runs/{unfinished}").json()
    assert document["run_key"] == unfinished
    assert document["status"] == "in progress"
    assert 0 < document["time"] < document["horizon"] == SCENE.horizon
    assert document["scene"]["flow"]["rate"] == SCENE.flow.rate
    assert document["last"]["gap"] > 0


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
    for address in (f"/unfinished-runs/{'0' * 32}", f"/unfinished-runs/{'0' * 32}/series"):
        assert reading.get(address).status_code == 404
