"""Runs that are interrupted between steps, and scenes that show what must not be forgotten then."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np

from solver import Run, Simulation
from solver.memory import Saved
from solver.protocols import Ramp, Sine, Steps
from solver.scene import Extension, Numerics, PowerLaw, Scene, Shear, Start, Trap, Vesicle
from tests.solver.scenes import shear_pair, with_contrasts
from tests.solver.suspensions import suspension

SHORT = {"horizon": 6.0}


def numerics(**fields: Any) -> Numerics:
    return Numerics(**{"points": 32, "tolerance": 1e-3} | fields)


ONE = Scene(vesicles=(Vesicle(reduced_area=0.8),), flow=Shear(rate=1.0), horizon=4.0)
PAIR = shear_pair(1.0, rate=1.0, numerics=numerics(), **SHORT)
RELAXED = Scene(
    vesicles=(Vesicle(center=(-1.2, 0.0)), Vesicle(center=(1.2, 0.0))),
    adhesion=PowerLaw(hamaker=1.0, distance=0.4),
    flow=Trap(rate=0.1),
    start=Start(relaxed=True, horizon=400.0),
    numerics=numerics(),
    horizon=4.0,
)
EXTENSION = suspension(3, horizon=2.0, flow=Extension(rate=0.2))

SCENES = {
    "pair": PAIR,
    "contrast": with_contrasts(PAIR, 4.0, 4.0),
    "auto": shear_pair(3.0, rate=1.0, numerics=numerics(points="auto", tolerance=1e-4), **SHORT),
    "relaxed": RELAXED,
    "moving frame": EXTENSION,
    "many": suspension(8, horizon=1.0),
    "protocol": EXTENSION.model_copy(update={"protocol": Ramp(begin=0.5, duration=0.7, start=0.5)}),
    "oscillating": PAIR.model_copy(update={"protocol": Sine(mean=1.0, period=2.0)}),
    "many with steps": suspension(8, horizon=1.0, protocol=Steps(times=(0.4,), factors=(1.0, 2.0))),
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


def restarted(scene: Scene, every: int, written: Callable[[Saved], Saved]) -> Run:
    """The run whose simulation is written down, read and made anew after every so many steps."""
    simulation, steps = Simulation(scene), 0
    while not simulation.done:
        simulation.step()
        steps += 1
        if steps % every == 0 and not simulation.done:
            simulation = Simulation.restored(scene, written(simulation.saved()))
    return simulation.run()
