"""What a run records leaves it in blocks, and what stays in a simulation does not grow with its horizon.

About 10 s of processor time."""

from __future__ import annotations

import pickle
from collections import defaultdict

import numpy as np
import pytest

from solver import Simulation, simulate
from solver.analysis.record import BLOCK_BYTES, Block, Forgetful, Sink
from solver.memory import Saved
from solver.scene import Criteria, Output, Scene, Shear, Vesicle
from tests.solver.restarts import PAIR, SCENES, arrays_of, numerics, restarted
from tests.solver.scenes import with_contrasts
from tests.solver.suspensions import suspension

FEW_BYTES = 1000


class Listed(Sink):
    """Lists the blocks that it is given."""

    def __init__(self) -> None:
        self.blocks: dict[str, list[Block]] = defaultdict(list)

    def take(self, part: str, block: Block) -> None:
        self.blocks[part].append(block)


@pytest.fixture
def small_blocks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("solver.analysis.record.BLOCK_BYTES", FEW_BYTES)


def size(block: Block) -> int:
    return sum(values.nbytes for values in block.values())


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("name", ["pair", "many"])
def test_blocks_together_are_what_is_recorded(name: str) -> None:
    output = Output(interval=0.05, frame_interval=0.2)
    sink, scene = Listed(), SCENES[name].model_copy(update={"output": output})
    results = Simulation(scene, sink=sink).finish()
    run = simulate(scene)
    assert results.outcome == run.outcome
    expected = {"series": run.series, "vesicle_series": run.vesicle_series, "frames": vars(run.frames)}
    for part, arrays in expected.items():
        blocks = sink.blocks[part]
        assert len(blocks) > 1 or not arrays
        for block in blocks:
            assert block.keys() == arrays.keys()
            rows = len(next(iter(block.values())))
            assert size(block) - size(block) / rows < FEW_BYTES
        for block in blocks[:-1]:
            assert size(block) >= FEW_BYTES
        for key, values in arrays.items():
            np.testing.assert_array_equal(np.concatenate([block[key] for block in blocks]), values)


@pytest.mark.usefixtures("small_blocks")
@pytest.mark.parametrize("name", ["pair", "auto", "moving frame"])
def test_a_run_that_goes_on_has_the_same_bits_with_any_blocks(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def pickled(saved: Saved) -> Saved:
        read: Saved = pickle.loads(pickle.dumps(saved))
        return read

    cut = restarted(SCENES[name], 11, pickled)
    monkeypatch.setattr("solver.analysis.record.BLOCK_BYTES", BLOCK_BYTES)
    assert arrays_of(cut) == arrays_of(simulate(SCENES[name]))


def test_a_run_whose_record_is_elsewhere_has_results_only() -> None:
    simulation = Simulation(PAIR.model_copy(update={"horizon": 0.1}), sink=Forgetful())
    results = simulation.finish()
    assert results.time == 0.1
    with pytest.raises(ValueError, match="sink"):
        simulation.run()


ON = Criteria(revolutions=100_000)
LONG: dict[str, tuple[Scene, float]] = {
    "pair": (PAIR.model_copy(update={"criteria": ON}), 200.0),
    "tumbling": (
        with_contrasts(
            Scene(
                horizon=1.0,
                vesicles=(Vesicle(reduced_area=0.8),),
                flow=Shear(rate=2.0),
                criteria=ON,
                numerics=numerics(integrator="bdf"),
            ),
            15.0,
        ),
        80.0,
    ),
    "many": (suspension(3, horizon=1.0), 48.0),
}


@pytest.mark.parametrize("name", LONG)
def test_what_a_simulation_remembers_does_not_grow(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("solver.analysis.record.BLOCK_BYTES", FEW_BYTES)
    monkeypatch.setattr("solver.analysis.viscosity_history._MOST", 40)
    monkeypatch.setattr("solver.analysis.viscosity_history._FAR", 10)
    monkeypatch.setattr("solver.analysis.answer_errors._MOST_SAMPLES", 20)
    scene, horizon = LONG[name]
    output = Output(interval=0.1, frame_interval=0.2)
    simulation = Simulation(scene.model_copy(update={"horizon": horizon, "output": output}), sink=Forgetful())
    largest = {0.5: 0, 1.0: 0}  # by the half of the run
    while not simulation.done:
        half = 0.5 if simulation.time < 0.6 * horizon else 1.0
        largest[half] = max(largest[half], len(pickle.dumps(simulation.saved())))
        simulation.step()
    assert simulation.time == horizon
    assert largest[1.0] < 1.05 * largest[0.5]


@pytest.mark.parametrize("name", ["pair", "tumbling", "many"])
def test_averages_and_errors_of_a_long_run_need_only_its_last_steps(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, horizon = LONG[name]
    scene = scene.model_copy(update={"horizon": horizon})
    whole = simulate(scene)
    monkeypatch.setattr("solver.analysis.viscosity_history._MOST", 180)
    monkeypatch.setattr("solver.analysis.viscosity_history._FAR", 50)
    monkeypatch.setattr("solver.analysis.answer_errors._MOST_SAMPLES", 40)
    short = simulate(scene)
    assert whole.viscosity
    assert short.viscosity
    assert whole.work.steps > 180
    assert short.viscosity.total == pytest.approx(whole.viscosity.total, rel=1e-10)
    assert short.period == whole.period
    if whole.error.viscosity is not None:  # from other samples of the turn
        assert short.error.viscosity is not None
        assert 1 / 2 < short.error.viscosity / whole.error.viscosity < 2
