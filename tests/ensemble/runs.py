"""Runs made up for tests: the shapes and types of a real one, numbers from a seed."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from solver.analysis.run import Energy, Errors, Frames, Outcome, Run, Viscosity, Work
from solver.scene import Numerics, PowerLaw, Scene, Shear, Vesicle


def shear_scene(
    rate: float = 0.5, hamaker: float = 1.5, reduced_area: float = 0.9, points: int = 32
) -> Scene:
    """Two adhering vesicles in shear."""
    return Scene(
        horizon=100.0,
        vesicles=(
            Vesicle(reduced_area=reduced_area, center=(-1.5, 0.0)),
            Vesicle(reduced_area=reduced_area, center=(1.5, 0.0)),
        ),
        adhesion=PowerLaw(hamaker=hamaker, distance=0.4),
        flow=Shear(rate=rate),
        numerics=Numerics(points=points),
    )


def quiescent_scene() -> Scene:
    """One vesicle at rest: no adhesion, no flow."""
    return Scene(horizon=20.0, vesicles=(Vesicle(reduced_area=1.0),))


def shear_run(
    scene: Scene | None = None,
    outcome: Outcome = Outcome.BOUND,
    seed: int = 0,
    samples: int = 40,
    frames: int = 10,
) -> Run:
    """Make up a run of two vesicles in shear, in which every quantity is present."""
    scene = shear_scene() if scene is None else scene
    random = np.random.default_rng(seed)
    shape = (frames, len(scene.vesicles), scene.numerics.points)
    names = ["bending_energy", "area_error", "closure_error", "gap", "center_distance", "center_angle"]
    names += ["adhesion_energy", "viscosity_bending_tension", "viscosity_adhesion"]
    series = {name: random.standard_normal(samples) for name in names}
    return Run(
        scene=scene,
        outcome=outcome,
        failure=None,
        time=random.uniform(50, 100),
        period=random.uniform(20, 40),
        effective_aspect_ratio=random.uniform(1, 3),
        inclination_angle=random.uniform(-90, 90),
        gap=random.uniform(0.2, 0.5),
        viscosity=Viscosity(*random.uniform(0, 2, 3).tolist()),
        energy=Energy(*random.uniform(0, 10, 2).tolist()),
        error=Errors(*random.uniform(0, 1e-6, 5).tolist()),
        work=Work(400, 12, 2000, 60, 80, random.uniform(0.5, 3), random.uniform(1e-6, 1e-2), shape[-1]),
        series={"time": np.arange(samples) * 0.25, **series},
        frames=Frames(
            time=np.arange(frames) * 1.0,
            tangent_angle=random.standard_normal(shape),
            center=random.standard_normal((*shape[:2], 2)),
            tension=random.standard_normal(shape),
        ),
    )


def failed_run() -> Run:
    """Make up a run that failed at once: no optional quantity, no sample, numbers that are not finite."""
    run = shear_run(quiescent_scene(), frames=1, samples=0)
    return replace(
        run,
        outcome=Outcome.FAILED,
        failure="step size underflow at t = 0",
        time=0.0,
        period=None,
        effective_aspect_ratio=None,
        inclination_angle=None,
        gap=None,
        viscosity=None,
        energy=Energy(bending=-0.0, adhesion=None),
        error=Errors(area=float("nan"), closure=float("inf"), temporal=-float("inf"), spatial=5e-324),
        frames=replace(run.frames, tension=np.full_like(run.frames.tension, np.nan)),
    )


def assert_same_run(first: Run, second: Run) -> None:
    """Every field is the same, floats to the last bit (so NaN equals NaN, and -0.0 differs from 0.0)."""
    for field in fields(Run):
        if field.name not in ("series", "frames"):
            assert repr(getattr(first, field.name)) == repr(getattr(second, field.name)), field.name
    assert first.scene == second.scene
    assert first.series.keys() == second.series.keys()
    for name, values in first.series.items():
        _assert_same_bits(values, second.series[name])
    for field in fields(Frames):
        _assert_same_bits(getattr(first.frames, field.name), getattr(second.frames, field.name))


def _assert_same_bits(first: np.ndarray, second: np.ndarray) -> None:
    assert (first.dtype, first.shape) == (second.dtype, second.shape)
    assert first.tobytes() == second.tobytes()
