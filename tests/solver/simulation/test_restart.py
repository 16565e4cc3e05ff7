"""A run that is saved and restored ends with the same bits as one that is not.

About 10 s of processor time."""

from __future__ import annotations

import dataclasses
import pickle
from typing import Any

import numpy as np
import pytest

from solver import Run, Simulation, simulate
from solver.analysis.criteria import CRITERIA, criteria_for
from solver.integrators.integrator import FACTORIES
from solver.scene import Extension, Numerics, PowerLaw, Scene, Shear, Start, Trap, Vesicle
from tests.solver.scenes import fixed_horizon, shear_pair, with_contrasts
from tests.solver.suspensions import suspension

SHORT = fixed_horizon(6.0)


def numerics(**fields: Any) -> Numerics:
    return Numerics(**{"points": 32, "tolerance": 1e-3} | fields)


ONE = Scene(vesicles=(Vesicle(reduced_area=0.8),), flow=Shear(rate=1.0), **fixed_horizon(4.0))
PAIR = shear_pair(1.0, rate=1.0, numerics=numerics(), **SHORT)
RELAXED = Scene(
    vesicles=(Vesicle(center=(-1.2, 0.0)), Vesicle(center=(1.2, 0.0))),
    adhesion=PowerLaw(hamaker=1.0, distance=0.4),
    flow=Trap(rate=0.1),
    start=Start(relaxed=True, horizon=400.0),
    numerics=numerics(),
    **fixed_horizon(4.0),
)
EXTENSION = suspension(3, horizon=2.0, flow=Extension(rate=0.2))

SCENES = {
    "pair": PAIR,
    "contrast": with_contrasts(PAIR, 4.0, 4.0),
    "auto": shear_pair(3.0, rate=1.0, numerics=numerics(points="auto", tolerance=1e-4), **SHORT),
    "relaxed": RELAXED,
    "moving frame": EXTENSION,
    "many": suspension(8, horizon=1.0),
    "at rest": PAIR.model_copy(update={"flow": None, "horizon": 300.0}),
    "single": ONE.model_copy(update={"numerics": numerics()}),
}


def arrays_of(run: Run) -> dict[str, Any]:
    """All that a run holds but its wall time, as bits."""
    fields = {field.name: getattr(run, field.name) for field in dataclasses.fields(run)}
    fields["work"] = dataclasses.replace(run.work, wall_seconds=0.0)
    fields["frames"] = vars(run.frames)
    for name in ("series", "frames", "vesicle_series"):
        fields[name] = {key: np.asarray(value).tobytes() for key, value in fields[name].items()}
    return fields


def restarted(scene: Scene, every: int) -> Run:
    """The run whose simulation is written down and made anew after every so many steps."""
    simulation, steps = Simulation(scene), 0
    while not simulation.done:
        simulation.step()
        steps += 1
        if steps % every == 0 and not simulation.done:
            written = pickle.dumps(simulation.saved())
            simulation = Simulation.restored(scene, pickle.loads(written))
    return simulation.run()


def require_same_bits(scene: Scene, every: int) -> None:
    assert arrays_of(restarted(scene, every)) == arrays_of(simulate(scene))


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
