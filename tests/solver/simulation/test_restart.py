"""A run that is saved and restored ends with the same bits as one that is not.

About 10 s of processor time."""

from __future__ import annotations

import pickle

import pytest

from solver import Simulation, simulate
from solver.analysis.criteria import CRITERIA, criteria_for
from solver.integrators.integrator import FACTORIES
from solver.memory import Saved
from solver.scene import Scene
from tests.solver.restarts import PAIR, SCENES, arrays_of, numerics, restarted


def pickled(saved: Saved) -> Saved:
    """What is read after it was written."""
    read: Saved = pickle.loads(pickle.dumps(saved))
    return read


def require_same_bits(scene: Scene, every: int) -> None:
    assert arrays_of(restarted(scene, every, pickled)) == arrays_of(simulate(scene))


@pytest.mark.parametrize("name", SCENES)
def test_scene(name: str) -> None:
    require_same_bits(SCENES[name], every=7)


@pytest.mark.parametrize("integrator", FACTORIES)
def test_every_registered_integrator(integrator: str) -> None:
    chosen = numerics(integrator=integrator)
    require_same_bits(PAIR.model_copy(update={"numerics": chosen, "horizon": 1.5}), every=4)


def test_every_registered_criterion_is_in_a_scene_of_these() -> None:
    """What a criterion remembers is restored in the scenes above; a new one needs a scene there."""
    asked = {type(criterion) for scene in SCENES.values() for criterion in criteria_for(scene)}
    assert asked == set(CRITERIA)


def test_step_control_by_area_and_length() -> None:
    chosen = numerics(integrator="sdc", step_control="area-length", tolerance=1e-2)
    require_same_bits(PAIR.model_copy(update={"numerics": chosen, "horizon": 1.0}), every=3)


def test_what_is_saved_does_not_change() -> None:
    simulation = Simulation(PAIR)
    for _ in range(5):
        simulation.step()
    saved = simulation.saved()
    before = pickle.dumps({**saved, "wall_seconds": 0})
    for _ in range(5):
        simulation.step()
    assert pickle.dumps({**saved, "wall_seconds": 0}) == before


def test_neither_the_end_nor_the_way_there_is_mistaken_for_the_other() -> None:
    simulation = Simulation(PAIR.model_copy(update={"horizon": 0.1}))
    with pytest.raises(ValueError, match="not done"):
        simulation.run()
    while not simulation.done:
        simulation.step()
    with pytest.raises(ValueError, match="done"):
        simulation.step()
    with pytest.raises(ValueError, match="done"):
        simulation.saved()
